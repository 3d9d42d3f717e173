"""Start values onto the constraints, from however far away, by start priority.

Omitted values move first, then those given in the model, then those that the importer set; a priority moves
only if the lower ones cannot reach the constraints alone, and each stage begins at the values as they were
given.  The last one holds higher priorities but gently: beside a value beyond reach that is held firmly, the
others are led to where they move the constraint no more, and no step is left.  With a stage's coordinates
free and the others held, a projection onto G dq = c is

    (W M W) dq = G_free^T mu ,   G_free dq = c

W (diagonal) makes the priorities of a stage so unlike in mass that of two which could move the lower one
does, and the higher one least: the limit of least squares with unequal weights (Golub & Van Loan, Matrix
Computations, sect. 12.1.5).  M couples none of unlike priority: inertia would throw the light one by 1/W;
and none that no row holds: these stay.  Positions by a damped Newton's method (Deuflhard, Newton Methods for
Nonlinear Problems, sect. 3.1), the step halved until |f| falls; velocities, which are linear, at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from .failure import GIVEN, OMITTED, SET, OmittedStartError, StartFailureError, StepFailureError
from .instant import Instant
from .linear import solve
from .nominals import extents, in_speeds, motion_speeds
from .system import NONHOLONOMIC, Sparse, System, Vector
from .thresholds import (
    INITIAL_ARRIVED,
    INITIAL_ITERATIONS,
    INITIAL_NEAR,
    INITIAL_SWEEPS,
    PRIORITY_EASE,
    PRIORITY_GENTLY,
)

EPS = float(np.finfo(float).eps)
HALVINGS = 25  # of a step of Newton's method


@dataclass(frozen=True)
class Stage:
    """Who may move, `free` (nv), and how reluctantly, `weight` (nv).

    `priority` is the highest that may, `of` (nv) are all.
    """

    priority: int
    of: NDArray[np.int_]
    free: NDArray[np.bool_]
    weight: Vector

    def rows(self, system: System, rows: Sequence[int]) -> list[int]:
        """The positions in `rows` of those that hold a free coordinate."""
        held = {k for k, j in zip(*system.jacobian, strict=True) if self.free[j]}
        return [i for i, k in enumerate(rows) if k in held]

    def nearest(self, M: Sparse, G: Sparse, c: Vector, off: float = 0.0) -> Vector:
        """dq in speeds (nv), zero where nothing is free, with G dq = c as nearly as can be; `off` as in
        linear.py."""
        free, weight, M, G = self.free, self.weight, M.tocoo(), G.tocoo()
        i, j = M.row, M.col
        held = np.isin(np.arange(len(free)), G.col[G.data != 0])
        coupled = (i == j) | free[i] & free[j] & (self.of[i] == self.of[j]) & (held[i] == held[j])
        mass = M.data * coupled * weight[j] * weight[i]
        M = csr_array((mass, (i, j)), M.shape)
        G = csr_array((G.data * free[G.col], (G.row, G.col)), G.shape)
        return solve(M, np.zeros(len(free)), G, c, nearest=True, off=off)[0]


def stages(priority: Sequence[int]) -> Iterator[Stage]:
    """Of speeds of these priorities (nv), one after another."""
    of = np.array(priority, dtype=int)
    for highest in (OMITTED, GIVEN, SET):
        if (of == highest).any():
            free = of <= highest
            below = np.where(of == OMITTED, 2 if highest > OMITTED else 0, highest - of)
            yield Stage(highest, of, free, np.where(free, PRIORITY_EASE**below, 1.0))


def gently(priority: Sequence[int]) -> Iterator[Stage]:
    """The last stage, in which all may move: where all are of one priority, that is the one before."""
    of = np.array(priority, dtype=int)
    if len({*priority}) > 1:
        yield Stage(SET, of, np.full(len(of), True), PRIORITY_GENTLY ** (SET - of))


def initial_positions(
    at: Instant,
    q0: Vector,
    v0: Vector,
    rows: Sequence[int],
    size: Vector,
    priority: Sequence[int] | None = None,
) -> Vector:
    """Positions with f = 0 on the rows: of the lowest priority (nq) that reaches them, weighted by M.

    `size` (nq): the coordinates' magnitudes.  Raises StartFailureError naming the constraints that remain
    violated and by how much, or the omitted value that is in the way.
    """
    system = at.system
    fixed = [k for k in rows if system.rows[k].kind != NONHOLONOMIC]
    q0 = at.moved(q0, np.zeros(system.nv))
    if not fixed:
        return q0
    priority = [GIVEN] * system.nq if priority is None else priority
    missed = np.zeros(len(fixed))
    moves = _of_speeds(system, priority)
    for stage in (*stages(moves), *gently(moves)):
        q, missed = _newton(at, q0, v0, fixed, size, stage)
        if not missed.any():
            return q
        if stage.priority == OMITTED and system.kinematics is None:
            _check_omitted(at, q0, v0, fixed, priority)
    violated = ", ".join(
        f"{system.rows[k].name!r} by {a:.3g}" for k, a in zip(fixed, missed, strict=True) if a
    )
    values = ", ".join(f"{n} = {x!r}" for n, x in zip(system.coordinates, q0.tolist(), strict=True))
    raise StartFailureError(
        "the start values cannot be projected onto the constraints: choose some near a configuration that "
        f"satisfies them, or other parameters (missed: {violated}; start values: {values})"
    )


def _of_speeds(system: System, priority: Sequence[int]) -> list[int]:
    """The priority (nv) of displacements in speeds: the highest of the coordinates (nq) that each moves."""
    return [max((priority[j] for j in places), default=OMITTED) for places in system.moved_by]


def _newton(
    at: Instant, q0: Vector, v0: Vector, fixed: list[int], size: Vector, stage: Stage
) -> tuple[Vector, Vector]:
    """Where the free coordinates come to, and what is then missed of f; 0 where that is rounding.

    It has arrived where f is rounding of its terms, which are of the size of q or of a parameter, for angles
    of 1 rad, since their sines and cosines stand beside 1; or, since f may hold larger ones (an input), where
    f falls no more and is rounding of what it was made of at the start (`size`).  While it falls on and on,
    there is nothing to arrive at.
    """
    own = stage.rows(at.system, fixed)
    least = extents(at.system, at.p)
    least[list(at.system.angles)] = 1.0
    q, f = q0, at.residual(q0)[fixed]
    for _ in range(INITIAL_ITERATIONS):
        M, _, G, _, _ = at.equations(q, v0)
        G = G[fixed]
        span = in_speeds(at.system, np.maximum(np.abs(q), least))
        if (np.abs(f) <= 4 * EPS * (np.abs(G) @ span)).all():
            return q, np.zeros(len(fixed))
        reach = np.abs(G) @ in_speeds(at.system, np.maximum(np.abs(q), size))
        unit = np.where(reach > 0, reach, np.where(f != 0, np.abs(f), 1.0))
        rounding = np.abs(f) <= 1e3 * EPS * reach
        left = np.where(rounding, 0.0, f)
        if rounding[own].all() and len(own) < len(fixed):
            return q, left  # what is left is not for these coordinates
        off = float((np.abs(f) / unit)[own].max(initial=0.0))
        try:
            step = stage.nearest(M, G[own], -f[own], off if off < INITIAL_NEAR else 0.0)
        except StepFailureError:
            return q, left
        before = np.linalg.norm((f / unit)[own])
        for damping in 2.0 ** -np.arange(HALVINGS):
            try:
                place = at.moved(q, damping * step)
                there = at.residual(place)[fixed]
            except StepFailureError:
                continue
            if np.linalg.norm((there / unit)[own]) < (1 - 0.1 * damping) * before:
                break
        else:
            return q, left
        q, f = place, there
    return q, f


def _check_omitted(
    at: Instant, q: Vector, v: Vector, fixed: Sequence[int], priority: Sequence[int]
) -> None:
    """Raises OmittedStartError where a row cannot be satisfied because none of the omitted coordinates in it
    has a derivative at their 0, though some have one elsewhere: naming these."""
    system, f = at.system, at.residual(q)
    G, held = at.equations(q, v)[2], dict[int, list[int]]()
    for k, j in zip(*system.jacobian, strict=True):
        if priority[j] == OMITTED:
            held.setdefault(k, []).append(j)
    for row in fixed:
        omitted = held.get(row, [])
        if f[row] == 0 or G[[row]].toarray()[0, omitted].any():
            continue
        names = []
        for j in omitted:
            aside = q.copy()
            aside[j] += np.abs(q).max(initial=0.0) or 1.0
            if at.equations(aside, v)[2][row, j] != 0:
                names.append(system.coordinates[j])
        if names:
            raise OmittedStartError(
                f"{' and '.join(names)} {'has' if len(names) == 1 else 'have'} no start value, and at 0 "
                f"constraint {system.rows[row].name!r}, missed by {f[row]:.3g}, does not depend on "
                f"{'it' if len(names) == 1 else 'them'} to first order: give {' and '.join(names)} a "
                "start value"
            )


def initial_velocities(
    at: Instant,
    q: Vector,
    v0: Vector,
    rows: Sequence[int],
    least: Vector,
    priority: Sequence[int],
) -> Vector:
    """Velocities with G v = nu on the rows, of the lowest priority (nv) that reaches them, weighted by M; as
    near as can be if none does.  `least` (nv) >= 0: speeds below which nothing counts."""
    M, _, G, nu, _ = at.equations(q, v0)
    G, nu, v = G[list(rows)], nu[list(rows)], v0
    for stage in stages(priority):
        v, own = v0, stage.rows(at.system, rows)
        for _ in range(INITIAL_SWEEPS):
            speeds = np.maximum(np.maximum(np.abs(v), np.abs(v0)), least)
            speeds = motion_speeds(at.system, M, speeds)
            slip = nu - G @ v
            missed = np.abs(slip) > INITIAL_ARRIVED * (np.abs(G) @ speeds + np.abs(nu))
            if not missed.any():
                return v
            if not missed[own].any():
                break
            v = v + stage.nearest(M, G[own], slip[own])
    return v
