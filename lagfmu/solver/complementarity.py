"""0 <= z  _|_  w = A z + b >= 0  for a symmetric positive semidefinite A: linear complementarity.

These are the conditions of the quadratic program  min z^T A z / 2 + b^T z, z >= 0  (Cottle, Pang & Stone,
The Linear Complementarity Problem, 1992, sect. 1.2), solved by the dual active set method (Goldfarb &
Idnani, Math. Programming 27 (1983) 1): the most violated w joins the set that is held at zero, and those
whose z would turn negative leave it.  The set stays independent, so dependent rows do no harm; w is
unique, whatever the order of the rows.
"""

from __future__ import annotations

import numpy as np

from ..numeric.system import Matrix, Vector
from ..numeric.thresholds import LCP_DEPENDENT, LCP_ZERO


def complementary(A: Matrix, b: Vector) -> tuple[Vector, Vector] | None:
    """z and w (k), rows that count as zero set to 0; None if there is no solution."""
    d = np.sqrt(np.maximum(A.diagonal(), 0.0))
    d[d == 0] = 1.0
    A, b = A / d / d[:, None], b / d
    floor = LCP_ZERO * np.abs(b).max(initial=0.0)
    z = np.zeros(len(b))
    held: list[int] = []
    for _ in range(50 * (len(b) + 1)):
        w = A @ z + b
        w[held] = 0.0
        j = int(w.argmin()) if len(w) else 0
        if not len(w) or w[j] >= -floor:
            return z / d, np.where(np.abs(w) <= floor, 0.0, w) * d
        if not _join(A, b, z, held, j):
            return None
    return None


def _join(A: Matrix, b: Vector, z: Vector, held: list[int], j: int) -> bool:
    """Raises z_j until w_j = 0, w staying 0 on the set; False if that cannot be."""
    while True:
        r = np.linalg.solve(A[np.ix_(held, held)], A[held, j]) if held else np.zeros(0)
        stands_out = float(A[j, j] - A[j, held] @ r)
        full = -float(A[j] @ z + b[j]) / stands_out if stands_out > LCP_DEPENDENT else np.inf
        ways = [z[i] / x if x > LCP_DEPENDENT else np.inf for i, x in zip(held, r, strict=True)]
        way = min(ways, default=np.inf)
        step = min(way, full)
        if not np.isfinite(step):
            return False
        z[held] -= step * r
        z[j] += step
        if full <= way:
            held.append(j)
            return True
        z[held.pop(int(np.argmin(ways)))] = 0.0
