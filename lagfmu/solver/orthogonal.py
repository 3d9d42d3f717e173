"""Dependent constraints: multipliers of least norm, and which are unique.

Singular value decomposition of G weighted by M^-1, a complete orthogonal decomposition: it gives the
accelerations, the multipliers of minimum norm (in rows scaled so that g_k M^-1 g_k^T = 1) and tells which
multipliers are unique: those whose component in the null space of G^T vanishes (Wojtyra 2005).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import lapack

from ..numeric.failure import MasslessError, StepFailureError
from ..numeric.system import Matrix, Vector
from ..numeric.thresholds import CONSISTENT, HIDDEN, HIDES, ON_CONSTRAINTS, RANK, VANISHES
from .schur import half_solve, mass_factor
from .solution import Solution, loose


def orthogonal(M: Matrix, b: Vector, G: Matrix, c: Vector, nearest: bool, off: float) -> Solution:
    """Raises StepFailureError if the constraints contradict each other, or M is singular on their surface."""
    factor = mass_factor(M)
    if factor is None:
        return _least_norm(M, b, G, c, nearest, off)
    L, s = factor
    W = half_solve(L, (G * s).T)
    r = np.sqrt(np.einsum("ij,ij->j", W, W))
    r[r == 0] = 1.0
    W = W / r
    U, sigma, Vt = np.linalg.svd(W, full_matrices=True)
    rank = int((sigma > max(RANK, loose(off))).sum())
    parts = np.abs(G) > HIDES * np.abs(G).max(axis=1, initial=0.0)[:, None]
    if rank < len(c) and (parts & (np.abs(W.T) < HIDDEN)).any():
        # light coordinates hide what the others are held by; in the KKT matrix they do not
        _, _, sizes, _ = _scaled(M, G)
        if (sizes > max(RANK, loose(off)) * sizes[0]).sum() >= len(b) + rank:
            return _least_norm(M, b, G, c, nearest, off)
    null = Vt[rank:]

    def substitute(b: Vector, c: Vector) -> tuple[Vector, Vector, Vector]:
        y = half_solve(L, b * s)
        right = c / r - W.T @ y
        part = (Vt[:rank] @ right) / sigma[:rank]
        lam = (Vt[:rank].T @ (part / sigma[:rank])) / r
        y = y + U[:, :rank] @ part
        return lapack.dtrtrs(L, y, lower=1, trans=1)[0] * s, lam, right

    x, lam, right = substitute(b, c)
    size = np.abs(c / r).max(initial=0) + np.abs(right).max(initial=0)
    size += np.abs(half_solve(L, (b + G.T @ lam) * s)).max(initial=0)
    strict = not nearest and off <= ON_CONSTRAINTS
    if strict and len(null) and np.abs(null @ right).max() > CONSISTENT * size:
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
    unique = (np.abs(null) < VANISHES).all(axis=0) if len(null) else np.ones(len(c), dtype=bool)
    return Solution(x, lam, unique)


def _scaled(M: Matrix, G: Matrix) -> tuple[Vector, Matrix, Vector, Matrix]:
    """1 / sqrt of the largest element of each row of the KKT matrix, and its singular values so scaled."""
    m = len(G)
    K = np.block([[M, G.T], [G, np.zeros((m, m))]])
    d = 1 / np.sqrt(np.maximum(np.abs(K).max(axis=1), np.finfo(float).tiny))
    return d, *np.linalg.svd(K * d * d[:, None])


def _least_norm(M: Matrix, b: Vector, G: Matrix, c: Vector, nearest: bool, off: float) -> Solution:
    """Dependent constraints and a massless coordinate together: the KKT matrix's least norm."""
    n = len(b)
    d, U, sigma, Vt = _scaled(M, G)
    keep = sigma > max(RANK, loose(off)) * sigma[0]
    null = Vt[~keep]
    if not nearest and len(null) and np.abs(null[:, :n]).max() > VANISHES:
        raise MasslessError(
            "the mass matrix is singular on the constraint surface: a coordinate has neither mass "
            "nor a constraint that determines its acceleration",
            np.flatnonzero(np.abs(null[:, :n]).max(axis=0) > VANISHES).tolist(),
        )
    right = np.concatenate([b, c]) * d
    missed = (
        0.0 if nearest or off > ON_CONSTRAINTS else np.abs(U[:, ~keep].T @ right).max(initial=0)
    )
    if missed > CONSISTENT * np.abs(right).max():
        raise StepFailureError("the constraints contradict each other at this state")
    z = Vt[keep].T @ ((U[:, keep].T @ right) / sigma[keep]) * d
    return Solution(z[:n], -z[n:], (np.abs(null[:, n:]) < VANISHES).all(axis=0))
