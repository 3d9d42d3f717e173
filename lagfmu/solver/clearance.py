"""Can an indicator have left its range between two samples?

Its rate f' = G v - nu is evaluated in interval arithmetic (interval.py) for the boxes of t, q, v and u
between the samples: with l <= f' <= h,

    f(t) >= max(f_a + l (t - a), f_b - h (b - t)) ,

whose lowest point is where the two lines meet (Piyavskii 1972).  It rises to the true minimum with the
square of b - a.  The boxes hold the dense output at both ends and in the middle and as much more as that
deviates from a straight line: the motion is smooth over a step, which f need not be.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from ..numeric.interval import Interval, of
from ..numeric.system import Vector
from ..numeric.thresholds import SEARCH_COARSE, SEARCH_FINE
from .flow import Flow
from .indicators import ranges

CLEAR, BRACKETS, UNKNOWN = "clear", "brackets", "unknown"  # what is known between two samples


def between(
    flow: Flow, dense: Any, a: float, b: float, at_a: Vector, at_b: Vector, step: float
) -> str:
    """CLEAR: nothing leaves its range; BRACKETS: something has left it at b, and once; else UNKNOWN."""
    found, rates, bounded = CLEAR, None, len(flow.system.contacts) + len(flow.system.floors)
    limits = ranges(flow)
    for r, f_a, f_b in zip(limits, at_a.tolist(), at_b.tolist(), strict=True):
        if r.inside(f_a) >= -r.slack > r.inside(f_b):
            found = BRACKETS
    for k, r in enumerate(limits[:bounded]):
        if k < len(flow.state.closed) and flow.state.closed[k]:
            continue
        if r.inside(float(at_a[k])) < -r.slack:
            continue
        if rates is None:
            rates = _rates(flow, dense, a, b)
        (low, high), f_a, f_b = rates[k], float(at_a[k]), float(at_b[k])
        if math.isnan(low):
            if b - a > SEARCH_COARSE * step:
                return UNKNOWN
        elif r.inside(f_b) < -r.slack:
            if b - a > SEARCH_FINE * step and low < 0 < high:
                return UNKNOWN
        elif (
            r.low > -math.inf and _lowest(f_a - r.low, f_b - r.low, low, high, b - a) < -r.slack
        ) or (
            r.high < math.inf and _lowest(r.high - f_a, r.high - f_b, -high, -low, b - a) < -r.slack
        ):
            return UNKNOWN
    return found


def _lowest(f_a: float, f_b: float, low: float, high: float, h: float) -> float:
    """The lowest that f can be on an interval of length h."""
    if low >= 0:
        return f_a
    if high <= 0:
        return f_b
    meet = (f_a - f_b + high * h) / (high - low)
    if not math.isfinite(meet):
        return -math.inf
    return min(f_a, f_b, f_a + low * min(max(meet, 0.0), h))


def _box(a: float, middle: float, b: float) -> Interval:
    bend = abs(a - 2 * middle + b)
    return min(a, middle, b) - bend, max(a, middle, b) + bend


def _boxes(values: Sequence[Sequence[float]]) -> list[Interval]:
    return [_box(*three) for three in zip(*values, strict=True)]


def _rates(flow: Flow, dense: Any, a: float, b: float) -> list[Interval]:
    system, times = flow.system, (a, a + (b - a) / 2, b)
    assert system.bounds is not None
    boxes = _boxes([dense(t).tolist() for t in times])
    inputs = _boxes([system.inputs_at(flow.u, t - flow.begun) for t in times])
    levels = [of(level) for level in flow.state.levels]
    q, v = boxes[: system.n], boxes[system.n :]
    found: list[Interval] = system.bounds((a, b), q, v, [*inputs, *levels], flow.p)
    return found
