"""LU of the scaled KKT matrix [[M, G^T], [G, 0]] with refinement in extended precision.

Right for extreme mass ratios, and for a coordinate without mass of its own.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from ..numeric.system import Matrix, Vector
from .schur import mass_factor
from .solution import Solution

REGULAR = 1e-14  # reciprocal condition above which the matrix is not singular


def kkt(M: Matrix, b: Vector, G: Matrix, c: Vector, least: float = 0.0) -> Solution | None:
    """None where the matrix is singular to working precision, or its reciprocal condition below `least`.

    Where it is, though it may be the masses alone that are, it is scaled from masses of 1 on: then no unit of
    mass counts beside the constraints, but masses that differ much cost digits.  From masses of 1 on also off
    the constraints, where `least` asks how nearly rows depend on each other.
    """
    if least > 0 and mass_factor(M) is not None:
        return _kkt(M, b, G, c, least, to_masses=True)
    found = _kkt(M, b, G, c, least, to_masses=False)
    if found is None and mass_factor(M) is None:
        found = _kkt(M, b, G, c, least, to_masses=True)
    return found


def _kkt(
    M: Matrix, b: Vector, G: Matrix, c: Vector, least: float, to_masses: bool
) -> Solution | None:
    n, m = len(b), len(c)
    K = np.zeros((n + m, n + m))
    K[:n, :n] = M
    K[:n, n:] = G.T
    K[n:, :n] = G
    d = np.ones(n + m)
    if to_masses:
        mass = M.diagonal() > 0
        d[:n][mass] = 2.0 ** -np.round(np.log2(M.diagonal()[mass]) / 2)
    if to_masses and m:
        row = (np.abs(G) * d[:n]).max(axis=1)
        d[n:] = 2.0 ** -np.round(np.log2(np.where(row > 0, row, 1.0)))
    A = K * d * d[:, None]
    for _ in range(20):  # symmetric equilibration (Ruiz 2001)
        largest = np.abs(A).max(axis=1)
        if not (largest > 0).all():
            return None
        d /= 2.0 ** np.round(np.log2(largest) / 2)  # powers of two: scaling rounds nothing
        A = K * d * d[:, None]
        if (np.abs(np.log2(largest)) <= 1).all():
            break
    lu, pivots, info = lapack.dgetrf(A)
    if info != 0:
        return None
    rcond, _ = lapack.dgecon(lu, np.abs(A).sum(axis=0).max())
    if rcond < max(REGULAR, least):
        return None
    right = np.concatenate([b, c]) * d
    z = lapack.dgetrs(lu, pivots, right)[0]
    wide, exact = A.astype(np.longdouble), z.astype(np.longdouble)
    for _ in range(3):
        rest = (right - wide @ exact).astype(float)
        exact += lapack.dgetrs(lu, pivots, rest)[0]
    z = (exact * d).astype(float)
    return Solution(z[:n], -z[n:], np.ones(m, dtype=bool))
