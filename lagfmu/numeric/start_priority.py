"""Start values by priority: who said them, and how those that miss the constraints are told."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

OMITTED, GIVEN, SET = 0, 1, 2  # nobody said it; the model's `start` does; the importer did
LEFT_OUT = "start values that were left out"
MISSES = "misses the constraints: projected to"


class Moved(NamedTuple):
    """A start value that missed the constraints, what it was moved to, and of which priority it is.

    `size`: the magnitude of the coordinate; of a velocity, that magnitude times the motion's natural rate,
    or the velocity itself if it is larger.
    """

    name: str
    given: float
    used: float
    priority: int
    size: float

    def __str__(self) -> str:
        return (
            f"start value {self.name} = {self.given!r} {MISSES} {self.used!r} "
            f"(moved by {self.used - self.given:.3g})"
        )


def left_out(moved: Iterable[Moved]) -> str:
    """Of the values that nobody gave, one line with what they are; empty where there are none."""
    values = ", ".join(f"{m.name} = {m.used!r}" for m in moved if m.priority == OMITTED)
    return f"{LEFT_OUT} follow from the constraints: {values}" if values else ""
