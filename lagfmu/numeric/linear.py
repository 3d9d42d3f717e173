"""Accelerations and multipliers:  M x = b + G^T lambda ,  G x = c .

LU of the KKT matrix [[M, G^T], [G, 0]], scaled by powers of two (Ruiz 2001) and refined in extended
precision.  Where that is singular, because rows of G depend on each other, the singular value decomposition
of G weighted by M^-1 (Golub & Van Loan, sect. 5.5): of all lambda the one of least norm, in rows scaled so
that g M^-1 g^T = 1; where M is singular too, that of the KKT matrix.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack, qr, solve_triangular

from .failure import MasslessError, StepFailureError
from .system import Matrix, Vector
from .thresholds import (
    CONSISTENT,
    HIDDEN,
    HIDES,
    ON_CONSTRAINTS,
    RANK,
    RANK_LOOSEST,
    RANK_TURNED,
    VANISHES,
)

REGULAR = 1e-14  # reciprocal condition above which a matrix is not singular
DEFINITE = 1e-4  # least pivot of the Cholesky factor of a mass matrix with a unit diagonal
CONTRADICTION = (
    "the constraints contradict each other at this state: dependent rows of G ask for different "
    "accelerations"
)
Solution = tuple[Vector, Vector]


def solve(
    M: Matrix, b: Vector, G: Matrix, c: Vector, nearest: bool = False, off: float = 0.0
) -> Solution:
    """x (n) and lambda (m).

    `nearest`, for a projection: a coordinate with neither mass nor constraint stays, and where dependent rows
    contradict each other c is met as nearly as can be (least squares in rows of comparable units).  `off`:
    how far the state is off the constraints, relative to their size; rows that depend on each other on them
    do so there, and are not asked to agree.

    Raises StepFailureError if a value is not finite, the mass matrix is singular on the constraint surface,
    or dependent constraints contradict each other.
    """
    if not (np.isfinite(M).all() and np.isfinite(b).all()):
        raise StepFailureError("a mass or a force is not finite at this state")
    if not (np.isfinite(G).all() and np.isfinite(c).all()):
        raise StepFailureError("a constraint or its derivative is not finite at this state")
    turned = min(RANK_TURNED * off, RANK_LOOSEST)  # angle between rows that are parallel on them
    agree = not nearest and off <= ON_CONSTRAINTS
    factor = _factor(M)
    scalings = (False, True) if factor is None else (off > 0,)
    found = next(
        (x for s in scalings if (x := _regular(M, b, G, c, turned**2, s)) is not None), None
    )
    if found is None and factor is not None and not _hides(*factor, M, G, max(RANK, turned)):
        found = _weighted(*factor, b, G, c, max(RANK, turned), agree)
    elif found is None:
        found = _least_norm(M, b, G, c, max(RANK, turned), not nearest, agree)
    if not (np.isfinite(found[0]).all() and np.isfinite(found[1]).all()):
        raise StepFailureError("the accelerations overflow at this state")
    return found


def _kkt(M: Matrix, G: Matrix) -> Matrix:
    return np.block([[M, G.T], [G, np.zeros((len(G), len(G)))]])


def _regular(
    M: Matrix, b: Vector, G: Matrix, c: Vector, least: float, from_masses: bool
) -> Solution | None:
    """By LU; None where the reciprocal condition is below `least`, or that of a singular matrix.

    `from_masses`: masses are scaled to 1 first.  Then no unit of mass counts beside the constraints, but
    masses that differ much cost digits.
    """
    n, K = len(b), _kkt(M, G)
    d = np.ones(len(K))
    if from_masses:
        has = M.diagonal() > 0
        d[:n][has] = 2.0 ** -np.round(np.log2(M.diagonal()[has]) / 2)
        row = (np.abs(G) * d[:n]).max(axis=1, initial=0.0)
        d[n:] = 2.0 ** -np.round(np.log2(np.where(row > 0, row, 1.0)))
    for _ in range(20):
        A = K * d * d[:, None]
        largest = np.abs(A).max(axis=1, initial=0.0)
        if not (largest > 0).all():
            return None
        if (np.abs(np.log2(largest)) <= 1).all():
            break
        d /= 2.0 ** np.round(np.log2(largest) / 2)  # powers of two: scaling rounds nothing
    A = K * d * d[:, None]
    lu, pivots, info = lapack.dgetrf(A)
    if info != 0 or lapack.dgecon(lu, np.abs(A).sum(axis=0).max())[0] < max(REGULAR, least):
        return None
    right = np.concatenate([b, c]) * d
    wide, z = A.astype(np.longdouble), np.zeros(len(K), dtype=np.longdouble)
    for _ in range(4):
        z += lapack.dgetrs(lu, pivots, (right - wide @ z).astype(float))[0]
    scaled = (z * d).astype(float)
    return scaled[:n], -scaled[n:]


def _factor(M: Matrix) -> tuple[Matrix, Vector] | None:
    """L and s with diag(s) M diag(s) = L L^T and a unit diagonal; None if M is not safely definite."""
    if not (M.diagonal() > 0).all():
        return None
    s = 1 / np.sqrt(M.diagonal())
    L, info = lapack.dpotrf(M * s * s[:, None], lower=1, clean=1)
    return None if info != 0 or L.diagonal().min(initial=1.0) < DEFINITE else (L, s)


def _weighted(
    L: Matrix, s: Vector, b: Vector, G: Matrix, c: Vector, least: float, agree: bool
) -> Solution:
    """Rows that depend on each other, up to the angle `least`; `agree`: they must not ask for different x."""
    W = solve_triangular(L, (G * s).T, lower=True)
    r = np.sqrt(np.einsum("ij,ij->j", W, W))
    r[r == 0] = 1.0
    U, sigma, Vt = np.linalg.svd(W / r, full_matrices=False)
    kept = sigma > least
    y = solve_triangular(L, b * s, lower=True)
    right = c / r - (W / r).T @ y
    part = (Vt[kept] @ right) / sigma[kept]
    lam = (Vt[kept].T @ (part / sigma[kept])) / r
    missed = np.abs(right - Vt[kept].T @ (Vt[kept] @ right)).max(initial=0.0)
    size = np.abs(c / r).max(initial=0.0) + np.abs(right).max(initial=0.0) + np.abs(y).max()
    if agree and missed > CONSISTENT * size:
        raise StepFailureError(CONTRADICTION)
    x = solve_triangular(L, y + U[:, kept] @ part, lower=True, trans=1) * s
    return x, lam


def _hides(L: Matrix, s: Vector, M: Matrix, G: Matrix, least: float) -> bool:
    """Whether rows seem to depend on each other because light coordinates hide what heavy ones are held by;
    in the KKT matrix they do not."""
    W = solve_triangular(L, (G * s).T, lower=True)
    W = W / np.maximum(np.linalg.norm(W, axis=0), np.finfo(float).tiny)
    parts = np.abs(G) > HIDES * np.abs(G).max(axis=1, initial=0.0)[:, None]
    if not (parts & (np.abs(W.T) < HIDDEN)).any():
        return False
    d, K = _equilibrated(M, G)
    sizes = np.linalg.svd(K * d * d[:, None], compute_uv=False)
    rank = np.linalg.matrix_rank(W, tol=least)
    return int((sizes > least * sizes[0]).sum()) >= len(M) + int(rank)


def _equilibrated(M: Matrix, G: Matrix) -> tuple[Vector, Matrix]:
    """The KKT matrix, and 1 / sqrt of the largest element of each of its rows."""
    K = _kkt(M, G)
    return 1 / np.sqrt(np.maximum(np.abs(K).max(axis=1), np.finfo(float).tiny)), K


def _least_norm(
    M: Matrix, b: Vector, G: Matrix, c: Vector, least: float, held: bool, agree: bool
) -> Solution:
    """Dependent constraints and a massless coordinate together; `held`: each must have an acceleration."""
    n, (d, K) = len(b), _equilibrated(M, G)
    U, sigma, Vt = np.linalg.svd(K * d * d[:, None])
    kept = sigma > least * sigma[0]
    free = np.abs(Vt[~kept, :n]).max(axis=0, initial=0.0) > VANISHES
    if held and free.any():
        raise MasslessError(
            "the mass matrix is singular on the constraint surface: a coordinate has neither mass nor a "
            "constraint that determines its acceleration",
            np.flatnonzero(free).tolist(),
        )
    right = np.concatenate([b, c]) * d
    if agree and np.abs(U[:, ~kept].T @ right).max(initial=0.0) > CONSISTENT * np.abs(right).max():
        raise StepFailureError(CONTRADICTION)
    z = Vt[kept].T @ ((U[:, kept].T @ right) / sigma[kept]) * d
    return z[:n], -z[n:]


def independent(M: Matrix, G: Matrix) -> list[int]:
    """Of the rows of G, as many as are independent."""
    W = G / np.maximum(np.abs(G).max(axis=1, initial=0.0), np.finfo(float).tiny)[:, None]
    W = W / np.sqrt(np.where(M.diagonal() > 0, M.diagonal(), 1.0))
    W = W / np.maximum(np.linalg.norm(W, axis=1), np.finfo(float).tiny)[:, None]
    R, order = qr(W.T, mode="r", pivoting=True)
    return sorted(order[: int((np.abs(R.diagonal()) > RANK).sum())].tolist())
