"""Start values onto the constraints, from anywhere, by precedence.

Positions by a damped Newton's method (Deuflhard, Newton Methods for Nonlinear Problems, sect. 3.1), the step
halved until |f| falls; velocities, which are linear, at once.  Each stage of precedence.py begins at the
start values as they were given.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..numeric.failure import OmittedStartError, StartFailureError, StepFailureError
from ..numeric.start_priority import GIVEN, OMITTED
from ..numeric.system import NONHOLONOMIC, Vector
from ..numeric.thresholds import INITIAL_ARRIVED, INITIAL_ITERATIONS, INITIAL_NEAR, INITIAL_SWEEPS
from .instant import Instant
from .magnitudes import extents, motion_speeds
from .motion import EPS
from .precedence import Stage, singular_omissions, stages


def project_from_afar(
    at: Instant,
    q0: Vector,
    v0: Vector,
    rows: Sequence[int],
    size: Vector,
    rank: Sequence[int] | None = None,
) -> Vector:
    """Positions with f = 0 on the rows: of the lowest rank (n) that reaches them, weighted by M.

    Raises StartFailureError naming the constraints that remain violated and by how much, or the omitted
    value that is in the way.
    """
    fixed = [k for k in rows if at.system.rows[k].kind != NONHOLONOMIC]
    if not fixed:
        return q0
    rank = [GIVEN] * at.system.n if rank is None else rank
    missed = np.zeros(len(fixed))
    for stage in stages(rank):
        q, missed = _newton(at, q0, v0, fixed, size, stage)
        if not missed.any():
            return q
        if stage.rank == OMITTED:
            _check_omissions(at, q0, v0, fixed, rank)
    violated = ", ".join(
        f"{at.system.rows[k].name!r} by {a:.3g}" for k, a in zip(fixed, missed, strict=True) if a
    )
    values = ", ".join(
        f"{n} = {x!r}" for n, x in zip(at.system.coordinates, q0.tolist(), strict=True)
    )
    raise StartFailureError(
        f"the start values {values} cannot be projected onto the constraints (missed: {violated}): "
        "choose start values near a configuration that satisfies them, or other parameters"
    )


def _newton(
    at: Instant, q0: Vector, v0: Vector, fixed: list[int], size: Vector, stage: Stage
) -> tuple[Vector, Vector]:
    """Where the free coordinates come to, and what is then missed of f; 0 where that is rounding.

    It has arrived where f is rounding of its terms, which are of the size of q or of a parameter; or,
    since f may hold larger ones (an input), where f falls no more and is rounding of what it was made
    of at the start (`size`).  While it falls on and on, there is nothing to arrive at.
    """
    q = q0
    own = [fixed.index(k) for k in stage.rows(at.system, fixed)]
    least = extents(at.system, at.p)
    M, _, G, _, _ = at.evaluate(q, v0)
    f = at.residual(q)[fixed]
    allowed = np.zeros(len(fixed))
    for _ in range(INITIAL_ITERATIONS):
        allowed = 4 * EPS * (np.abs(G[fixed]) @ np.maximum(np.abs(q), least))
        if (np.abs(f) <= allowed).all():
            return q, np.zeros(len(fixed))
        unit = np.abs(G[fixed]) @ np.maximum(np.abs(q), size)
        unit = np.where(unit > 0, unit, np.where(f != 0, np.abs(f), 1.0))
        allowed = 1e3 * EPS * (np.abs(G[fixed]) @ np.maximum(np.abs(q), size))
        if (np.abs(f[own]) <= allowed[own]).all() and len(own) < len(fixed):
            break  # what is left is not for these coordinates
        try:
            off = float(
                (np.abs(f[own]) / np.where(unit[own] > 0, unit[own], np.inf)).max(initial=0.0)
            )
            off = off if off < INITIAL_NEAR else 0.0
            step = stage.nearest(M, G[fixed][own], -f[own], off)
        except StepFailureError:
            break
        for damping in 2.0 ** -np.arange(25):
            trial = q + damping * step
            try:
                f_trial = at.residual(trial)[fixed]
            except StepFailureError:
                continue
            falls = np.linalg.norm((f_trial / unit)[own]), np.linalg.norm((f / unit)[own])
            if falls[0] < (1 - 0.1 * damping) * falls[1]:
                break
        else:
            break
        q, f = trial, f_trial
        M, _, G, _, _ = at.evaluate(q, v0)
        allowed = 4 * EPS * (np.abs(G[fixed]) @ np.maximum(np.abs(q), least))
    return q, np.where(np.abs(f) <= allowed, 0.0, f)


def _check_omissions(
    at: Instant, q0: Vector, v0: Vector, fixed: list[int], rank: Sequence[int]
) -> None:
    """Raises OmittedStartError where an omitted value's 0 is singular, naming it."""
    f = at.residual(q0)
    for k in fixed:
        names = singular_omissions(at, q0, v0, k, rank) if f[k] != 0 else []
        if names:
            raise OmittedStartError(
                f"{' and '.join(names)} {'has' if len(names) == 1 else 'have'} no start value, and at 0 "
                f"constraint {at.system.rows[k].name!r}, missed by {f[k]:.3g}, does not depend on "
                f"{'it' if len(names) == 1 else 'them'} to first order: give "
                f"{' and '.join(names)} a start value"
            )


def velocities_from_afar(
    at: Instant,
    q: Vector,
    v0: Vector,
    rows: Sequence[int],
    rank: Sequence[int] | None,
    least: Vector,
) -> Vector:
    """Velocities with G v = nu on the rows, of the lowest rank (n) that reaches them, weighted by M; as near
    as can be if none does.  `least` (n) >= 0: speeds below which nothing counts.
    """
    system, rows = at.system, list(rows)
    M, _, G, nu, _ = at.evaluate(q, v0)
    v = v0
    for stage in stages([GIVEN] * system.n if rank is None else rank) if rows else ():
        v, own = v0, stage.rows(system, rows)
        for _ in range(INITIAL_SWEEPS):
            speeds = motion_speeds(system, M, np.maximum(np.maximum(np.abs(v), np.abs(v0)), least))
            slip = nu - G @ v
            missed = np.abs(slip) > INITIAL_ARRIVED * (np.abs(G) @ speeds + np.abs(nu))
            if not missed[rows].any():
                return v
            if not missed[own].any():
                break
            v = v + stage.nearest(M, G[own], slip[own])
    return v
