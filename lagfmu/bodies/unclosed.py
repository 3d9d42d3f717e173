"""What cannot be closed, in words: which joint misses and by how much, or which motor asks for it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..model.elements import Holonomic
from ..model.model import Model
from .branches import CLOSED
from .draft import Draft
from .joints import CROSS
from .loads import Motor
from .moving import Moving
from .nearest import Nearest
from .rows import Array, Rows, condition

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
