"""A six-axis arm from a URDF file, whose motors follow sines: the wrench in each joint, drives included.

Held here: each angle is the one prescribed, and the first joint carries what all links need together, their
weight and the rates of their momenta.  tests/test_rigid_bodies.py holds the wrenches of such an arm against
recursive Newton-Euler.
"""

from pathlib import Path

from sympy import Symbol, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import ClosedForm, Parameter, Scene, output
from lagfmu.bodies import Gravity, Motor, from_urdf, mechanism

arm = from_urdf(Path(__file__).with_name("arm.urdf"), limits=False)
t, w = dynamicsymbols._t, Symbol("rate", real=True)
swings = dict(
    zip((joint.name for joint in arm.joints), (0.9, 0.5, -0.8, 1.2, 0.7, -1.5), strict=True)
)
motors = [
    Motor(f"motor_{name}", name, motion=angle * sin((1 + k / 4) * w * t))
    for k, (name, angle) in enumerate(swings.items())
]
model = mechanism(
    "Arm",
    bodies=arm.bodies,
    joints=arm.joints,
    loads=[Gravity((0, 0, -9.81)), *motors],
    parameters=[Parameter(w, 2.0, "rad/s", "rate of the first axis")],
    description="Six-axis arm from a URDF file on prescribed joint motions",
)
scenes = [Scene("Arm", stop_time=3.0, step_size=0.02)]

g = symbols("gravity.z", real=True)
masses = {body.name: Symbol(f"{body.name}.mass", positive=True) for body in arm.bodies}


def carried(x: str) -> object:
    """What the links need together along an axis of the ground."""
    fall = g if x == "z" else 0
    return sum(m * (output(f"der({name}.position.{x},2)") - fall) for name, m in masses.items())


first = arm.joints[0].name  # its marker on the ground has the ground's axes
closed_forms = [
    *(
        ClosedForm(f"angle.{name}", angle * sin((1 + k / 4) * w * t))
        for k, (name, angle) in enumerate(swings.items())
    ),
    *(
        ClosedForm(f"force.{first}.{x}", carried(x), scale=output(f"force.{first}.norm"))
        for x in "xyz"
    ),
]
