"""Nominals: the size of each coordinate, and the natural rate of the motion, at the start.  No unit counts.

    size   of a coordinate: |q|, or the largest parameter of its dimension in its rows; angle: at most 1 rad
    rate   [1/s] of the motion: the largest sqrt(|vdot| / size), and |v| / size where a row tells the size

The rows of a coordinate are those of the constraints and of M in which it stands.  No parameter counts that
stands in none of them, as in a force alone: it says nothing of where the motion goes.  A coordinate without
any takes the largest of the others of its dimension; if there is none either and it is at 0, it has no size:
its 0 is a mark on a ruler.  There the motion itself tells what is large, V tau and A tau^2 with V and A the
largest speed and acceleration of its dimension: tau is the shortest time in which anything changes, 1/rate of
the coordinates that have a size, or V/A.  Rows and angles alone give that rate (a place may be far away, and
says nothing), and V/A the forces before they cancel.

A displacement of each coordinate tells what holds it: dvdot, were it displaced by its size.  At rest on
springs that balance, what is left of the acceleration is rounding, and sqrt(|dvdot| / size) is the rate.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .failure import StepFailureError
from .instant import Instant
from .linear import responses
from .motion import Motion
from .system import Sparse, System, Vector
from .thresholds import DISPLACED, LOST, LOTS

SIDES = (5**0.5 - 1) / 2  # golden ratio: its multiples fall on both sides in no period
Mask = NDArray[np.bool_]


def extents(system: System, p: Sequence[float]) -> Vector:
    """For each coordinate (nq) the largest magnitude among the parameters of its dimension that stand in
    its rows, those that are numbers in the code with them; angles: 0."""
    own = [max((abs(p[i]) for i in indices), default=0.0) for indices in system.extents]
    return np.array(own, dtype=float).clip(min=system.folded)


def _shared(system: System, p: Sequence[float]) -> Vector:
    """The same; where rows tell none, the largest that other coordinates of its dimension have."""
    own = extents(system, p)
    alike = np.array(system.dimension)
    others = np.array([own[alike == of].max() for of in system.dimension])
    return np.where(own > 0, own, others)


def in_speeds(system: System, size: Vector) -> Vector:
    """Sizes (nq) of coordinates as those of displacements in speeds (nv): of the coordinates of the same
    dimension that a speed moves; of an angle alone 1 rad."""
    if system.kinematics is None:
        return size
    turns = np.array(system.speed_dimension) == system.angle_dimension
    return system.across(size, np.where(turns, 1.0, 0.0))


def sizes(at: Instant, q: Vector, before: Vector) -> Vector:
    """The coordinates' sizes (n); 0 where there is none.  `before` (n): sizes before a projection."""
    system = at.system
    place = np.where(np.abs(q) > LOST * before, np.abs(q), 0.0)
    size = np.maximum(place, _shared(system, at.p))
    angles = list(system.angles)
    if angles:
        size[angles] = min(place[angles].max(), 1.0) or 1.0
    return size


def motion_speeds(system: System, M: Sparse, speed: Vector) -> Vector:
    """What speeds (nv) a whole motion has that moves in each at `speed` (nv) >= 0: the largest of its
    dimension; and, across dimensions, with the kinetic energy of the fastest for the heaviest of its own.

    A coordinate may rest only because others, which move, hold it: what rounding leaves of its speed is
    rounding of theirs.
    """
    mass, own = M.diagonal(), system.speed_dimension
    momentum = (np.sqrt(np.maximum(mass, 0.0)) * speed).max(initial=0.0)
    heaviest, fastest = (_largest_alike(system, x, own) for x in (mass, speed))
    has = heaviest > 0
    fastest[has] = np.maximum(fastest[has], momentum / np.sqrt(heaviest[has]))
    return fastest


def _largest_alike(system: System, x: Vector, dimensions: Sequence[int]) -> Vector:
    """Of each dimension the largest x (nv) among the speeds that have it, times a second; 0 where none."""
    largest: dict[int, float] = {}
    for of, value in zip(system.speed_dimension, x.tolist(), strict=True):
        largest[of] = max(largest.get(of, value), value)
    return np.array([largest.get(of, 0.0) for of in dimensions])


