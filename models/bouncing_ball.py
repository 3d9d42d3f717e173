"""Ball that bounces to rest: a contact with restitution (Newton's law of impact).

y [m] is the height above the floor.  lambda [N] is the floor's force, m g once the ball lies; the
bounces themselves are impulses.  Infinitely many of them end in a finite time, sqrt(2 h/g)
(1 + e)/(1 - e) after a fall from rest.
"""

from sympy import Eq, Piecewise, floor, log, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Contact,
    Disk,
    Ground,
    Model,
    Parameter,
    Scene,
    initial,
    output,
)

t = dynamicsymbols._t
y = dynamicsymbols("y")
m, g = symbols("m g", positive=True)
e = symbols("e", nonnegative=True)

T = m * y.diff() ** 2 / 2
V = m * g * y

model = Model(
    name="BouncingBall",
    lagrangian=T - V,
    coordinates={y: "m"},
    constraints=[Contact("floor", y, "the ball is on the floor or above it", restitution=e)],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the ball", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(e, 0.7, "1", "coefficient of restitution", min=0, max=1),
    ],
    start={y: 1.0},
    description="Ball that bounces on the floor until it rests",
    descriptions={y: "height above the floor"},
    picture=[
        Ground((-0.5, 0), (0.5, 0)),
        Disk((0, y)),
        Arrow("floor", at=(0, y)),
    ],
)

scenes = [Scene("BouncingBall", stop_time=3.0, step_size=0.01)]

# It meets the floor at t1 with the speed w, and leaves it for the (k+1)-th time, k = 0, 1, ..., at
#     t1 + (2 w/g) (e + e^2 + ... + e^k)   with the speed   w e^(k+1) .
w = sqrt(initial(y.diff()) ** 2 + 2 * g * initial(y))
first = (initial(y.diff()) + w) / g
flight = 2 * w * e / g  # between the first bounce and the second
left = 1 - (t - first) * (1 - e) / flight  # e^k at the bounces, 0 at the end of them all
k = Piecewise((floor((t - first) / flight), Eq(e, 1)), (floor(log(left) / log(e)), True))
sum_of_powers = Piecewise((k, Eq(e, 1)), ((1 - e**k) / (1 - e), True))
since = t - first - flight * sum_of_powers
falling = initial(y) + initial(y.diff()) * t - g * t**2 / 2
bouncing = w * e ** (k + 1) * since - g * since**2 / 2
height = Piecewise((falling, t < first), (bouncing, (t - first) * (1 - e) < flight), (0, True))

closed_forms = [
    # the ball is at rest as soon as it would rise by less than 1e-9 of its first height
    ClosedForm("y", height, rounding=3e-9, scale=w**2 / (2 * g)),
    ClosedForm("lambda.floor", m * g, while_closed="floor"),
    ClosedForm(
        "lambda.floor in flight", actual=output("lambda.floor"), expected=0, while_open="floor"
    ),
]
