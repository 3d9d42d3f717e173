"""A double wishbone suspension on a bump: a quarter of a car, and the force in each joint of its wheel.

Two arms on oblique hinges carry the upright by balls, a tie rod steers it, spring and damper stand on the
lower arm; the body of the car slides up and down.  The wheel stands on a post that follows a road of points,
which the car drives over, and may leave it.  All points are those of the car at rest: x ahead, y to the left,
z up.  tests/test_rigid_bodies.py holds the run against Newton's and Euler's equations by hand.
(Gillespie, Fundamentals of Vehicle Dynamics, ch. 7.)
"""

from math import dist

from sympy import Matrix, asin, atan2, eye, symbols, zeros
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Box, ClosedForm, Output, Parameter, Rod, Scene, Spline, output
from lagfmu.bodies import (
    Body,
    Contact,
    Distance,
    Gravity,
    Ground,
    Motor,
    Prismatic,
    Revolute,
    Spherical,
    SpringDamper,
    mechanism,
)

t = dynamicsymbols._t
speed, radius = symbols("speed radius", real=True)
WAY = [0, 2, 3, 4, 5, 5.5, 6, 6.5, 7, 8, 9, 10, 20, 30]
HEIGHT = [0, 0, 0, 0, 0, 0.04, 0.08, 0.04, 0, 0, 0, 0, 0, 0]
road = Spline("road", WAY, HEIGHT, "m", "m")

# centres of the wheel and of the upright's mass
WHEEL, MASS = (0.01, 0.76, 0.31), (0.004, 0.73, 0.32)
LOW, HIGH = (0.01, 0.70, 0.20), (0.03, 0.66, 0.55)  # the balls of the upright
ARM, RACK = (-0.13, 0.68, 0.26), (-0.12, 0.36, 0.27)  # the ends of the tie rod
lower_hinge = {"point": (0.0, 0.35, 0.22), "axis": (1.0, 0.05, 0.02)}
upper_hinge = {"point": (0.02, 0.42, 0.52), "axis": (1.0, -0.04, 0.03)}
STRUT = (0.02, 0.45, 0.70), (0.01, 0.58, 0.22)

# How the bodies look.
RAILS = [
    Rod((-0.35, 0.33, 0.22), (0.35, 0.37, 0.22), 0.025),
    Rod((-0.25, 0.43, 0.51), (0.25, 0.41, 0.53), 0.02),
    Rod((0.02, 0.35, 0.22), STRUT[0], 0.02),
]
LOWER = [Rod((x, 0.35, 0.22), LOW, 0.014) for x in (-0.15, 0.15)]
UPPER = [Rod((x, 0.42, 0.52), HIGH, 0.011) for x in (-0.1, 0.14)]
TYRE = Rod((0.01, 0.7, 0.31), (0.01, 0.84, 0.31), 0.31)
CARRIER = [Rod(LOW, HIGH, 0.02), Rod(ARM, LOW, 0.014)]

ground = Ground()
car = Body("car", 320.0, (60, 60, 90), center=(0, 0.2, 0.5), shape=RAILS)
lower = Body(
    "lower", 4.0, (0.05, 0.03, 0.07, 0.002, 0, -0.004), center=(0.01, 0.52, 0.21), shape=LOWER
)
upper = Body("upper", 2.0, (0.02, 0.012, 0.027), center=(0.02, 0.53, 0.53), shape=UPPER)
upright = Body(
    "upright", 28.0, (0.6, 0.9, 0.6, 0.01, 0.02, -0.03), center=MASS, shape=[TYRE, *CARRIER]
)
post = Body("post", 10.0, (0.2, 0.2, 0.2), shape=Box((0, 0.76, -0.02), (0.5, 0.3, 0.04)))

e0, e1, e2, e3 = (dynamicsymbols(f"upright.orientation.{x}") for x in "wxyz")
axle = Matrix([2 * (e1 * e2 - e0 * e3), 1 - 2 * (e1**2 + e3**2), 2 * (e2 * e3 + e0 * e1)])

