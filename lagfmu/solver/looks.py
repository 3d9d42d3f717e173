"""Where in a step a contact may open or close unseen, more is looked at.

A quarter of the step at most; while a contact is open, no further than half of the way to it at the
present speed, |f| / (|G| |v|), so that no obstacle is stepped across; first where a rebound is highest,
so that no bounce is; and where a multiplier may dip below zero between two looks.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .indicators import indicators
from .leg import Leg
from .system import Vector

LARGEST_LOOK, SMALLEST_LOOK = 1 / 4, 1 / 200  # parts of a step in which events are looked for
DIPS, SHALLOW = 3, 0.1  # parabolas drawn, and how low, of the looks, they must go to be looked into


def looks(
    leg: Leg, solver: Any, t0: float, y0: Vector, before: Vector
) -> tuple[list[float], list[Vector]]:
    """Times within the step at which the indicators are looked at, and their values, y0's first."""
    h, dense = solver.t - t0, solver.dense_output()
    highest = t0 + _top_of_rebound(leg, t0, y0, before)
    rows = [k for k, c in zip(leg.system.contacts, leg.state.closed, strict=True) if not c]
    times, values, y = [t0], [before], y0
    while True:
        stride = h * LARGEST_LOOK
        if rows:
            q, v = leg.split(y)
            _, _, G, nu, _ = leg.at(times[-1]).evaluate(q, v)
            f = np.abs(values[-1][: len(leg.state.closed)][[not c for c in leg.state.closed]])
            speed = np.abs(G[rows]) @ np.abs(v) + np.abs(nu[rows])
            ahead = 0.5 * f / np.where(speed > 0, speed, np.inf)
            near = float(ahead[speed > 0].min(initial=stride))
            stride = min(stride, max(near, h * SMALLEST_LOOK))
        t = times[-1] + stride
        if times[-1] < highest:
            t = min(t, highest)
        if t >= solver.t - h * SMALLEST_LOOK or t <= times[-1]:
            return times, values
        times.append(t)
        y = dense(t)
        values.append(indicators(leg, t, y))


def _top_of_rebound(leg: Leg, t: float, y: Vector, values: Vector) -> float:
    """The time [s] in which an open contact that has just been left parts most, f' / (-f'')."""
    left = [
        (c, k)
        for c, k in enumerate(leg.system.contacts)
        if not leg.state.closed[c] and values[c] <= leg.state.gap[c]
    ]
    if not left:
        return float("inf")
    q, v = leg.split(y)
    now = leg.near(t, q, v)
    speed, pull = now.G @ v - now.nu, now.gamma - now.G @ now.vdot
    return min(
        (
            float(speed[k] / pull[k])
            for c, k in left
            if speed[k] > 0
            and pull[k] > 0
            and speed[k] ** 2 > 2 * pull[k] * (leg.state.gap[c] - values[c])
        ),
        default=float("inf"),
    )


def look_into_dips(
    leg: Leg, solver: Any, times: list[float], values: list[Vector], contact: int
) -> None:
    """One more look, put in its place, if the multiplier passes below zero and back between two looks.

    The lowest point is that of a parabola through three neighbours, drawn again with it as one of them.
    """
    for i in range(len(times) - 2):
        t, lam = times[i : i + 3], [float(v[contact]) for v in values[i : i + 3]]
        for _ in range(DIPS):
            if min(lam) < 0:
                break
            lowest, depth = _vertex(t, lam)
            if not (t[0] < lowest < t[2]) or lowest in t or depth > SHALLOW * max(lam):
                break
            seen = indicators(leg, lowest, solver.dense_output()(lowest))
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
