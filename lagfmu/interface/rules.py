"""What a variable may be set to: one table of rules, in the same words wherever a value is given.

Python callers ask `problems_of`.  The page gets MESSAGES as data, and the columns of each variable
(live/facts.py).  The FMU itself checks what it is given by the same columns of the variable table:
runtime/fmi/values.c, and the slave of the python target.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .. import names
from ..methods import NUMBERS, unknown
from .variables import VariableTable

MESSAGES = {  # in the order in which they are looked at
    "settable": "'{name}' is calculated and cannot be set",
    "finite": "'{name}' = {value}, expected a finite number",
    "whole": "'{name}' = {value}, expected a whole number",
    "range": "'{name}' = {value} is outside its bounds [{minimum}, {maximum}]",
    "positive": "'{name}' = {value}, expected a positive number",
}
CALCULATED = ("output", "estimate")  # roles of what nobody sets


@dataclass(frozen=True)
class Rule:
    """What one variable may be set to, in SI units.

    `kind` as FMI names it; `fixed`: only before the end of the initialization; `positive`: zero makes no
    sense either; `items` are the numbers of an Enumeration by name; `start` is what is described, and
    `follows`: it comes from an expression of parameters.
    """

    name: str
    kind: str = "Real"
    settable: bool = True
    fixed: bool = True
    minimum: float = -math.inf
    maximum: float = math.inf
    positive: bool = False
    items: Mapping[str, int] = field(default_factory=dict)
    start: float | None = None
    follows: bool = False

    def problem(self, value: Any) -> str:
        """What is wrong with a value of it; empty if nothing is."""
        named = self.settable and isinstance(value, str) and bool(self.items)
        broken = "" if named else self._broken(value)
        if not broken and self.items and value not in (*self.items, *self.items.values()):
            return f"{self.name!r} = {value!r}: {unknown(value, self.items)}"
        plain = getattr(value, "item", lambda: value)()  # of NumPy's numbers Python's
        told = {"value": repr(plain), "minimum": self.minimum, "maximum": self.maximum}
        return MESSAGES[broken].format(name=self.name, **told) if broken else ""

    def _broken(self, value: Any) -> str:
        """Which rule a value breaks first."""
        if not self.settable:
            return "settable"
        if not isinstance(value, (int, float, np.number)) or not np.isfinite(value):
            return "finite"
        if self.kind != "Real" and value != np.round(value):
            return "whole"
        if not self.minimum <= value <= self.maximum:
            return "range"
        return "positive" if self.positive and not value > 0 else ""

    def number(self, value: Any) -> float:
        """A value as the FMU takes it: an item by its number, one that is none by a number that is none."""
        if isinstance(value, str):
            return self.items.get(value, 1 + max((0, *self.items.values())))
        return float(value) if self.kind == "Real" else int(value)

    def asked(self, value: Any) -> float:
        """The same of a value that a user asked for by name, which is meant even if it is the described one.

        A start that follows from parameters goes before it if it differs from the description: the described
        value is handed over one unit in the last place off.
        """
        found = self.number(value)
        return math.nextafter(found, math.inf) if self.follows and found == self.start else found


def rules_of(table: VariableTable) -> dict[str, Rule]:
    """Of a variable table, by name."""
    return {
        v.name: Rule(
            v.name,
            v.kind,
            v.role not in CALCULATED,
            v.role != "input",
            -math.inf if v.minimum is None else v.minimum,
            math.inf if v.maximum is None else v.maximum,
            v.positive,
            {m: NUMBERS[m] for m in v.items},
            v.start if isinstance(v.start, float) else None,
            v.description.endswith(names.FOLLOWS),
        )
        for v in table.variables
    }


def problems_of(known: Mapping[str, Rule], values: Mapping[str, Any]) -> list[str]:
    """All that is wrong with values by name: variables that there are not, or that nobody sets; numbers."""
    found = []
    for name, value in values.items():
        if text := unsettable(known, name) or known[name].problem(value):
            found.append(text)
    return found


def unsettable(known: Mapping[str, Rule], name: str) -> str:
    """Why nobody sets a variable of this name; empty if it can be set."""
    if name in known and known[name].settable:
        return ""
    settable = [n for n, rule in known.items() if rule.settable]
    settable.sort(key=lambda n: names.read(n).head == names.SOLVER)  # what is physics stands first
    return missing(name, settable, "cannot be set")


def missing(name: str, known: Iterable[str], what: str = "is not in the FMU") -> str:
    """What to say of a name that the FMU does not have."""
    known = list(known)
    near = difflib.get_close_matches(name, known, 1)
    if near:
        return f"{name!r} {what}; did you mean {near[0]!r}?"
    return f"{name!r} {what}, expected one of {', '.join(known) or 'none'}"
