"""The model that a URDF file is by itself: all of it, in gravity, with motors where they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import ModelError
from ..model.model import Model
from .arguments import chosen, motors
from .loads import Gravity
from .mechanism import mechanism
from .urdf import BASES, from_urdf

GRAVITY = (0, 0, -9.81)  # m/s^2
CHOICES = {"base": BASES, "motors": ("none", "torque", "motion"), "limits": ("true", "false")}
# The Python file that says the same.
PYTHON = '''"""The robot of {file}.  Add motors, contacts and closed loops of your own, then:

    lagfmu simulate {own} --plot out.svg
"""

from pathlib import Path

from lagfmu import Scene
from lagfmu.bodies import Gravity, from_urdf, mechanism

robot = from_urdf(Path(__file__).parent / {path!r})
model = mechanism(
    robot.name,
    bodies=robot.bodies,
    joints=[*robot.joints],
    loads=[Gravity((0, 0, -9.81)), *robot.loads],
    start={{**robot.start}},  # e.g. "angle.j2": 0.5
    description=robot.description,
)
scenes = [Scene(model.name, stop_time=1.0, step_size=0.01)]
'''


def read(path: Path, arguments: Sequence[str] = ()) -> Model:
    """The model of a URDF file; `arguments` are texts base=floating, motors=torque or motion, limits=false,
    and starts by names of the FMU, angle.j2=0.5.

    With motors=torque each joint that follows no other has the input J_motor.torque (J_motor.force), with
    motors=motion J_motor.angle (J_motor.position).  Raises RequestError for arguments, ModelError.
    """
    asked, given = chosen(path, arguments, CHOICES)
    parts = from_urdf(path, limits=asked["limits"] == "true", base=asked["base"])
    if not parts.bodies:
        raise ModelError(
            parts.name, ["nothing in the file moves: give it a joint, or base=floating"]
        )
    start = {**parts.start, **given}
    return mechanism(
        parts.name,
        bodies=parts.bodies,
        joints=parts.joints,
        loads=[Gravity(GRAVITY), *parts.loads, *motors(parts.joints, asked["motors"], start)],
        start=start,
        description=f"{path.name}{f': {parts.description}' if parts.description else ''}",
    )
