"""lambda eliminated: Z^T (M x - b) = 0 and G x = c, where G Z = 0.

Z is orthonormal in the metric of M (an unweighted basis loses digits at extreme mass ratios).  lambda is
recovered afterwards from G^T lambda = M x - b.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from ..numeric.system import Matrix, Vector
from ..numeric.thresholds import RANK
from .schur import half_solve, mass_factor
from .solution import Solution


def nullspace(M: Matrix, b: Vector, G: Matrix, c: Vector) -> Solution | None:
    """None where M is not safely definite or the rows, at least one, are not safely independent."""
    factor = mass_factor(M)
    if factor is None or not len(G):
        return None
    L, s = factor
    W = half_solve(L, (G * s).T)
    r = np.sqrt(np.einsum("ij,ij->j", W, W))
    if not (r > 0).all():
        return None
    Q, R = np.linalg.qr(W / r, mode="complete")
    m = len(c)
    diagonal = np.abs(np.diagonal(R))
    if len(b) < m or diagonal.min() < np.sqrt(RANK):
        return None
    y = half_solve(L, b * s)
    Z = Q[:, m:]
    R = R[:m]
    particular = lapack.dtrtrs(R, c / r, trans=1)[0]
    z = Q[:, :m] @ particular + Z @ (Z.T @ y)
    lam = lapack.dtrtrs(R, Q[:, :m].T @ (z - y))[0] / r
    x = lapack.dtrtrs(L, z, lower=1, trans=1)[0] * s
    return Solution(x, lam, np.ones(m, dtype=bool))
