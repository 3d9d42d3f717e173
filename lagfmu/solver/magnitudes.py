"""What is large and what is small in a motion: sizes, natural rate, error scales.  No unit counts.

    size   of a coordinate: |q|, or the largest parameter of its dimension; of angles at most 1 rad
    rate   [1/s] of the motion: the largest |v| / size and sqrt(|vdot| / size)
    scale  below which an error is absolute: |q| and |v| of the start, or what rounding leaves of size,
           and of v what forces make of the rounding of q

A coordinate at 0 of whose dimension there is no parameter has no size: its 0 is a mark on a ruler.
There the motion itself tells what is large, V tau and A tau^2 with V and A the largest speed and
acceleration of its dimension: tau is the shortest time in which anything changes, 1/rate of the
coordinates that have a size, or V/A.  Too small a size is safe, an error is then measured by the
motion reached so far; too large a one hides errors.  Hence parameters and angles alone give that
rate (a place may be far away, and says nothing), and V/A the forces before they cancel.

A displacement of each coordinate in turn tells what holds it: dvdot, were it displaced by its size.  The
rate of small oscillations is omega = sqrt(|dvdot| / size), and rounding of q shakes v by
eps |dvdot| (|q| / size) / omega: on stiff springs that is more than rounding of v itself, and no step
could be small enough to resolve it.  At rest on springs that balance, what is left of the acceleration
is such rounding, and omega is the natural rate.

Without either, as in a free fall from rest, x = a t^2/2 looks the same on every scale, and the only time
is the importer's: tau is MEASURED_PART of the first communication step.  Were the motion a million times
faster than that step, its size would be taken for at most 1e6 times what it is, which the floor of the
scale, below 1e-6, still forgives.  `complete` does this, at the start and once more as a step begins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..numeric.failure import StepFailureError
from ..numeric.system import Matrix, System, Vector
from ..numeric.thresholds import DISPLACED, LOST, MEASURED_PART, SHAKEN, STILL, TOUCH
from .instant import Instant, Motion
from .motion import EPS, independent, motion
from .state import Settings, State

Mask = NDArray[np.bool_]


def extents(system: System, p: Sequence[float]) -> Vector:
    """For each coordinate the largest magnitude among the parameters of its dimension, those that are
    numbers in the code with them; angles: 0."""
    parts = system.extent or ((),) * system.n
    folded = system.folded or (0.0,) * system.n
    return np.array([max((abs(p[i]) for i in part), default=0.0) for part in parts]).clip(
        min=folded
    )


def sizes(system: System, q: Vector, p: Sequence[float], before: Vector) -> Vector:
    """The coordinates' sizes (n); 0 where there is none.  `before` (n): sizes before a projection."""
    place = np.where(np.abs(q) > LOST * before, np.abs(q), 0.0)
    size = np.maximum(place, extents(system, p))
    angles = list(system.angles)
    if angles:
        size[angles] = min(place[angles].max(), 1.0) or 1.0
    return size


def motion_speeds(system: System, M: Matrix, speed: Vector) -> Vector:
    """What speeds (n) a whole motion has that moves each coordinate at `speed` (n) >= 0: the largest of its
    dimension; and, across dimensions, with the kinetic energy of the fastest for the heaviest of its own.

    A coordinate may rest only because others, which move, hold it: what rounding leaves of its speed is
    rounding of theirs.
    """
    mass = M.diagonal()
    momentum = (np.sqrt(np.maximum(mass, 0.0)) * speed).max(initial=0.0)
    shared = np.empty(system.n)
    for j in range(system.n):
        like = list(system.like[j]) if system.like else [j]
        heaviest = mass[like].max()
        shared[j] = speed[like].max()
        if heaviest > 0:
            shared[j] = max(shared[j], momentum / np.sqrt(heaviest))
    return shared


def shared(system: System, scale: Vector, y: Vector) -> Vector:
    """`scale` (2 n), no smaller than the scales and magnitudes in y (2 n) of the coordinates that are alike:
    the steps are the same in whatever frame."""
    alike = system.alike
    if not alike.any():
        return scale
    largest = np.maximum(scale, np.abs(y)).reshape(2, 1, system.n)
    together: Vector = np.maximum(scale, np.where(alike, largest, 0.0).max(axis=2).ravel())
    return together


def is_incomplete(state: State) -> bool:
    """True while a size, or the rate, is not known."""
    return state.rate == 0 or 0.0 in state.size


