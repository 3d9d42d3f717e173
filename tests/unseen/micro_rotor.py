"""Free asymmetric rotor of a micromachine in Euler parameters (Dzhanibekov's turning over; Euler).

Inertias of 1e-17 kg m^2, a thousand turns a second about the middle axis, which is unstable: it turns
over and back. Energy and the three components of the angular momentum in space are conserved; lambda is
0, since the kinetic energy does not feel the length of p at constant |p|'s rate (its own 0 beside J w^2).
"""

from sympy import Matrix, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Conserved, Holonomic, Model, Parameter, Scene, output

p0, p1, p2, p3 = p = dynamicsymbols("p0:4")
A, B, C = symbols("A B C", positive=True)

rates = Matrix([x.diff() for x in p])
w = 2 * Matrix([[-p1, p0, p3, -p2], [-p2, -p3, p0, p1], [-p3, p2, -p1, p0]]) * rates  # in the body
turn = Matrix(
    [
        [p0**2 + p1**2 - p2**2 - p3**2, 2 * (p1 * p2 - p0 * p3), 2 * (p1 * p3 + p0 * p2)],
        [2 * (p1 * p2 + p0 * p3), p0**2 - p1**2 + p2**2 - p3**2, 2 * (p2 * p3 - p0 * p1)],
        [2 * (p1 * p3 - p0 * p2), 2 * (p2 * p3 + p0 * p1), p0**2 - p1**2 - p2**2 + p3**2],
    ]
)
momentum = turn * Matrix([A * w[0], B * w[1], C * w[2]])

SPIN = 6000.0  # rad/s
WOBBLE = 60.0  # rad/s

model = Model(
    name="MicroRotor",
    lagrangian=(A * w[0] ** 2 + B * w[1] ** 2 + C * w[2] ** 2) / 2,
    coordinates=dict.fromkeys(p, "1"),
    constraints=[Holonomic("unit", p0**2 + p1**2 + p2**2 + p3**2 - 1, "Euler parameters")],
    parameters=[
        Parameter(A, 1e-17, "kg.m^2", "least moment of inertia", min=0),
        Parameter(B, 2e-17, "kg.m^2", "middle moment of inertia", min=0),
        Parameter(C, 3e-17, "kg.m^2", "largest moment of inertia", min=0),
    ],
    start={
        p0: 1.0, p1: 0.0, p2: 0.0, p3: 0.0,
        p0.diff(): 0.0, p1.diff(): WOBBLE / 2, p2.diff(): SPIN / 2, p3.diff(): 0.0,
    },
    description="Micromachined rotor that turns over about its middle axis",
)  # fmt: skip

scenes = [Scene("MicroRotor", stop_time=5e-3, step_size=5e-5)]

closed_forms = [
    Conserved("energy", output("energy.kinetic")),
    *(
        Conserved(f"angular momentum along {axis}", momentum[k], scale=B * SPIN)
        for k, axis in enumerate("xyz")
    ),
]
