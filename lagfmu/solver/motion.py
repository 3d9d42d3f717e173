"""One state of motion: accelerations, multipliers, and the projection onto the constraints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import qr

from . import at_friction
from .failure import StepFailureError
from .instant import Instant, Motion
from .linear import solve, solve_nullspace
from .solution import RANK, Solution
from .system import NONHOLONOMIC, Matrix, Vector

EPS = float(np.finfo(float).eps)
ITERATIONS = 10
SMALL = 1e-12  # residual, relative to the constraint's own size, that rounding may leave
ROUNDING = 100 * EPS  # and that is left in peace where Newton's method still gains, but slowly
LINEAR = 0.1  # ratio of successive residuals: Newton's method converges linearly, G loses rank


def motion(
    at: Instant,
    q: Vector,
    v: Vector,
    active: Sequence[int],
    off: float = 0.0,
) -> Motion:
    """Accelerations (n) and multipliers (m; 0 for rows that do not act) at a state, `off` the constraints."""

    def method(M: Matrix, b: Vector, G: Matrix, c: Vector) -> Solution:
        if at.system.formulation == "nullspace":
            return solve_nullspace(M, b, G, c, off)
        return solve(M, b, G, c, off=off)

    if at.slides:
        return at_friction.motion_with_friction(at, q, v, active, method)
    M, F, G, nu, gamma = at.evaluate(q, v)
    rows = list(active)
    found = method(M, F, G[rows], gamma[rows])
    lam = np.zeros(at.system.m)
    lam[rows] = found.lam
    unique = np.ones(at.system.m, dtype=bool)
    unique[rows] = found.unique
    return Motion(M, F, G, nu, gamma, found.x, lam, unique)


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
        rows = sorted({*rows, *at_friction.sticking(at, rows)})
    if not rows:
        return q, v
    fixed = [k for k in rows if at.system.rows[k].kind != NONHOLONOMIC]
    M, _, G, nu, _ = at.evaluate(q, v)
    before, none = np.inf, np.zeros(at.system.n)
    for count in range(ITERATIONS + 1 if fixed else 0):
        f = (at.residual(q) - offset)[fixed]
        miss, steepness = np.abs(f), np.abs(G[fixed])
        if (miss <= 2 * EPS * (steepness @ np.abs(q))).all():
            break
        error = (miss / (steepness @ np.maximum(np.abs(q), size))).max()
        if error < EPS**2 or (error > before / 2 and error < SMALL):
            break  # f vanishes with q, or rounding in f is all that is left
        if count == ITERATIONS:
            if error < ROUNDING:
                break  # linear convergence, or terms that are larger than q tells
            worst = [at.system.rows[k].name for k, a in zip(fixed, miss, strict=True) if a > 0]
            cause = "the configuration is singular, or nearly so" if error > LINEAR * before else ""
            raise StepFailureError(
                f"the step to t = {float(at.t)!r} s cannot be projected onto the constraints "
                f"{', '.join(map(repr, worst))} (missed by {miss.max():.3g}): "
                f"{cause or 'take smaller steps'}"
            )
        before = error
        q = q + solve(M, none, G[fixed], -f, nearest=True, off=error if dependent else 0.0).x
        M, _, G, nu, _ = at.evaluate(q, v)
    slip = nu[rows] - G[rows] @ v
    return q, v + solve(M, np.zeros(at.system.n), G[rows], slip, nearest=True).x
