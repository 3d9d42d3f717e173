"""The slider-crank of slider_crank_bodies.py in space: an example of redundancy.

Three parallel hinges and a slide hold each other out of the plane: of 20 rows on 18 speeds 17 are
independent.  force.A.x and .y, those of B and C, force.D.y and torque.D.z have one value, that of the
mechanism in the plane; nothing else has.  With C spherical one redundant row is left.
"""

from dataclasses import replace
from math import pi

from slider_crank_bodies import closed_forms as in_the_plane
from sympy import Symbol
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Scene, output
from lagfmu.bodies import Body, Gravity, Ground, Prismatic, Revolute, mechanism

ground = Ground()
crank = Body("crank", mass=2.0, inertia=(0.001, 0.01, 0.01))
rod = Body("rod", mass=1.0, inertia=(0.001, 0.02, 0.02))
piston = Body("piston", mass=0.5, inertia=(0.001, 0.001, 0.001))
model = mechanism(
    "SliderCrankSpace",
    bodies=[crank, rod, piston],
    joints=[
        Revolute("A", ground.at((0, 0, 0)), crank.at((-0.1, 0, 0))),
        Revolute("B", crank.at((0.1, 0, 0)), rod.at((-0.25, 0, 0))),
        Revolute("C", rod.at((0.25, 0, 0)), piston.at((0, 0, 0))),
        Prismatic("D", ground.at((0, 0, 0)), piston.at((0, 0, 0)), axis="x"),
    ],
    loads=[Gravity((0, -9.81, 0))],
    start={"angle.A": pi / 4, "der(angle.A)": 10.0},
    description="Slider-crank in space, with three redundant rows",
)

scenes = [Scene("SliderCrankSpace", stop_time=2.0, step_size=0.01)]

# What stands for the angles in the plane, and for the moments of inertia about z.
phi, rod_angle = dynamicsymbols("crank.orientation.z rod.orientation.z")
in_space = {phi: dynamicsymbols("angle.A"), rod_angle: output("angle.A") + output("angle.B")}
in_space |= {Symbol(f"{b}.inertia", real=True): output(f"{b}.inertia.zz") for b in ("crank", "rod")}


def moved(form):
    """A closed form of the mechanism in the plane, in the names that it has in space."""
    told = vars(form)
    terms = {k: told[k].subs(in_space) for k in told if hasattr(told[k], "subs")}
    return replace(form, **terms)


closed_forms = [moved(form) for form in in_the_plane]
