"""Bead on a track whose heights are a table, a wave of five periods: rate, bend and their change are the
spline's.

m x'' = -lambda h'(x), m z'' = lambda - m g, z = h(x) give
lambda = m (g + h''(x) x'^2) / (1 + h'(x)^2), with h' and h'' of the spline.
"""

import math

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    ClosedForm,
    Conserved,
    Holonomic,
    Model,
    Parameter,
    Scene,
    Spline,
    output,
)

x, z = dynamicsymbols("x z")
m, g = symbols("m g", positive=True)
PLACES = [j / 10 for j in range(101)]
height = Spline("height", PLACES, [0.1 * math.cos(math.pi * s) for s in PLACES], "m", "m")

model = Model(
    name="Track",
    lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * g * z,
    coordinates={x: "m", z: "m"},
    constraints=[Holonomic("track", z - height(x), "the bead is held on the track")],
    parameters=[
        Parameter(m, 0.3, "kg", "mass of the bead", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
    ],
    start={x: 0.0, z: 0.1, x.diff(): 2.0},
    description="Bead on a track with tabulated heights",
)

scenes = [Scene("Track", stop_time=2.0, step_size=0.01)]

steep, bent = height(x).diff(x), height(x).diff(x, 2)
closed_forms = [
    ClosedForm("lambda.track", m * (g + bent * x.diff() ** 2) / (1 + steep**2), scale=m * g),
    Conserved("energy", output("energy.total"), scale=m * g),
]
