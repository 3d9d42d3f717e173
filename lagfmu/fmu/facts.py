"""What the generated script of a python FMU states: the variable table, the methods, the numeric form.

Imports neither NumPy nor SciPy, so that a script can be read where they are missing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from ..numeric.system import System


class Variable(NamedTuple):
    """A row of the variable table; its position is the value reference."""

    name: str
    kind: str
    role: str  # what may set it: parameter, solver, start, input; output and estimate: nobody
    start: Any
    minimum: float | None
    maximum: float | None
    positive: bool
    given: bool  # by the model's `start`

    @property
    def computed(self) -> bool:
        """It is read from the state."""
        return self.role in ("output", "start")

    def problem(self, value: Any, methods: Mapping[int, str]) -> str:
        """Why it cannot have the value; empty if it can.  `methods`: those that can be chosen, by number."""
        if self.kind == "Integer" and self.role == "solver":
            offered = ", ".join(f"{k} ({method})" for k, method in methods.items())
            return (
                "" if value in methods else f"{self.name!r} = {value!r}, expected one of {offered}"
            )
        if self.kind != "Real":
            return ""
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            return f"{self.name!r} = {value!r}, expected a finite number"
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        if not low <= value <= high:
            return f"{self.name!r} = {value!r} is outside its bounds [{low}, {high}]"
        if self.positive and not value > 0:
            return f"{self.name!r} = {value!r}, expected a positive number"
        return ""


@dataclass(frozen=True)
class Facts:
    """What an FMU is made of: the numeric form, the variables by reference, the methods that can be chosen by
    number, the default one, the default tolerance, and what tells this FMU from others."""

    system: System
    variables: tuple[Variable, ...]
    methods: Mapping[int, str]
    method: str
    tolerance: float
    identity: str = ""
