"""Slider in a straight guide that rubs on both sides, driven along and pressed across by forces from outside.

x, z [m] the slider, the guide z = 0; F [N] drives, P [N] presses down. The guide pushes with
lambda.guide = m g + P, of either sign; friction is mu |lambda.guide| against the motion, whichever side
bears.
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    ClosedForm,
    Friction,
    Holonomic,
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
m, g = symbols("m g", positive=True)
mu = symbols("mu", nonnegative=True)

model = Model(
    name="GuidedSlider",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * g * z,
    coordinates={x: "m", z: "m"},
    forces={x: F, z: -P},
    constraints=[
        Holonomic("guide", z, "the guide is straight"),
        Nonholonomic("hold", x.diff(), "it stays where it is"),
        Friction("grip", of=["hold"], normal=multiplier("guide"), static=mu),
    ],
    parameters=[
        Parameter(m, 0.5, "kg", "mass", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(mu, 0.2, "1", "coefficient of friction", min=0),
    ],
    inputs=[Input(F, "N", 0.0, "drives along"), Input(P, "N", 0.0, "presses down")],
    start={x: 0.0, z: 0.0, x.diff(): 1.0},
    description="Slider in a guide that rubs on both sides",
)

scenes = [Scene("GuidedSlider", stop_time=1.0, step_size=0.01)]

closed_forms = [
    ClosedForm("lambda.guide", m * g + P, scale=m * g),
    ClosedForm("lambda.hold", m * x.diff(t, 2) - F, actual=output("lambda.hold"), scale=m * g),
]
