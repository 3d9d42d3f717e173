"""The model that a URDF file is by itself: all of it, in gravity, with motors where they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import ModelError, RequestError
from ..model.model import Model
from .joints import Gear, Joint
from .loads import Gravity, Motor
from .mechanism import mechanism
from .urdf import BASES, from_urdf

GRAVITY = (0, 0, -9.81)  # m/s^2
MOTORS: dict[str, dict[str, Any]] = {"none": {}, "torque": {}, "motion": {"motion": True}}
CHOICES = {"base": BASES, "motors": tuple(MOTORS), "limits": ("true", "false")}


def read(path: Path, arguments: Sequence[str] = ()) -> Model:
    """The model of a URDF file; `arguments` are texts base=floating, motors=torque or motion, limits=false,
    and starts by names of the FMU, angle.j2=0.5.

    With motors=torque each joint that follows no other has the input J_motor.torque (J_motor.force), with
    motors=motion J_motor.angle (J_motor.position).  Raises RequestError for arguments, ModelError.
    """
    chosen, start = _chosen(path, arguments)
    parts = from_urdf(path, limits=chosen["limits"] == "true", base=chosen["base"])
    if not parts.bodies:
        raise ModelError(
            parts.name, ["nothing in the file moves: give it a joint, or base=floating"]
        )
    followers = {p.first for p in parts.joints if isinstance(p, Gear)}
    start = {**parts.start, **start}
    motors = []
    for joint in parts.joints if chosen["motors"] != "none" else ():
        if isinstance(joint, Joint) and len(joint.measures) == 1 and joint.name not in followers:
            begin = start.get(joint.measures[0], 0.0) if chosen["motors"] == "motion" else 0.0
            of = MOTORS[chosen["motors"]]
            motors.append(Motor(f"{joint.name}_motor", joint, start=begin, **of))
    return mechanism(
        parts.name,
        bodies=parts.bodies,
        joints=parts.joints,
        loads=[Gravity(GRAVITY), *parts.loads, *motors],
        start=start,
        description=f"{path.name}{f': {parts.description}' if parts.description else ''}",
    )


def _chosen(path: Path, arguments: Sequence[str]) -> tuple[dict[str, str], dict[str, float]]:
    chosen, start, problems = {"base": "fixed", "motors": "none", "limits": "true"}, {}, []
    for text in arguments:
        name, sign, value = (part.strip() for part in text.partition("="))
        if name in CHOICES and value in CHOICES[name]:
            chosen[name] = value
        elif name in CHOICES:
            problems.append(f"{text!r}: expected {name}={' or '.join(CHOICES[name])}")
        elif sign and "." in name:
            try:
                start[name] = float(value)
            except ValueError:
                problems.append(f"{text!r}: {value!r} is no number, expected one in SI")
        else:
            problems.append(
                f"{text!r}: expected {', '.join(f'{n}=...' for n in CHOICES)}, or a start by the name of the "
                "FMU, e.g. angle.j2=0.5"
            )
    if problems:
        raise RequestError(str(path), problems)
    return chosen, start
