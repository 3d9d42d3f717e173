"""Particle on the inside of a vertical circular loop (looping the loop; a classic).

x to the right, y up [m], both from the centre.  With f = (a^2 - x^2 - y^2)/(2 a), which is a - r near
the loop and smooth at its centre, lambda [N] is the loop's normal force, positive inward.  From the
bottom the particle stays on all the way round if v0^2 >= 5 g a, swings to and fro if v0^2 <= 2 g a, and
otherwise leaves the loop, flies a parabola, and meets the loop again.
"""

from sympy import Heaviside, cos, pi, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Contact,
    Disk,
    Model,
    Parameter,
    Scene,
    Track,
    departure,
    initial,
    output,
)

t = dynamicsymbols._t
x, y = dynamicsymbols("x y")
m, g, a = symbols("m g a", positive=True)
turn = symbols("turn")  # along the drawn loop

T = m * (x.diff() ** 2 + y.diff() ** 2) / 2
V = m * g * y

model = Model(
    name="Loop",
    lagrangian=T - V,
    coordinates={x: "m", y: "m"},
    constraints=[
        Contact("loop", (a**2 - x**2 - y**2) / (2 * a), "the particle is on the loop or inside it")
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the particle", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(a, 1.0, "m", "radius of the loop", min=0),
    ],
    start={x: 0.0, y: -a, x.diff(): 6.0},
    description="Particle that runs up the inside of a vertical loop and falls off it",
    descriptions={x: "to the right of the centre", y: "above the centre"},
    picture=[
        Track((a * sin(turn), a * cos(turn)), turn, 0, 2 * pi),
        Disk((x, y), trace=True),
        Arrow("loop", at=(x, y)),
    ],
)

scenes = [Scene("Loop", stop_time=2.0, step_size=0.01)]

# Towards the centre  m v^2/a = lambda + m g y/a,  and until it leaves  v^2 = v0^2 + 2 g (y0 - y).
y0 = initial(y)
square = x.diff() ** 2 + y.diff() ** 2
square0 = initial(x.diff()) ** 2 + initial(y.diff()) ** 2
force_now = m * (square - g * y) / a
force = m * (square0 + g * (2 * y0 - 3 * y)) / a

# It leaves where that is nothing, and flies a parabola from there.
xd, yd = departure("loop", x), departure("loop", y)
vx, vy = departure("loop", x.diff()), departure("loop", y.diff())
tau = t - departure("loop")

# So it does from the start if it is let go inside of the loop, until it has left it (1) for the first time.
left = Heaviside(output("departure.loop.count") - 1, 1)
across = left * (xd + vx * tau) + (1 - left) * (initial(x) + initial(x.diff()) * t)
up = left * (yd + vy * tau - g * tau**2 / 2)
up += (1 - left) * (y0 + initial(y.diff()) * t - g * t**2 / 2)
flight = left + 1 - initial(output("contact.loop"))  # not 0: from one or the other

closed_forms = [
    ClosedForm("lambda.loop", force, until_departure="loop"),
    ClosedForm(
        "lambda.loop from the state",
        force_now,
        actual=output("lambda.loop"),
        while_closed="loop",
    ),
    ClosedForm(
        "lambda.loop in flight", actual=output("lambda.loop"), expected=0, while_open="loop"
    ),
    ClosedForm("radius squared", a**2, actual=x**2 + y**2, while_closed="loop"),
    ClosedForm(
        "y at the departure",
        actual=yd,
        expected=(square0 / g + 2 * y0) / 3,
        at_departure="loop",
        scale=a,
    ),
    ClosedForm("v^2 at the departure", actual=vx**2 + vy**2, expected=g * yd, at_departure="loop"),
    ClosedForm("x in flight", across, actual=x, while_open="loop", when=flight, scale=a),
    ClosedForm("y in flight", up, actual=y, while_open="loop", when=flight, scale=a),
    Conserved("energy until it leaves", output("energy.total"), until_departure="loop"),
]
