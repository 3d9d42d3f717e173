"""One state of motion: accelerations, multipliers, and the projection onto the constraints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.linalg import qr

from ..numeric.failure import MasslessError, StepFailureError
from ..numeric.system import NONHOLONOMIC, Matrix, Vector
from ..numeric.thresholds import (
    PROJECTION_ITERATIONS,
    PROJECTION_LINEAR,
    PROJECTION_ROUNDING,
    PROJECTION_SMALL,
    RANK,
)
from . import optional_friction
from .instant import Instant, Motion
from .linear import solve, solve_nullspace
from .solution import Solution
from .straight import solver_of

EPS = float(np.finfo(float).eps)


def motion(
    at: Instant,
    q: Vector,
    v: Vector,
    active: Sequence[int],
    off: float = 0.0,
) -> Motion:
    """Accelerations (n) and multipliers (m; 0 for rows that do not act) at a state, `off` the constraints."""

    if at.slides:
        return optional_friction.motion_with_friction(at, q, v, active, _method(at, off))
    values, rows = at.values(q, v), list(active)
    M, F, G, nu, gamma = at.system.placed(values)
    lam, unique = np.zeros(at.system.m), np.ones(at.system.m, dtype=bool)
    written = solver_of(at.system, rows)
    quick = written(values[0], values[1], values[2], values[4]) if written else None
    if quick is not None:
        lam[rows] = quick[1]
        return Motion(M, F, G, nu, gamma, np.array(quick[0]), lam, unique)
    found = _method(at, off)(M, F, G[rows], gamma[rows])
    lam[rows] = found.lam
    unique[rows] = found.unique
    return Motion(M, F, G, nu, gamma, found.x, lam, unique)


def _method(at: Instant, off: float) -> Callable[[Matrix, Vector, Matrix, Vector], Solution]:
    """The ladder of linear.py, as the formulation has it."""

    def method(M: Matrix, b: Vector, G: Matrix, c: Vector) -> Solution:
        try:
            if at.system.formulation == "nullspace":
                return solve_nullspace(M, b, G, c, off)
            return solve(M, b, G, c, off=off)
        except MasslessError as error:
            raise error.named(at.system.coordinates) from error

    return method


def independent(now: Motion, active: Sequence[int]) -> list[int]:
    """Of the rows that act, as many as are independent at the state, on the constraints, of `now`."""
    rows = list(active)
    if now.unique[rows].all():
        return rows
    G = now.G[rows] / np.maximum(np.abs(now.G[rows]).max(axis=1), np.finfo(float).tiny)[:, None]
    mass = np.sqrt(np.where(now.M.diagonal() > 0, now.M.diagonal(), np.inf))
    W = G / np.where(np.isfinite(mass), mass, 1.0)
    W = W / np.maximum(np.linalg.norm(W, axis=1), np.finfo(float).tiny)[:, None]
    R, order = qr(W.T, mode="r", pivoting=True)
    rank = int((np.abs(R.diagonal()) > RANK).sum())
    return sorted(rows[k] for k in order[:rank])


def distance(
    at: Instant, q: Vector, G: Matrix, active: Sequence[int], offset: Vector, size: Vector
) -> float:
    """The largest |f - offset| of the rows, relative to the terms of G size."""
    fixed = [k for k in active if at.system.rows[k].kind != NONHOLONOMIC]
    reach = np.abs(G[fixed]) @ np.maximum(np.abs(q), size)
    f = np.abs(at.residual(q) - offset)[fixed]
    return float((f / np.where(reach > 0, reach, np.inf)).max(initial=0.0))


def project(
    at: Instant,
    q: Vector,
    v: Vector,
    active: Sequence[int],
    offset: Vector,
    size: Vector,
    dependent: bool = False,
) -> tuple[Vector, Vector]:
    """The nearest state, in the metric of M, with f = offset and G v = nu on the active rows.

    Newton's method on M dq = G^T mu, G dq = -(f - offset) until the residual is at rounding level;
    then one such solve for the velocities (Hairer & Wanner II, sect. VII.2, projection methods).
    Meant for states that are nearly consistent; `initial.py` deals with the others.  `size` (n) are
    the coordinates' magnitudes, which say what rounding is.  Raises StepFailureError naming the
    constraints if Newton's method does not arrive.  `dependent`: rows that act depend on each other, on the
    constraints.
    """
    rows = list(active)
    if at.slides:
        rows = sorted({*rows, *optional_friction.sticking(at, rows)})
    if not rows:
        return q, v
    fixed = [k for k in rows if at.system.rows[k].kind != NONHOLONOMIC]
    values = at.values(q, v)
    _, _, G, nu, _ = at.system.placed(values)
    before = np.inf
    for count in range(PROJECTION_ITERATIONS + 1 if fixed else 0):
        f = (at.residual(q) - offset)[fixed]
        miss, steepness = np.abs(f), np.abs(G[fixed])
        if (miss <= 2 * EPS * (steepness @ np.abs(q))).all():
            break
        reach = steepness @ np.maximum(np.abs(q), size)
        error = np.divide(miss, reach, out=np.full(len(miss), np.inf), where=reach > 0)[
            miss > 0
        ].max()
        if error < EPS**2 or (error > before / 2 and error < PROJECTION_SMALL):
            break  # f vanishes with q, or rounding in f is all that is left
        if count == PROJECTION_ITERATIONS:
            if error < PROJECTION_ROUNDING:
                break  # linear convergence, or terms that are larger than q tells
            worst = [at.system.rows[k].name for k, a in zip(fixed, miss, strict=True) if a > 0]
            slower = (
                not error < PROJECTION_LINEAR * before
            )  # infinite: no coordinate moves a row here
            cause = "the configuration is singular, or nearly so" if slower else ""
            raise StepFailureError(
                f"the step to t = {float(at.t)!r} s cannot be projected onto the constraints "
                f"{', '.join(map(repr, worst))} (missed by {miss.max():.3g}): "
                f"{cause or 'take smaller steps'}"
            )
        before = error
        q = q + _nearest(at, values, fixed, -f, off=error if dependent else 0.0)
        values = at.values(q, v)
        _, _, G, nu, _ = at.system.placed(values)
    return q, v + _nearest(at, values, rows, nu[rows] - G[rows] @ v)


def _nearest(at: Instant, values: Any, rows: Sequence[int], c: Vector, off: float = 0.0) -> Vector:
    """x (n) with G x = c on the rows, the shortest in the metric of M; `values` as of `dynamics`."""
    written = solver_of(at.system, rows)
    if written is not None:
        asked = [0.0] * at.system.m
        for k, x in zip(rows, c.tolist(), strict=True):
            asked[k] = x
        found = written(values[0], [0.0] * at.system.n, values[2], asked)
        if found is not None:
            return np.array(found[0])
    M, _, G, _, _ = at.system.placed(values)
    return solve(M, np.zeros(at.system.n), G[list(rows)], c, nearest=True, off=off).x
