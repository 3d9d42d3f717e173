"""What a study keeps of a run: NAME:last, :max, :min, :mean, :time-of-max, or all points, :trajectory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ... import names
from ...errors import SettingError
from ...fmu.session import LAST, MAX, MEAN, MIN, TIME_OF_MAX, TYPES
from ...verification.simulate import missing

REDUCTIONS = {"last": LAST, "max": MAX, "min": MIN, "mean": MEAN, "time-of-max": TIME_OF_MAX}
TRAJECTORY = "trajectory"


@dataclass(frozen=True)
class Kept:
    """The reductions (variable, how) in the order asked for, and the variables kept at all points."""

    numbers: tuple[tuple[str, str], ...]
    trajectories: tuple[str, ...]

    @property
    def extremes(self) -> bool:
        """Whether anything is kept that is looked for at departures too."""
        return any(how not in ("last", "mean") for _, how in self.numbers)

    @property
    def columns(self) -> tuple[str, ...]:
        """NAME:HOW of each number."""
        return tuple(f"{name}:{how}" for name, how in self.numbers)

    @property
    def plan(self) -> tuple[tuple[str, int], ...]:
        """For the session: the numbers, then the variables whose trajectories are kept."""
        found = [(name, REDUCTIONS[how]) for name, how in self.numbers]
        return (*found, *((name, LAST) for name in self.trajectories))


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
                if known[n] in TYPES and names.read(n).head != names.SOLVER
            ]
    numbers, trajectories, problems = [], [], []
    for text in dict.fromkeys(texts):
        name, sign, how = text.rpartition(":")
        if not sign or (how not in REDUCTIONS and how != TRAJECTORY and text in known):
            name, how = text, "last"
        if how != TRAJECTORY and how not in REDUCTIONS:
            ways = ", ".join((*REDUCTIONS, TRAJECTORY))
            problems.append(f"{text!r}: {how!r} is unknown, expected one of {ways}")
        elif name not in known or known[name] not in TYPES:
            problems.append(missing(name, [n for n in known if known[n] in TYPES]))
        elif how == TRAJECTORY:
            trajectories.append(name)
        else:
            numbers.append((name, how))
    if problems:
        raise SettingError("keep: " + "; ".join(problems))
    return Kept(tuple(numbers), tuple(trajectories))
