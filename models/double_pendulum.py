"""Double pendulum in Cartesian coordinates: two bobs on two massless rods (Landau & Lifshitz, sect. 5).

x1, y1 and x2, y2 [m] are the bobs, to the right and up from the pivot.  With f1 = x1^2 + y1^2 - L1^2
and f2 = (x2 - x1)^2 + (y2 - y1)^2 - L2^2 the forces along the rods are 2 lambda times the rod, so that
lambda = -tension/(2 L) [N/m] for either.
"""

from math import cos, sin

from sympy import sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Holonomic,
    Model,
    Parameter,
    Rod,
    Scene,
    output,
)

x1, y1, x2, y2 = dynamicsymbols("x1 y1 x2 y2")
m1, m2, g, L1, L2 = symbols("m1 m2 g L1 L2", positive=True)

T = m1 * (x1.diff() ** 2 + y1.diff() ** 2) / 2 + m2 * (x2.diff() ** 2 + y2.diff() ** 2) / 2
V = m1 * g * y1 + m2 * g * y2
dx, dy = x2 - x1, y2 - y1

model = Model(
    name="DoublePendulum",
    lagrangian=T - V,
    coordinates={x1: "m", y1: "m", x2: "m", y2: "m"},
    constraints=[
        Holonomic("upper", x1**2 + y1**2 - L1**2, "the upper rod keeps its length"),
        Holonomic("lower", dx**2 + dy**2 - L2**2, "the lower rod keeps its length"),
    ],
    parameters=[
        Parameter(m1, 1.0, "kg", "mass of the upper bob", min=0),
        Parameter(m2, 0.5, "kg", "mass of the lower bob", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(L1, 1.0, "m", "length of the upper rod", min=0),
        Parameter(L2, 0.8, "m", "length of the lower rod", min=0),
    ],
    start={
        x1: sin(1.0),
        y1: -cos(1.0),
        x2: sin(1.0) + 0.8 * sin(1.5),
        y2: -cos(1.0) - 0.8 * cos(1.5),
    },
    description="Double pendulum: two bobs on two massless rods",
    descriptions={
        x1: "upper bob, to the right of the pivot",
        y1: "upper bob, above the pivot",
        x2: "lower bob, to the right of the pivot",
        y2: "lower bob, above the pivot",
    },
    picture=[
        Rod((0, 0), (x1, y1)),
        Rod((x1, y1), (x2, y2)),
        Disk((x1, y1)),
        Disk((x2, y2), trace=True),
        Arrow("upper", at=(x1, y1)),
        Arrow("lower", at=(x2, y2)),
    ],
)

scenes = [Scene("DoublePendulum", stop_time=10.0, step_size=0.01)]

# Newton's equations along the rods, with T1 and T2 the tensions, c the cosine between the rods, and
# u1, u2 the speeds with which the rods turn:
#     T1 - c T2 = m1 (u1^2 - g y1)/L1 ,     (m1 + m2) T2 - c m2 T1 = m1 m2 u2^2/L2 .
upward = m1 * (x1.diff() ** 2 + y1.diff() ** 2 - g * y1) / L1
outward = m1 * m2 * (dx.diff() ** 2 + dy.diff() ** 2) / L2
c = (x1 * dx + y1 * dy) / (L1 * L2)
T2 = (outward + c * m2 * upward) / (m1 + m2 * (1 - c**2))
T1 = upward + c * T2

closed_forms = [
    ClosedForm("lambda.upper", -T1 / (2 * L1)),
    ClosedForm("lambda.lower", -T2 / (2 * L2)),
    ClosedForm("der(x2,2)", -T2 * dx / (m2 * L2)),
    ClosedForm("Q.y1", -T1 * y1 / L1 + T2 * dy / L2),
    ClosedForm("upper rod's length", L1, actual=sqrt(x1**2 + y1**2)),
    ClosedForm("lower rod's length", L2, actual=sqrt(dx**2 + dy**2)),
    Conserved("energy", output("energy.total"), scale=(m1 + m2) * g * L1 + m2 * g * L2),
]
