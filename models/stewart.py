"""A Stewart platform whose six legs are driven so that its plate follows a prescribed motion.

A leg is a cylinder on a universal joint and a rod that slides in it and ends in a ball joint under the plate:
13 bodies with 78 speeds, which 72 rows of joints and six drives determine.  The drives prescribe the lengths
|p + R b - a| that put the plate's centre at p(t), rolled by R(t).  Held here: that the plate is there, and
that the six balls give it the force and the moment that it needs.  tests/test_rigid_bodies.py holds the
wrench in every joint against inverse dynamics by hand.
"""

from sympy import Matrix, cos, pi, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Parameter, Scene, output
from lagfmu.bodies import Body, Gravity, Ground, Motor, Prismatic, Spherical, Universal, mechanism

t = dynamicsymbols._t
low, high, h, sway, w = symbols("low high height sway rate", real=True)
roll = sin(w * t) / 5
position = Matrix([sway * sin(w * t), sway * sin(2 * w * t), h + sway * sin(3 * w * t)])
turn = Matrix([[1, 0, 0], [0, cos(roll), -sin(roll)], [0, sin(roll), cos(roll)]])
# by which two feet stand off each of three directions, and two heads off those between
NEAR = pi / 12


def around(radius, off):
    """Six points on a circle, in pairs [m]."""
    angles = [2 * pi * k / 3 + side * off for k in range(3) for side in (-1, 1)]
    return [(radius * cos(a), radius * sin(a), 0) for a in angles]


ground = Ground()
plate = Body("plate", mass=50.0, inertia=(2.5, 2.0, 4.0, 0.1, -0.2, 0.15))
bodies, joints, drives = [plate], [], []
feet, heads = around(low, NEAR), around(high, pi / 3 - NEAR)
for k, (foot, head) in enumerate(zip(feet, heads, strict=True), 1):
    cylinder = Body(f"cylinder{k}", mass=4.0, inertia=(0.1, 0.1, 0.004), center=(0, 0, 0.25))
    rod = Body(f"rod{k}", mass=2.0, inertia=(0.06, 0.06, 0.001), center=(0, 0, -0.3))
    hinge, end = cylinder.at((0, 0, 0)), rod.at((0, 0, 0))
    d = position + turn * Matrix(head) - Matrix(foot)
    bodies += [cylinder, rod]
    joints += [
        Universal(f"foot{k}", ground.at(foot), hinge),
        Prismatic(f"leg{k}", hinge, end, axis="z"),
        Spherical(f"head{k}", plate.at(head), end),
    ]
    drives.append(Motor(f"drive{k}", f"leg{k}", motion=sqrt(d.dot(d))))
model = mechanism(
    "Stewart",
    bodies=bodies,
    joints=joints,
    loads=[Gravity((0, 0, -9.81)), *drives],
    parameters=[
        Parameter(low, 0.8, "m", "radius of the circle of the feet"),
        Parameter(high, 0.4, "m", "radius of the circle of the heads"),
        Parameter(h, 1.0, "m", "height of the plate"),
        Parameter(sway, 0.08, "m", "amplitude of the plate's centre"),
        Parameter(w, 3.0, "rad/s", "rate of the plate's motion"),
    ],
    start={"plate.position": (0, 0, 1), "plate.orientation": (1, 0, 0, 0)},
    description="Stewart platform on six driven legs, which carry it along a prescribed motion",
)

scenes = [Scene("Stewart", stop_time=2.0, step_size=0.05)]

# What the plate needs, in its own axes, comes from the balls: the rods receive the opposite.
m, g = symbols("plate.mass gravity.z", real=True)
xx, yy, zz, xy, xz, yz = symbols(
    [f"plate.inertia.{x}" for x in ("xx", "yy", "zz", "xy", "xz", "yz")]
)
J, omega = Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), Matrix([roll.diff(t), 0, 0])
force = m * turn.T * (position.diff(t, 2) - Matrix([0, 0, g]))
moment = J * omega.diff(t) + omega.cross(J * omega)
pulls = [Matrix([output(f"force.head{k}.{x}") for x in "xyz"]) for k in range(1, 7)]
received = -sum(pulls, Matrix([0, 0, 0]))
turning = -sum((Matrix(r).cross(f) for r, f in zip(heads, pulls, strict=True)), Matrix([0, 0, 0]))

closed_forms = [
    *(ClosedForm(f"plate.position.{x}", p, scale=h) for x, p in zip("xyz", position, strict=True)),
    ClosedForm("plate.orientation.x", sin(roll / 2), scale=1),
    *(
        ClosedForm(f"force on the plate, {x}", f, actual=actual, scale=-m * g)
        for x, f, actual in zip("xyz", force, received, strict=True)
    ),
    *(
        ClosedForm(f"moment on the plate, {x}", n, actual=actual, scale=-m * g * high)
        for x, n, actual in zip("xyz", moment, turning, strict=True)
    ),
]
