"""What is varied: method, tolerance or step, communication step; and the grids over them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...methods import FIXED_STEP
from ...names import METHOD, STEP

ORDERS = {"rk4": 4, "rattle": 6}  # of convergence


@dataclass(frozen=True)
class Setting:
    """One way to run an FMU.

    `tolerance` (relative) for methods with step-size control, `step` [s] for those with a fixed one,
    the other is 0; `communication` [s] is the importer's step.  Without a method the FMU runs as it
    was built.
    """

    method: str
    tolerance: float
    step: float
    communication: float

    @property
    def dial(self) -> str:
        """The tolerance or the step as text: 1e-6, 0.01 s or 0.5 ms."""
        if self.tolerance:
            return f"{self.tolerance:.0e}".replace("e-0", "e-")
        return f"{self.step:.3g} s" if self.step >= 1e-3 else f"{1e3 * self.step:.3g} ms"

    @property
    def values(self) -> dict[str, Any]:
        """The FMU's parameters; the tolerance goes through fmi2SetupExperiment instead."""
        values: dict[str, Any] = {METHOD: self.method} if self.method else {}
        return values | {STEP: self.step} if self.step else values

    def __str__(self) -> str:
        return f"{self.method or 'as built'} {self.dial}, every {self.communication:.3g} s"


def tolerances(decades: int = 2) -> tuple[float, ...]:
    """1e-3 ... 1e-13, loosest first, `decades` apart."""
    return tuple(float(f"1e-{k}") for k in range(3, 14, decades))


def dials(method: str, communication: float, grid: Sequence[float], halvings: int) -> list[Setting]:
    """The settings of one method at one communication step, from coarse to fine.

    A fixed step divides the communication step evenly, hence H, H/2, H/4, ...
    """
    if method in FIXED_STEP:
        return [
            Setting(method, 0.0, communication / 2**k, communication) for k in range(halvings + 1)
        ]
    return [Setting(method, tol, 0.0, communication) for tol in grid]
