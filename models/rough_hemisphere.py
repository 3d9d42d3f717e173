"""Particle that slides down a rough hemisphere and leaves it (example 7.10 with friction).

r [m] and theta [rad] from the top.  lambda.surface [N] is the normal force, lambda.hold [N] the friction,
positive in the sense of a growing theta.  It slides from rest if tan(theta0) > mu_s, and leaves where
v^2 = g r cos(theta).
"""

from sympy import Max, cos, exp, pi, sign, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Contact,
    Disk,
    Friction,
    Ground,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    Track,
    departure,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
r, theta = dynamicsymbols("r theta")
m, g, a = symbols("m g a", positive=True)
mu_s, mu_k = symbols("mu_s mu_k", nonnegative=True)
turn = symbols("turn")  # along the drawn surface

model = Model(
    name="RoughHemisphere",
    lagrangian=m * (r.diff() ** 2 + r**2 * theta.diff() ** 2) / 2 - m * g * r * cos(theta),
    coordinates={r: "m", theta: "rad"},
    constraints=[
        Contact("surface", r - a, "the particle stays outside of the sphere"),
        Nonholonomic("hold", a * theta.diff(), "the particle rests on the sphere"),
        Friction("grip", of=["hold"], normal=multiplier("surface"), static=mu_s, kinetic=mu_k),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(a, 1.0, "m", "radius of the sphere", min=0),
        Parameter(mu_s, 0.3, "1", "coefficient of static friction", min=0),
        Parameter(mu_k, 0.2, "1", "coefficient of kinetic friction", min=0),
    ],
    start={r: a, theta: 0.4},
    description="Particle that slides down a rough hemisphere and leaves it",
    descriptions={r: "distance from the centre", theta: "angle from the top"},
    picture=[
        Ground((-2 * a, 0), (2 * a, 0)),
        Track((a * sin(turn), a * cos(turn)), turn, -pi / 2, pi / 2),
        Disk((r * sin(theta), r * cos(theta)), trace=True),
        Arrow("surface", at=(r * sin(theta), r * cos(theta))),
        Arrow("hold", at=(r * sin(theta), r * cos(theta))),
    ],
)

scenes = [Scene("RoughHemisphere", stop_time=2.0, step_size=0.01)]


# w = v^2/(g a):  dw/dtheta = 2 sin(theta) - 2 mu (cos(theta) - w) while it slides down, which is linear in w.
def particular(angle):
    """A solution of it."""
    return ((4 * mu_k**2 - 2) * cos(angle) - 6 * mu_k * sin(angle)) / (1 + 4 * mu_k**2)


def w(angle):
    """w of the slide from theta0 with the speed of the start."""
    w0 = a * initial(theta.diff()) ** 2 / g
    begin = initial(theta)
    return particular(angle) + (w0 - particular(begin)) * exp(2 * mu_k * (angle - begin))


slides = 1 - output("sticks.grip")
first = 1 - sign(output("slipping.grip.count"))  # it has slid since the start, ...
upwards = Max(0, -sign(initial(theta.diff())))
down = slides * first * Max(0, output("slip.hold")) * (1 - upwards)  # ... and downwards
angle = departure("surface", theta)

closed_forms = [
    ClosedForm(
        "v^2/(g a)",
        w(theta),
        actual=a * theta.diff() ** 2 / g,
        until_departure="surface",
        when=down,
    ),
    ClosedForm(
        "normal force while it slides",
        m * g * (cos(theta) - w(theta)),
        actual=output("lambda.surface"),
        until_departure="surface",
        when=down,
        scale=m * g,
    ),
    ClosedForm(
        "friction while it slides",
        -mu_k * m * g * (cos(theta) - w(theta)),
        actual=output("lambda.hold"),
        until_departure="surface",
        when=down,
        scale=m * g,
    ),
    ClosedForm(
        "friction while it rests",
        -m * g * sin(theta),
        actual=output("lambda.hold"),
        when=1 - slides,
    ),
    ClosedForm(
        "w = cos(theta) at the departure",
        cos(angle),
        actual=w(angle),
        at_departure="surface",
        when=first * (1 - upwards) * sign(sin(initial(theta)) - mu_s * cos(initial(theta))),
    ),
    Conserved(
        "energy and heat", output("energy.total") + output("energy.dissipated"), scale=m * g * a
    ),
]
