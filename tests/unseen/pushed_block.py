"""Block on a rough floor that is pulled along and lifted by forces from outside.

x, z [m] the block; F [N] pulls along, P [N] lifts. lambda.floor = m (z'' + g) - P is never negative, and
lambda.hold = m x'' - F never more than mu lambda.floor: the block sticks, slides or flies by the forces of
the very instant.
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    ClosedForm,
    Contact,
    Friction,
    Input,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    multiplier,
    output,
)

t = dynamicsymbols._t
x, z, F, P = dynamicsymbols("x z F P")
m, g, l = symbols("m g l", positive=True)  # noqa: E741 - the literature's letter
mu = symbols("mu", nonnegative=True)

model = Model(
    name="PushedBlock",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * g * (z - l),
    coordinates={x: "m", z: "m"},
    forces={x: F, z: P},
    constraints=[
        Contact("floor", z - l, "the block stands on the floor"),
        Nonholonomic("hold", x.diff(), "it stays where it is"),
        Friction("grip", of=["hold"], normal=multiplier("floor"), static=mu),
    ],
    parameters=[
        Parameter(m, 1.0, "kg", "mass", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 0.1, "m", "height of the middle above the sole", min=0),
        Parameter(mu, 0.3, "1", "coefficient of friction", min=0),
    ],
    inputs=[Input(F, "N", 0.0, "pull along"), Input(P, "N", 0.0, "lift")],
    start={x: 0.0, z: 0.1},
    description="Block on a rough floor, pulled and lifted",
)

scenes = [Scene("PushedBlock", stop_time=1.0, step_size=0.01)]

closed_forms = [
    ClosedForm("lambda.floor", m * (z.diff(t, 2) + g) - P, scale=m * g),
    ClosedForm("lambda.hold", m * x.diff(t, 2) - F, actual=output("lambda.hold"), scale=m * g),
]
