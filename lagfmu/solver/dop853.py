"""SciPy's DOP853 (Hairer, Norsett & Wanner I, sect. II.10), safe at any rate of change.

Its error norm squares rates of change: at 1e155 and more it overflows, and accepts whatever it sees.
"""

from __future__ import annotations

from typing import Any

from scipy.integrate import DOP853

from .system import Vector


class Dop853(DOP853):  # type: ignore[misc]
    """The method of order 8, with what `stiffness.py` asks for."""

    def _estimate_error_norm(self, K: Any, h: float, scale: Vector) -> Any:
        return super()._estimate_error_norm(K * h, 1.0, scale)  # type: ignore[misc]

    def estimated_error(self, h: float) -> Vector:
        """Of the step of h [s] just taken: estimates of order 5 and 3 make one of order 8 (eq. II.10.17)."""
        return self._estimate_error(self.K, h)  # type: ignore[no-any-return]

    def last_stage(self, y0: Vector) -> tuple[Vector, Vector]:
        """Argument and rate of change of the stage at the end of the step from y0."""
        h, k = self.t - self.t_old, len(self.A) - 1
        return y0 + h * (self.A[k, :k] @ self.K[:k]), self.K[k]
