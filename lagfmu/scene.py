"""What one FMU must show: its name, the formulation of the equations, the experiment."""

from __future__ import annotations

import keyword
from dataclasses import dataclass

from .errors import ModelError
from .model import NAME
from .solver.state import DEFAULT_TOLERANCE
from .solver.state import METHODS as PYTHON_METHODS

FORMULATIONS = ("multipliers", "nullspace", "minimal")
METHODS = (*PYTHON_METHODS, "rattle")  # the last of native FMUs only


@dataclass(frozen=True)
class Scene:
    """One FMU of a model.

    `formulation` is 'multipliers' (KKT), 'nullspace' (lambda eliminated) or 'minimal' (dependent
    coordinates eliminated); all three report lambda and Q.  `stop_time` and `step_size` [s],
    `tolerance`, `method` and `step` (the largest one of a method with a fixed step [s]; 0: chosen from
    the start) are the defaults that the FMU states and starts with.
    """

    name: str
    formulation: str = "multipliers"
    stop_time: float = 1.0
    step_size: float = 0.01
    tolerance: float = DEFAULT_TOLERANCE
    method: str = "auto"
    step: float = 0.0

    def __post_init__(self) -> None:
        problems = []
        if not NAME.match(self.name):
            problems.append(f"scene name {self.name!r} is no FMI name: use letters, digits and _")
        elif keyword.iskeyword(self.name):
            problems.append(
                f"scene name {self.name!r} is a word of the Python language: choose another"
            )
        if self.formulation not in FORMULATIONS:
            problems.append(
                f"formulation {self.formulation!r} is unknown, expected one of "
                f"{', '.join(FORMULATIONS)}"
            )
        if self.method not in METHODS:
            problems.append(
                f"method {self.method!r} is unknown, expected one of {', '.join(METHODS)}"
            )
        for what in ("stop_time", "step_size", "tolerance"):
            value = getattr(self, what)
            if not 0 < value < float("inf"):
                problems.append(f"{what} = {value!r}, expected a positive number")
        if not 0 <= self.step < float("inf"):
            problems.append(f"step = {self.step!r}, expected a positive number, or 0")
        if problems:
            raise ModelError(self.name, problems)
