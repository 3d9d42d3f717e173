"""All integrators behind one interface, SciPy's: `step()`, `t`, `y`, `f`, `h_abs`, `dense_output()`.

Error weights: tol * max(|y_i|, s_i), up to a factor 2 on the safe side, because SciPy adds the two.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..numeric.system import Matrix, Vector
from .integrators import INTEGRATORS
from .state import Settings

RELATIVE_FLOOR = 100 * np.finfo(float).eps  # SciPy's own


def tolerance_of(settings: Settings) -> float:
    """Error of a step, relative to its scale, that the method's own estimate may show.

    radau5's estimate is of order 3, what it delivers of order 5: 0.1 tol^(2/3), as in the authors' code
    (Hairer & Wanner II, sect. IV.8) and in the native target.
    """
    tolerance = settings.tolerance
    return 0.1 * tolerance ** (2 / 3) if settings.method == "radau5" else tolerance


def share(integrator: Any, settings: Settings, scale: Vector) -> None:
    """The scale (2 n) of errors in the step to come; a fixed step has none."""
    if hasattr(integrator, "atol"):
        integrator.atol = tolerance_of(settings) / 2 * scale


def stepper(
    settings: Settings,
    slope: tuple[Callable[[float, Vector], Vector], Callable[[float, Vector], Matrix]],
    t: float,
    y: Vector,
    t_bound: float,
    scale: Vector,
    first_step: float | None,
) -> Any:
    """An integrator of y' = f(t, y) from t to t_bound [s]; `slope` is f and df/dy."""
    span, (fun, jacobian) = t_bound - t, slope
    more = {"jac": jacobian} if settings.method == "radau5" else {}
    if settings.method == "rk4":
        return INTEGRATORS["rk4"](fun, t, y, t_bound, first_step or span)
    return INTEGRATORS[settings.method](
        fun,
        t,
        y,
        t_bound,
        rtol=max(tolerance_of(settings) / 2, RELATIVE_FLOOR),
        atol=tolerance_of(settings) / 2 * scale,
        first_step=None if first_step is None else min(first_step, span),
        max_step=settings.maximum_step or np.inf,
        **more,
    )
