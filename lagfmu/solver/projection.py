"""Back onto f(q, t) = 0 and G v = nu by the least correction in the metric of M.

    M w = G^T mu ,  G w = -f ,  dq = B w    repeated (Newton);    M dv = G^T mu ,  G dv = nu - G v

(Hairer, Lubich & Wanner, Geometric Numerical Integration, sect. IV.4; Hairer & Wanner, Solving Ordinary
Differential Equations II, sect. VII.2.)  It is done after every accepted step, which leaves the constraints
by its local error alone, so that one or two iterations suffice.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..numeric.failure import StepFailureError
from ..numeric.system import Vector
from .equations import Motion, Terms
from .linear import rows_of, solve

ITERATIONS = 20
CONVERGED = 1e-9  # of a coordinate's size: the correction after one so small is one of rounding
MISSED = 1e-6  # of the terms of f: what is left by more cannot be reached


def project_positions(
    motion: Motion,
    t: float,
    q: Vector,
    v: Vector,
    rows: Sequence[int],
    span: Vector,
    rank: int | None = None,
) -> Vector:
    """q (nq), displacements in speeds being of the size `span` (nv), on f = 0 of the holonomic ones of
    `rows`, `rank` of which are independent.

    Raises StepFailureError if that is not reached.
    """
    tied = motion.holonomic(rows)
    if not tied:
        return motion.moved(t, q, np.zeros(len(v)))
    for _ in range(ITERATIONS):
        terms = motion.terms(t, q, v).of(tied)
        decomposed = rows_of(terms.M, terms.G, rank)
        f = motion.residual(t, q)[tied]
        w, _ = solve(terms.M, np.zeros(len(v)), decomposed, -f)
        q = motion.moved(t, q, w)
        reach = np.maximum(motion.system.across(np.abs(q), span), span)
        if (np.abs(w) <= CONVERGED * reach).all():
            _check_reached(motion, t, q, tied, terms, reach)
            return q
    names = ", ".join(repr(motion.system.rows[k].name) for k in tied)
    raise StepFailureError(f"the constraints {names} cannot be held at t = {t!r} s")


def project_velocities(terms: Terms, v: Vector) -> Vector:
    """v (nv) on G v = nu of the rows in `terms`."""
    if not len(terms.G):
        return v
    dv, _ = solve(terms.M, np.zeros(len(v)), rows_of(terms.M, terms.G), terms.nu - terms.G @ v)
    moved: Vector = v + dv
    return moved


def _check_reached(
    motion: Motion, t: float, q: Vector, tied: Sequence[int], terms: Terms, reach: Vector
) -> None:
    """Of rows that contradict each other one stays missed, however small the correction."""
    f = np.abs(motion.residual(t, q)[list(tied)])
    missed = f > MISSED * (np.abs(terms.G) @ reach)
    if missed.any():
        names = ", ".join(
            repr(motion.system.rows[k].name) for k, out in zip(tied, missed, strict=True) if out
        )
        raise StepFailureError(f"the constraints contradict each other at t = {t!r} s: {names}")
