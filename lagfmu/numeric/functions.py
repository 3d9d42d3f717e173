"""Functions that generated code calls: attitudes and vectors that are fixed on bodies, and tables.

Rotation matrices, and vectors that are fixed on bodies (model/attitude.py): of numbers or of arrays.

A matrix is a list of nine elements by rows, a vector one of three.

A tabulated function: cubic polynomials between knots, a straight line (or the period) outside.

    y(x) = c0 + c1 s + c2 s^2 + c3 s^3 ,  s = x - x_k ,  x_k <= x < x_(k+1)

A value or a derivative costs a search among the knots and a polynomial.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import Any

List = list[Any]


def rotation(e: Sequence[Any]) -> List:
    """R of a unit quaternion (Goldstein, Classical Mechanics, eq. 4.47)."""
    w, x, y, z = e
    return [
        *(w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z),
    ]


def turned(R: Sequence[Any], s: Sequence[Any]) -> List:
    """R s."""
    x, y, z = s
    return [R[k] * x + R[k + 1] * y + R[k + 2] * z for k in (0, 3, 6)]


def across(w: Sequence[Any], s: Sequence[Any]) -> List:
    """w x s."""
    return [w[1] * s[2] - w[2] * s[1], w[2] * s[0] - w[0] * s[2], w[0] * s[1] - w[1] * s[0]]


def levers(R: Sequence[Any], s: Sequence[Any]) -> List:
    """R (e_k x s) (9) of each axis k: what a speed about it does."""
    x, y, z = s
    return [
        *(R[k + 2] * y - R[k + 1] * z for k in (0, 3, 6)),
        *(R[k] * z - R[k + 2] * x for k in (0, 3, 6)),
        *(R[k + 1] * x - R[k] * y for k in (0, 3, 6)),
    ]


OPERATIONS = {f.__name__: f for f in (rotation, turned, across, levers)}


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