model = mechanism(
    "DoubleWishbone",
    bodies=[car, lower, upper, upright, post],
    joints=[
        Prismatic("ride", ground.at((0, 0, 0)), car.at((0, 0, 0))),
        Prismatic("lift", ground.at((0, 0, 0)), post.at((0, 0, 0))),
        Revolute("A", car.at(**lower_hinge), lower.at(**lower_hinge)),
        Revolute("B", car.at(**upper_hinge), upper.at(**upper_hinge)),
        Spherical("C", upright.at(LOW), lower.at(LOW)),
        Spherical("D", upright.at(HIGH), upper.at(HIGH)),
        Distance("tie", upright.at(ARM), car.at(RACK), dist(ARM, RACK)),
    ],
    loads=[
        Gravity((0, 0, -9.81)),
        SpringDamper("strut", car.at(STRUT[0]), lower.at(STRUT[1]), 42e3, 0.62, damping=2.5e3),
        Motor("drive", "lift", motion=road(speed * t)),
    ],
    contacts=[Contact("patch", post.at((0, 0.76, 0)), upright.at(WHEEL), radius)],
    parameters=[
        Parameter(speed, 18.0, "m/s", "of the car"),
        Parameter(radius, 0.31, "m", "of the wheel"),
    ],
    outputs=[
        Output(
            "camber", -asin(axle[2]), "rad", "of the wheel, negative where its top leans inward"
        ),
        Output(
            "toe", atan2(axle[0], axle[1]), "rad", "of the wheel, positive where it points inward"
        ),
    ],
    description="Double wishbone suspension of a quarter of a car that drives over a bump",
)
scenes = [Scene("DoubleWishbone", stop_time=1.0, step_size=0.01)]

masses = {body.name: symbols(f"{body.name}.mass") for body in (car, lower, upper, upright)}
g, load = symbols("gravity.z"), output("force.patch.z")
weight = -g * sum(masses.values())
needed = sum(m * (output(f"der({name}.position.z,2)") - g) for name, m in masses.items())


# Of the upright, in its own axes: what balls and tie rod receive from it, and the wheel's load, which is
# vertical, move and turn it.
def vector(name, rate="{}"):
    """The components of an output, or of a parameter, of the FMU."""
    return Matrix([output(rate.format(f"{name}.{x}")) for x in "xyz"])


xx, yy, zz, xy, xz, yz = (
    output(f"upright.inertia.{x}") for x in ["xx", "yy", "zz", "xy", "xz", "yz"]
)
J = Matrix([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
m, w, center = masses["upright"], vector("upright.omega"), vector("upright.center")
turn = Matrix([[0, -e3, e2], [e3, 0, -e1], [-e2, e1, 0]])
turn = eye(3) + 2 * e0 * turn + 2 * turn**2
up = turn[2, :].T
hub = vector("patch.second") - center
received = [
    (vector(f"{name}.first") - center, -vector(f"force.{name}")) for name in ("C", "D", "tie")
]
received.append((hub, load * up))
needed_force = m * turn.T * (vector("upright.position", "der({},2)") - Matrix([0, 0, g]))
needed_moment = J * vector("upright.omega", "der({})") + w.cross(J * w)

closed_forms = [
    ClosedForm("position.lift", road(speed * t), scale=radius),
    ClosedForm(
        "wheel on the road",
        road(speed * t) + radius,
        actual=output("upright.position.z") + up.dot(hub),
        while_closed="patch.z",
    ),
    ClosedForm("wheel's load", needed, actual=load, scale=weight),
    *(
        ClosedForm(f"force on the upright, {x}", f, actual=actual, scale=weight)
        for x, f, actual in zip(
            "xyz", needed_force, sum((f for _, f in received), zeros(3, 1)), strict=True
        )
    ),
    *(
        ClosedForm(f"moment on the upright, {x}", n, actual=actual, scale=weight * radius)
        for x, n, actual in zip(
            "xyz", needed_moment, sum((r.cross(f) for r, f in received), zeros(3, 1)), strict=True
        )
    ),
]