def complete(at: Instant, settings: Settings, state: State, span: float) -> State:
    """Sizes, rate, scales, gaps as far as they can be known; scales only grow.

    span [s]: of the first step, or 0 while there is none.
    """
    system = at.system
    q, v = np.array(state.q), np.array(state.v)
    now = motion(at, q, v, system.active(state.closed))
    felt = _felt(now)
    known = np.array(state.size)
    size, found = known.copy(), known > 0
    own = np.zeros(system.n)  # rate [1/s] by which a size is taken from the motion
    natural = 0.0
    steady = _rate(system, size, np.abs(v), felt, found & _measured(system, at.p))
    for j in np.flatnonzero(~found):
        like = list(system.like[j]) if system.like else [j]
        speed, pull = np.abs(v[like]).max(), felt[like].max()
        acceleration = np.abs(now.vdot[like]).max()
        if acceleration <= LOST * pull:
            acceleration = pull  # at rest: what is left is rounding of forces that cancel
        own[j] = max(steady, pull / speed if speed > 0 else 0.0)
        if own[j] > 0:  # one that is hardly pushed moves no farther than the others do
            own[j] = max(own[j], _slowest(system, known, np.abs(v)))
        natural = max(natural, own[j])
        if own[j] == 0 and span > 0:
            own[j] = 1 / (MEASURED_PART * span)
        if own[j] > 0:
            size[j] = max(speed / own[j], acceleration / own[j] / own[j])
    back, shaken = _held(at, state, now)
    rate = state.rate
    if rate == 0:
        pull = np.abs(now.vdot)
        if not v.any() and bool((pull <= LOST * np.maximum(felt, back)).all()):  # it rests
            pull = np.where(back > LOST / DISPLACED * felt, back, 0.0)
        rate = max(_rate(system, known, np.abs(v), pull, found), natural)
    rate = rate or _rate(system, size, np.abs(v), felt, found) or (1 / span if span > 0 else 0.0)
    floor = max(1e-8, 10 * EPS / settings.tolerance)
    speed_scale = floor * size * np.where(own > 0, own, rate)
    roundings = min(max(SHAKEN * settings.tolerance, 0.01), 10.0)
    speed_scale = np.maximum(speed_scale, roundings / settings.tolerance * shaken)
    scale = np.maximum(state.scale, np.concatenate([floor * size, speed_scale]))
    gap = np.array(state.gap)
    if not found.all():
        reach = np.abs(now.G) @ np.maximum(np.abs(q), size)
        gap = np.maximum(gap, TOUCH * reach[list(system.contacts)])
    return replace(
        state,
        size=tuple(size.tolist()),
        rate=float(rate),
        scale=tuple(np.where(scale > 0, scale, STILL).tolist()),
        gap=tuple(gap.tolist()),
    )


def _measured(system: System, p: Sequence[float]) -> Mask:
    """True for angles and for coordinates of a dimension that parameters have."""
    has: Mask = extents(system, p) > 0
    has[list(system.angles)] = True
    return has


def _felt(now: Motion) -> Vector:
    """Accelerations (n) before forces cancel: at least what each coordinate's forces give it alone."""
    mass = now.M.diagonal()
    forces = np.abs(now.F) + np.abs(now.G).T @ np.abs(now.lam)
    alone: Vector = forces / np.where(mass > 0, mass, np.inf)
    return np.maximum(np.abs(now.vdot), alone)


def _held(at: Instant, state: State, now: Motion) -> tuple[Vector, Vector]:
    """Accelerations (n) with which a state comes back if each coordinate in turn is displaced by its
    size, linearly; and the speeds (n) by which rounding of the coordinates shakes it.

    Both 0 at the edge of what the equations describe.
    """
    active = independent(now, at.system.active(state.closed))
    size = np.array(state.size)
    back, noise = np.zeros(at.system.n), np.zeros(at.system.n)
    for j in np.flatnonzero(size):
        moved = np.array(state.q)
        moved[j] += DISPLACED * size[j]
        try:
            there = motion(at, moved, np.array(state.v), active)
        except StepFailureError:
            return np.zeros(at.system.n), np.zeros(at.system.n)
        change = np.abs(there.vdot - now.vdot) / DISPLACED
        back += change
        noise += EPS * change * (abs(state.q[j]) / size[j])
    omega = np.sqrt((back[size > 0] / size[size > 0]).max(initial=0.0))
    return back, noise / omega if omega > 0 else noise


def _slowest(system: System, size: Vector, speed: Vector) -> float:
    """The least rate at which a coordinate that has a size moves through it; 0 if none does."""
    rates = [
        _rate(system, size, speed, np.zeros(system.n), np.arange(system.n) == j)
        for j in np.flatnonzero(size > 0)
    ]
    return min((r for r in rates if r > 0), default=0.0)


def _rate(system: System, size: Vector, speed: Vector, pull: Vector, counted: Mask) -> float:
    """The largest speed / size and sqrt(pull / size) of those that count; an angle's speed by 1 rad."""
    unit = size.copy()
    unit[list(system.angles)] = 1.0
    rates = np.maximum(speed[counted] / unit[counted], np.sqrt(pull[counted] / size[counted]))
    return float(rates.max(initial=0.0))
