"""What a file that is a model by itself is asked for: NAME=VALUE, a start by names of the FMU, motors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import RequestError
from .joints import Gear, Joint
from .loads import Motor

BY_KIND: dict[str, dict[str, Any]] = {"torque": {}, "motion": {"motion": True}}


def chosen(
    path: Path, arguments: Sequence[str], choices: Mapping[str, Sequence[str]]
) -> tuple[dict[str, str], dict[str, float]]:
    """The value of each of `choices`, whose first is that without an argument (of one that lists no other
    any text is taken), and the start.

    Raises RequestError with all problems at once.
    """
    found, start, problems = {name: values[0] for name, values in choices.items()}, {}, []
    for text in arguments:
        name, sign, value = (part.strip() for part in text.partition("="))
        if sign and name in choices and (value in choices[name] or len(choices[name]) == 1):
            found[name] = value
        elif name in choices:
            known = " or ".join(choices[name]) if len(choices[name]) > 1 else "..."
            problems.append(f"{text!r}: expected {name}={known}")
        elif sign and "." in name:
            try:
                start[name] = float(value)
            except ValueError:
                problems.append(f"{text!r}: {value!r} is no number, expected one in SI")
        else:
            problems.append(
                f"{text!r}: expected {', '.join(f'{n}=...' for n in choices)}, or a start by the name of the "
                "FMU, e.g. angle.j2=0.5"
            )
    if problems:
        raise RequestError(str(path), problems)
    return found, start


def motors(joints: Sequence[Any], kind: str, start: Mapping[str, Any]) -> list[Motor]:
    """One on each motion of a joint that follows no other, by kind: torque, motion, else none."""
    followers = {p.first for p in joints if isinstance(p, Gear)}
    found = []
    for joint in joints if kind in BY_KIND else ():
        measures = joint.measures if isinstance(joint, Joint) else []
        for measure in measures:
            name = measure.partition(".")[2]
            if not {name, measure} & followers:
                begin = float(start.get(measure, 0.0)) if kind == "motion" else 0.0
                of = joint if len(measures) == 1 else measure
                found.append(Motor(f"{name}_motor", of, start=begin, **BY_KIND[kind]))
    return found
