"""The functions that are watched within a step, event indicators: where one of them leaves its range, the
equations change.

    0 .. contacts - 1   of a contact: lambda >= 0 while it is closed; while it is open f >= 0, left only at
                        f < -gap, within which contacts touch

A further kind takes the numbers after these: its values stand in `indicators`, its ranges in `ranges`, what
it does at an event in advance.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .leg import Leg
from .system import System, Vector


@dataclass(frozen=True)
class Range:
    """Where an indicator may lie.

    It has left the range when it is outside by more than `slack`; the time is that at which it passes the
    limit itself if it has been inside by more than `slack` before (is armed).
    """

    low: float
    high: float = float("inf")
    slack: float = 0.0

    def inside(self, value: float) -> float:
        """How far inside the range a value lies, negative outside."""
        return min(float(value) - self.low, self.high - float(value))

    def widened(self) -> Range:
        """The range with its slack."""
        return Range(self.low - self.slack, self.high + self.slack)


def is_watched(system: System) -> bool:
    """True if there is anything to watch."""
    return bool(system.contacts)


def indicators(leg: Leg, t: float, y: Vector) -> Vector:
    """All values at (t, y), in the present modes."""
    return _of_contacts(leg, t, y)


def ranges(leg: Leg) -> list[Range]:
    """The range of each, in the present modes."""
    state = leg.state
    return [
        Range(0.0, slack=0.0 if shut else gap)
        for shut, gap in zip(state.closed, state.gap, strict=True)
    ]


def _of_contacts(leg: Leg, t: float, y: Vector) -> Vector:
    q, v = leg.split(y)
    at = leg.at(t)
    contacts = list(leg.system.contacts)
    values = at.residual(q)[contacts]
    if any(leg.state.closed):
        lam = leg.near(t, q, v).lam[contacts]
        values = np.where(leg.state.closed, lam, values)
    return values
