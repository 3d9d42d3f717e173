"""The model that an MJCF file is by itself: all of it, with its own gravity and its actuators, or others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import ModelError
from ..model.model import Model
from .arguments import chosen, motors
from .mechanism import mechanism
from .mjcf import from_mjcf

CHOICES = {
    "key": ("",),
    "motors": ("file", "none", "torque", "motion"),
    "limits": ("true", "false"),
}
# The Python file that says the same.
PYTHON = '''"""The mechanism of {file}.  Add motors, contacts and closed loops of your own, then:

    lagfmu simulate {own} --plot out.svg
"""

from pathlib import Path

from lagfmu import Scene
from lagfmu.bodies import from_mjcf, mechanism

parts = from_mjcf(Path(__file__).parent / {path!r})  # key="home" begins at that key frame
model = mechanism(
    parts.name,
    bodies=parts.bodies,
    joints=[*parts.joints],
    loads=[*parts.loads],  # gravity among them
    start={{**parts.start}},  # e.g. "angle.j2": 0.5
    near=parts.near,
    inputs=parts.inputs,
    parameters=parts.parameters,
    description={file!r},
)
scenes = [Scene(model.name, stop_time=1.0, step_size=0.01)]
'''


def read(path: Path, arguments: Sequence[str] = ()) -> Model:
    """The model of an MJCF file; `arguments` are texts key=home, motors=none, torque or motion, limits=false,
    and starts by names of the FMU, angle.j2=0.5.

    motors= says what stands in place of the actuators of the file: nothing, an input J_motor.torque
    (J_motor.force) of each joint of one motion that follows no other, or J_motor.angle (J_motor.position).
    Raises RequestError for arguments, ModelError.
    """
    asked, given = chosen(path, arguments, CHOICES)
    own = asked["motors"] == "file"
    parts = from_mjcf(path, limits=asked["limits"] == "true", key=asked["key"], actuators=own)
    if not parts.bodies:
        raise ModelError(parts.name, ["nothing in the file moves: give a body of it a joint"])
    if asked["motors"] == "motion" and parts.near:
        raise ModelError(
            parts.name,
            [
                f"motors=motion: {', '.join(parts.near)} are tied by equalities, so that not each moves by "
                "itself: choose motors=torque, or write those Motor(..., motion=True) that drive it: lagfmu "
                f"new my.py --from {path.name}"
            ],
        )
    start = {**parts.start, **given}
    added = motors(parts.joints, asked["motors"], {**parts.near, **start})
    return mechanism(
        parts.name,
        **{**parts.arguments, "loads": [*parts.loads, *added], "start": start},
        description=path.name,
    )
