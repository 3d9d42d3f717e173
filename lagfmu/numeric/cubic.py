"""A tabulated function: cubic polynomials between knots, a straight line (or the period) outside.

    y(x) = c0 + c1 s + c2 s^2 + c3 s^3 ,  s = x - x_k ,  x_k <= x < x_(k+1)

A value or a derivative costs a search among the knots and a polynomial.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence


class Cubic:
    """`knots` (n) ascend; row k of `coefficients` (n, 4) holds from knot k, the last one beyond it."""

    def __init__(
        self, knots: Sequence[float], coefficients: Sequence[Sequence[float]], periodic: bool
    ) -> None:
        self.knots, self.coefficients = tuple(knots), tuple(map(tuple, coefficients))
        self.periodic = periodic

    def __call__(self, x: float, order: int = 0) -> float:
        """The value, or the derivative of that order (up to 3)."""
        first, last = self.knots[0], self.knots[-1]
        if self.periodic:
            x -= (last - first) * math.floor((x - first) / (last - first))
        k = max(bisect_right(self.knots, x) - 1, 0)
        s = x - self.knots[k]
        c0, c1, c2, c3 = self.coefficients[k]
        if s < 0:
            c2 = c3 = 0.0
        if order == 0:
            return c0 + s * (c1 + s * (c2 + s * c3))
        if order == 1:
            return c1 + s * (2 * c2 + s * 3 * c3)
        return 2 * c2 + s * 6 * c3 if order == 2 else 6 * c3
