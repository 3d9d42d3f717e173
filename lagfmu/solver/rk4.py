"""The classical Runge-Kutta method of order 4 (Hairer, Norsett & Wanner I, Table II.1.2).

y1 = y0 + h/6 (k1 + 2 k2 + 2 k3 + k4) at a fixed step: a constant cost a step, for real time.
It has the shape of SciPy's steppers, so that `advance.py` drives all methods alike.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from ..numeric.system import Vector


class RK4:
    """Fixed steps that divide [t0, t_bound] evenly: h' = H / ceil(H / h)."""

    def __init__(
        self,
        fun: Callable[[float, Vector], Vector],
        t0: float,
        y0: Vector,
        t_bound: float,
        step: float,
    ) -> None:
        self.fun, self.t, self.y, self.t_bound = fun, t0, y0, t_bound
        span = t_bound - t0
        self.count = max(1, math.ceil(span / step * (1 - 1e-12)))
        self.start, self.taken = t0, 0
        self.h_abs = span / self.count
        self.f = fun(t0, y0)
        self.status = "running"
        self.t_old: float | None = None

    def step(self) -> None:
        """One step; `t`, `y`, `f` move on."""
        self.taken += 1
        last = self.taken == self.count
        end = self.t_bound if last else self.start + self.taken * self.h_abs
        h, t, y = end - self.t, self.t, self.y
        k1 = self.f
        k2 = self.fun(t + h / 2, y + h / 2 * k1)
        k3 = self.fun(t + h / 2, y + h / 2 * k2)
        k4 = self.fun(end, y + h * k3)
        self.f_old, self.y_old, self.t_old = k1, y, t
        self.t, self.y = end, y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        self.f = self.fun(end, self.y)
        self.error = h / 6 * (k4 - self.f)  # against the method of order 3 with f(y1) for k4
        self.status = "finished" if last else "running"

    def dense_output(self) -> Callable[[float], Any]:
        """Cubic Hermite interpolation over the step just taken."""
        assert self.t_old is not None
        t0, h = self.t_old, self.t - self.t_old
        y0, y1, f0, f1 = self.y_old, self.y, self.f_old, self.f

        def at(t: float) -> Vector:
            x = (t - t0) / h
            slope = (1 - x) * h * f0 - x * h * f1 - (1 - 2 * x) * (y1 - y0)
            return (1 - x) * y0 + x * y1 + x * (1 - x) * slope

        return at
