"""Watt's governor in points (Pontryagin, Ordinary Differential Equations, sect. 27; Maxwell, 1868).

Two balls (x1, y1, z1), (x2, y2, z2) [m] hang on arms of length l from the top of a spindle that turns by
phi [rad], and carry a sleeve at height z on links of the same length; each ball stays in the spindle's
plane on either side. Without a torque the angular momentum about the spindle and the energy are
conserved; steady, the height of the balls below the top is h = (m + M) g / (m w^2). It starts there, and
a torque makes it rise.
"""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Conserved, Holonomic, Input, Model, Parameter, Scene, initial, output

t = dynamicsymbols._t
x1, y1, z1, x2, y2, z2, z, phi, tau = dynamicsymbols("x1 y1 z1 x2 y2 z2 z phi tau")
m, M, J, g, l = symbols("m M J g l", positive=True)  # noqa: E741 - the literature's letter

balls = {"1": (x1, y1, z1), "2": (x2, y2, z2)}
T = J * phi.diff() ** 2 / 2 + M * z.diff() ** 2 / 2
T += m * sum(c.diff() ** 2 for ball in balls.values() for c in ball) / 2
constraints = []
for k, (x, y, h) in balls.items():
    constraints += [
        Holonomic(f"arm{k}", x**2 + y**2 + h**2 - l**2, "from the top to the ball"),
        Holonomic(f"link{k}", x**2 + y**2 + (h - z) ** 2 - l**2, "from the ball to the sleeve"),
        Holonomic(f"plane{k}", x * sin(phi) - y * cos(phi), "turns with the spindle"),
    ]

OUT, DOWN = 0.18, 0.24  # m, for arms of 0.3 m
TURN = ((2.0 / 0.5 + 1) * 9.81 / DOWN) ** 0.5  # rad/s, steady

model = Model(
    name="WattGovernor",
    lagrangian=T - m * g * (z1 + z2) - M * g * z,
    forces={phi: tau},
    coordinates=dict.fromkeys((x1, y1, z1, x2, y2, z2, z), "m") | {phi: "rad"},
    constraints=constraints,
    parameters=[
        Parameter(m, 0.5, "kg", "mass of a ball", min=0),
        Parameter(M, 4.0, "kg", "mass of the sleeve", min=0),
        Parameter(J, 0.05, "kg.m^2", "moment of inertia of the spindle", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 0.3, "m", "length of an arm and of a link", min=0),
    ],
    inputs=[Input(tau, "N.m", 0.2, "torque on the spindle")],
    start={
        x1: OUT, y1: 0.0, z1: -DOWN, x2: -OUT, y2: 0.0, z2: -DOWN, z: -2 * DOWN, phi: 0.0,
        phi.diff(): TURN, y1.diff(): OUT * TURN, y2.diff(): -OUT * TURN,
    },
    description="Watt's governor, whose balls rise as a torque turns it faster",
)  # fmt: skip

scenes = [Scene("WattGovernor", stop_time=1.0, step_size=0.005)]


def momentum(of):
    """About the spindle; `of` takes a state to its value now or at the start."""
    spin = J * of(phi.diff())
    for x, y, _ in balls.values():
        spin += m * (of(x) * of(y.diff()) - of(y) * of(x.diff()))
    return spin


closed_forms = [
    ClosedForm("angular momentum", momentum(initial) + tau * t, actual=momentum(lambda state: state)),
    Conserved("energy but for the torque's work", output("energy.total") - tau * phi),
]  # fmt: skip
