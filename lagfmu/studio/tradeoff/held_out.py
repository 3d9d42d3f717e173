"""Start values and parameters other than those that a choice was made on."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ... import names
from ...errors import SimulationError
from ...fmu.read import Trajectory, joint_starts, kind_of
from ...fmu.session import Session
from .observe import observe
from .reference import Reference, refer
from .setting import Setting

SHARE = 0.05  # of a value, or of its largest magnitude in the scene where all start values are zero
CASES = 3
TRIES = 40


@dataclass(frozen=True)
class Case:
    """The FMU at other values: what was set, and what it should report there."""

    values: Mapping[str, float]
    reference: Reference


def cases(session: Session) -> list[Case]:
    """Other points, with their references.  Raises SimulationError if it cannot be run there."""
    scene = observe(session, _built(session))
    drawn = [other_values(session, scene, random.Random(k)) for k in range(CASES)]
    return [Case(values, refer(session, values)) for values in drawn]


def other_values(session: Session, scene: Trajectory, chance: random.Random) -> dict[str, float]:
    """Every parameter and start value, moved by up to SHARE, within its bounds.

    Start values of zero stay, unless all are zero.  The FMU puts what misses the constraints back on
    them.  Values that it refuses, or at which other contacts are closed at the start, are drawn again.
    """
    reason = "other contacts are closed at the start"
    for _ in range(TRIES):
        values = _drawn(session, scene, chance)
        try:
            begun = observe(session, _built(session), values, stop=session.experiment.step_size)
        except SimulationError as error:
            reason = str(error)
            continue
        contacts = names.those(begun.dtype.names or (), names.CONTACT)
        if all(begun[n][0] == scene[n][0] for n in contacts):
            return values
    raise SimulationError(
        f"{session.description.modelName}: no other start values or parameters were found within "
        f"{SHARE:.0%} of the scene's that the FMU starts with ({reason})"
    )


def _built(session: Session) -> Setting:
    return Setting("", 0.0, 0.0, session.experiment.step_size)


def _drawn(session: Session, scene: Trajectory, chance: random.Random) -> dict[str, float]:
    given = [
        v
        for v in session.description.modelVariables
        if kind_of(v) == "Real" and v.start is not None and names.read(v.name).head != names.SOLVER
    ]
    outputs, joints = scene.dtype.names or (), joint_starts(session.description)
    starts = [
        v
        for v in given
        if v.initial in ("exact", "approx") and v.name in outputs and v.name not in joints
    ]
    still = all(float(v.start) == 0 for v in starts)
    values: dict[str, float] = {}
    for v in given:
        share, value = SHARE * chance.uniform(-1, 1), float(v.start)
        moved = value * (1 + share)
        if v in starts and still:
            moved = share * float(np.abs(scene[v.name]).max())
        elif v not in starts and v.causality != "parameter":
            continue
        if moved != value and not session.rules[v.name].problem(moved):
            values[v.name] = moved
    return values
