"""Stewart's platform on six legs, one of which a prescribed motion drives (Stewart, 1965).

x, y, z [m] the middle of the plate, a, b, c [rad] its turns about x, then y, then z; legs go in pairs
from points on the ground (radius P) to points of the plate (radius p). f = |leg|^2 - l^2, so that a leg
pushes with 2 l lambda along itself. No degree of freedom is left: lambda follows from the prescribed
motion s, and the power of the driven leg is what the plate gains.
"""

from math import cos as cosine
from math import pi
from math import sin as sine

from sympy import Abs, Matrix, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Holonomic, Input, Model, Output, Parameter, Scene, multiplier, output

t = dynamicsymbols._t
x, y, z, a, b, c, s = dynamicsymbols("x y z a b c s")
m, A, C, g, P, p, l = symbols("m A C g P p l", positive=True)  # noqa: E741 - the literature's letter

Rx = Matrix([[1, 0, 0], [0, cos(a), -sin(a)], [0, sin(a), cos(a)]])
Ry = Matrix([[cos(b), 0, sin(b)], [0, 1, 0], [-sin(b), 0, cos(b)]])
Rz = Matrix([[cos(c), -sin(c), 0], [sin(c), cos(c), 0], [0, 0, 1]])
turn = Rx * Ry * Rz
w = Matrix(  # in the plate
    [
        a.diff() * cos(b) * cos(c) + b.diff() * sin(c),
        -a.diff() * cos(b) * sin(c) + b.diff() * cos(c),
        a.diff() * sin(b) + c.diff(),
    ]
)

GROUND = [k * 2 * pi / 3 + side * pi / 12 for k in range(3) for side in (-1, 1)]
PLATE = [k * 2 * pi / 3 + side * (pi / 3 - pi / 18) for k in range(3) for side in (-1, 1)]
HIGH = 0.8
reach = [
    (0.35 * cosine(v) - 0.7 * cosine(u)) ** 2 + (0.35 * sine(v) - 0.7 * sine(u)) ** 2
    for u, v in zip(GROUND, PLATE, strict=True)
]
LENGTH = (reach[0] + HIGH**2) ** 0.5

legs = []
for u, v in zip(GROUND, PLATE, strict=True):
    foot = P * Matrix([cosine(u), sine(u), 0])
    head = Matrix([x, y, z]) + turn * (p * Matrix([cosine(v), sine(v), 0]))
    legs.append((head - foot).dot(head - foot))

drive = 2 * s * multiplier("leg6") * s.diff()

model = Model(
    name="Stewart",
    lagrangian=m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2
    + (A * (w[0] ** 2 + w[1] ** 2) + C * w[2] ** 2) / 2
    - m * g * z,
    coordinates={x: "m", y: "m", z: "m", a: "rad", b: "rad", c: "rad"},
    constraints=[
        Holonomic(f"leg{k}", leg - (s if k == 6 else l) ** 2) for k, leg in enumerate(legs, 1)
    ],
    parameters=[
        Parameter(m, 12.0, "kg", "mass of the plate", min=0),
        Parameter(A, 0.4, "kg.m^2", "moment of inertia across", min=0),
        Parameter(C, 0.8, "kg.m^2", "moment of inertia about the plate's axis", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(P, 0.7, "m", "radius of the points on the ground", min=0),
        Parameter(p, 0.35, "m", "radius of the points of the plate", min=0),
        Parameter(l, LENGTH, "m", "length of the fixed legs", min=0),
    ],
    inputs=[Input(s, "m", LENGTH, "length of the driven leg", rate=0.05)],
    start={x: 0.0, y: 0.0, z: HIGH, a: 0.0, b: 0.0, c: 0.0},
    outputs=[Output("drive.power", drive, "W", "power of the driven leg")],
    description="Stewart's platform, one leg of which is driven",
)

scenes = [Scene("Stewart", stop_time=1.0, step_size=0.01)]

# where legs meet, far larger than their sum
pushes = sum(Abs(output(f"Q.leg{k}.z")) for k in range(1, 7))
closed_forms = [
    ClosedForm("weight", m * (z.diff(t, 2) + g), actual=output("Q.z"), scale=m * g + pushes),
]
