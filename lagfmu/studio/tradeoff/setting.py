"""What is varied: the method, and its tolerance or step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...methods import FIXED_STEP
from ...names import METHOD, STEP

HALVINGS = 10  # of a fixed step, at most


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
        """The FMU's parameters; the tolerance is one of the experiment."""
        values: dict[str, Any] = {METHOD: self.method} if self.method else {}
        return values | {STEP: self.step} if self.step else values

    def __str__(self) -> str:
        return f"{self.method or 'as built'} {self.dial}"


def ladder(
    method: str, communication: float, tolerances: Sequence[float], halvings: int = HALVINGS
) -> list[Setting]:
    """The settings of one method at one communication step [s], from coarse to fine.

    A fixed step divides the communication step evenly: H, H/2, H/4, ...
    """
    if method in FIXED_STEP:
        steps = [communication / 2**k for k in range(halvings + 1)]
        return [Setting(method, 0.0, h, communication) for h in steps]
    return [Setting(method, tol, 0.0, communication) for tol in tolerances]
