"""M x = F + G^T lambda ,  G x = gamma :  the one linear problem of constrained mechanics.

With forces F and gamma it gives accelerations and multipliers; with F = 0 and gamma = -f the least
correction of positions, with gamma = nu - G v that of velocities, least in the metric of M (the same
equations are those of Gauss's principle of least constraint, Lanczos, The Variational Principles of
Mechanics, sect. IV.8); with F = 0 and gamma the jump of the contacts' speeds, an impact.

Scaling: x = D y with D = diag(M)^(-1/2), so that y counts in units of the square root of energy, and each
row of G D is divided by its length.  Redundant rows: with the singular value decomposition of what this
gives, U S V^T (Golub & Van Loan, Matrix Computations, sect. 2.4 and 5.5.2), its r largest singular values
say all that the rows say, V_r^T y = S_r^-1 U_r^T gamma: r orthonormal rows.  Their multipliers kappa are
unique, and lambda = U_r S_r^-1 kappa is the solution of least norm for the rows as they are scaled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dposv, dsysvx

from ..numeric.failure import MasslessError
from ..numeric.system import Matrix, Vector

INDEPENDENT = 1e-10  # of the largest singular value: smaller ones are rounding of redundant rows
LIGHT = 1e-15  # of the largest mass: a smaller one hides what others are held by
SLIGHT = 1e-8  # of a row's largest element: one so small is rounding of 0
ALONE = (
    1e-6  # part that a multiplier may have in lambda that push nothing, and still be called unique
)


@dataclass(frozen=True)
class Rows:
    """The rows of a G (m, n) in the scale of an M (n, n): D (n), the rows' lengths (m), and U, S, V^T of the
    scaled rows, of which `rank` singular values count."""

    D: Vector
    length: Vector
    U: Matrix
    S: Vector
    Vt: Matrix
    rank: int

    @property
    def unique(self) -> list[bool]:
        """(m): has the multiplier no part in the null space of G^T (Wojtyra 2005)?"""
        null = self.U[:, self.rank :]
        found: list[bool] = (np.linalg.norm(null, axis=1) <= ALONE).tolist()
        return found

    def leave_one(self, slope: Vector) -> bool:
        """Is slope . lambda, slope (m), the same for all lambda + z with G^T z = 0?"""
        scaled = slope / self.length
        part = np.linalg.norm(scaled @ self.U[:, self.rank :])
        return bool(part <= ALONE * np.linalg.norm(scaled))


def rows_of(M: Matrix, G: Matrix, rank: int | None = None) -> Rows:
    """Scale and decompose; `rank` where it is known: off the constraints redundant rows seem independent."""
    D = _scale(M, G)
    scaled = G * D
    length = np.linalg.norm(scaled, axis=1)
    length[length == 0] = 1.0
    U, S, Vt = np.linalg.svd(scaled / length[:, None])
    if rank is None:
        rank = int(np.sum(INDEPENDENT * S.max(initial=0.0) < S))
    return Rows(D, length, U, S, Vt, rank)


def solve(
    M: Matrix, F: Vector, rows: Rows, gamma: Vector, eliminate: bool = False
) -> tuple[Vector, Vector]:
    """x (n) and lambda (m).  `eliminate`: by the null space of G, else by the symmetric bordered matrix.

    Raises MasslessError if M leaves a motion without mass that the rows allow.
    """
    D, r = rows.D, rows.rank
    MD, FD = M * np.outer(D, D), F * D
    U, S, V, Z = rows.U[:, :r], rows.S[:r], rows.Vt[:r].T, rows.Vt[r:].T
    bound = (U.T @ (gamma / rows.length)) / S
    if eliminate:  # y = V bound + Z z,  Z^T M Z z = Z^T (F - M V bound)
        y = V @ bound
        if Z.shape[1]:
            _, z, failed = dposv(Z.T @ MD @ Z, Z.T @ (FD - MD @ y))
            if failed:
                raise _singular(MD, Z)
            y = y + Z @ z
        kappa = V.T @ (MD @ y - FD)
    else:
        n = len(FD)
        K = np.block([[MD, V], [V.T, np.zeros((r, r))]])
        *_, found, condition, _, _, failed = dsysvx(K, np.concatenate([FD, bound]))
        if failed or not condition > np.finfo(float).eps:
            raise _singular(MD, Z)
        y, kappa = found[:n, 0], -found[n:, 0]
    return D * y, (U @ (kappa / S)) / rows.length


def _scale(M: Matrix, G: Matrix) -> Vector:
    """D (n): diag(M)^(-1/2); without a mass of its own a coordinate counts as the others in its rows, those
    that have one first, and so does one so light that the rows which hold it would seem alike."""
    mass = M.diagonal()
    heavy = mass > LIGHT * mass.max(initial=0.0)
    D = np.where(heavy, 1 / np.sqrt(np.where(heavy, mass, 1.0)), 0.0)
    A = np.abs(G)
    A = np.where(A.max(axis=1, initial=0.0)[:, None] * SLIGHT < A, A, 0.0)
    while (D == 0).any():
        others = (A * D).max(axis=1, initial=0.0)
        per = np.where(A > 0, others[:, None] / np.where(A > 0, A, 1.0), 0.0).max(
            axis=0, initial=0.0
        )
        D = np.where(D == 0, per if (per[D == 0] > 0).any() else 1.0, D)
    return D


def _singular(M: Matrix, Z: Matrix) -> MasslessError:
    """The cause: what moves in the null space Z of the rows, and has no kinetic energy."""
    values, vectors = np.linalg.eigh(Z.T @ M @ Z)
    idle = np.abs(Z @ vectors[:, 0])
    what = "is singular" if values[0] > -ALONE else "is not positive"
    return MasslessError(
        f"the mass matrix {what} for a motion that the constraints allow",
        np.flatnonzero(idle > 0.1 * idle.max()).tolist(),
    )
