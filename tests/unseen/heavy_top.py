"""Heavy symmetric top in Euler parameters, on a fixed tip (Goldstein, Classical Mechanics, sect. 5.7).

p0..p3 are Euler parameters, their length held at 1.  The mass matrix is singular along p.  Without friction
the angular momenta about the vertical and about the axis of figure, and the energy, are conserved; the
constraint does no work and its force Q = 2 lambda p points along p.
"""

from sympy import Matrix, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Conserved, Holonomic, Model, Output, Parameter, Scene, output

p0, p1, p2, p3 = p = dynamicsymbols("p0:4")
A, C, m, g, l = symbols("A C m g l", positive=True)  # noqa: E741 - the literature's letter

rates = Matrix([x.diff() for x in p])
body = 2 * Matrix([[-p1, p0, p3, -p2], [-p2, -p3, p0, p1], [-p3, p2, -p1, p0]]) * rates  # rad/s
up = (2 * (p1 * p3 - p0 * p2), 2 * (p2 * p3 + p0 * p1), p0**2 - p1**2 - p2**2 + p3**2)

LEAN, SPIN = (0.96, 0.28), 50.0  # cos, sin of half the lean from the vertical; rad/s

model = Model(
    name="HeavyTop",
    lagrangian=(A * (body[0] ** 2 + body[1] ** 2) + C * body[2] ** 2) / 2 - m * g * l * up[2],
    coordinates=dict.fromkeys(p, "1"),
    constraints=[Holonomic("unit", p0**2 + p1**2 + p2**2 + p3**2 - 1, "Euler parameters")],
    parameters=[
        Parameter(A, 0.012, "kg.m^2", "moment of inertia across, about the tip", min=0),
        Parameter(C, 0.005, "kg.m^2", "moment of inertia about the axis of figure", min=0),
        Parameter(m, 0.6, "kg", "mass", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(l, 0.11, "m", "from the tip to the centre of mass", min=0),
    ],
    start={
        p0: LEAN[0], p1: LEAN[1], p2: 0.0, p3: 0.0,
        p2.diff(): -LEAN[1] * SPIN / 2, p3.diff(): LEAN[0] * SPIN / 2,
        p0.diff(): 0.0, p1.diff(): 0.0,
    },
    outputs=[Output("rise", up[2], "1", "cosine of the lean from the vertical")],
    description="Heavy symmetric top in Euler parameters",
)  # fmt: skip

scenes = [Scene("HeavyTop", stop_time=1.0, step_size=0.01)]

about_figure = C * body[2]
about_vertical = A * (body[0] * up[0] + body[1] * up[1]) + C * body[2] * up[2]
closed_forms = [
    Conserved("energy", output("energy.total")),
    Conserved("angular momentum about the axis of figure", about_figure),
    Conserved("angular momentum about the vertical", about_vertical),
]
