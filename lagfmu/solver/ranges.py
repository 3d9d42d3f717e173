"""Where an event indicator may lie, and which are those of frictions (indicators.py)."""

from __future__ import annotations

from dataclasses import dataclass

from ..numeric.system import System


@dataclass(frozen=True)
class Range:
    """Where an indicator may lie.

    It has left the range when it is outside by more than `slack`; the time is that at which it passes the
    limit itself if it has been inside by more than `slack` before (is armed).  `rises`: that has to be
    seen first, as it begins on the limit.
    """

    low: float
    high: float = float("inf")
    slack: float = 0.0
    rises: bool = False

    def way(self, value: float) -> int:
        """The way on which a value has left the range: 1 upwards, -1 downwards."""
        return 1 if float(value) > self.high else -1

    def inside(self, value: float) -> float:
        """How far inside the range a value lies, negative outside."""
        return min(float(value) - self.low, self.high - float(value))

    def widened(self) -> Range:
        """The range with its slack."""
        return Range(self.low - self.slack, self.high + self.slack)


def first_of_frictions(system: System) -> int:
    """The number of the first indicator of a friction."""
    return len(system.contacts) + len(system.floors)
