"""A system at one time with its inputs and parameters: all that the equations need but the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .failure import StepFailureError, plain
from .system import Matrix, System, Vector


@dataclass(frozen=True)
class Instant:
    """`system` at time t [s] under the inputs u and the parameters p."""

    system: System
    t: float
    u: Sequence[float]
    p: Sequence[float]

    def evaluate(self, q: Vector, v: Vector) -> tuple[Matrix, Vector, Matrix, Vector, Vector]:
        """M (n, n), F (n), G (m, n), nu (m), gamma (m), with arithmetic failures named."""
        try:
            return self.system.assemble(self.t, q, v, self.u, self.p)
        except (ArithmeticError, ValueError) as error:
            raise StepFailureError(
                f"the equations cannot be evaluated at t = {float(self.t)!r} s ({plain(error)})"
            ) from error

    def residual(self, q: Vector) -> Vector:
        """f (m): how far each position constraint is missed; 0 for nonholonomic rows."""
        assert self.system.residual is not None
        try:
            f = self.system.residual(self.t, q.tolist(), self.u, self.p)
        except (ArithmeticError, ValueError) as error:
            raise StepFailureError(
                f"the constraints cannot be evaluated at t = {float(self.t)!r} s ({plain(error)})"
            ) from error
        return np.array(f, dtype=float)
