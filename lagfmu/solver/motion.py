"""One state of motion: accelerations, multipliers, and the projection onto the constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .failure import StepFailureError
from .linear import Solution, solve, solve_nullspace
from .system import NONHOLONOMIC, Matrix, System, Vector

EPS = float(np.finfo(float).eps)
ITERATIONS = 10
SMALL = 1e-9  # residual, relative to the constraint's own size, that rounding may leave


@dataclass(frozen=True)
class Motion:
    """M, F, G, nu, gamma at a state and the solution for the rows that act (`active`)."""

    M: Matrix
    F: Vector
    G: Matrix
    nu: Vector
    gamma: Vector
    vdot: Vector
    lam: Vector
    unique: NDArray[np.bool_]


def motion(
    system: System,
    t: float,
    q: Vector,
    v: Vector,
    u: Sequence[float],
    p: Sequence[float],
    active: Sequence[int],
) -> Motion:
    """Accelerations (n) and multipliers (m; 0 for rows that do not act) at a state."""
    M, F, G, nu, gamma = evaluate(system, t, q, v, u, p)
    rows = list(active)
    method = solve_nullspace if system.formulation == "nullspace" else solve
    found: Solution = method(M, F, G[rows], gamma[rows])
    lam = np.zeros(system.m)
    lam[rows] = found.lam
    unique = np.ones(system.m, dtype=bool)
    unique[rows] = found.unique
    return Motion(M, F, G, nu, gamma, found.x, lam, unique)


def evaluate(
    system: System, t: float, q: Vector, v: Vector, u: Sequence[float], p: Sequence[float]
) -> tuple[Matrix, Vector, Matrix, Vector, Vector]:
    """`System.assemble`, with arithmetic failures named."""
    try:
        return system.assemble(t, q, v, u, p)
    except (ArithmeticError, ValueError) as error:
        raise StepFailureError(
            f"the equations cannot be evaluated at t = {float(t)!r} s ({error})"
        ) from error


def residual(system: System, t: float, q: Vector, u: Sequence[float], p: Sequence[float]) -> Vector:
    """f (m): how far each position constraint is missed; 0 for nonholonomic rows."""
    try:
        return np.array(system.residual(t, q.tolist(), u, p), dtype=float)
    except (ArithmeticError, ValueError) as error:
        raise StepFailureError(
            f"the constraints cannot be evaluated at t = {float(t)!r} s ({error})"
        ) from error


def project(
    system: System,
    t: float,
    q: Vector,
    v: Vector,
    u: Sequence[float],
    p: Sequence[float],
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
    if not rows:
        return q, v
    fixed = [k for k in rows if system.rows[k].kind != NONHOLONOMIC]
    M, _, G, nu, _ = evaluate(system, t, q, v, u, p)
    before = np.inf
    for count in range(ITERATIONS + 1 if fixed else 0):
        f = (residual(system, t, q, u, p) - offset)[fixed]
        miss, steepness = np.abs(f), np.abs(G[fixed])
        if (miss <= 2 * EPS * (steepness @ np.abs(q))).all():
            break
        error = (miss / (steepness @ np.maximum(np.abs(q), size))).max()
        if error < EPS**2 or (error > before / 2 and error < SMALL):
            break  # f vanishes with q, or rounding in f is all that is left
        if count == ITERATIONS:
            worst = [system.rows[k].name for k, a in zip(fixed, miss, strict=True) if a > 0]
            raise StepFailureError(
                f"the step to t = {float(t)!r} s cannot be projected onto the constraints "
                f"{', '.join(map(repr, worst))} (missed by {miss.max():.3g}): take smaller steps"
            )
        before = error
        q = q + solve(M, np.zeros(system.n), G[fixed], -f).x
        M, _, G, nu, _ = evaluate(system, t, q, v, u, p)
    slip = nu[rows] - G[rows] @ v
    return q, v + solve(M, np.zeros(system.n), G[rows], slip).x
