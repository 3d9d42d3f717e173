"""The accuracy that is asked for: 1e-6, 1e-6:lambda.surface, 1e-6:lambda.surface,Q.*"""

from __future__ import annotations

import fnmatch
import re
from collections.abc import Collection
from dataclasses import dataclass

from ..errors import UsageError

MARGIN = 5.0  # the choice is this much better on the scene than what was asked
HELD_OUT_MARGIN = 2.0  # and still this much on other start values and parameters
LOOSEST, FINEST = 0.1, 1e-12
GROUPS = {  # of quantities that an accuracy is asked of
    "lambda": r"lambda\.[\w.]+",
    "Q": r"Q\.\w+(\.\w+\.\w+)?",
    "coordinates": r"(\w+\.(position|orientation)\.)?[A-Za-z_]\w*",
    "event time": r"departure\.[\w.]+\.time",
}
USUAL = 10.0  # times the tolerance that a closed form may miss, unless it says otherwise


def _is(variable: str, name: str) -> bool:
    """Whether a variable is meant by a name, a pattern (Q.*) or a group."""
    group = GROUPS.get(name)
    if group is not None and re.fullmatch(group, variable):
        return True
    return fnmatch.fnmatchcase(variable, name)


@dataclass(frozen=True)
class Goal:
    """A relative error, and the quantities that it is asked of (all measured ones if empty)."""

    accuracy: float
    names: tuple[str, ...] = ()

    @property
    def on_the_scene(self) -> float:
        """The error that a setting may have where it is chosen."""
        return self.accuracy / MARGIN

    @property
    def held_out(self) -> float:
        """The error that it may have elsewhere."""
        return self.accuracy / HELD_OUT_MARGIN

    def allowed(self, symbols: Collection[str], within: float) -> float | None:
        """What a statement about these variables may miss, relative to its scale; None: not asked.

        A measured quantity is held to the accuracy itself.  An expression of such, which loosens them
        by its terms, is when it is allowed `within` / USUAL of what is usual.
        """
        if self.names and not all(any(_is(s, n) for n in self.names) for s in symbols):
            return None
        measured = len(symbols) == 1 and any(_is(s, group) for s in symbols for group in GROUPS)
        return self.accuracy if measured else self.accuracy * max(1.0, within / USUAL)

    def __str__(self) -> str:
        return f"{self.accuracy:g}" + (f" of {', '.join(self.names)}" if self.names else "")


def parse(text: str) -> Goal:
    """'1e-6' or '1e-6:NAME,NAME'.  Raises UsageError if it is neither."""
    number, colon, names = text.partition(":")
    wanted = tuple(n.strip() for n in names.split(",") if n.strip())
    try:
        accuracy = float(number)
    except ValueError:
        accuracy = float("nan")
    if not FINEST <= accuracy <= LOOSEST or (colon and not wanted):
        raise UsageError(
            f"--accuracy {text!r}: expected a relative error from {FINEST:g} to {LOOSEST:g}, and after "
            "a colon the outputs that it is asked of, e.g. 1e-6 or 1e-6:lambda.surface,Q.*"
        )
    return Goal(accuracy, wanted)
