"""Cam and follower: an input whose rates are estimated turns a tabulated profile, which lifts a follower.

z [m] the follower above the cam's axis, x [m] its way into its guide, phi [rad] the cam's angle: a prescribed
motion of which the importer gives the angle alone. A spring holds the follower down, z - lift(phi) >= 0; a
side force S presses it against the guide, which rubs: m z'' = -m g - k (z - z0) + lambda.cam + lambda.rub,
|lambda.rub| <= mu S. Where the cam turns it round friction cannot hold what the cam drives: it slips on.
"""

import math

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    ClosedForm,
    Contact,
    Friction,
    Input,
    Model,
    Nonholonomic,
    Output,
    Parameter,
    Scene,
    Spline,
    multiplier,
)

z, x, phi = dynamicsymbols("z x phi")
m, g, k, z0, S = symbols("m g k z0 S", positive=True)
mu = symbols("mu", nonnegative=True)
ANGLES = [j / 10 - 1 for j in range(600)]
lift = Spline("lift", ANGLES, [0.03 + 0.01 * math.sin(a) ** 2 for a in ANGLES], "rad", "m")

model = Model(
    name="Cam",
    lagrangian=m * (z.diff() ** 2 + x.diff() ** 2) / 2 - m * g * z - k * (z - z0) ** 2 / 2,
    coordinates={z: "m", x: "m"},
    forces={x: -S},
    constraints=[
        Contact("cam", z - lift(phi), "the follower stays on the cam"),
        Contact("guide", x, "the follower lies against its guide"),
        Nonholonomic("rub", z.diff()),
        Friction("grip", of=["rub"], normal=multiplier("guide"), static=mu),
    ],
    parameters=[
        Parameter(m, 0.2, "kg", "mass of the follower", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(k, 800.0, "N/m", "stiffness of the spring", min=0),
        Parameter(z0, 0.02, "m", "height at which the spring is slack"),
        Parameter(S, 3.0, "N", "side force", min=0),
        Parameter(mu, 0.2, "1", "coefficient of friction", min=0),
    ],
    inputs=[Input(phi, "rad", rates="estimated")],
    outputs=[Output("spring.force", k * (z - z0), "N", "push of the spring")],
    description="Follower on a cam with a tabulated profile",
)

scenes = [Scene("Cam", stop_time=2.0, step_size=0.01)]

closed_forms = [ClosedForm("lambda.guide", S, while_closed="guide")]
