"""A cat from a URDF file that turns over in the air: its spine bends in a circle, nothing else turns it.

The picture falls with it.  Its start is the least motion at which the spine moves as it is told to: without
momentum and without angular momentum, which stay 0 though it turns by half a turn.

Held here: momentum stays, and the spine's force is what the hind part's mass needs.
"""

from pathlib import Path

from sympy import Symbol, cos, pi, sin, sqrt
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Parameter, Scene, output
from lagfmu.bodies import Motor, from_urdf, mechanism

cat = from_urdf(Path(__file__).with_name("cat.urdf"), limits=False, base="floating")
t, w, b = dynamicsymbols._t, Symbol("rate", real=True), Symbol("bent", real=True)
model = mechanism(
    "Cat",
    bodies=cat.bodies,
    joints=cat.joints,
    loads=[
        Motor("nods", "nod", motion=b * sin(w * t)),
        Motor("bends", "bend", motion=b * cos(w * t)),
    ],
    start={"front.rpy": (pi, 0, 0)},
    parameters=[
        Parameter(w, 8.0, "rad/s", "rate of the circle in which the spine bends"),
        Parameter(b, 0.9, "rad", "how far the spine bends"),
    ],
    description="Cat from a URDF file that turns over in the air",
)
scenes = [Scene("Cat", stop_time=0.85, step_size=0.01)]

masses = {body.name: Symbol(f"{body.name}.mass", positive=True) for body in cat.bodies}
way = [output(f"der(back.position.{x},2)") for x in "xyz"]


def against(x: str) -> object:
    """The acceleration of the front along an axis by which the momentum of all stays what it is."""
    others = sum(m * output(f"der({n}.position.{x},2)") for n, m in masses.items() if n != "front")
    return -others / masses["front"]


closed_forms = [
    ClosedForm("angle.nod", b * sin(w * t)),
    ClosedForm("angle.bend", b * cos(w * t)),
    *(
        ClosedForm(
            f"der(front.position.{x},2)",
            against(x),
            scale=output("force.bend.norm") / masses["front"],
        )
        for x in "xyz"
    ),
    ClosedForm("force.bend.norm", masses["back"] * sqrt(sum(a**2 for a in way))),
]
