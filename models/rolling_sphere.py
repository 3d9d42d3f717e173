"""Solid sphere that rolls down a fixed sphere and leaves it (Goldstein, ch. 1 and 2, exercises).

RollingSphere never slips.  On the way down the normal force vanishes before the friction that rolling needs,
so that with any coefficient it slips before it leaves: SlippingSphere.

r [m] from centre to centre, theta [rad] of the line of centres from the vertical, phi [rad] the
sphere's own turn.  lambda.surface [N] is the normal force, positive outward; lambda.rolling [N] is
the friction on the rolling sphere, positive in the sense of a growing theta: it holds back and is
negative.  The friction acts while the surface is touched, and goes with it.
"""

from sympy import Abs, Max, Rational, cos, exp, pi, sign, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Contact,
    Disk,
    Friction,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    departure,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
r, theta, phi = dynamicsymbols("r theta phi")
m, g, a, R = symbols("m g a R", positive=True)
mu_s, mu_k = symbols("mu_s mu_k", nonnegative=True)

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
        Friction("grip", of=["rolling"], normal=multiplier("surface"), static=mu_s, kinetic=mu_k),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass of the rolling sphere", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(a, 1.0, "m", "radius of the fixed sphere", min=0),
        Parameter(R, 0.2, "m", "radius of the rolling sphere", min=0),
        Parameter(mu_s, 0.4, "1", "coefficient of static friction", min=0),
        Parameter(mu_k, 0.3, "1", "coefficient of kinetic friction", min=0),
    ],
    start={r: a + R, theta: 0.05, phi: 0.0},
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

scenes = [
    Scene("RollingSphere", stop_time=2.0, step_size=0.01, frictions=()),
    Scene("SlippingSphere", stop_time=2.0, step_size=0.01),
]

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

# With friction it slips where (2/7) m g sin(theta) exceeds mu_s lambda.surface, before that is 0. Downhill,
# w = b theta'^2/g  has  dw/dtheta = 2 sin(theta) - 2 mu_k (cos(theta) - w) , linear in w; it leaves
# where w = cos(theta).
begun = output("slipping.grip.theta")


def particular(at):
    """A solution of it."""
    return ((4 * mu_k**2 - 2) * cos(at) - 6 * mu_k * sin(at)) / (1 + 4 * mu_k**2)


def w(at):
    """w of the slide from where it began."""
    w0 = b * output("slipping.grip.velocity.theta") ** 2 / g
    return particular(at) + (w0 - particular(begun)) * exp(2 * mu_k * (at - begun))


slips = output("slipping.grip.count")
way, turned = (a + R) * initial(theta.diff()), R * initial(phi.diff())
began = 1 - sign(Max(0, Abs(way - turned) - 1e-12 * (Abs(way) + Abs(turned))))  # by rolling
rolls = began * output("sticks.grip") * (1 - sign(slips))  # since the start
once = began * Max(0, 1 - (slips - 1) ** 2) * Max(0, sign(begun))  # on the right, where these hold
slides = once * (1 - output("sticks.grip")) * Max(0, sign(output("slip.rolling")))
never = {"only": ["RollingSphere"]}
rough = {"only": ["SlippingSphere"], "until_departure": "surface"}

closed_forms = [
    ClosedForm("lambda.surface", normal_force, until_departure="surface", **never),
    ClosedForm("lambda.rolling", friction, while_closed="surface", scale=m * g, **never),
    ClosedForm("Q.phi", -R * friction, while_closed="surface", scale=m * g * R, **never),
    ClosedForm(
        "der(theta,2)", 5 * g * sin(theta) / (7 * b), while_closed="surface", scale=g / b, **never
    ),
    ClosedForm(
        "cos(theta) at the departure",
        actual=cos(angle),
        expected=(10 * cos(theta0) + 7 * v0**2 / (g * b)) / 17,
        at_departure="surface",
        **never,
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
    Conserved("energy", output("energy.total"), scale=m * g * b, **never),
    ClosedForm(
        "normal force while it rolls",
        normal_force,
        actual=output("lambda.surface"),
        when=rolls,
        **rough,
    ),
    ClosedForm(
        "friction while it rolls",
        friction,
        actual=output("lambda.rolling"),
        scale=m * g,
        when=rolls,
        **rough,
    ),
    ClosedForm(
        "where it slips",
        mu_s * (17 * cos(begun) - 10 * cos(theta0) - 7 * v0**2 / (g * b)),
        actual=2 * sin(begun),
        when=once,
        **rough,
    ),
    ClosedForm(
        "b theta'^2/g while it slides",
        w(theta),
        actual=b * theta.diff() ** 2 / g,
        when=slides,
        **rough,
    ),
    ClosedForm(
        "normal force while it slides",
        m * g * (cos(theta) - w(theta)),
        actual=output("lambda.surface"),
        scale=m * g,
        when=slides,
        **rough,
    ),
    ClosedForm(
        "friction while it slides",
        -mu_k * m * g * (cos(theta) - w(theta)),
        actual=output("lambda.rolling"),
        scale=m * g,
        when=slides,
        **rough,
    ),
    ClosedForm(
        "w = cos(theta) at the departure",
        cos(angle),
        actual=w(angle),
        at_departure="surface",
        when=once,
        only=["SlippingSphere"],
    ),
    Conserved(
        "energy and heat",
        output("energy.total") + output("energy.dissipated"),
        scale=m * g * b,
        only=["SlippingSphere"],
    ),
]
