"""Start values and parameters other than those that a choice was made on."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import names
from ...errors import SimulationError
from ...fmu.closed_forms import CarriedForm
from ...fmu.described import Trajectory
from ...verification.simulate import steps_of
from .importer import Importer
from .measure import wider
from .reference import refer
from .setting import Setting

SHARE = 0.05  # of a value, or of its largest magnitude in the scene where all start values are zero
CASES = 3
TRIES = 40


@dataclass(frozen=True)
class Case:
    """One run of a built FMU at other values: what was set, the error of each quantity, the steps."""

    values: Mapping[str, float]
    errors: Mapping[str, float]
    own: Mapping[str, float]
    steps: int

    def error(self, names: Sequence[str]) -> float:
        """The largest error of the named quantities; the reference's own is added to it."""
        return max(self.errors[n] + self.own[n] for n in names)


def held_out(importer: Importer, closed_forms: Sequence[CarriedForm]) -> list[Case]:
    """The FMU as it was built, with its default settings, at other points.

    Errors are the larger ones of the FMU's communication step and of up to ten times that.

    Raises SimulationError if it cannot be run there.
    """
    built = Setting("", 0.0, 0.0, importer.step_size)
    scene = importer.observe(built)
    found = []
    for k in range(CASES):
        values = other_values(importer, scene, random.Random(k))
        reference = refer(importer, closed_forms, values, second_opinion=False)
        run = importer.observe(built, values)
        steps = steps_of(run)
        errors = reference.errors(run)
        wide = reference.errors(
            importer.observe(replace(built, communication=wider(importer)), values)
        )
        worst = {n: max(e, wide[n]) for n, e in errors.items()}
        found.append(Case(values, worst, reference.own, steps))
    return found


def other_values(importer: Importer, scene: Trajectory, chance: random.Random) -> dict[str, float]:
    """Every parameter and start value, moved by up to SHARE, within its bounds.

    Start values of zero stay, unless all are zero.  The FMU puts what misses the constraints back on
    them.  Values that it refuses, or at which other contacts are closed at the start, are drawn again.
    """
    reason = "other contacts are closed at the start"
    built = Setting("", 0.0, 0.0, importer.step_size)
    for _ in range(TRIES):
        values = _drawn(importer, scene, chance)
        try:
            begun = importer.observe(built, values, stop=importer.step_size)
        except SimulationError as error:
            reason = str(error)
            continue
        contacts = names.those(begun.dtype.names or (), names.CONTACT)
        if all(begun[n][0] == scene[n][0] for n in contacts):
            return values
    raise SimulationError(
        f"{importer.description.modelName}: no other start values or parameters were found within "
        f"{SHARE:.0%} of the scene's that the FMU starts with ({reason})"
    )


def _drawn(importer: Importer, scene: Trajectory, chance: random.Random) -> dict[str, float]:
    values: dict[str, float] = {}
    starts = [
        v
        for v in importer.outputs
        if v.type == "Real" and v.initial in ("exact", "approx") and v.start is not None
    ]
    still = all(float(v.start) == 0 for v in starts)
    for v in importer.description.modelVariables:
        if v.type != "Real" or v.start is None or names.read(v.name).head == names.SOLVER:
            continue
        value = float(v.start)
        moved = value * (1 + SHARE * chance.uniform(-1, 1))
        if v in starts and still:
            moved = SHARE * chance.uniform(-1, 1) * float(np.abs(scene[v.name]).max())
        elif v not in starts and v.causality != "parameter":
            continue
        low = -np.inf if v.min is None else float(v.min)
        high = np.inf if v.max is None else float(v.max)
        if moved != value and low <= moved <= high:
            values[v.name] = moved
    return values
