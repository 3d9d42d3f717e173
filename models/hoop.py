"""Bead on a smooth hoop that a motor turns about its vertical diameter (Goldstein, ch. 2, exercises).

r [m] from the centre, theta [rad] from the downward vertical, phi [rad] the angle of the hoop's plane;
phi = omega t is a constraint that depends on time.  lambda.hoop [N] is the hoop's force in its plane,
positive outward; lambda.drive [N.m] the motor's torque, so that lambda.drive/(r sin(theta)) is the hoop's
force across its plane.  Below omega^2 = g/R the bead swings about the bottom; above, the bottom repels it,
and it swings about cos(theta) = g/(R omega^2).
"""

from sympy import cos, pi, sin, symbols
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
    Page,
    Parameter,
    Scene,
    Track,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
r, theta, phi = dynamicsymbols("r theta phi")
m, g, R = symbols("m g R", positive=True)
omega = symbols("omega", real=True)
turn = symbols("turn")  # along the drawn hoop

T = m * (r.diff() ** 2 + r**2 * theta.diff() ** 2 + (r * sin(theta) * phi.diff()) ** 2) / 2
V = -m * g * r * cos(theta)


def at(radius, angle):
    """The point of the hoop's plane, in space."""
    across = radius * sin(angle)
    return (across * cos(phi), across * sin(phi), -radius * cos(angle))


model = Model(
    name="Hoop",
    lagrangian=T - V,
    coordinates={r: "m", theta: "rad", phi: "rad"},
    constraints=[
        Holonomic("hoop", r - R, "the bead stays on the hoop"),
        Holonomic("drive", phi - omega * t, "a motor turns the hoop at a constant rate"),
    ],
    parameters=[
        Parameter(m, 0.1, "kg", "mass of the bead", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(R, 0.2, "m", "radius of the hoop", min=0),
        Parameter(omega, 10.0, "rad/s", "rate of the hoop"),
    ],
    start={r: R, theta: 0.3, phi.diff(): omega},
    description="Bead on a hoop that is turned about its vertical diameter",
    descriptions={
        r: "distance from the centre",
        theta: "angle from the downward vertical",
        phi: "angle of the hoop's plane",
    },
    outputs=[Output("motor.power", multiplier("drive") * phi.diff(), "W", "power of the motor")],
    picture=[
        Line((0, 0, -R), (0, 0, R)),
        Track(at(R, turn), turn, 0, 2 * pi),
        Disk(at(r, theta), trace=True),
        Arrow("hoop", at=at(r, theta)),
        Arrow("drive", at=at(r, theta)),
    ],
    page=Page(
        sliders=[omega, theta, theta.diff(), R],
        curves=[theta, "lambda.hoop", "lambda.drive", "energy.*"],
        ranges={omega: (0, 20), theta: (0.01, 3.1)},
    ),
)

scenes = [Scene("Hoop", stop_time=5.0, step_size=0.01)]

# On the hoop  theta'' = (omega^2 cos(theta) - g/R) sin(theta),  whose first integral is
#     theta'^2 - omega^2 sin(theta)^2 - 2 (g/R) cos(theta) = constant.
# Along the radius  -m R (theta'^2 + omega^2 sin(theta)^2) = m g cos(theta) + lambda.hoop,  and the angular
# momentum m R^2 sin(theta)^2 omega grows at the rate lambda.drive.
theta0, rate0 = initial(theta), initial(theta.diff())
inward = R * (rate0**2 + omega**2 * (2 * sin(theta) ** 2 - sin(theta0) ** 2))
inward += g * (3 * cos(theta) - 2 * cos(theta0))
momentum = m * (R * sin(theta)) ** 2 * omega

closed_forms = [
    ClosedForm("phi", omega * t),
    ClosedForm("lambda.hoop", -m * inward),
    ClosedForm("der(theta,2)", (omega**2 * cos(theta) - g / R) * sin(theta)),
    ClosedForm(
        "lambda.drive",
        2 * m * R**2 * omega * sin(theta) * cos(theta) * theta.diff(),
    ),
    ClosedForm("motor.power", omega * output("lambda.drive")),
    Conserved("Jacobi's integral", output("energy.total") - omega * momentum, scale=m * g * R),
]
