"""What one variable may be set to, in the same words wherever a value is given."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import Any

from ..methods import unknown

MESSAGES = {  # in the order in which they are looked at
    "settable": "'{name}' is calculated and cannot be set: set coordinates, speeds, parameters or inputs",
    "finite": "'{name}' = {value}, expected a finite number",
    "whole": "'{name}' = {value}, expected a whole number",
    "range": "'{name}' = {value} is outside its bounds [{minimum}, {maximum}]",
    "positive": "'{name}' = {value}, expected a positive number",
}


@dataclass(frozen=True)
class Rule:
    """What one variable may be set to, in SI units.

    `kind` as FMI names it; `positive`: zero makes no sense either; `items` are the numbers of an Enumeration
    by name; `start` is what is described, `follows`: it comes from an expression of parameters,
    and `begins`: it is a start value.
    """

    name: str
    kind: str = "Real"
    settable: bool = True
    minimum: float | None = None
    maximum: float | None = None
    positive: bool = False
    items: Mapping[str, int] = field(default_factory=dict)
    start: float | None = None
    follows: bool = False
    begins: bool = False

    def problem(self, value: Any) -> str:
        """What is wrong with a value of it; empty if nothing is."""
        named = self.settable and isinstance(value, str) and bool(self.items)
        broken = "" if named else self._broken(value)
        if not broken and self.items and value not in (*self.items, *self.items.values()):
            return f"{self.name!r} = {value!r}: {unknown(value, self.items)}"
        if not broken:
            return ""
        text = repr(getattr(value, "item", lambda: value)())  # of NumPy's numbers Python's
        low, high = self._ends
        return MESSAGES[broken].format(name=self.name, value=text, minimum=low, maximum=high)

    @property
    def _ends(self) -> tuple[float, float]:
        low, high = self.minimum, self.maximum
        return -math.inf if low is None else low, math.inf if high is None else high

    def _broken(self, value: Any) -> str:
        """Which rule a value breaks first."""
        if not self.settable:
            return "settable"
        number = float(value) if isinstance(value, Real) else math.nan
        if not math.isfinite(number):
            return "finite"
        if self.kind != "Real" and not number.is_integer():
            return "whole"
        low, high = self._ends
        if not low <= number <= high:
            return "range"
        return "positive" if self.positive and not number > 0 else ""

    def number(self, value: Any) -> float:
        """A value as the FMU takes it: an item by its number, one that is none by a number that is none."""
        if isinstance(value, str):
            return self.items.get(value, 1 + max((0, *self.items.values())))
        return float(value) if self.kind == "Real" else int(value)

    def asked(self, value: Any) -> float:
        """The same of a value that a user asked for by name, which is meant even if it is the described one.

        A start that follows from parameters goes before it if it differs from the description: the described
        value is handed over one unit in the last place off.  A start of 0 is handed over as -0, since the
        described 0 may be one that nobody gave.
        """
        found = self.number(value)
        if self.begins and found == self.start == 0:
            return -0.0
        return math.nextafter(found, math.inf) if self.follows and found == self.start else found


def missing(name: str, known: Iterable[str], what: str = "is not in the FMU") -> str:
    """What to say of a name that the FMU does not have."""
    known = list(known)
    near = difflib.get_close_matches(name, known, 1)
    if near:
        return f"{name!r} {what}; did you mean {near[0]!r}?"
    return f"{name!r} {what}, expected one of {', '.join(known) or 'none'}"
