"""Coulomb friction in given modes: the rows that stick act, those that slip push against the slip.

    sticks   G_t v = nu_t ,  |lambda_t| <= mu_s N
    slips    lambda_t = -mu_k N s/|s| ,  s = G_t v - nu_t      (Pfeiffer & Glocker 1996, ch. 5)

With N = sign (load + c lambda) of the same instant the equations of sliding are

    M vdot = F - sum_f mu_f N_f d_f + G^T lambda ,  G vdot = gamma ,   d_f = G_t^T s/|s| .

They are linear: with (x0, lambda0) for F alone and (x_f, lambda_f) for d_f alone, which the ladder of
linear.py gives, lambda = lambda0 - sum_f mu_f N_f lambda_f and

    (1 + A) N = sign (load + c lambda0) ,   A_fg = sign_f mu_g c_f lambda_g .

1 + A is the matrix G_n M^-1 (G_n^T - sign mu G_t^T s/|s|) of the sliding problem over G_n M^-1 G_n^T.
Where it is not positive there is no acceleration or there are several (Painleve 1895; Genot & Brogliato
1999): that is refused by name.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..numeric.failure import StepFailureError
from ..numeric.system import Matrix, System, Vector
from .instant import Instant, Motion
from .painleve import check_opened, check_solvable
from .share import best_share
from .solution import Solution
from .state import Slide

Method = Callable[[Matrix, Vector, Matrix, Vector], Solution]


@dataclass(frozen=True)
class Press:
    """What frictions do at an instant, one entry a friction.

    normal [N]: the normal force, with its sign while it slips (at least 0 in the right mode), its
    magnitude while it sticks; `static` the coefficient; `slip` [m/s] the slip velocity (two entries, the
    second 0 for one row); `tangential` [N] likewise the multipliers; `loaded`: something presses;
    `reserve`: mu_s N - |lambda_t| over their sum, of the best share of redundant multipliers.
    """

    normal: Vector
    static: Vector
    slip: Matrix
    tangential: Matrix
    loaded: NDArray[np.bool_]
    reserve: Vector


@dataclass(frozen=True)
class Law:
    """The coefficients of all frictions at a state; C (frictions, m) takes lambda to N - load."""

    static: Vector
    kinetic: Vector
    load: Vector
    C: Matrix


def law(at: Instant, q: Vector, v: Vector) -> Law:
    """Raises StepFailureError if a coefficient is negative, or kinetic above static."""
    system = at.system
    assert system.coulomb is not None
    static, kinetic, load, normal = system.coulomb(at.t, q.tolist(), v.tolist(), at.u, at.p)
    C = np.zeros((len(system.frictions), system.m))
    values = iter(normal)
    for i, friction in enumerate(system.frictions):
        for k in friction.normal:
            C[i, k] = next(values)
        if not 0 <= kinetic[i] <= static[i] < np.inf:
            raise StepFailureError(
                f"friction {friction.name!r} has the coefficients static = {static[i]!r} and kinetic = "
                f"{kinetic[i]!r} at t = {float(at.t)!r} s, expected 0 <= kinetic <= static"
            )
    return Law(np.array(static, float), np.array(kinetic, float), np.array(load, float), C)


def loaded(system: System, active: Collection[int]) -> list[bool]:
    """Whether something presses: the rows in `active` act."""
    return [not f.gated or any(k in active for k in f.normal) for f in system.frictions]


def sticking(at: Instant, active: Collection[int]) -> list[int]:
    """The rows that act by friction beside those in `active`."""
    on = loaded(at.system, active)
    return [
        k
        for f, slide, presses in zip(at.system.frictions, at.slides, on, strict=True)
        if presses and slide.sticks
        for k in f.rows
    ]


def slip_velocity(system: System, G: Matrix, v: Vector, nu: Vector) -> Matrix:
    """s = G_t v - nu_t [m/s] of each friction, (frictions, 2)."""
    s = np.zeros((len(system.frictions), 2))
    for i, f in enumerate(system.frictions):
        rows = list(f.rows)
        s[i, : len(rows)] = G[rows] @ v - nu[rows]
    return s


def heading(slide: Slide, s: Vector) -> Vector:
    """The unit vector of the slip velocity s; on beyond a stop it goes on as before, so that the
    equations of a flow stay smooth there."""
    e = np.array(slide.direction)
    length = np.hypot(s[0], s[1])
    if not length > slide.noise or (s[1] == 0 and e[1] == 0) or s @ e < 0:
        return e
    return np.asarray(s / length)


def motion_with_friction(
    at: Instant,
    q: Vector,
    v: Vector,
    active: Sequence[int],
    method: Method,
) -> Motion:
    """Accelerations and multipliers at a state: contacts and constraints `active`, frictions as in
    at.slides.  Raises StepFailureError where the sliding problem is not safely solvable."""
    system = at.system
    M, F, G, nu, gamma = at.evaluate(q, v)
    now = law(at, q, v)
    on = np.array(loaded(system, active))
    rows = sorted({*active, *sticking(at, active)})
    base = method(M, F, G[rows], gamma[rows])
    x, lam, unique = base.x, np.zeros(system.m), np.ones(system.m, dtype=bool)
    lam[rows], unique[rows] = base.lam, base.unique
    slip = slip_velocity(system, G, v, nu)
    sign = np.array([s.sign for s in at.slides])
    sliding = [i for i, s in enumerate(at.slides) if on[i] and not s.sticks]
    normal = np.zeros(len(at.slides))
    if sliding:
        towards = {i: heading(at.slides[i], slip[i]) for i in sliding}
        answers, pushed = [], []
        for i in sliding:
            mine = list(system.frictions[i].rows)
            found = method(M, G[mine].T @ towards[i][: len(mine)], G[rows], np.zeros(len(rows)))
            wide = np.zeros(system.m)
            wide[rows] = found.lam
            answers.append(found.x)
            pushed.append(wide)
        mu = now.kinetic[sliding]
        A = sign[sliding, None] * (now.C[sliding] @ np.array(pushed).T) * mu
        check_solvable(at, sliding, A)
        N = np.linalg.solve(
            np.eye(len(sliding)) + A, sign[sliding] * (now.load[sliding] + now.C[sliding] @ lam)
        )
        x = x - (mu * N) @ np.array(answers)
        lam = lam - (mu * N) @ np.array(pushed)
        normal[sliding] = N
        share = np.array(pushed).T * mu  # of the multipliers to a unit normal force

        def unit(k: int) -> Vector:
            """Multipliers to a unit acceleration of the row k, of those in `rows`."""
            wide = np.zeros(system.m)
            along = np.array([float(r == k) for r in rows])
            wide[rows] = method(M, np.zeros(system.n), G[rows], along).lam
            return wide

        check_opened(
            at, sliding, rows, unique, A, share, sign[sliding, None] * now.C[sliding], unit
        )
        for i, strength in zip(sliding, mu * N, strict=True):
            mine = list(system.frictions[i].rows)
            lam[mine] = -strength * towards[i][: len(mine)]
    reserve = np.zeros(len(at.slides))
    stuck = [i for i, s in enumerate(at.slides) if on[i] and s.sticks]
    if stuck:
        best = lam
        touched = {
            k for i in stuck for k in (*system.frictions[i].rows, *system.frictions[i].normal)
        }
        if not all(unique[k] for k in touched):
            lam, best = best_share(system, G, rows, lam, now.C, now.load, now.static, stuck)
        for i in stuck:
            normal[i] = abs(now.load[i] + now.C[i] @ lam)
            held = now.static[i] * abs(now.load[i] + now.C[i] @ best)
            force = math.hypot(*best[list(system.frictions[i].rows)])
            reserve[i] = (held - force) / (held + force) if held + force > 0 else 0.0
    tangential = np.zeros((len(at.slides), 2))
    for i, f in enumerate(system.frictions):
        tangential[i, : len(f.rows)] = lam[list(f.rows)]
    press = Press(normal, now.static, slip, tangential, on, reserve)
    return Motion(M, F, G, nu, gamma, x, lam, unique, press)
