"""Trammel of Archimedes: the ends of a bar slide along two lines; its middle runs on a circle.

x, y [m] the middle of a bar of length l, theta [rad] its angle; the lower end slides along the horizontal
line, the upper one along the vertical. That the middle stays on the circle of radius l/2 follows, and is
said too. One degree of freedom: (m l^2/3) theta'' = -m g (l/2) cos theta. The pushes of the lines, which
`circle` shares by its least norm, add up to the unique Q.x = m x'', Q.y = m (y'' + g).
"""

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Conserved, Holonomic, Model, Parameter, Scene, output

t = dynamicsymbols._t
x, y, theta = dynamicsymbols("x y theta")
m, g, l = symbols("m g l", positive=True)  # noqa: E741 - the literature's letter

model = Model(
    name="Trammel",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2
    + m * l**2 * theta.diff() ** 2 / 24
    - m * g * y,
    coordinates={x: "m", y: "m", theta: "rad"},
    constraints=[
        Holonomic("floor", y - l / 2 * sin(theta), "the lower end on the horizontal line"),
        Holonomic("wall", x - l / 2 * cos(theta), "the upper end on the vertical line"),
        Holonomic("circle", x**2 + y**2 - l**2 / 4, "the middle on its circle"),
    ],
    parameters=[
        Parameter(m, 2.0, "kg", "mass of the bar", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 1.5, "m", "length of the bar", min=0),
    ],
    start={x: 0.45, y: 0.6, theta: 0.9272952180016122},
    description="Bar whose ends slide along two perpendicular lines, said once too often",
)

scenes = [Scene("Trammel", stop_time=3.0, step_size=0.01)]

fall = -3 * g / (2 * l) * cos(theta)  # theta''
bend = l / 2 * theta.diff() ** 2
closed_forms = [
    ClosedForm("der(theta,2)", fall, scale=g / l + theta.diff() ** 2),
    ClosedForm("Q.x", -m * (l / 2 * sin(theta) * fall + bend * cos(theta)), scale=m * (g + bend)),
    ClosedForm("Q.y", m * (g + l / 2 * cos(theta) * fall - bend * sin(theta)), scale=m * (g + bend)),
    Conserved("energy", output("energy.total"), scale=m * g * l),
]  # fmt: skip
