"""What cannot be closed, in words: which joint misses and by how much, or which motor asks for it.

Given values that cannot be: places and velocities at which the joints close, as near to them as can be,

    minimize  (g(q) - g0)^T m (g(q) - g0)   with   f(q) = 0 ,

m (diagonal) what resists each value: of a length the masses, of an angle the moments of inertia that it
moves.  q = q1 + N y, led back to f = 0, with the movements N that the rows leave at q1; in y by the method of
Broyden, Fletcher, Goldfarb and Shanno (Nocedal & Wright, Numerical Optimization, sect. 6.1), since a value
may be nearest at a limit of its own, where no step changes it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..model.elements import Holonomic
from ..model.model import Model
from .draft import Draft
from .joints import CROSS
from .loads import Motor
from .moving import CLOSED, DENSE, REDUNDANT, Moving
from .rows import Array, Rows, condition

ON_ROWS = 1e-12  # what they may miss on the way, relative to their size
STEEP = 1e-7  # the slope of a minimum, relative
ALIKE = 2  # beginnings that lead as near: no others are tried
CHARTS = 3  # places q1, one after the other


@dataclass(frozen=True)
class Nearest:
    """The values g of `held`, which are to be `asked`, while the `rows` f are 0.

    Of a mechanism with more than DENSE speeds a place from which no value is led nearer.
    """

    moving: Moving
    rows: Sequence[Rows]
    held: Rows
    asked: Array

    def places(self, begun: Sequence[Array]) -> tuple[Array, Array]:
        """Coordinates, and what each row misses: of several beginnings from that which leads nearest, and of
        these with the least movement from the last."""
        moving = self.moving
        found = [self._closed(q) for q in begun]
        if all(missed.max(initial=0.0) > CLOSED for _, missed in found):
            zero = np.zeros(self._count)
            found += [moving.closed(self.rows, zero, q) for q in (begun[0], begun[-1])]
        there = [q for q, missed in found if missed.max(initial=0.0) <= CLOSED]
        if not there:
            return min(found, key=lambda f: float(f[1].max()))
        slid: list[tuple[Array, float]] = []
        for q in sorted(there, key=self._off):
            slid.append(self._slid(q))
            least = min(off for _, off in slid)
            as_near = [q for q, off in slid if off <= least * (1 + CLOSED)]
            if len(as_near) == ALIKE:
                break
        return self._closed(min(as_near, key=lambda q: moving.far(q, begun[-1])))

    def velocities(self, q: Array, v: Array) -> Array:
        """From velocities v at which the rows stay 0, those at which also the rates of the values are as near
        as can be to those that are asked for."""
        m, N = np.sqrt(self._masses(q))[:, None], self._free(q)
        missing = self.asked - self.held.rates(q, v)
        y = np.linalg.lstsq(m * (self.held.slopes(q) @ N), m[:, 0] * missing, rcond=None)[0]
        found: Array = v + N @ y
        return found

    def _slid(self, q: Array) -> tuple[Array, float]:
        """From q on along the rows to where the values are nearest, and how far off these are."""
        from scipy.optimize import minimize  # few mechanisms need it

        off = self._off(q)
        for _ in range(CHARTS):
            at, N = q, self._free(q)
            if N.shape[1] == 0 or off == 0:
                break

            def squared(y: Array, at: Array = at, N: Array = N, off: float = off) -> float:
                there, missed = self._closed(self.moving.moved(at, N @ y))
                return (self._off(there) / off) ** 2 if missed.max(initial=0.0) <= CLOSED else 4.0

            y = minimize(
                squared, np.zeros(N.shape[1]), method="BFGS", jac="3-point", options={"gtol": STEEP}
            ).x
            new, missed = self._closed(self.moving.moved(q, N @ y))
            there = self._off(new)
            if missed.max(initial=0.0) > CLOSED or there >= off * (1 - CLOSED):
                break
            q, off = new, there
        return q, off

    def _closed(self, q: Array) -> tuple[Array, Array]:
        return self.moving.newton(self.rows, np.zeros(self._count), q, ON_ROWS)

    def _free(self, q: Array) -> Array:
        """Movements (n_v, N) that the rows leave, square to each other in the metric of M; the largest is as
        large as the mechanism."""
        moving = self.moving
        if len(moving.weight) > DENSE:
            return np.zeros((len(moving.weight), 0))
        A = moving.slopes(self.rows, q)
        A = A / moving.sizes(A)[:, None] / moving.weight
        _, values, V = np.linalg.svd(A)
        N = V[np.count_nonzero(values > REDUNDANT * values.max(initial=0.0)) :].T
        N = N / moving.weight[:, None]
        largest = float(np.abs(N / moving.scale[:, None]).max(initial=0.0))
        return np.asarray(N / (largest or 1.0))

    def _masses(self, q: Array) -> Array:
        """m: of a length without regard to what turns."""
        a = self.held.slopes(q) / self.moving.weight
        straight = a * self.moving.lengths
        a = np.where(straight.any(axis=1, keepdims=True), straight, a)
        yields = np.einsum("ij,ij->i", a, a)
        return 1 / np.where(yields > 0, yields, 1.0)

    def _off(self, q: Array) -> float:
        """How far the values are from what is asked for [kg^(1/2) m]."""
        missing = self.asked - self.held.values(q)
        return float(np.linalg.norm(np.sqrt(self._masses(q)) * missing))

    @property
    def _count(self) -> int:
        return sum(r.shape[0] for r in self.rows)


PARALLEL = 0.99  # cosine of the axes of a universal joint
HALF = 1e-6  # of a row: met, though not as it is meant


def parallel(closing: Sequence[Holonomic], values: Array) -> Iterator[str]:
    """Universal joints whose axes are parallel where they begin: which way they turn apart nobody says."""
    for c, cosine in zip(closing, values.tolist(), strict=True):
        joint, _, row = c.name.partition(".")
        if row == CROSS and abs(cosine) > PARALLEL:
            apart = math.degrees(math.acos(min(abs(cosine), 1.0)))
            yield (
                f"the axes of universal joint {joint!r} begin {apart:.3g} degrees from parallel, expected "
                "square: choose other axes (axis=, second_axis=), turn a marker, or give a body another "
                "start, as its rpy"
            )


def turned_over(
    moving: Moving, closing: Sequence[Holonomic], values: Array, q: Array
) -> Iterator[str]:
    """Joints whose rows vanish, but at half a turn from where they hold."""
    met = {c.name.partition(".")[0]: True for c in closing}
    for c, value in zip(closing, values.tolist(), strict=True):
        met[c.name.partition(".")[0]] &= abs(value) <= HALF
    for joint in moving.turned_over(q):
        if met[joint]:
            yield (
                f"joint {joint!r} begins turned over by half a turn: the axes of its markers point apart "
                "there: start its bodies nearer to where they point the same way, or turn a marker"
            )


def unfollowed(
    draft: Draft,
    model: Model,
    parts: Sequence[Any],
    moving: Moving,
    closing: Sequence[Holonomic],
    begun: Sequence[Array],
) -> Iterator[str]:
    """Motors that prescribe what the joints, which close without them, cannot follow."""
    motors = {p.name: draft.motion_of(p.joint) for p in parts if isinstance(p, Motor)}
    joints, drives = (
        [c for c in closing if (c.name in motors) == driven] for driven in (False, True)
    )
    if not drives:
        return
    alone, driven = (Rows(model, [condition(model, c) for c in part]) for part in (joints, drives))
    q, missed = Nearest(moving, [alone], driven, np.zeros(len(drives))).places(begun)
    if missed.max(initial=0.0) > CLOSED:
        return
    found = Rows(model, [motors[c.name].values[:2] for c in drives]).values(q)
    for c, off, place in zip(drives, driven.values(q).tolist(), found.tolist(), strict=True):
        of = motors[c.name]
        if abs(off) > CLOSED:
            yield (
                f"motor {c.name!r} prescribes {of.name} = {place - off:.6g} {of.unit}, which the joints "
                f"cannot follow: the nearest that was found is {place:.6g} {of.unit}: begin elsewhere, by "
                "motion= or, of an input, by Motor(..., start=...)"
            )


def left_open(closing: Sequence[Holonomic], values: Array, missed: Array) -> Iterator[str]:
    """Which joints miss, the worst first."""
    names = [c.name for c in closing]
    if not np.isfinite(values).all():
        lost = {n.split(".")[0] for n, x in zip(names, values, strict=True) if not np.isfinite(x)}
        for joint in sorted(lost):
            yield f"joint {joint!r} has no finite value where it begins: start it elsewhere"
        return
    worst: dict[str, tuple[float, float]] = {}
    by_name = dict(zip(names, values.tolist(), strict=True))
    for name, value, miss in zip(names, values.tolist(), missed.tolist(), strict=True):
        joint = name.split(".")[0]
        worst[joint] = max(worst.get(joint, (0.0, 0.0)), (miss, abs(value)))
    for joint, (miss, value) in sorted(worst.items(), key=lambda item: -item[1][0]):
        if f"{joint}.{CROSS}" in by_name and miss > CLOSED:
            off = math.degrees(math.asin(min(abs(by_name[f"{joint}.{CROSS}"]), 1.0)))
            yield (
                f"universal joint {joint!r} cannot be closed: at the nearest that was found its axes miss "
                f"being square by {off:.3g} degrees: turn a marker, or choose other axes"
            )
        elif miss > CLOSED:
            yield (
                f"joint {joint!r} cannot be closed: the nearest that was found misses it by {value:.3g} "
                "(m or rad): correct a length, or give a start nearer to where it closes"
            )
