"""A system at one time with its inputs and parameters: all that the equations need but the motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numeric.failure import StepFailureError, plain
from ..numeric.system import Matrix, System, Vector
from .state import Slide


@dataclass(frozen=True)
class Instant:
    """`system` at time t [s] under the inputs u and the parameters p, its frictions in the modes `slides`."""

    system: System
    t: float
    u: Sequence[float]
    p: Sequence[float]
    slides: tuple[Slide, ...] = ()

    def evaluate(self, q: Vector, v: Vector) -> tuple[Matrix, Vector, Matrix, Vector, Vector]:
        """M (n, n), F (n), G (m, n), nu (m), gamma (m), with arithmetic failures named."""
        return self.system.placed(self.values(q, v))

    def values(self, q: Vector, v: Vector) -> Any:
        """The values of M, F, G, nu, gamma that are not structurally zero, as lists (system.py)."""
        assert self.system.dynamics is not None
        try:
            return self.system.dynamics(self.t, q.tolist(), v.tolist(), self.u, self.p)
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


@dataclass(frozen=True)
class Motion:
    """M, F, G, nu, gamma at a state and the solution for the rows that act (`active`).

    `press`: what frictions do then (friction.py).
    """

    M: Matrix
    F: Vector
    G: Matrix
    nu: Vector
    gamma: Vector
    vdot: Vector
    lam: Vector
    unique: NDArray[np.bool_]
    press: Any = None
