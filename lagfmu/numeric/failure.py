"""Why a step or a start cannot be done.  The message names the cause; the FMI layer picks the status.

Start values by priority: who said them, and how those that miss the constraints are told.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple


class StepFailureError(Exception):
    """A numerical or physical reason for which a start or a simulation does not go on."""


class MasslessError(StepFailureError):
    """Coordinates, by number, of which nothing says how they accelerate; the message lacks their names."""

    def __init__(self, message: str, coordinates: Sequence[int]) -> None:
        super().__init__(message)
        self.coordinates = tuple(coordinates)

    def named(self, names: Sequence[str]) -> StepFailureError:
        """The same, with the names of the coordinates of the system."""
        return StepFailureError(f"{self} ({', '.join(names[j] for j in self.coordinates)})")


class StartFailureError(StepFailureError):
    """Start values from which no consistent state can be reached."""


class OmittedStartError(StartFailureError):
    """A start value that nobody gave, and whose 0 is singular: what is to be done is known."""


def evaluated(what: str, t: float, function: Callable[..., Any], *arguments: Any) -> Any:
    """function(*arguments).  What Python cannot compute is a StepFailureError that says what and when [s]."""
    try:
        return function(*arguments)
    except (ArithmeticError, ValueError) as error:
        raise StepFailureError(
            f"{what} cannot be evaluated at t = {float(t)!r} s ({_plain(error)})"
        ) from error


def _plain(error: Exception) -> str:
    """What Python, NumPy or SciPy could not compute, in words for who does not know them."""
    if isinstance(error, OverflowError):
        return "a number beyond 1.8e308"
    if isinstance(error, ZeroDivisionError):
        return "a division by zero"
    text = str(error)
    if "domain" in text or "expected a" in text:  # the words of math, before and after Python 3.14
        return "a function outside of its domain"
    return "a value that is not finite" if "infs or NaNs" in text else text


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
