"""Accelerations and multipliers:  M x = b + G^T lambda ,  G x = c .

The ladder, each rung for a measured reason:

1. schur.py: Cholesky of the Schur complement, where its condition and that of M allow it;
2. kkt.py: LU of the scaled KKT matrix with refinement, for extreme masses;
3. orthogonal.py: singular value decomposition of the weighted G, for dependent constraints.

Sign: +G^T lambda stands on the side of the forces, as in equations.py.
"""

from __future__ import annotations

import numpy as np

from ..numeric.failure import MasslessError, StepFailureError
from ..numeric.system import Matrix, Vector
from ..numeric.thresholds import ON_CONSTRAINTS
from . import dependent
from .kkt import kkt
from .schur import schur
from .solution import Solution, loose

TAKES_PART = 1e-6  # part of a motion by which a coordinate counts as moving


def solve(
    M: Matrix, b: Vector, G: Matrix, c: Vector, nearest: bool = False, off: float = 0.0
) -> Solution:
    """x (n) and lambda (m) of M x = b + G^T lambda, G x = c.

    `nearest`, for a projection: a coordinate with neither mass nor constraint stays; where dependent rows
    contradict each other, as those of a c do that is nothing but rounding, c is met as nearly as can be
    (least squares in rows of comparable units).  `off`: how far the state is off the constraints, relative to
    their size; rows that depend on each other on them do so there, and are not asked to agree.

    Raises StepFailureError if a value is not finite, the mass matrix is singular on the constraint
    surface, or dependent constraints contradict each other.
    """
    _check_finite(M, b, G, c)
    least = loose(off) ** 2
    found = schur(M, b, G, c, least) or kkt(M, b, G, c, least)
    if found is None:
        if dependent.orthogonal is None:
            raise MasslessError(
                "the mass matrix is singular at this state: a coordinate has no mass", _massless(M)
            )
        found = dependent.orthogonal(M, b, G, c, nearest, off)
    return _finite(found)


def _massless(M: Matrix) -> list[int]:
    """The coordinates that take part in the motion with the least kinetic energy, masses scaled to 1."""
    size = np.sqrt(np.where(M.diagonal() > 0, M.diagonal(), 1.0))
    motion = np.linalg.eigh(M / size / size[:, None])[1][:, 0]
    return [int(j) for j in np.flatnonzero(np.abs(motion) > TAKES_PART)]


def solve_nullspace(M: Matrix, b: Vector, G: Matrix, c: Vector, off: float = 0.0) -> Solution:
    """The same by nullspace.py, where that is safe."""
    _check_finite(M, b, G, c)
    found = dependent.nullspace(M, b, G, c) if len(G) and off <= ON_CONSTRAINTS else None
    return solve(M, b, G, c, off=off) if found is None else _finite(found)


def _check_finite(M: Matrix, b: Vector, G: Matrix, c: Vector) -> None:
    if not (np.isfinite(M).all() and np.isfinite(b).all()):
        raise StepFailureError("a mass or a force is not finite at this state")
    if not (np.isfinite(G).all() and np.isfinite(c).all()):
        raise StepFailureError("a constraint or its derivative is not finite at this state")


def _finite(found: Solution) -> Solution:
    if not (np.isfinite(found.x).all() and np.isfinite(found.lam).all()):
        raise StepFailureError("the accelerations overflow at this state")
    return found
