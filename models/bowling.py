"""Ball thrown without spin along the lane: it slides, then rolls (Coriolis 1835).

x [m] along the lane, z [m] above it, phi [rad] the turn.  lambda.touch [N] is the friction along x.
It rolls after 2 v0/(7 mu g), at (5/7) v0.
"""

from sympy import Abs, Min, Rational, sign, symbols
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
x, z, phi = dynamicsymbols("x z phi")
m, R, g, mu = symbols("m R g mu", positive=True)

model = Model(
    name="Bowling",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2
    + Rational(1, 5) * m * R**2 * phi.diff() ** 2
    - m * g * z,
    coordinates={x: "m", z: "m", phi: "rad"},
    constraints=[
        Contact("lane", z, "the ball lies on the lane"),
        Nonholonomic("touch", x.diff() - R * phi.diff(), "the point of contact rests"),
        Friction("grip", of=["touch"], normal=multiplier("lane"), static=mu),
    ],
    parameters=[
        Parameter(m, 7.0, "kg", "mass of the ball", min=0),
        Parameter(R, 0.108, "m", "radius of the ball", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(mu, 0.12, "1", "coefficient of friction", min=0),
    ],
    outputs=[
        Output("slide.power", multiplier("touch") * x.diff(), "W", "work of friction on the way")
    ],
    start={x: 0.0, x.diff(): 8.0},
    description="Ball thrown without spin that slides, then rolls",
    descriptions={x: "distance along the lane", z: "height above it", phi: "rotation"},
    picture=[  # beside the ball, as it goes along
        Ground((-6 * R, 0), (6 * R, 0)),
        Disk((0, z + R), radius=R, angle=-phi),
        Arrow("lane", at=(0, z)),
        Arrow("touch", at=(0, z), along=(1, 0)),
    ],
)

scenes = [Scene("Bowling", stop_time=3.0, step_size=0.01)]

v0 = initial(x.diff()) - R * initial(phi.diff())
end = 2 * Abs(v0) / (7 * mu * g)
slid = Min(t, end)
push = mu * g * sign(v0)  # of friction against the slip, over m
speed = initial(x.diff()) - push * slid
lane = {"until_departure": "lane"}

closed_forms = [
    ClosedForm(
        "x",
        initial(x) + initial(x.diff()) * slid - push * slid**2 / 2 + speed * (t - slid),
        **lane,
    ),
    ClosedForm("der(x)", speed, **lane),
    ClosedForm(
        "R phi'", initial(phi.diff()) * R + 5 * push * slid / 2, actual=R * phi.diff(), **lane
    ),
    ClosedForm(
        "heat",
        mu * m * g * (Abs(v0) * slid - 7 * mu * g * slid**2 / 4),
        actual=output("energy.dissipated"),
        **lane,
    ),
    ClosedForm("lambda.lane", m * g, **lane),
    Conserved("energy and heat", output("energy.total") + output("energy.dissipated")),
]
