"""Disk (or sphere, or hoop) on an incline with friction: does it roll? (Marion & Thornton, example 7.9)

y [m] down the incline, z [m] above it, theta [rad] the turn.  lambda.incline [N] is the normal force,
lambda.rolling [N] the friction, positive down the incline.  kappa is the moment of inertia over M R^2: 1/2
for a disk, 2/5 for a solid sphere, 1 for a hoop.  From rest it rolls if tan(alpha) <= mu_s (1 + 1/kappa).
"""

from math import pi

from sympy import Max, Min, cos, sign, sin, symbols
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
    Output,
    Parameter,
    Scene,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
y, z, theta = dynamicsymbols("y z theta")
M, R, g, kappa = symbols("M R g kappa", positive=True)
alpha = symbols("alpha", real=True)
mu_s, mu_k = symbols("mu_s mu_k", nonnegative=True)

T = M * (y.diff() ** 2 + z.diff() ** 2) / 2 + kappa * M * R**2 * theta.diff() ** 2 / 2
V = M * g * (z * cos(alpha) - y * sin(alpha))


def along(way, height=0):
    """The point a way down the incline and a height above it."""
    return (
        way * cos(alpha) + height * sin(alpha),
        -way * sin(alpha) + height * cos(alpha),
    )


model = Model(
    name="InclineFriction",
    lagrangian=T - V,
    coordinates={y: "m", z: "m", theta: "rad"},
    constraints=[
        Contact("incline", z, "the disk lies on the incline"),
        Nonholonomic("rolling", y.diff() - R * theta.diff(), "the point of contact rests"),
        Friction("grip", of=["rolling"], normal=multiplier("incline"), static=mu_s, kinetic=mu_k),
    ],
    parameters=[
        Parameter(M, 1.0, "kg", "mass", min=0),
        Parameter(R, 0.1, "m", "radius", min=0),
        Parameter(kappa, 0.5, "1", "moment of inertia over M R^2", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(alpha, pi / 6, "rad", "angle of the incline", min=0, max=pi / 2),
        Parameter(mu_s, 0.4, "1", "coefficient of static friction", min=0),
        Parameter(mu_k, 0.3, "1", "coefficient of kinetic friction", min=0),
    ],
    outputs=[
        Output(
            "friction.needed",
            -multiplier("rolling") / multiplier("incline"),
            "1",
            "friction over normal force",
            otherwise=0,
        )
    ],
    start={y: 0.0, theta: 0.0},
    description="Disk on an incline that rolls as long as friction allows",
    descriptions={y: "distance down the incline", z: "distance from it", theta: "rotation"},
    picture=[
        Ground(along(0), along(2)),
        Disk(along(y, z + R), radius=R, angle=-theta),
        Arrow("incline", at=along(y, z)),
        Arrow("rolling", at=along(y, z)),
    ],
)

scenes = [Scene("InclineFriction", stop_time=1.0, step_size=0.01)]

# It rolls with y'' = g sin(alpha)/(1 + kappa) and lambda = -kappa/(1 + kappa) M g sin(alpha).  It slides with
# lambda = -mu_k M g cos(alpha) s/|s|: s = y' - R theta' then changes at the rate below, and if that ends at 0
# and friction suffices, it rolls from there on; if not, it slides on downhill.
a, normal = g * sin(alpha), M * g * cos(alpha)
holds = kappa * sin(alpha) / (1 + kappa) - mu_s * cos(alpha)  # <= 0 if it can roll
s0 = initial(y.diff()) - R * initial(theta.diff())
way = sign(s0)
push = -way * mu_k * g * cos(alpha)  # of friction, over M
rate = a + push * (1 + 1 / kappa)
stop = -s0 / rate  # the time when s = 0, if it is positive
rolls = output("sticks.grip")
slid = Min(t, stop)  # it slides that long, if it rolls now
tau = t - slid
v1 = initial(y.diff()) + (a + push) * slid

closed_forms = [
    ClosedForm(
        "friction while it rolls",
        -kappa / (1 + kappa) * M * a,
        actual=output("lambda.rolling"),
        scale=normal,
        until_departure="incline",
        when=rolls,
    ),
    ClosedForm(
        "friction while it slides",
        -mu_k * normal * sign(output("slip.rolling")),
        actual=output("lambda.rolling"),
        scale=normal,
        until_departure="incline",
        when=(1 - rolls) * sign(output("slip.rolling")) ** 2,
    ),
    ClosedForm(
        "it rolls from rest",
        1,
        actual=rolls,
        until_departure="incline",
        when=(1 - way**2) * Max(0, -holds),
    ),
    ClosedForm(
        "it slides from rest",
        0,
        actual=rolls,
        until_departure="incline",
        when=(1 - way**2) * Max(0, holds),
        scale=1,
    ),
    ClosedForm(
        "y while it rolls",
        initial(y)
        + initial(y.diff()) * slid
        + (a + push) * slid**2 / 2
        + v1 * tau
        + a / (1 + kappa) * tau**2 / 2,
        actual=y,
        until_departure="incline",
        when=rolls * Max(0, -holds),
    ),
    ClosedForm(
        "y of a slide from rest",
        initial(y) + initial(y.diff()) * t + (a - mu_k * g * cos(alpha)) * t**2 / 2,
        actual=y,
        until_departure="incline",
        when=(1 - way**2) * Max(0, holds),
    ),
    ClosedForm("lambda.incline", normal, until_departure="incline"),
    Conserved(
        "energy and heat",
        output("energy.total") + output("energy.dissipated"),
        scale=output("energy.kinetic"),
    ),
]
