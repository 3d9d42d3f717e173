"""Four-bar of three rigid bodies whose last joint is held by two pins, side by side on one bolt.

Each body has its centre and its angle; a pin says that two points are one. The rocker's bearing is
doubled: its two pins say the same, so that each carries half, and the sum is unique. The crank is driven
by a torque. Conserved: the energy but for the torque's work.
"""

from math import atan2

from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Conserved, Holonomic, Input, Model, Parameter, Scene, output

x1, y1, a1, x2, y2, a2, x3, y3, a3, tau = dynamicsymbols("x1 y1 a1 x2 y2 a2 x3 y3 a3 tau")
rho, g = symbols("rho g", positive=True)
lengths = l1, l2, l3, d = symbols("l1 l2 l3 d", positive=True)

bodies = [(x1, y1, a1, l1), (x2, y2, a2, l2), (x3, y3, a3, l3)]
T = sum(
    rho * n * (x.diff() ** 2 + y.diff() ** 2) / 2 + rho * n**3 * a.diff() ** 2 / 24
    for x, y, a, n in bodies
)
V = g * sum(rho * n * y for _, y, _, n in bodies)


def end(body, side):
    """The body's end: -1 where it begins, 1 where it ends."""
    x, y, a, n = body
    return (x + side * n / 2 * cos(a), y + side * n / 2 * sin(a))


def pin(name, p, q):
    """Two points are one: two rows."""
    return [Holonomic(name + axis, u - w) for axis, u, w in zip("xy", p, q, strict=True)]


# 0.3, 0.9, 0.6 and 0.75 m: the crank at (0.18, 0.24), the coupler's end where the circles meet.
A, D = (0.18, 0.24), (0.75, 0.0)
gap = ((D[0] - A[0]) ** 2 + (D[1] - A[1]) ** 2) ** 0.5
along = (0.81 - 0.36 + gap**2) / (2 * gap)
up = (0.81 - along**2) ** 0.5
ux, uy = (D[0] - A[0]) / gap, (D[1] - A[1]) / gap
B = (A[0] + along * ux - up * uy, A[1] + along * uy + up * ux)
places = [((0.0, 0.0), A), (A, B), (B, D)]
start = {}
for (x, y, a, _), (p, q) in zip(bodies, places, strict=True):
    start |= {x: (p[0] + q[0]) / 2, y: (p[1] + q[1]) / 2, a: atan2(q[1] - p[1], q[0] - p[0])}

model = Model(
    name="DoubledPins",
    lagrangian=T - V,
    forces={a1: tau},
    coordinates={q: unit for x, y, a, _ in bodies for q, unit in ((x, "m"), (y, "m"), (a, "rad"))},
    constraints=[
        *pin("ground", end(bodies[0], -1), (0, 0)),
        *pin("crank", end(bodies[0], 1), end(bodies[1], -1)),
        *pin("coupler", end(bodies[1], 1), end(bodies[2], -1)),
        *pin("left", end(bodies[2], 1), (d, 0)),
        *pin("right", end(bodies[2], 1), (d, 0)),
    ],
    parameters=[
        Parameter(rho, 2.0, "kg/m", "mass of the bars by their length", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        *(Parameter(s, n, "m", min=0) for s, n in zip(lengths, (0.3, 0.9, 0.6, 0.75), strict=True)),
    ],
    inputs=[Input(tau, "N.m", 6.0, "torque on the crank")],
    start=start,
    description="Four-bar whose last bearing has two pins that say the same",
)

scenes = [Scene("DoubledPins", stop_time=2.0, step_size=0.01)]

closed_forms = [
    Conserved(
        "energy but for the torque's work",
        output("energy.total") - tau * a1,
        scale=output("energy.kinetic") + tau * a1,
    ),
]
