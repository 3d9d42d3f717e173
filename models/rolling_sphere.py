"""Solid sphere that rolls down a fixed sphere and leaves it (Goldstein, ch. 1 and 2, exercises).

r [m] from centre to centre, theta [rad] of the line of centres from the vertical, phi [rad] the
sphere's own turn.  lambda.surface [N] is the normal force, positive outward; lambda.rolling [N] is
the friction on the rolling sphere, positive in the sense of a growing theta: it holds back and is
negative.  The friction acts while the surface is touched, and goes with it.
"""

from sympy import Rational, cos, pi, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Contact,
    Disk,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    departure,
    initial,
    output,
)

t = dynamicsymbols._t
r, theta, phi = dynamicsymbols("r theta phi")
m, g, a, R = symbols("m g a R", positive=True)

I = Rational(2, 5) * m * R**2  # noqa: E741 - the literature's letter
T = m * (r.diff() ** 2 + r**2 * theta.diff() ** 2) / 2 + I * phi.diff() ** 2 / 2
V = m * g * r * cos(theta)

model = Model(
    name="RollingSphere",
    lagrangian=T - V,
    coordinates={r: "m", theta: "rad", phi: "rad"},
    constraints=[
        Contact("surface", r - (a + R), "the spheres touch or are apart"),
        Nonholonomic(
            "rolling",
            (a + R) * theta.diff() - R * phi.diff(),
            "the point of contact rests on the fixed sphere",
            while_closed="surface",
        ),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the rolling sphere", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(a, 1.0, "m", "radius of the fixed sphere", min=0),
        Parameter(R, 0.2, "m", "radius of the rolling sphere", min=0),
    ],
    start={r: 1.2, theta: 0.05, phi: 0.0},
    description="Solid sphere that rolls down a fixed sphere and leaves it",
    descriptions={
        r: "distance of the centres",
        theta: "angle of the line of centres from the vertical",
        phi: "rotation of the rolling sphere",
    },
    picture=[
        Disk((0, 0), radius=a),
        Disk((r * sin(theta), r * cos(theta)), radius=R, angle=pi / 2 - phi),
        Arrow("surface", at=(r * sin(theta), r * cos(theta))),
        Arrow("rolling", at=(a * sin(theta), a * cos(theta)), along=(cos(theta), -sin(theta))),
    ],
)

scenes = [Scene("RollingSphere", stop_time=2.0, step_size=0.01)]

# With b = a + R and R phi' = b theta' while it rolls:  I phi'' = -R lambda.rolling  and
#     m b theta'' = m g sin(theta) + lambda.rolling ,
# so that  theta'' = (5/7) (g/b) sin(theta),  and the energy gives
#     (7/10) m b^2 theta'^2 = (7/10) m v0^2 + m g b (cos(theta0) - cos(theta)) .
# Along the line of centres  0 = m b theta'^2 - m g cos(theta) + lambda.surface.
b = a + R
theta0 = initial(theta)
v0 = b * initial(theta.diff())
normal_force = m * g * (17 * cos(theta) - 10 * cos(theta0)) / 7 - m * v0**2 / b
friction = -2 * m * g * sin(theta) / 7

# Afterwards the centre flies a parabola from the departure's state, and the spin stays.
rd, angle = departure("surface", r), departure("surface", theta)
rate, spin = departure("surface", r.diff()), departure("surface", theta.diff())
tau = t - departure("surface")
x = rd * sin(angle) + (rate * sin(angle) + rd * spin * cos(angle)) * tau
z = rd * cos(angle) + (rate * cos(angle) - rd * spin * sin(angle)) * tau - g * tau**2 / 2
turn = departure("surface", phi) + departure("surface", phi.diff()) * tau

closed_forms = [
    ClosedForm("lambda.surface", normal_force, until_departure="surface"),
    ClosedForm("lambda.rolling", friction, while_closed="surface", scale=m * g),
    ClosedForm("Q.phi", -R * friction, while_closed="surface", scale=m * g * R),
    ClosedForm("der(theta,2)", 5 * g * sin(theta) / (7 * b), while_closed="surface", scale=g / b),
    ClosedForm(
        "cos(theta) at the departure",
        actual=cos(angle),
        expected=(10 * cos(theta0) + 7 * v0**2 / (g * b)) / 17,
        at_departure="surface",
    ),
    ClosedForm(
        "lambda.rolling in flight",
        actual=output("lambda.rolling"),
        expected=0,
        while_open="surface",
    ),
    ClosedForm("r sin(theta) in flight", x, actual=r * sin(theta), while_open="surface"),
    ClosedForm("r cos(theta) in flight", z, actual=r * cos(theta), while_open="surface", scale=b),
    ClosedForm("phi in flight", turn, actual=phi, while_open="surface"),
    Conserved("energy", output("energy.total"), scale=m * g * b),
]
