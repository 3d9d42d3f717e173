"""What the variables of a table may be set to, by one kind of rule (model/rule.py).

Python callers ask `problems_of`.  The page gets MESSAGES as data, and the columns of each variable
(studio/live/page.py).  The FMU itself checks what it is given by the same columns of the variable table:
runtime/fmi/experiment.c, and by the same kind of rule fmu/slave/instance.py, the python target.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .. import names
from ..methods import NUMBERS
from ..model.rule import Rule, missing

if TYPE_CHECKING:  # who runs an FMU needs no SymPy
    from .variables import VariableTable

CALCULATED = ("output", "estimate", "interface")  # roles of what nobody sets


def rules_of(table: VariableTable) -> dict[str, Rule]:
    """Of a variable table, by name."""
    return {
        v.name: Rule(
            v.name,
            v.kind,
            v.role not in CALCULATED,
            v.minimum,
            v.maximum,
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
