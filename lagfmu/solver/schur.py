"""Cholesky of the Schur complement S = G M^-1 G^T (Ascher & Petzold 1998, sect. 10.2).

M and S are scaled to a unit diagonal: fast, but only where the estimated condition of both allows it.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import blas, lapack

from ..numeric.system import Matrix, Vector
from .solution import Solution

TRUSTED = 1e-5  # reciprocal condition above which the Schur complement is used
EXACT = 1e-2  # and above which its solution needs no refinement


def schur(M: Matrix, b: Vector, G: Matrix, c: Vector, least: float = 0.0) -> Solution | None:
    """None where it is not safe, or the reciprocal condition is below `least`."""
    factor = mass_factor(M)
    if factor is None:
        return None
    L, s = factor
    m = len(c)
    rcond = 1.0
    if m:
        W = half_solve(L, (G * s).T)
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
        if rcond < max(TRUSTED, least):
            return None

    def substitute(b: Vector, c: Vector) -> tuple[Vector, Vector]:
        y = half_solve(L, b * s)
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


def mass_factor(M: Matrix) -> tuple[Matrix, Vector] | None:
    """L and s with diag(s) M diag(s) = L L^T and a unit diagonal; None if M is not safely definite."""
    d = M.diagonal()
    if not (d > 0).all():
        return None
    s = 1 / np.sqrt(d)
    L, info = lapack.dpotrf(M * s * s[:, None], lower=1, clean=1)
    if info != 0 or L.diagonal().min() < 1e-4:
        return None
    return L, s


def half_solve(L: Matrix, B: Matrix) -> Matrix:
    """L^-1 B.  For a matrix by BLAS: dtrtrs starts threads even where B is 3 x 2."""
    if B.ndim == 1:
        return np.asarray(lapack.dtrtrs(L, B, lower=1)[0])
    return np.asarray(blas.dtrsm(1.0, L, B, lower=1))
