"""Atwood's machine (Marion & Thornton, example 2.9): two masses, massless string and pulley.

x1, x2 [m] are the displacements of the two masses from the start, both downward.  lambda [N] is
the string's force on either mass, positive downward: the tension is -lambda.
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Arrow,
    ClosedForm,
    Conserved,
    Disk,
    Holonomic,
    Line,
    Model,
    Output,
    Parameter,
    Scene,
    initial,
    multiplier,
    output,
)

t = dynamicsymbols._t
x1, x2 = dynamicsymbols("x1 x2")
m1, m2, g = symbols("m1 m2 g", positive=True)

WHEEL, LENGTH = 0.3, 2.0  # m, of the drawn pulley and string

T = (m1 * x1.diff() ** 2 + m2 * x2.diff() ** 2) / 2
V = -(m1 * g * x1 + m2 * g * x2)

model = Model(
    name="Atwood",
    lagrangian=T - V,
    coordinates={x1: "m", x2: "m"},
    constraints=[Holonomic("string", x1 + x2, "the string keeps its length")],
    parameters=[
        Parameter(m1, 2.0, "kg", "first mass", min=0),
        Parameter(m2, 1.0, "kg", "second mass", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
    ],
    start={x1: 0.0, x2: 0.0},
    description="Atwood's machine: two masses on a string over a pulley",
    descriptions={
        x1: "first mass, down from the start",
        x2: "second mass, down from the start",
    },
    outputs=[Output("tension", -multiplier("string"), "N", "pull of the string on either mass")],
    picture=[
        Disk((0, 0), radius=WHEEL, angle=-x2 / WHEEL),
        Line((-WHEEL, 0), (-WHEEL, -LENGTH - x1)),
        Line((WHEEL, 0), (WHEEL, -LENGTH - x2)),
        Disk((-WHEEL, -LENGTH - x1)),
        Disk((WHEEL, -LENGTH - x2)),
        Arrow("string", at=(-WHEEL, -LENGTH - x1)),
        Arrow("string", at=(WHEEL, -LENGTH - x2)),
    ],
)

scenes = [Scene("Atwood", stop_time=1.0, step_size=0.01)]

# m1 x1'' = m1 g + lambda  and  m2 x2'' = m2 g + lambda  with  x1'' = -x2'':
acceleration = (m1 - m2) / (m1 + m2) * g
tension = 2 * m1 * m2 / (m1 + m2) * g
fall = initial(x1.diff()) * t + acceleration * t**2 / 2
free_fall = (m1 + m2) * (g * t) ** 2 / 2  # kinetic energy without the string

closed_forms = [
    ClosedForm("lambda.string", -tension),
    ClosedForm("tension", tension),
    ClosedForm("der(x1,2)", acceleration, scale=g),
    ClosedForm("x1", initial(x1) + fall),
    ClosedForm("x2", initial(x2) - fall),
    Conserved("energy", output("energy.total"), scale=output("energy.kinetic") + free_fall),
]
