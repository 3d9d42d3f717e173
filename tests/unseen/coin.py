"""Coin that rolls on a table: three rows of no slip, the third of which the table already says.

x, y, z [m] the centre; heading, lean, spin [rad]: the axis of the coin is turned by the heading about the
vertical and leans from the horizontal by `lean` (0: upright). The velocity of the point that touches
vanishes, three rows; that its height stays 0 is the first constraint besides. The table carries the coin:
Q.z = m (z'' + g). The energy is conserved (Routh; Bloch, Nonholonomic Mechanics and Control, sect. 1.4).
"""

from sympy import Matrix, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Conserved, Holonomic, Model, Nonholonomic, Parameter, Scene, output

t = dynamicsymbols._t
x, y, z, heading, lean, spin = dynamicsymbols("x y z heading lean spin")
m, g, R = symbols("m g R", positive=True)

# e: along the way; n: the coin's axis; down: from the centre to the table, in the plane of the coin.
e = Matrix([cos(heading), sin(heading), 0])
n = Matrix([-sin(heading) * cos(lean), cos(heading) * cos(lean), sin(lean)])
down = -e.cross(n)  # unit vector: n, e and this one are perpendicular
down = down if down[2].subs({lean: 0, heading: 0}) < 0 else -down
turn = Matrix([0, 0, heading.diff()]) + lean.diff() * e + spin.diff() * n
slip = Matrix([x.diff(), y.diff(), z.diff()]) + turn.cross(R * down)

across, along, axial = turn.dot(e), turn.dot(down), turn.dot(n)
T = m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2
T += m * R**2 / 4 * (across**2 + along**2) / 2 + m * R**2 / 2 * axial**2 / 2

model = Model(
    name="Coin",
    lagrangian=T - m * g * z,
    coordinates={x: "m", y: "m", z: "m", heading: "rad", lean: "rad", spin: "rad"},
    constraints=[
        Holonomic("table", z - R * cos(lean), "the rim touches the table"),
        Nonholonomic("slipx", slip[0], "the point that touches is at rest"),
        Nonholonomic("slipy", slip[1], "the point that touches is at rest"),
        Nonholonomic("slipz", slip[2], "the point that touches is at rest"),
    ],
    parameters=[
        Parameter(m, 0.008, "kg", "mass", min=0),
        Parameter(g, 9.81, "m/s^2", "acceleration of gravity", min=0),
        Parameter(R, 0.013, "m", "radius", min=0),
    ],
    start={z: 0.013 * 0.96, lean: 0.2837941092083279, heading: 0.0, spin: 0.0, x: 0.0, y: 0.0,
           spin.diff(): 40.0, heading.diff(): -12.0},
    description="Coin that rolls on a table without slipping",
)  # fmt: skip

scenes = [Scene("Coin", stop_time=0.5, step_size=0.005)]

closed_forms = [
    Conserved("energy", output("energy.total")),
    ClosedForm("Q.z", m * (z.diff(t, 2) + g), scale=m * g),
]
