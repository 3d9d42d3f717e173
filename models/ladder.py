"""Uniform ladder that slides down a smooth wall along a smooth floor (Routh, Dynamics I; a classic).

x, y [m] are the ladder's middle, from the corner of wall and floor; theta [rad] its angle above the
floor.  lambda.wall, lambda.floor and lambda.top [N] are the normal forces on the ladder, positive away
from the wall and upward: its upper end leaves the wall at two thirds of the height from which it was
let go, then falls to the floor and lies there, sliding on.
"""

from math import cos as cosine
from math import sin as sine

from sympy import Heaviside, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Contact,
    Ground,
    Model,
    Parameter,
    Rod,
    Scene,
    departure,
    initial,
    output,
)

t = dynamicsymbols._t
x, y, theta = dynamicsymbols("x y theta")
m, g, l = symbols("m g l", positive=True)  # noqa: E741 - the literature's letter

I = m * l**2 / 12  # noqa: E741 - the literature's letter
T = m * (x.diff() ** 2 + y.diff() ** 2) / 2 + I * theta.diff() ** 2 / 2
V = m * g * y

lower = (x + l * cos(theta) / 2, y - l * sin(theta) / 2)
upper = (x - l * cos(theta) / 2, y + l * sin(theta) / 2)

model = Model(
    name="Ladder",
    lagrangian=T - V,
    coordinates={x: "m", y: "m", theta: "rad"},
    constraints=[
        Contact("wall", x - l * cos(theta) / 2, "the upper end is at the wall or before it"),
        Contact("floor", y - l * sin(theta) / 2, "the lower end is on the floor or above it"),
        Contact("top", y + l * sin(theta) / 2, "so is the upper end"),
    ],
    parameters=[
        Parameter(m, 10.0, "kg", "mass of the ladder", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 2.0, "m", "length of the ladder", min=0),
    ],
    start={x: cosine(1.2), y: sine(1.2), theta: 1.2},
    description="Ladder that slides down a wall, leaves it, and falls to the floor",
    descriptions={
        x: "middle of the ladder, from the wall",
        y: "middle of the ladder, above the floor",
        theta: "angle of the ladder above the floor",
    },
    picture=[
        Ground((0, 0), (2 * l, 0)),
        Ground((0, 5 * l / 4), (0, 0)),
        Rod(lower, upper),
        Arrow("wall", at=upper),
        Arrow("floor", at=lower),
        Arrow("top", at=upper),
    ],
)

scenes = [Scene("Ladder", stop_time=1.5, step_size=0.01)]

# At the wall  x = (l/2) cos(theta),  y = (l/2) sin(theta)  and  T = m l^2 theta'^2/6, so that
#     theta'^2 = theta0'^2 + (3 g/l) (sin(theta0) - sin(theta)) ,   theta'' = -(3 g/(2 l)) cos(theta) ,
# and the forces follow from  m x'' = lambda.wall  and  m y'' = lambda.floor - m g.
theta0, rate0 = initial(theta), initial(theta.diff())
square = rate0**2 + 3 * g * (sin(theta0) - sin(theta)) / l
wall = m * cos(theta) * (3 * g * sin(theta) / 4 - l * square / 2)
floor = m * g - m * (3 * g * cos(theta) ** 2 / 4 + l * sin(theta) * square / 2)
highest = 2 * sin(theta0) / 3 + 2 * l * rate0**2 / (9 * g)  # sin(theta) where the wall's force ends
# ... unless it goes up, and over the vertical, where the wall lets go as well:
over = Heaviside(rate0, 0) * Heaviside(rate0**2 + 3 * g * (sin(theta0) - 1) / l, 1)
# That is so if it slid on the floor all along:
slid = initial(output("contact.floor")) * Heaviside(-output("departure.floor.count"), 1)

# Without the wall x' stays and gravity turns nothing: an end that is alone on the floor (side = 1: the
# lower end, -1: the upper) is pushed by  lambda  with  I theta'' = -side (l/2) cos(theta) lambda  and
# m y'' = lambda - m g  in  y = side (l/2) sin(theta),  so that
#     (1 + 3 cos(theta)^2) lambda = m g - side m (l/2) sin(theta) theta'^2 ,
# and at the wall  lambda = m g - m (3 g cos(theta)^2/4 + side (l/2) sin(theta) theta'^2).  On both ends
# it lies, and each carries half of it.
at_wall, on_floor, on_top = (output(f"contact.{c}") for c in ("wall", "floor", "top"))  # 0 or 1
arm = 1 + 3 * cos(theta) ** 2


def pushed(side, other):
    """The force on an end that touches the floor; `other`: the other end does, too."""
    turning = side * l * sin(theta) * theta.diff() ** 2 / 2
    free = m * (g - turning) / arm
    held = m * (g - 3 * g * cos(theta) ** 2 / 4 - turning)
    return other * m * g / 2 + (1 - other) * (at_wall * held + (1 - at_wall) * free)


# From the departure on  (1 + 3 cos(theta)^2) theta'^2 + 12 (g/l) sin(theta)  is constant until it lies.
angle, rate = departure("wall", theta), departure("wall", theta.diff())
slide = (1 + 3 * cos(angle) ** 2) * rate**2 + 12 * g * (sin(angle) - sin(theta)) / l
falling = m * (g - l * sin(theta) * slide / (2 * arm)) / arm
free = departure("wall", x) + departure("wall", x.diff()) * (t - departure("wall"))

# No end has struck wall or floor: what is closed was so at the start.
unstruck = Heaviside(initial(at_wall) - at_wall, 1) * Heaviside(initial(on_floor) - on_floor, 1)
unstruck *= Heaviside(-output("departure.floor.count"), 1)
unstruck *= Heaviside(initial(at_wall) - output("departure.wall.count"), 1)

closed_forms = [
    ClosedForm("lambda.wall", wall, until_departure="wall", when=slid),
    ClosedForm("lambda.floor", floor, until_departure="wall", when=slid),
    ClosedForm(
        "sin(theta) at the departure",
        actual=sin(angle),
        expected=highest,
        at_departure="wall",
        when=slid * (1 - over),
    ),
    ClosedForm(
        "der(theta)^2 at the departure",
        actual=rate**2,
        expected=rate0**2 + 3 * g * (sin(theta0) - highest) / l,
        at_departure="wall",
        when=slid * (1 - over),
    ),
    ClosedForm("x without the wall", free, actual=x, while_open="wall"),
    ClosedForm(
        "lambda.floor without the wall",
        actual=output("lambda.floor"),
        expected=(1 - on_top) * falling + on_top * m * g / 2,
        while_open="wall",
        when=slid,
        scale=m * g,
    ),
    ClosedForm(
        "lambda.floor from the state",
        pushed(1, on_top),
        actual=output("lambda.floor"),
        while_closed="floor",
        scale=m * g,
    ),
    ClosedForm("lambda.top", pushed(-1, on_floor), while_closed="top", scale=m * g),
    Conserved("energy until it lies", output("energy.total"), while_open="top", when=unstruck),
]
