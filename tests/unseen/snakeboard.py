"""Snakeboard (Ostrowski, Lewis, Murray & Burdick, 1994): two axles that steer, a rotor, no slip sideways.

x, y [m] the middle, theta [rad] the board, psi [rad] the rotor relative to it, phi [rad] the steering:
the front axle stands at phi, the rear at -phi. Two nonholonomic constraints, whose lambda [N] are the
sideways forces. Without torques the rotor's momentum Jr (theta' + psi') and the energy are conserved.
"""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Conserved, Input, Model, Nonholonomic, Parameter, Scene, output

x, y, theta, psi, phi, tau = dynamicsymbols("x y theta psi phi tau")
m, J, Jr, Jw, l = symbols("m J J_r J_w l", positive=True)  # noqa: E741 - the literature's letter


def sideways(angle, side):
    """Velocity of an axle at `side` l across its wheels."""
    return (
        -sin(theta + angle) * x.diff()
        + cos(theta + angle) * y.diff()
        + side * l * cos(angle) * theta.diff()
    )


model = Model(
    name="Snakeboard",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2
    + J * theta.diff() ** 2 / 2
    + Jr * (theta.diff() + psi.diff()) ** 2 / 2
    + Jw * ((theta.diff() + phi.diff()) ** 2 + (theta.diff() - phi.diff()) ** 2) / 2,
    forces={psi: tau},
    coordinates={x: "m", y: "m", theta: "rad", psi: "rad", phi: "rad"},
    constraints=[
        Nonholonomic("front", sideways(phi, 1), "the front wheels do not slip sideways"),
        Nonholonomic("rear", sideways(-phi, -1), "the rear wheels do not slip sideways"),
    ],
    parameters=[
        Parameter(m, 6.0, "kg", "mass", min=0),
        Parameter(J, 0.1, "kg.m^2", "moment of inertia of the board", min=0),
        Parameter(Jr, 0.3, "kg.m^2", "moment of inertia of the rotor", min=0),
        Parameter(Jw, 0.02, "kg.m^2", "moment of inertia of an axle", min=0),
        Parameter(l, 0.25, "m", "from the middle to an axle", min=0),
    ],
    inputs=[Input(tau, "N.m", 0.0, "torque between rotor and board")],
    start={  # rolls along its axis, the wheels begin to steer, the rotor turns
        theta: 0.0, phi: 0.0, x: 0.0, y: 0.0, psi: 0.0,
        x.diff(): 0.5, y.diff(): 0.0, theta.diff(): 0.0, phi.diff(): 0.4, psi.diff(): 3.0,
    },
    description="Snakeboard that steers while its rotor turns",
)  # fmt: skip

scenes = [Scene("Snakeboard", stop_time=2.0, step_size=0.01)]

closed_forms = [
    Conserved("energy", output("energy.total")),
    Conserved("momentum of the rotor", Jr * (theta.diff() + psi.diff())),
]
