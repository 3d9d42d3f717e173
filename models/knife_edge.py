"""Knife edge (a skate) on an incline (Bloch, Nonholonomic Mechanics and Control, ch. 1).

x [m] down the incline, y [m] across, phi [rad] the blade's heading from the x axis.  The blade
moves only along itself, x' sin phi - y' cos phi = 0: no relation of the coordinates can say that.
lambda [N] is the sideways force on the blade, positive along (sin phi, -cos phi).
"""

from math import pi

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Model,
    Nonholonomic,
    Parameter,
    Rod,
    Scene,
    initial,
    output,
)

t = dynamicsymbols._t
x, y, phi = dynamicsymbols("x y phi")
m, J, g = symbols("m J g", positive=True)
alpha = symbols("alpha", real=True)

blade = 0.2  # m, half of the drawn blade

T = m * (x.diff() ** 2 + y.diff() ** 2) / 2 + J * phi.diff() ** 2 / 2
V = -m * g * x * sin(alpha)

model = Model(
    name="KnifeEdge",
    lagrangian=T - V,
    coordinates={x: "m", y: "m", phi: "rad"},
    constraints=[
        Nonholonomic(
            "edge",
            x.diff() * sin(phi) - y.diff() * cos(phi),
            "the blade does not move sideways",
        )
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass", min=0),
        Parameter(J, 0.1, "kg.m^2", "moment of inertia about the contact point", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(alpha, pi / 6, "rad", "angle of the incline", min=0, max=pi / 2),
    ],
    start={x: 0.0, y: 0.0, phi: 0.0, phi.diff(): 1.0},
    description="Knife edge that slides and turns on an incline",
    descriptions={
        x: "distance down the incline",
        y: "distance across the incline",
        phi: "heading of the blade",
    },
    picture=[
        Rod(
            (y - blade * sin(phi), -x + blade * cos(phi)),
            (y + blade * sin(phi), -x - blade * cos(phi)),
        ),
        Disk((y, -x), trace=True),
        Arrow("edge", at=(y, -x)),
    ],
)

scenes = [Scene("KnifeEdge", stop_time=10.0, step_size=0.01)]

# J phi'' = 0: the heading turns at a constant rate, omega.  With G = g sin(alpha) the speed u along
# the blade obeys  u' = G cos(phi),  and across it, in the direction (sin phi, -cos phi),
#     -m u omega = m G sin(phi) + lambda .
# Hence, with S the time integral of cos(phi) and C that of sin(phi),
#     u = u0 + G S ,   x = x0 + u0 S + G S^2/2 ,   y = y0 + u0 C + G (integral of S sin(phi)) .
G = g * sin(alpha)
phi0, omega = initial(phi), initial(phi.diff())
u0 = initial(x.diff()) * cos(phi0) + initial(y.diff()) * sin(phi0)
heading = phi0 + omega * t
S = (sin(heading) - sin(phi0)) / omega  # here and in C for omega != 0
C = (cos(phi0) - cos(heading)) / omega
down = u0 * S + G * S**2 / 2
drift = (t - (sin(2 * heading) - sin(2 * phi0)) / (2 * omega)) / 2 - C * sin(phi0)
across = u0 * C + G * drift / omega
sideways = -m * (omega * u0 + G * (2 * sin(phi) - sin(phi0)))

# From rest with phi0 = 0 that is a cycloid, with lambda = -2 m g sin(alpha) sin(omega t): x swings
# between 0 and G / (2 omega^2), and y drifts across the slope at the mean rate G / (2 omega).
closed_forms = [
    ClosedForm("phi", heading),
    ClosedForm("lambda.edge", sideways),
    ClosedForm("x", initial(x) + down),
    ClosedForm("y", initial(y) + across),
    Conserved("energy", output("energy.total"), scale=output("energy.kinetic")),
]