def natural(
    at: Instant, q: Vector, v: Vector, size: Vector, now: Motion, rows: Sequence[int]
) -> tuple[Vector, float, Vector]:
    """Sizes (n) as far as they can be known, from those of places; the natural rate [1/s], 0: not known; what
    speeds (nv) the forces give within what they move, or the natural rate if that is less or there are none.

    `now` is the motion, and `rows` those of the rows that act in it which do not depend on others.
    """
    system, speed, felt, known = at.system, np.abs(v), now.felt, size > 0
    size = size.copy()
    measured = extents(system, at.p) > 0
    measured[list(system.angles)] = True
    span = in_speeds(system, size)
    sure = in_speeds(system, np.where(known & measured, size, 0.0)) > 0
    steady = _rate(system, span, speed, felt, sure)
    slowest = min(_rates(system, span, speed, np.zeros(system.nv), span > 0), default=0.0)
    fastest = 0.0  # of the rates by which sizes are taken from the motion
    alike = (_largest_alike(system, x, system.dimension) for x in (speed, np.abs(now.vdot), felt))
    for j, V, A, pull in zip(range(system.nq), *alike, strict=True):
        if known[j] or system.dimension[j] not in system.speed_dimension:
            continue
        if LOST * pull >= A:
            A = pull  # at rest: what is left is rounding of forces that cancel
        place = size[known & (np.array(system.dimension) == system.dimension[j])].max(initial=0.0)
        moves = LOST * np.sqrt(place * pull) < V  # else it is rounding of what forces give
        rate = max(steady, pull / V if moves else 0.0)
        if rate > 0:
            # one that is hardly pushed moves no farther than the others do
            rate = max(rate, slowest)
            size[j] = max(V / rate, A / rate / rate)
        fastest = max(fastest, rate)
    pull = np.abs(now.vdot)
    if not v.any():
        back = _held(at, q, v, np.where(known, size, 0.0), now, rows)
        if (pull <= LOST * np.maximum(felt, back)).all():  # it rests
            pull = np.where(back > LOST / DISPLACED * felt, back, 0.0)
    told = np.where(sure, speed, 0.0)
    rate = max(_rate(system, span, told, pull, span > 0), fastest)
    rate = rate or _rate(system, span, speed, felt, span > 0)
    span = in_speeds(system, size)
    own = np.sqrt(span * _beyond_rounding(system, now))
    natural = span * rate
    return size, rate, np.where((own > 0) & ((own < natural) | (natural == 0)), own, natural)


def _beyond_rounding(system: System, now: Motion) -> Vector:
    """What is felt (nv), but 0 where it is rounding of what the others feel, compared as sqrt(mass) times
    acceleration: out of the plane in which a mechanism moves no force acts.  What has no mass is compared
    with what has its dimension."""
    mass, felt = now.M.diagonal(), now.felt
    strength = np.sqrt(np.maximum(mass, 0.0)) * felt
    most = np.where(
        mass > 0, strength.max(initial=0.0), _largest_alike(system, felt, system.speed_dimension)
    )
    lost = np.where(mass > 0, strength, felt) <= LOST * most
    return np.where(lost, 0.0, felt)


def _held(
    at: Instant, q: Vector, v: Vector, size: Vector, now: Motion, rows: Sequence[int]
) -> Vector:
    """Accelerations (nv) with which a state comes back if each coordinate is displaced by its size, linearly,
    in at most LOTS lots of those that stand far apart, to sides that the golden ratio chooses, so that none
    cancel; 0 at the edge of what the equations describe.

    A displacement leaves r = (F + G^T lambda - M vdot, gamma - G vdot) of the equations;
    K (dvdot, -dlambda) = r, K the matrix before it.  Frictions push as they did.
    """
    system, place = at.system, np.arange(len(q))
    lines = [*range(system.nv), *(system.nv + k for k in rows)]
    sides = np.where(place // LOTS * SIDES % 1 < 0.5, DISPLACED, -DISPLACED)

    def left(lot: int | None = None) -> Vector:
        there = q + np.where(place % LOTS == lot, sides * size, 0.0)
        M, F, G, _, gamma = at.equations(there, v)
        return np.concatenate([F + G.T @ now.lam - M @ now.vdot, gamma - G @ now.vdot])[lines]

    try:
        before, lots = left(), sorted(set((np.flatnonzero(size) % LOTS).tolist()))
        r = np.array([(left(lot) - before) / DISPLACED for lot in lots]).reshape(-1, len(lines))
        back: Vector = np.abs(responses(now.M, now.G[rows], r.T)).sum(axis=1)
    except StepFailureError:
        return np.zeros(len(now.vdot))
    return back


def _rates(system: System, span: Vector, speed: Vector, pull: Vector, counted: Mask) -> list[float]:
    """speed / span or sqrt(pull / span) (nv) of those that count, where it is not 0; an angle's speed by 1
    rad."""
    unit = np.where(np.array(system.speed_dimension) == system.angle_dimension, 1.0, span)
    rates = np.maximum(speed[counted] / unit[counted], np.sqrt(pull[counted] / span[counted]))
    return [rate for rate in rates.tolist() if rate > 0]


def _rate(system: System, span: Vector, speed: Vector, pull: Vector, counted: Mask) -> float:
    """The largest of them."""
    return max(_rates(system, span, speed, pull, counted), default=0.0)
