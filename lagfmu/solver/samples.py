"""Where in a step an event may pass unseen, more is looked at.

First at the quarters of the step, and where a rebound is highest; then in the middle between two samples as
long as f of an open contact, or h of a force that jumps, can have left its range and come back
(clearance.py); and where a multiplier may dip below zero between two samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ..numeric.system import Vector
from ..numeric.thresholds import (
    SEARCH_DIPS,
    SEARCH_FIRST,
    SEARCH_MOST,
    SEARCH_SHALLOW,
    SEARCH_SMALLEST,
)
from .clearance import BRACKETS, CLEAR, between
from .flow import Flow
from .indicators import indicators


def samples(
    flow: Flow, solver: Any, t0: float, y0: Vector, y1: Vector, before: Vector
) -> tuple[list[float], list[Vector]]:
    """Times within the step at which the indicators are looked at, and their values.

    `before`: at its start (t0, y0); y1: the projected state at its end.
    """
    h, dense = float(solver.t - t0), solver.dense_output()
    highest = t0 + _top_of_rebound(flow, t0, y0, before)
    inner = {t0 + k * h / SEARCH_FIRST for k in range(1, SEARCH_FIRST)} | {highest}
    times = [t0, *sorted(t for t in inner if t0 < t < solver.t), float(solver.t)]
    values = [before]
    values += [indicators(flow, t, dense(t)) for t in times[1:-1]]
    values.append(indicators(flow, solver.t, y1))
    k = 0
    while flow.system.bounds is not None and k + 1 < len(times):
        a, b = times[k], times[k + 1]
        middle = a + (b - a) / 2
        found = between(flow, dense, a, b, values[k], values[k + 1], h)
        if found == BRACKETS:
            break
        more = len(times) < SEARCH_MOST and b - a > SEARCH_SMALLEST * h and a < middle < b
        if found == CLEAR or not more:
            k += 1
        else:
            times.insert(k + 1, middle)
            values.insert(k + 1, indicators(flow, middle, dense(middle)))
    return times, values


def _top_of_rebound(flow: Flow, t: float, y: Vector, values: Vector) -> float:
    """The time [s] in which an open contact that has just been left parts most, f' / (-f'')."""
    left = [
        (c, k)
        for c, k in enumerate(flow.system.contacts)
        if not flow.state.closed[c] and values[c] <= flow.state.gap[c]
    ]
    if not left:
        return float("inf")
    q, v = flow.split(y)
    now = flow.near(t, q, v)
    speed, pull = now.G @ v - now.nu, now.gamma - now.G @ now.vdot
    return min(
        (
            float(speed[k] / pull[k])
            for c, k in left
            if speed[k] > 0
            and pull[k] > 0
            and speed[k] ** 2 > 2 * pull[k] * (flow.state.gap[c] - values[c])
        ),
        default=float("inf"),
    )


def look_into_dips(
    flow: Flow, solver: Any, times: list[float], values: list[Vector], contact: int
) -> None:
    """One more look, put in its place, if the multiplier passes below zero and back between two samples.

    The lowest point is that of a parabola through three neighbours, drawn again with it as one of them.
    """
    for i in range(len(times) - 2):
        t, lam = times[i : i + 3], [float(v[contact]) for v in values[i : i + 3]]
        for _ in range(SEARCH_DIPS):
            if min(lam) < 0:
                break
            lowest, depth = _vertex(t, lam)
            if not (t[0] < lowest < t[2]) or lowest in t or depth > SEARCH_SHALLOW * max(lam):
                break
            seen = indicators(flow, lowest, solver.dense_output()(lowest))
            if seen[contact] < 0:
                k = next(k for k, other in enumerate(times) if other > lowest)
                times.insert(k, lowest)
                values.insert(k, seen)
                return
            first = int(lowest > t[1])  # its neighbours: 0 and 1, or 1 and 2
            t = [t[first], lowest, t[first + 1]]
            lam = [lam[first], float(seen[contact]), lam[first + 1]]


def _vertex(t: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """The lowest point of the parabola through three points; not a number if it has none."""
    left, right = (y[1] - y[0]) / (t[1] - t[0]), (y[2] - y[1]) / (t[2] - t[1])
    bend = (right - left) / (t[2] - t[0])
    if not bend > 0:
        return float("nan"), float("nan")
    slope = left + bend * (t[1] - t[0])  # at t[1]
    return t[1] - slope / (2 * bend), y[1] - slope * (slope / (4 * bend))
