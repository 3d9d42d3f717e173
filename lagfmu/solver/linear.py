"""Accelerations and multipliers:  M x = b + G^T lambda ,  G x = c .

The ladder, each rung for a measured reason:

1. Cholesky of the Schur complement S = G M^-1 G^T (Ascher & Petzold 1998, sect. 10.2), with M and S
   scaled to a unit diagonal: fast, but only where the estimated condition of both allows it;
2. LU of the scaled KKT matrix with refinement: right for extreme mass ratios and for a coordinate
   without mass of its own;
3. singular value decomposition of G weighted by M^-1, a complete orthogonal decomposition: where the
   constraints are dependent it gives the accelerations, the multipliers of minimum norm (in rows
   scaled so that g_k M^-1 g_k^T = 1) and tells which multipliers are unique: those whose component in
   the null space of G^T vanishes (Wojtyra 2005).

Sign: +G^T lambda stands on the side of the forces, as in equations.py.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, lapack

from .failure import StepFailureError
from .system import Matrix, Vector

TRUSTED = 1e-5  # reciprocal condition above which the Schur complement is used
EXACT = 1e-2  # and above which its solution needs no refinement
RANK = 1e-12  # singular values below this, relative to rows of unit norm, count as zero
CONSISTENT = 1e-7  # a dependent row may miss its right-hand side by this, relative to its terms


@dataclass(frozen=True)
class Solution:
    """x (n), lambda (m), and for each multiplier whether it is unique."""

    x: Vector
    lam: Vector
    unique: NDArray[np.bool_]


def solve(M: Matrix, b: Vector, G: Matrix, c: Vector, nearest: bool = False) -> Solution:
    """x (n) and lambda (m) of M x = b + G^T lambda, G x = c.

    `nearest`, for a projection: where dependent rows contradict each other, as those of a c do that is
    nothing but rounding, c is met as nearly as can be (least squares in rows of comparable units).

    Raises StepFailureError if a value is not finite, the mass matrix is singular on the constraint
    surface, or dependent constraints contradict each other.
    """
    _check_finite(M, b, G, c)
    found = _schur(M, b, G, c) or _kkt(M, b, G, c)
    found = found or _orthogonal(M, b, G, c, nearest)
    if not (np.isfinite(found.x).all() and np.isfinite(found.lam).all()):
        raise StepFailureError("the accelerations overflow at this state")
    return found


def _check_finite(M: Matrix, b: Vector, G: Matrix, c: Vector) -> None:
    if not (np.isfinite(M).all() and np.isfinite(b).all()):
        raise StepFailureError("a mass or a force is not finite at this state")
    if not (np.isfinite(G).all() and np.isfinite(c).all()):
        raise StepFailureError("a constraint or its derivative is not finite at this state")


def solve_nullspace(M: Matrix, b: Vector, G: Matrix, c: Vector) -> Solution:
    """The same with lambda eliminated: Z^T (M x - b) = 0 and G x = c, where G Z = 0.

    Z is orthonormal in the metric of M (an unweighted basis loses digits at extreme mass ratios).
    lambda is recovered afterwards from G^T lambda = M x - b.
    """
    _check_finite(M, b, G, c)
    factor = _mass_factor(M)
    if factor is None or not len(G):
        return solve(M, b, G, c)
    L, s = factor
    W = _half_solve(L, (G * s).T)
    r = np.sqrt(np.einsum("ij,ij->j", W, W))
    if not (r > 0).all():
        return solve(M, b, G, c)
    Q, R = np.linalg.qr(W / r, mode="complete")
    m = len(c)
    diagonal = np.abs(np.diagonal(R))
    if len(b) < m or diagonal.min() < np.sqrt(RANK):
        return solve(M, b, G, c)
    y = _half_solve(L, b * s)
    Z = Q[:, m:]
    R = R[:m]
    particular = lapack.dtrtrs(R, c / r, trans=1)[0]
    z = Q[:, :m] @ particular + Z @ (Z.T @ y)
    lam = lapack.dtrtrs(R, Q[:, :m].T @ (z - y))[0] / r
    x = lapack.dtrtrs(L, z, lower=1, trans=1)[0] * s
    if not (np.isfinite(x).all() and np.isfinite(lam).all()):
        raise StepFailureError("the accelerations overflow at this state")
    return Solution(x, lam, np.ones(m, dtype=bool))


def _mass_factor(M: Matrix) -> tuple[Matrix, Vector] | None:
    """L and s with diag(s) M diag(s) = L L^T and a unit diagonal; None if M is not safely definite."""
    d = M.diagonal()
    if not (d > 0).all():
        return None
    s = 1 / np.sqrt(d)
    L, info = lapack.dpotrf(M * s * s[:, None], lower=1, clean=1)
    if info != 0 or L.diagonal().min() < 1e-4:
        return None
    return L, s


def _half_solve(L: Matrix, B: Matrix) -> Matrix:
    """L^-1 B.  For a matrix by BLAS: dtrtrs starts threads even where B is 3 x 2."""
    if B.ndim == 1:
        return np.asarray(lapack.dtrtrs(L, B, lower=1)[0])
    return np.asarray(blas.dtrsm(1.0, L, B, lower=1))


def _schur(M: Matrix, b: Vector, G: Matrix, c: Vector) -> Solution | None:
    factor = _mass_factor(M)
    if factor is None:
        return None
    L, s = factor
    m = len(c)
    rcond = 1.0
    if m:
        W = _half_solve(L, (G * s).T)
        r = np.sqrt(np.einsum("ij,ij->j", W, W))
        if not (r > 0).all():
            return None
        W = W / r
    if m > 1:
        S = W.T @ W
        C, info = lapack.dpotrf(S, lower=1)
        if info != 0:
            return None
        rcond, info = lapack.dpocon(C, np.abs(S).sum(axis=0).max(), uplo="L")
        if rcond < TRUSTED:
            return None

    def substitute(b: Vector, c: Vector) -> tuple[Vector, Vector]:
        y = _half_solve(L, b * s)
        lam = np.zeros(m)
        if m:
            scaled = c / r - W.T @ y
            if m > 1:
                scaled = lapack.dpotrs(C, scaled, lower=1)[0]
            y = y + W @ scaled
            lam = scaled / r
        return lapack.dtrtrs(L, y, lower=1, trans=1)[0] * s, lam

    x, lam = substitute(b, c)
    if rcond < EXACT:  # one refinement
        dx, dlam = substitute(b + G.T @ lam - M @ x, c - G @ x)
        x, lam = x + dx, lam + dlam
    return Solution(x, lam, np.ones(m, dtype=bool))


def _kkt(M: Matrix, b: Vector, G: Matrix, c: Vector) -> Solution | None:
    """LU of [[M, G^T], [G, 0]] in scaled rows and columns, with refinement in extended precision."""
    n, m = len(b), len(c)
    K = np.zeros((n + m, n + m))
    K[:n, :n] = M
    K[:n, n:] = G.T
    K[n:, :n] = G
    d = np.ones(n + m)
    A = K.copy()
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
    if rcond < 1e-14:
        return None
    right = np.concatenate([b, c]) * d
    z = lapack.dgetrs(lu, pivots, right)[0]
    wide, exact = A.astype(np.longdouble), z.astype(np.longdouble)
    for _ in range(3):
        rest = (right - wide @ exact).astype(float)
        exact += lapack.dgetrs(lu, pivots, rest)[0]
    z = (exact * d).astype(float)
    return Solution(z[:n], -z[n:], np.ones(m, dtype=bool))


def _orthogonal(M: Matrix, b: Vector, G: Matrix, c: Vector, nearest: bool) -> Solution:
    factor = _mass_factor(M)
    if factor is None:
        return _least_norm(M, b, G, c, nearest)
    L, s = factor
    W = _half_solve(L, (G * s).T)
    r = np.sqrt(np.einsum("ij,ij->j", W, W))
    r[r == 0] = 1.0
    W = W / r
    U, sigma, Vt = np.linalg.svd(W, full_matrices=True)
    rank = int((sigma > RANK).sum())
    null = Vt[rank:]

    def substitute(b: Vector, c: Vector) -> tuple[Vector, Vector, Vector]:
        y = _half_solve(L, b * s)
        right = c / r - W.T @ y
        part = (Vt[:rank] @ right) / sigma[:rank]
        lam = (Vt[:rank].T @ (part / sigma[:rank])) / r
        y = y + U[:, :rank] @ part
        return lapack.dtrtrs(L, y, lower=1, trans=1)[0] * s, lam, right

    x, lam, right = substitute(b, c)
    size = np.abs(c / r).max(initial=0) + np.abs(right).max(initial=0)
    size += np.abs(_half_solve(L, (b + G.T @ lam) * s)).max(initial=0)
    if not nearest and len(null) and np.abs(null @ right).max() > CONSISTENT * size:
        raise StepFailureError(
            "the constraints contradict each other at this state: dependent rows of G ask for "
            "different accelerations"
        )
    Mw, Gw, xw, lamw = (a.astype(np.longdouble) for a in (M, G, x, lam))
    for _ in range(
        3
    ):  # refinement in extended precision: rows that are nearly parallel lose digits
        rest = (b + Gw.T @ lamw - Mw @ xw).astype(float), (c - Gw @ xw).astype(float)
        dx, dlam, _ = substitute(*rest)
        xw, lamw = xw + dx, lamw + dlam
    x, lam = xw.astype(float), lamw.astype(float)
    unique = (np.abs(null) < 1e-8).all(axis=0) if len(null) else np.ones(len(c), dtype=bool)
    return Solution(x, lam, unique)


def _least_norm(M: Matrix, b: Vector, G: Matrix, c: Vector, nearest: bool) -> Solution:
    """Dependent constraints and a massless coordinate together: the KKT matrix's least norm."""
    n, m = len(b), len(c)
    K = np.block([[M, G.T], [G, np.zeros((m, m))]])
    d = 1 / np.sqrt(np.maximum(np.abs(K).max(axis=1), np.finfo(float).tiny))
    U, sigma, Vt = np.linalg.svd(K * d * d[:, None])
    keep = sigma > RANK * sigma[0]
    null = Vt[~keep]
    if len(null) and np.abs(null[:, :n]).max() > 1e-8:
        raise StepFailureError(
            "the mass matrix is singular on the constraint surface: a coordinate has neither mass "
            "nor a constraint that determines its acceleration"
        )
    right = np.concatenate([b, c]) * d
    missed = 0.0 if nearest else np.abs(U[:, ~keep].T @ right).max(initial=0)
    if missed > CONSISTENT * np.abs(right).max():
        raise StepFailureError("the constraints contradict each other at this state")
    z = Vt[keep].T @ ((U[:, keep].T @ right) / sigma[keep]) * d
    return Solution(z[:n], -z[n:], (np.abs(null[:, n:]) < 1e-8).all(axis=0))
