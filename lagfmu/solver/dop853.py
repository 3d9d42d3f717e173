"""SciPy's DOP853 (Hairer, Norsett & Wanner I, sects. II.4, II.5 and II.10), which costs little more than its
stages and is safe at any rate of change.

    k_s = f(t + c_s h, y + h sum_j a_sj k_j) ,   y1 = y + h sum_s b_s k_s

SciPy's own step evaluates f at y1 as well, which is then projected and evaluated again: here that is done
when dense output, or a further step from y1, asks for it.  SciPy's error norm squares rates of change: at
1e155 and more it overflows, and accepts whatever it sees; here it squares h k.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import DOP853

from ..numeric.system import Vector

SAFETY, LEAST, MOST = 0.9, 0.2, 10.0  # of the step: how near the error may come, and the next one
COUNT = DOP853.n_stages
STAGES = [(s, float(DOP853.C[s]), DOP853.A[s, :s].copy()) for s in range(1, COUNT)]
ERRORS = np.array([DOP853.E5[:COUNT], DOP853.E3[:COUNT]])
EXPONENT = -1 / (DOP853.error_estimator_order + 1)


class Dop853(DOP853):  # type: ignore[misc]
    """The method of order 8, with what `stiffness.py` asks for."""

    def __init__(
        self,
        fun: Callable[[float, Vector], Vector],
        t0: float,
        y0: Vector,
        t_bound: float,
        rtol: float,
        atol: Vector,
        first_step: float | None,
        max_step: float = math.inf,
    ) -> None:
        if first_step is None:  # SciPy chooses one
            chosen = DOP853(fun, t0, y0, t_bound, rtol=rtol, atol=atol, max_step=max_step)
            first_step = float(chosen.h_abs)
        self.fun, self.t, self.y, self.t_bound = fun, t0, y0, t_bound
        self.rtol, self.atol, self.h_abs, self.max_step = rtol, atol, first_step, max_step
        self.n, self.status, self._dense = len(y0), "running", None
        self.t_old: float | None = None
        self.f: Vector | None = None  # where the next step begins, once it is known
        self.K_extended = np.empty((COUNT + 1 + len(DOP853.A_EXTRA), self.n))
        self.K = self.K_extended[: COUNT + 1]

    def step(self) -> str | None:
        """One accepted step, or the reason why there is none."""
        t, y, self._dense = self.t, self.y, None
        self._evaluate_end()
        smallest, rejected = 10 * (math.nextafter(t, math.inf) - t), False
        size = min(max(float(self.h_abs), smallest), self.max_step)
        while True:
            if size < smallest:
                self.status = "failed"
                return str(self.TOO_SMALL_STEP)
            end = min(t + size, self.t_bound)
            size = end - t
            new = self._new(t, y, size)
            error = self._error(size, self.atol + self.rtol * np.maximum(np.abs(y), np.abs(new)))
            if error < 1:
                break
            size *= max(LEAST, SAFETY * error**EXPONENT)  # LEAST if it is not a number
            rejected = True
        self.t_old, self.y_old, self.h_previous = t, y, size
        self.t, self.y, self.f = end, new, None
        factor = min(MOST, SAFETY * error**EXPONENT) if error > 0 else MOST
        self.h_abs = size * (min(1.0, factor) if rejected else factor)
        if end == self.t_bound:
            self.status = "finished"
        return None

    def _evaluate_end(self) -> None:
        if self.f is None:
            self.f = self.fun(self.t, self.y)

    def _new(self, t: float, y: Vector, h: float) -> Vector:
        """The state at the end of a step h from (t, y)."""
        K, fun = self.K, self.fun
        K[0] = self.f
        for s, c, a in STAGES:
            K[s] = fun(t + c * h, y + h * (a @ K[:s]))
        new: Vector = y + h * (DOP853.B @ K[:COUNT])
        return new

    def _error(self, h: float, scale: Vector) -> float:
        fifth, third = (ERRORS @ self.K[:COUNT]) * h / scale
        of_fifth, of_third = float(fifth @ fifth), float(third @ third)
        both = (of_fifth + 0.01 * of_third) * self.n
        return of_fifth / math.sqrt(both) if both != 0 else 0.0

    def dense_output(self) -> Any:
        """The polynomial of degree 7 over the step just taken, which is not yet projected."""
        if self._dense is None:
            self._evaluate_end()
            self.K[COUNT] = self.f
            self._dense = self._dense_output_impl()
        return self._dense

    def estimated_error(self, h: float) -> Vector:
        """Of the step of h [s] just taken: estimates of order 5 and 3 make one of order 8 (eq. II.10.17)."""
        return self._estimate_error(self.K, h)  # type: ignore[no-any-return]

    def last_stage(self, y0: Vector) -> tuple[Vector, Vector]:
        """Argument and rate of change of the stage at the end of the step from y0."""
        h, k = self.h_previous, len(self.A) - 1
        return y0 + h * (self.A[k, :k] @ self.K[:k]), self.K[k]
