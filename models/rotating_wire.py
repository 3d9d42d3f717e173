"""Bead on a straight smooth wire that a motor turns at a constant rate in a horizontal plane.

(Goldstein, Classical Mechanics, sect. 1.6.)  r [m] along the wire from the axis, phi [rad] the
wire's angle; phi = omega t is a constraint that depends on time.  lambda [N.m] is the motor's
torque, positive in the sense of a growing phi; its power lambda omega feeds the bead's energy.
"""

from sympy import cos, cosh, sin, sinh, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Holonomic,
    Line,
    Model,
    Output,
    Parameter,
    Scene,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
r, phi = dynamicsymbols("r phi")
m = symbols("m", positive=True)
omega = symbols("omega", real=True)

T = m * (r.diff() ** 2 + r**2 * phi.diff() ** 2) / 2

model = Model(
    name="RotatingWire",
    lagrangian=T,
    coordinates={r: "m", phi: "rad"},
    constraints=[Holonomic("drive", phi - omega * t, "a motor turns the wire at a constant rate")],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the bead", min=0),
        Parameter(omega, 2.0, "rad/s", "rate of the wire"),
    ],
    start={r: 0.1, phi: 0.0, phi.diff(): 2.0},
    description="Bead on a straight wire that is turned at a constant rate",
    descriptions={r: "bead's distance along the wire", phi: "angle of the wire"},
    outputs=[
        Output("motor.power", multiplier("drive") * phi.diff(), "W", "power of the motor"),
        Output("bead.speed", sqrt(r.diff() ** 2 + (r * phi.diff()) ** 2), "m/s"),
    ],
    picture=[
        Disk((0, 0), radius=0.02),
        Line((-cos(phi), -sin(phi)), (cos(phi), sin(phi))),
        Disk((r * cos(phi), r * sin(phi)), trace=True),
        Arrow("drive", at=(r * cos(phi), r * sin(phi))),
    ],
)

scenes = [Scene("RotatingWire", stop_time=1.5, step_size=0.01)]

# r'' = omega^2 r,  and the angular momentum m r^2 omega grows at the rate lambda = 2 m omega r r'.
r0, v0 = initial(r), initial(r.diff())
torque = m * (r0**2 * omega**2 + v0**2) * sinh(2 * omega * t)
torque += 2 * m * omega * r0 * v0 * cosh(2 * omega * t)
jacobi = m * r.diff() ** 2 / 2 - m * omega**2 * r**2 / 2  # T2 - T0, which is not the energy

closed_forms = [
    ClosedForm("r", r0 * cosh(omega * t) + v0 / omega * sinh(omega * t)),  # for omega != 0
    ClosedForm("phi", omega * t),
    ClosedForm("lambda.drive", torque),
    ClosedForm(
        "lambda.drive from the state",
        2 * m * omega * r * r.diff(),
        actual=output("lambda.drive"),
    ),
    ClosedForm("motor.power", omega * torque),
    ClosedForm("bead.speed", sqrt(2 * output("energy.kinetic") / m)),
    Conserved("Jacobi's integral", jacobi, scale=T),
]
