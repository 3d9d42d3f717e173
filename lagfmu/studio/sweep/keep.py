"""What a study keeps of a run: NAME:last, :max, :min, :mean, :time-of-max, or all points, :trajectory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ... import names
from ...errors import SettingError
from ...fmu.batch import LAST, MAX, MEAN, MIN, TIME_OF_MAX
from ...fmu.session import KINDS
from ...model.rule import missing

REDUCTIONS = {"last": LAST, "max": MAX, "min": MIN, "mean": MEAN, "time-of-max": TIME_OF_MAX}
TRAJECTORY = "trajectory"
PEAKS = {"max": "peak.max", "min": "peak.min", "time-of-max": "peak.max_time"}
FOUND = {  # of the reductions that look for something: whether the FMU has found it
    True: "of the continuous motion, found by the FMU itself",
    False: "of the communication points",
}


@dataclass(frozen=True)
class Kept:
    """The reductions (variable, how) in the order asked for, and the variables kept at all points; `peaks`:
    those of the reductions that the FMU tells itself, by its `peak.*`."""

    numbers: tuple[tuple[str, str], ...]
    trajectories: tuple[str, ...]
    peaks: tuple[tuple[str, str], ...] = ()

    def about(self, column: str) -> str:
        """What a column NAME:HOW has been found in; empty where it is plain."""
        name, _, how = column.rpartition(":")
        return FOUND[(name, how) in self.peaks] if how in PEAKS else ""

    @property
    def columns(self) -> tuple[str, ...]:
        """NAME:HOW of each number."""
        return tuple(f"{name}:{how}" for name, how in self.numbers)

    @property
    def plan(self) -> tuple[tuple[str, int], ...]:
        """For the session: the numbers, then the variables whose trajectories are kept."""
        found = [
            (names.name(PEAKS[how], "", name), LAST)
            if (name, how) in self.peaks
            else (name, REDUCTIONS[how])
            for name, how in self.numbers
        ]
        return (*found, *((name, LAST) for name in self.trajectories))


def peaked(texts: Sequence[str]) -> list[str]:
    """The variables, or patterns of them, whose peaks are of use to what is to be kept."""
    asked = [text.rpartition(":") for text in texts] or [("lambda.*", ":", "max")]
    return list(dict.fromkeys(name for name, _, how in asked if how in PEAKS))


def kept(texts: Sequence[str], known: Mapping[str, str], outputs: Sequence[str]) -> Kept:
    """`known` maps the FMU's variables to their FMI types.  Without texts: the largest multipliers, and
    counts and times of departures and slips; of an FMU that has none of these all `outputs`, at the end.
    Raises SettingError with all problems at once."""
    if not texts:
        texts = [f"{n}:max" for n in names.those(known, names.MULTIPLIER)]
        events = names.those(
            known, names.DEPARTURES, names.DEPARTURE_TIME, names.SLIPS, names.SLIP_TIME
        )
        texts += [f"{n}:last" for n in events]
        if not texts:
            texts = [
                f"{n}:last"
                for n in outputs
                if known[n] in KINDS and names.read(n).head != names.SOLVER
            ]
    numbers, trajectories, problems = [], [], []
    if any(names.varied(text.rpartition(":")[0] or text) for text in texts):
        texts = [*texts, f"{names.SENSITIVITY_VALID}:last"]  # without it a 0 may be none
    for text in dict.fromkeys(texts):
        name, sign, how = text.rpartition(":")
        if not sign or (how not in REDUCTIONS and how != TRAJECTORY and text in known):
            name, how = text, "last"
        if how != TRAJECTORY and how not in REDUCTIONS:
            ways = ", ".join((*REDUCTIONS, TRAJECTORY))
            problems.append(f"{text!r}: {how!r} is unknown, expected one of {ways}")
        elif name not in known or known[name] not in KINDS:
            problems.append(missing(name, [n for n in known if known[n] in KINDS]))
        elif how == TRAJECTORY:
            trajectories.append(name)
        else:
            numbers.append((name, how))
    if problems:
        raise SettingError("keep: " + "; ".join(problems))
    peaks = [
        (n, how) for n, how in numbers if how in PEAKS and names.name(PEAKS[how], "", n) in known
    ]
    return Kept(tuple(numbers), tuple(trajectories), tuple(peaks))
