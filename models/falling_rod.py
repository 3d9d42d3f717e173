"""Uniform rod that falls over on a rough floor: its foot sticks, slips, slides on (Painleve 1895).

x, y [m] of the middle, theta [rad] from the floor.  lambda.floor [N] is the normal force on the foot,
lambda.foot [N] the friction, positive along x.  In one direction of slip, for mu > 4/3 and around
tan(theta) = 2, there is no acceleration that agrees with Coulomb's law, or there are several: such a start
and such a step are refused.
"""

from sympy import Abs, cos, sign, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Contact,
    Friction,
    Ground,
    Model,
    Nonholonomic,
    Output,
    Parameter,
    Rod,
    Scene,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
x, y, theta = dynamicsymbols("x y theta")
m, g, l = symbols("m g l", positive=True)  # noqa: E741 - half of the length
mu, e = symbols("mu e", nonnegative=True)

foot = (x - l * cos(theta), y - l * sin(theta))
head = (x + l * cos(theta), y + l * sin(theta))

model = Model(
    name="FallingRod",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2
    + m * l**2 / 6 * theta.diff() ** 2
    - m * g * y,
    coordinates={x: "m", y: "m", theta: "rad"},
    constraints=[
        Contact("floor", y - l * sin(theta), "the foot stands on the floor", restitution=e),
        Nonholonomic("foot", x.diff() + l * sin(theta) * theta.diff(), "the foot rests"),
        Friction("grip", of=["foot"], normal=multiplier("floor"), static=mu),
        Contact("lying", y + l * sin(theta), "the head hits the floor", restitution=e),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the rod", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 1.0, "m", "half of its length", min=0),
        Parameter(mu, 0.5, "1", "coefficient of friction", min=0),
        Parameter(e, 0.0, "1", "coefficient of restitution", min=0, max=1),
    ],
    outputs=[Output("head.height", y + l * sin(theta), "m", "height of the upper end")],
    start={x: 0.0, y: 0.9320390859672263, theta: 1.2},
    description="Uniform rod that falls over on a rough floor",
    descriptions={
        x: "place of the middle",
        y: "height of the middle",
        theta: "angle from the floor",
    },
    picture=[
        Ground((-3 * l, 0), (3 * l, 0)),
        Rod(foot, head),
        Arrow("floor", at=foot),
        Arrow("foot", at=foot),
        Arrow("lying", at=head),
    ],
)

scenes = [Scene("FallingRod", stop_time=0.75, step_size=0.01)]

# While the foot has been on the floor and has stuck since the start, the rod turns about it:
# theta'' = -(3/4)(g/l) cos(theta), and theta'^2 = theta0'^2 + (3/2)(g/l)(sin(theta0) - sin(theta)).
rate = -3 * g * cos(theta) / (4 * l)
square = initial(theta.diff()) ** 2 + 3 * g / (2 * l) * (sin(initial(theta)) - sin(theta))
slip = initial(x.diff()) + l * sin(initial(theta)) * initial(theta.diff())
turns = output("sticks.grip") * (1 - output("slipping.grip.count")) * (1 - output("contact.lying"))
turns = turns * (1 - sign(Abs(slip)))  # a rod that begins by sliding sticks later on

closed_forms = [
    ClosedForm(
        "der(theta,2) on the foot",
        rate,
        actual=theta.diff(t, 2),
        when=turns,
        until_departure="floor",
    ),
    ClosedForm(
        "theta'^2 on the foot",
        square,
        actual=theta.diff() ** 2,
        scale=g / l,
        when=turns,
        until_departure="floor",
    ),
    ClosedForm(
        "normal force on the foot",
        m * (g + l * (cos(theta) * rate - sin(theta) * square)),
        actual=output("lambda.floor"),
        when=turns,
        until_departure="floor",
    ),
    ClosedForm(
        "friction on the foot",
        -m * l * (sin(theta) * rate + cos(theta) * square),
        actual=output("lambda.foot"),
        scale=m * g,
        when=turns,
        until_departure="floor",
    ),
    Conserved(
        "energy and heat", output("energy.total") + output("energy.dissipated"), scale=m * g * l
    ),
]
