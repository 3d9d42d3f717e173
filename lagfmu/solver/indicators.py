"""The functions that are watched within a step, event indicators: where one of them leaves its range, the
equations change.

    0 .. contacts - 1   of a contact: lambda >= 0 while it is closed; while it is open f >= 0, left only at
                        f < -gap, within which contacts touch
    then                of a jump of the forces: h on the side of its level (jumps.py)

A further kind takes the numbers after these: its values stand in `indicators`, its ranges in `ranges`, what
it does at an event in advance.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .jumps import limits, surfaces
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

    def way(self, value: float) -> int:
        """The way on which a value has left the range: 1 upwards, -1 downwards."""
        return 1 if float(value) > self.high else -1

    def inside(self, value: float) -> float:
        """How far inside the range a value lies, negative outside."""
        return min(float(value) - self.low, self.high - float(value))

    def widened(self) -> Range:
        """The range with its slack."""
        return Range(self.low - self.slack, self.high + self.slack)


def is_watched(system: System) -> bool:
    """True if there is anything to watch."""
    return bool(system.contacts or system.floors)


def indicators(leg: Leg, t: float, y: Vector) -> Vector:
    """All values at (t, y), in the present modes."""
    q, _ = leg.split(y)
    values = _of_contacts(leg, t, y) if leg.system.contacts else np.zeros(0)
    if not leg.system.floors:
        return values
    at = leg.at(t)
    return np.concatenate([values, surfaces(leg.system, t, q, at.u, at.p)])


def ranges(leg: Leg) -> list[Range]:
    """The range of each, in the present modes."""
    state = leg.state
    contacts = [
        Range(0.0, slack=0.0 if shut else gap)
        for shut, gap in zip(state.closed, state.gap, strict=True)
    ]
    jumps = [
        Range(*limits(level, floor))
        for level, floor in zip(state.levels, leg.system.floors, strict=True)
    ]
    return contacts + jumps


def _of_contacts(leg: Leg, t: float, y: Vector) -> Vector:
    q, v = leg.split(y)
    at = leg.at(t)
    contacts = list(leg.system.contacts)
    values = at.residual(q)[contacts]
    if any(leg.state.closed):
        lam = leg.near(t, q, v).lam[contacts]
        values = np.where(leg.state.closed, lam, values)
    return values
