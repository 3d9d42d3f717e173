"""Kapitza's pendulum: its pivot is shaken up and down by a prescribed motion (Landau & Lifshitz, sect. 30).

x, y [m] the bob, Y [m] the pivot, an input with its two derivatives. With f = x^2 + (y - Y)^2 - l^2 the
rod's pull is -2 l lambda. By f'' = 0: lambda = m [(y - Y) (g + Y'') - |r'|^2] / (2 l^2), r = (x, y - Y).
The pivot gives the power 2 lambda (y - Y) Y', which the bob takes.
"""

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Holonomic, Input, Model, Output, Parameter, Scene, multiplier, output

t = dynamicsymbols._t
x, y, Y = dynamicsymbols("x y Y")
m, g, l = symbols("m g l", positive=True)  # noqa: E741 - the literature's letter

d = y - Y
power = 2 * multiplier("rod") * d * Y.diff()

model = Model(
    name="Kapitza",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
    coordinates={x: "m", y: "m"},
    constraints=[Holonomic("rod", x**2 + d**2 - l**2, "the rod keeps its length")],
    parameters=[
        Parameter(m, 0.2, "kg", "mass of the bob", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 0.5, "m", "length of the rod", min=0),
    ],
    inputs=[Input(Y, "m", 0.0, "height of the pivot", rate=0.4)],
    start={x: 0.14, y: 0.48, x.diff(): 0.0, y.diff(): 0.4},
    outputs=[Output("pivot.power", power, "W", "power of the pivot's drive")],
    description="Pendulum upside down on a pivot that is shaken",
)

scenes = [Scene("Kapitza", stop_time=2.0, step_size=0.01)]

rate = x.diff() ** 2 + d.diff(t) ** 2
growth = m * (x.diff() * x.diff(t, 2) + y.diff() * y.diff(t, 2)) + m * g * y.diff()
closed_forms = [
    ClosedForm("lambda.rod", m * (d * (g + Y.diff(t, 2)) - rate) / (2 * l**2)),
    ClosedForm(
        "pivot's power",
        growth,
        actual=output("pivot.power"),
        scale=output("energy.kinetic") * 10 / l * y.diff() + m * g * y.diff(),
    ),
]
