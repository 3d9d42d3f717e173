"""A statement that was checked, and all those of one FMU."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..fmu.read import Trajectory

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Missed:
    """A statement that fails, along the run: `time` (points,) [s], `actual` and `expected` (points,)."""

    time: Floats
    actual: Floats
    expected: Floats


@dataclass(frozen=True)
class Check:
    """One statement: its largest error relative to its scale, and the error that is allowed.

    `points` is the number of communication points at which it was evaluated; with 0 it was not
    reached, and nothing is known.  `missed`, of one that fails: what was found, and what was expected.
    """

    name: str
    error: float
    allowed: float
    points: int
    detail: str = ""
    missed: Missed | None = field(default=None, repr=False, compare=False)

    @property
    def passed(self) -> bool:
        """True if it was held at one point at least, and the error is within what is allowed."""
        return self.points > 0 and self.error <= self.allowed

    @property
    def failed(self) -> bool:
        """True if it was held, and the error is beyond what is allowed."""
        return self.points > 0 and not self.passed

    @property
    def verdict(self) -> str:
        """pass, FAIL, or not reached."""
        if self.points == 0:
            return "not reached"
        return "pass" if self.passed else "FAIL"

    def __str__(self) -> str:
        figures = f" {self.error:.1e}, allowed {self.allowed:.0e}" if self.allowed else ""
        return f"{self.name}: {self.verdict}{figures} {self.detail}".rstrip()


@dataclass(frozen=True)
class Verification:
    """The checks of one FMU, `closed_forms` of them closed forms, and what the run cost.

    `uncovered` are the outputs of which no closed form and no reference says anything;
    `left_out` closed forms of the model need what this FMU does not have.
    """

    name: str
    checks: tuple[Check, ...]
    simulated: float
    seconds: float
    steps: int
    closed_forms: int
    uncovered: tuple[str, ...] = ()
    left_out: int = 0

    @property
    def passed(self) -> bool:
        """True if no check failed."""
        return not any(c.failed for c in self.checks)

    @property
    def worst(self) -> Check | None:
        """The closed form whose error is the largest part of what it is allowed; None without any."""
        measured = [c for c in self.checks if c.points and c.allowed]
        return max(measured, key=lambda c: c.error / c.allowed, default=None)

    def told(self) -> list[tuple[tuple[str, str, str, str, str], Check]]:
        """Each check with its row."""
        return list(zip(self.rows(), self.checks, strict=True))

    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """(statement, largest error, allowed, at how many points, verdict) as text; no figures where it is
        yes or no."""
        return [
            (
                c.name,
                f"{c.error:.1e}" if c.points and c.allowed else "",
                f"{c.allowed:.0e}" if c.allowed else "",
                str(c.points) if c.allowed else "",
                c.verdict,
            )
            for c in self.checks
        ]


class Against(Protocol):
    """What a run is held against besides closed forms: a table, or a statement."""

    @property
    def variables(self) -> set[str]:
        """Those of the FMU that it says something of."""

    @property
    def stop_time(self) -> float | None:
        """Until when it says something [s]; None if it does not know."""

    def checks(self, result: Trajectory, values: Mapping[str, float]) -> list[Check]:
        """On what a run returned; `values` are parameters, by name.  Raises LagfmuError."""
