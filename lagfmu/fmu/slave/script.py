"""What the generated script of a python FMU states: the variable table, the methods, the numeric form.

Imports neither NumPy nor SciPy, so that a script can be read where they are missing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

from ...model.rule import Rule

if TYPE_CHECKING:
    from ...numeric.system import System


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

    @property
    def rule(self) -> Rule:
        """Which values it can have; of `solver.method` the keys of Facts.methods."""
        return Rule(self.name, self.kind, True, self.minimum, self.maximum, self.positive)


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
