"""One state of motion: accelerations, multipliers, and the projection onto the constraints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from . import at_friction
from .failure import StepFailureError
from .instant import Instant, Motion
from .linear import solve, solve_nullspace
from .solution import Solution
from .system import NONHOLONOMIC, Vector

EPS = float(np.finfo(float).eps)
ITERATIONS = 10
SMALL = 1e-12  # residual, relative to the constraint's own size, that rounding may leave


def motion(
    at: Instant,
    q: Vector,
    v: Vector,
    active: Sequence[int],
) -> Motion:
    """Accelerations (n) and multipliers (m; 0 for rows that do not act) at a state."""
    method = solve_nullspace if at.system.formulation == "nullspace" else solve
    if at.slides:
        return at_friction.motion_with_friction(at, q, v, active, method)
    M, F, G, nu, gamma = at.evaluate(q, v)
    rows = list(active)
    found: Solution = method(M, F, G[rows], gamma[rows])
    lam = np.zeros(at.system.m)
    lam[rows] = found.lam
    unique = np.ones(at.system.m, dtype=bool)
    unique[rows] = found.unique
    return Motion(M, F, G, nu, gamma, found.x, lam, unique)


def project(
    at: Instant,
    q: Vector,
    v: Vector,
    active: Sequence[int],
    offset: Vector,
    size: Vector,
) -> tuple[Vector, Vector]:
    """The nearest state, in the metric of M, with f = offset and G v = nu on the active rows.

    Newton's method on M dq = G^T mu, G dq = -(f - offset) until the residual is at rounding level;
    then one such solve for the velocities (Hairer & Wanner II, sect. VII.2, projection methods).
    Meant for states that are nearly consistent; `initial.py` deals with the others.  `size` (n) are
    the coordinates' magnitudes, which say what rounding is.  Raises StepFailureError naming the
    constraints if Newton's method does not arrive.
    """
    rows = list(active)
    if at.slides:
        rows = sorted({*rows, *at_friction.sticking(at, rows)})
    if not rows:
        return q, v
    fixed = [k for k in rows if at.system.rows[k].kind != NONHOLONOMIC]
    M, _, G, nu, _ = at.evaluate(q, v)
    before = np.inf
    for count in range(ITERATIONS + 1 if fixed else 0):
        f = (at.residual(q) - offset)[fixed]
        miss, steepness = np.abs(f), np.abs(G[fixed])
        if (miss <= 2 * EPS * (steepness @ np.abs(q))).all():
            break
        error = (miss / (steepness @ np.maximum(np.abs(q), size))).max()
        if error < EPS**2 or (error > before / 2 and error < SMALL):
            break  # f vanishes with q, or rounding in f is all that is left
        if count == ITERATIONS:
            worst = [at.system.rows[k].name for k, a in zip(fixed, miss, strict=True) if a > 0]
            raise StepFailureError(
                f"the step to t = {float(at.t)!r} s cannot be projected onto the constraints "
                f"{', '.join(map(repr, worst))} (missed by {miss.max():.3g}): take smaller steps"
            )
        before = error
        q = q + solve(M, np.zeros(at.system.n), G[fixed], -f, nearest=True).x
        M, _, G, nu, _ = at.evaluate(q, v)
    slip = nu[rows] - G[rows] @ v
    return q, v + solve(M, np.zeros(at.system.n), G[rows], slip, nearest=True).x
