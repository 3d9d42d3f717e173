"""Puck on a table, pulled both ways by forces from outside, under a clamp that a signal switches.

x, y, z [m] the puck; F, W [N] pull along x and y; c > 0 puts the clamp on, which presses with C [N]: a force
that jumps with an input. The table pushes with lambda.table = m (z'' + g) + C or without C, and friction is
at most mu times that, in every direction of the plane.
"""

from sympy import Heaviside, symbols
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
x, y, z, F, W, c = dynamicsymbols("x y z F W c")
m, g, h = symbols("m g h", positive=True)
C, mu = symbols("C mu", nonnegative=True)

press = C * Heaviside(c)

model = Model(
    name="ClampedPuck",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2 - m * g * z,
    coordinates={x: "m", y: "m", z: "m"},
    forces={x: F, y: W, z: -press},
    constraints=[
        Contact("table", z - h, "the puck lies on the table"),
        Nonholonomic("holdx", x.diff(), "it stays where it is"),
        Nonholonomic("holdy", y.diff(), "it stays where it is"),
        Friction("grip", of=["holdx", "holdy"], normal=multiplier("table"), static=mu),
    ],
    parameters=[
        Parameter(m, 0.5, "kg", "mass", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(h, 0.02, "m", "height of the middle above the table", min=0),
        Parameter(C, 10.0, "N", "force of the clamp", min=0),
        Parameter(mu, 0.4, "1", "coefficient of friction", min=0),
    ],
    inputs=[
        Input(F, "N", 0.0, "pull along x"),
        Input(W, "N", 0.0, "pull along y"),
        Input(c, "1", -1.0, "the clamp is on where this is positive"),
    ],
    start={x: 0.0, y: 0.0, z: 0.02, x.diff(): 0.5},
    description="Puck on a table under a clamp that is switched",
)

scenes = [Scene("ClampedPuck", stop_time=1.0, step_size=0.01)]

closed_forms = [
    ClosedForm("lambda.table", m * (z.diff(t, 2) + g) + press, scale=m * g),
    ClosedForm("lambda.holdx", m * x.diff(t, 2) - F, actual=output("lambda.holdx"), scale=m * g),
    ClosedForm("lambda.holdy", m * y.diff(t, 2) - W, actual=output("lambda.holdy"), scale=m * g),
]
