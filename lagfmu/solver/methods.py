"""The menu of integrators behind one interface: `step()`, `t`, `y`, `f`, `h_abs`, `dense_output()`.

dop853, dopri5 and radau5 are SciPy's (Hairer, Norsett & Wanner I, sects. II.5 and II.10; Hairer &
Wanner II, sect. IV.8); rk4 is our own.  Error weights: tol * max(|y_i|, s_i), up to a factor 2 on the
safe side, because SciPy adds the two.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import DOP853, RK45, Radau

from .rk4 import RK4
from .state import Settings
from .system import Vector


class Dop853(DOP853):  # type: ignore[misc]
    """SciPy's, whose error norm squares rates of change: at 1e155 and more it overflows and accepts."""

    def _estimate_error_norm(self, K: Any, h: float, scale: Vector) -> Any:
        return super()._estimate_error_norm(K * h, 1.0, scale)  # type: ignore[misc]


ADAPTIVE: dict[str, Any] = {"dop853": Dop853, "dopri5": RK45, "radau5": Radau}
RELATIVE_FLOOR = 100 * np.finfo(float).eps  # SciPy's own


def stepper(
    settings: Settings,
    fun: Callable[[float, Vector], Vector],
    t: float,
    y: Vector,
    t_bound: float,
    scale: Vector,
    first_step: float | None,
) -> Any:
    """An integrator of y' = fun(t, y) from t to t_bound [s]."""
    span = t_bound - t
    if settings.method == "rk4":
        return RK4(fun, t, y, t_bound, first_step or span)
    rtol = max(settings.tolerance / 2, RELATIVE_FLOOR)
    return ADAPTIVE[settings.method](
        fun,
        t,
        y,
        t_bound,
        rtol=rtol,
        atol=settings.tolerance / 2 * scale,
        first_step=None if first_step is None else min(first_step, span),
        max_step=settings.maximum_step or np.inf,
    )


def last_stage(solver: Any, y0: Vector) -> tuple[Vector, Vector]:
    """Argument and rate of change of dop853's stage at the end of the step from y0."""
    h, k = solver.t - solver.t_old, len(solver.A) - 1
    return y0 + h * (solver.A[k, :k] @ solver.K[:k]), solver.K[k]
