"""Event location: indicators are watched (indicators.py), lambda of a closed contact, f of an open one.

Where one leaves its range the time is bracketed to rounding, each trial being an integration from the
last accepted point, so that the event does not depend on the communication step (Hairer, Norsett &
Wanner I, sect. II.6, with exact trials).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from scipy.optimize import brentq

from ..numeric.system import Vector
from .flow import Flow
from .indicators import indicators, ranges
from .motion import EPS
from .ranges import Range, first_of_frictions
from .samples import look_into_dips, samples

Event = tuple[
    float, dict[int, int]
]  # its time [s], the indicators that leave their ranges: 1 up, -1 down


def first_event(
    flow: Flow,
    solver: Any,
    t0: float,
    y0: Vector,
    y1: Vector,
    before: Vector,
    armed: list[bool],
) -> tuple[Event | None, Vector]:
    """The earliest event within the step just taken, if there is one, and the indicators at its end."""
    times, values = samples(flow, solver, t0, y0, y1, before)
    for c, closed in enumerate(flow.state.closed):
        if closed:
            look_into_dips(flow, solver, times, values, c)
    for i in range(2 * len(flow.state.slides)):
        look_into_dips(flow, solver, times, values, first_of_frictions(flow.system) + i)
    found: list[tuple[float, int, int]] = []
    for k, r in enumerate(ranges(flow)):
        risen = flow.state.closed[k] or armed[k] if k < len(armed) else not r.rises
        for i in range(1, len(times)):
            risen = risen or r.inside(values[i - 1][k]) > r.slack
            if r.inside(values[i][k]) < -r.slack:
                limit = r if risen else r.widened()
                inside = max((j for j in range(i) if limit.inside(values[j][k]) > 0), default=0)
                t = _locate(flow, t0, y0, times[inside], times[i], k, limit)
                if t is not None:
                    found.append((t, k, r.way(values[i][k])))
                    break
    if not found:
        gap = flow.state.gap
        for c, closed in enumerate(flow.state.closed):
            armed[c] = bool(armed[c] or (not closed and any(v[c] > gap[c] for v in values)))
        return None, values[-1]
    earliest = min(t for t, _, _ in found)
    return (earliest, {k: way for t, k, way in found if t == earliest}), values[-1]


def _past(height: Callable[[float], float], root: float, b: float) -> float:
    """The root, or the next time after it at which the limit has been passed, rounding included."""
    step, elapsed = EPS * b, root
    while elapsed < b and height(elapsed) > 0:
        elapsed, step = min(root + step, b), 2 * step
    return elapsed


def _locate(
    flow: Flow, t0: float, y0: Vector, lo: float, hi: float, indicator: int, limit: Range
) -> float | None:
    """The time in [lo, hi] at which the indicator leaves the range, to rounding."""

    def height(elapsed: float) -> float:
        t = t0 + elapsed
        return limit.inside(indicators(flow, t, flow.reach(t0, y0, t))[indicator])

    for a in dict.fromkeys((lo - t0, 0.0)):
        b = hi - t0
        if height(b) >= 0:
            return None  # it only grazed: within the tolerance there is no event
        if height(a) > 0:
            root = float(brentq(height, a, b, xtol=EPS * b, rtol=4 * EPS, maxiter=200))
            return t0 + (root if indicator < len(flow.state.closed) else _past(height, root, b))
    return float(t0)
