"""Accelerations and multipliers:  M x = b + G^T lambda ,  G x = c .

Sparse LU of the KKT matrix [[M, G^T], [G, 0]], scaled by powers of two (Ruiz 2001) and refined in extended
precision.  Where that is singular, because rows of G depend on each other, the singular value decomposition
of G weighted by M^-1 (Golub & Van Loan, sect. 5.5): of all lambda the one of least norm, in rows scaled so
that g M^-1 g^T = 1; where M is singular too, that of the KKT matrix.  These are dense.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack, qr, solve_triangular
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, structural_rank
from scipy.sparse.linalg import splu

from .failure import MasslessError, StepFailureError
from .system import Matrix, Sparse, Vector
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
APART = 1e-8  # that of [[1, G^T], [G, 0]] above which each of its rows stands out by far from the others
DEFINITE = 1e-4  # least pivot of the Cholesky factor of a mass matrix with a unit diagonal
CONTRADICTION = (
    "the constraints contradict each other at this state: dependent rows of G ask for different "
    "accelerations"
)
Solution = tuple[Vector, Vector]


def solve(
    M: Sparse, b: Vector, G: Sparse, c: Vector, nearest: bool = False, off: float = 0.0
) -> Solution:
    """x (n) and lambda (m).

    `nearest`, for a projection: a coordinate with neither mass nor constraint stays, and where dependent rows
    contradict each other c is met as nearly as can be (least squares in rows of comparable units).  `off`:
    how far the state is off the constraints, relative to their size; rows that depend on each other on them
    do so there, and are not asked to agree.

    Raises StepFailureError if a value is not finite, the mass matrix is singular on the constraint surface,
    or dependent constraints contradict each other.
    """
    if not (np.isfinite(M.data).all() and np.isfinite(b).all()):
        raise StepFailureError("a mass or a force is not finite at this state")
    if not (np.isfinite(G.data).all() and np.isfinite(c).all()):
        raise StepFailureError("a constraint or its derivative is not finite at this state")
    turned = min(RANK_TURNED * off, RANK_LOOSEST)  # angle between rows that are parallel on them
    agree = not nearest and off <= ON_CONSTRAINTS
    definite = _is_definite(M)
    scalings = (off > 0,) if definite else (False, True)
    factored = next((x for s in scalings if (x := factor(M, G, turned**2, s)) is not None), None)
    if factored is not None:
        found = factored.solve(b, c)
    else:
        found = _singular(M.toarray(), b, G.toarray(), c, definite, not nearest, agree, turned)
    if not (np.isfinite(found[0]).all() and np.isfinite(found[1]).all()):
        raise StepFailureError("the accelerations overflow at this state")
    return found


@dataclass(frozen=True)
class Factored:
    """The KKT matrix, n of whose rows are those of M: `lu` of d K d, and that in extended precision."""

    n: int
    lu: Any
    d: Vector
    wide: Sparse

    def solve(self, b: Vector, c: Vector) -> Solution:
        """x (n) and lambda (m), refined."""
        right = np.concatenate([b, c]) * self.d
        z = np.zeros(len(right), dtype=np.longdouble)
        for _ in range(4):
            z += self.lu.solve((right - self.wide @ z).astype(float))
        scaled = (z * self.d).astype(float)
        return scaled[: self.n], -scaled[self.n :]

    def columns(self, right: Matrix) -> Matrix:
        """x (n, k) of k right-hand sides (n + m, k), as the factors have it."""
        found: Matrix = self.lu.solve(right * self.d[:, None]) * self.d[:, None]
        return found[: self.n]


def factor(M: Sparse, G: Sparse, least: float = 0.0, from_masses: bool = False) -> Factored | None:
    """By LU; None where the reciprocal condition is below `least`, or that of a singular matrix.

    `from_masses`: masses are scaled to 1 first.  Then no unit of mass counts beside the constraints, but
    masses that differ much cost digits.
    """
    n, K = M.shape[0], _kkt(M, G)
    d = np.ones(K.shape[0])
    if from_masses:
        has = M.diagonal() > 0
        d[:n][has] = 2.0 ** -np.round(np.log2(M.diagonal()[has]) / 2)
        row = row_sizes(G.tocoo(), d[:n], np.ones(G.shape[0]))
        d[n:] = 2.0 ** -np.round(np.log2(np.where(row > 0, row, 1.0)))
    for _ in range(20):
        largest = row_sizes(K, d, d)
        if not (largest > 0).all():
            return None
        if (np.abs(np.log2(largest)) <= 1).all():
            break
        d /= 2.0 ** np.round(np.log2(largest) / 2)  # powers of two: scaling rounds nothing
    if not len(d):
        return None
    A = csr_array((K.data * d[K.row] * d[K.col], (K.row, K.col)), K.shape)
    if structural_rank(A) < len(d):  # SuperLU's BLAS would write about it to the terminal
        return None
    try:
        lu = splu(A.tocsc())
    except RuntimeError:
        return None
    if _reciprocal_condition(A, lu) < max(REGULAR, least):
        return None
    return Factored(n, lu, d, A.astype(np.longdouble))


def responses(M: Sparse, G: Sparse, right: Matrix) -> Matrix:
    """x (n, k) for right-hand sides (n + m, k); not refined."""
    n, factored = M.shape[0], factor(M, G) or factor(M, G, 0.0, True)
    if not np.isfinite(right).all():
        raise StepFailureError("a force is not finite near this state")
    if factored is not None:
        return factored.columns(right)
    return np.array([solve(M, r[:n], G, r[n:])[0] for r in right.T]).reshape(-1, n).T


def _kkt(M: Sparse, G: Sparse) -> Sparse:
    n, M, G = M.shape[0], M.tocoo(), G.tocoo()
    row = np.concatenate([M.row, G.row + n, G.col])
    column = np.concatenate([M.col, G.col, G.row + n])
    size = n + G.shape[0]
    return coo_array((np.concatenate([M.data, G.data, G.data]), (row, column)), (size, size))


def row_sizes(A: Sparse, right: Vector, left: Vector) -> Vector:
    """The largest magnitude in each row of diag(left) A diag(right)."""
    found = np.zeros(A.shape[0])
    np.maximum.at(found, A.row, np.abs(A.data) * right[A.col])
    return found * left


def _reciprocal_condition(A: Sparse, lu: Any) -> float:
    """1 / (|A| |A^-1|) of a symmetric matrix in the 1-norm, estimated (Higham 1988, algorithm 4.1); 0 if
    not finite."""
    size = A.shape[0]
    x, found = np.full(size, 1 / size), 0.0
    for _ in range(5):
        y = lu.solve(x)
        found = max(found, float(np.abs(y).sum()))
        z = lu.solve(np.where(y < 0, -1.0, 1.0))
        j = int(np.abs(z).argmax())
        if not abs(z[j]) > z @ x:
            break
        x = np.zeros(size)
        x[j] = 1.0
    ramp = (1 + np.arange(size) / max(size - 1, 1)) * (-1.0) ** np.arange(size)
    found = max(found, 2 * float(np.abs(lu.solve(ramp)).sum()) / (3 * size))
    norm = float(np.abs(A).sum(axis=0).max())
    return 1 / (norm * found) if np.isfinite(found) and found > 0 else 0.0


def blocks(M: Sparse) -> Iterator[tuple[NDArray[np.intp], Matrix]]:
    """The rows that M (n, n), symmetric, couples with each other, and what it has there (k, k), k > 1."""
    count, of = connected_components(M, directed=False)
    order = np.argsort(of, kind="stable")
    for rows in np.split(order, np.cumsum(np.bincount(of, minlength=count))[:-1]):
        if len(rows) > 1:
            yield rows, M[rows][:, rows].toarray()


def _is_definite(M: Sparse) -> bool:
    """Whether M is safely positive definite."""
    if not (M.diagonal() > 0).all():
        return False
    return all(_cholesky(block) is not None for _, block in blocks(M))


def _cholesky(M: Matrix) -> tuple[Matrix, Vector] | None:
    """L and s with diag(s) M diag(s) = L L^T and a unit diagonal; None if M is not safely definite."""
    s = 1 / np.sqrt(M.diagonal())
    L, info = lapack.dpotrf(M * s * s[:, None], lower=1, clean=1)
    return None if info != 0 or L.diagonal().min(initial=1.0) < DEFINITE else (L, s)


def _singular(
    M: Matrix,
    b: Vector,
    G: Matrix,
    c: Vector,
    definite: bool,
    held: bool,
    agree: bool,
    turned: float,
) -> Solution:
    """Where the KKT matrix is; the last two as in the functions that are chosen from."""
    least, root = max(RANK, turned), _cholesky(M) if definite else None
    if root is not None and not _hides(*root, M, G, least):
        return _weighted(*root, b, G, c, least, agree)
    return _least_norm(M, b, G, c, least, held, agree)


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
    """The KKT matrix, and 1 / sqrt of the largest element of each of its rows, in a unit of mass in which
    the largest element of M is then 1."""
    K = np.block([[M, G.T], [G, np.zeros((len(G), len(G)))]])
    d, n = 1 / np.sqrt(np.maximum(np.abs(K).max(axis=1), np.finfo(float).tiny)), len(M)
    most = np.abs(M * d[:n] * d[:n, None]).max(initial=0.0)
    unit = np.sqrt(most) if most > 0 else 1.0
    return np.concatenate([d[:n] / unit, d[n:] * unit]), K


def _least_norm(
    M: Matrix, b: Vector, G: Matrix, c: Vector, least: float, held: bool, agree: bool
) -> Solution:
    """Dependent constraints and a massless coordinate together; `held`: each must have an acceleration."""
    n, (d, K) = len(b), _equilibrated(M, G)
    U, sigma, Vt = np.linalg.svd(K * d * d[:, None])
    kept = sigma > least * sigma[0]
    free = _idle(Vt[~kept, :n])
    if held and free:
        raise MasslessError(
            "the mass matrix is singular on the constraint surface: a coordinate has neither mass nor a "
            "constraint that determines its acceleration",
            free,
        )
    right = np.concatenate([b, c]) * d
    if agree and np.abs(U[:, ~kept].T @ right).max(initial=0.0) > CONSISTENT * np.abs(right).max():
        raise StepFailureError(CONTRADICTION)
    z = Vt[kept].T @ ((U[:, kept].T @ right) / sigma[kept]) * d
    return z[:n], -z[n:]


def massless(M: Matrix, G: Matrix) -> list[int]:
    """The coordinates that can accelerate without mass and without violating a constraint."""
    d, K = _equilibrated(M, G)
    _, sigma, Vt = np.linalg.svd(K * d * d[:, None])
    return _idle(Vt[sigma <= RANK * sigma.max(initial=0.0), : len(M)])


def _idle(null: Matrix) -> list[int]:
    """The coordinates that take part in vectors of the null space of the KKT matrix."""
    found: list[int] = np.flatnonzero(np.abs(null).max(axis=0, initial=0.0) > VANISHES).tolist()
    return found


def independent(M: Sparse, G: Sparse) -> list[int]:
    """Of the rows of G, as many as are independent."""
    mass = np.where(M.diagonal() > 0, M.diagonal(), 1.0)
    largest = row_sizes(G.tocoo(), np.ones(G.shape[1]), np.ones(G.shape[0]))
    W = divided(divided(G, largest), np.ones(G.shape[0]), np.sqrt(mass))
    W = divided(W, norms(W))
    if stand_apart(W):
        return list(range(G.shape[0]))
    R, order = qr(W.toarray().T, mode="r", pivoting=True)
    return sorted(order[: int((np.abs(R.diagonal()) > RANK).sum())].tolist())


def stand_apart(G: Sparse) -> bool:
    """Whether it is certain that rows of unit norm do not depend on each other, nor nearly so: their least
    singular value is above the root of APART."""
    n = G.shape[1]
    places = np.arange(n)
    one = csr_array((np.ones(n), (places, places)), (n, n))
    return G.shape[0] <= n and factor(one, G, APART) is not None


def norms(G: Sparse) -> Vector:
    """The Euclidean norm of each row."""
    found: Vector = np.sqrt((G * G).sum(axis=1))
    return found


def divided(G: Sparse, rows: Vector, columns: Vector | None = None) -> Sparse:
    """Each row divided by a size, 0 or more, and each column."""
    G = G.tocoo()
    data = G.data / np.maximum(rows, np.finfo(float).tiny)[G.row]
    data = data if columns is None else data / columns[G.col]
    return csr_array((data, (G.row, G.col)), G.shape)
