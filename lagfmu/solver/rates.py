"""The rates of prescribed motions: whether they belong to the motion, and what they are from its values.

Between points that belong to one motion

    u1 - u0 = h (u0' + u1')/2 - h^2 (u1'' - u0'')/12 + O(h^5) ,  u1' - u0' = h (u0'' + u1'')/2 + O(h^3)

(Euler and Maclaurin).  Estimated are the derivatives of the cubic polynomial through the latest four points,
by Newton's divided differences (Hairer, Norsett & Wanner I, sect. III.5): the second is right to O(h^2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from ..numeric.system import System
from ..numeric.thresholds import RATES_KEPT, RATES_ROUNDING


@dataclass(frozen=True)
class Past:
    """The latest communication points (t, u) of each estimated motion, newest first."""

    points: tuple[tuple[tuple[float, float], ...], ...] = ()


def estimated(
    system: System, past: Past, t: float, u: Sequence[float], was_set: Sequence[bool]
) -> tuple[list[float], Past]:
    """The inputs with their rates at a communication point, and the points up to it.

    What was not set keeps the value of its latest point; what never was goes on by its rates.
    """
    w, found = list(u), []
    for i, k in enumerate(system.estimated):
        before = past.points[i] if past.points else ()
        if not before and not was_set[i]:
            found.append(before)
            continue
        value = u[k] if was_set[i] else before[0][1]
        points = ((t, value), *(p for p in before if p[0] < t))[:RATES_KEPT]
        w[k] = value
        if len(points) > 1:
            w[k + 1 : k + 4] = derivatives(points)
        found.append(points)
    return w, Past(tuple(found))


def derivatives(points: Sequence[tuple[float, float]]) -> list[float]:
    """The first, second and third derivative at the first of 2 to 4 points."""
    times = [t for t, _ in points]
    table = [u for _, u in points]
    newton = []
    for order in range(1, len(points)):
        table = [
            (table[j] - table[j + 1]) / (times[j] - times[j + order]) for j in range(len(table) - 1)
        ]
        newton.append(table[0])
    d1, d2, d3 = [*newton, 0.0, 0.0][:3]
    a = times[0] - times[1]
    b = times[0] - times[2] if len(points) > 2 else 0.0
    return [d1 + a * (d2 + b * d3), 2 * (d2 + (a + b) * d3), 6 * d3]


def half_connected(u: Sequence[float], went: Sequence[float], h: float) -> bool:
    """True where u has moved over the last step h and u' has not moved accordingly, or u' and not u''.

    By more than half of the step's own size.  `u` are u, u', u'' as they are set, `went` where the rates
    have carried them to.
    """
    a = went[2]
    v = went[1] - h * a
    x = went[0] - h * (v + h * a / 2)
    way, speed, size = u[0] - x, u[1] - v, abs(x) + abs(u[0])
    miss = abs(way - h * (v + u[1]) / 2 + h * h * (u[2] - a) / 12)
    if miss > RATES_ROUNDING * size and miss > (abs(way) + h * (abs(v) + abs(u[1])) / 2) / 2:
        return True
    miss = abs(speed - h * (a + u[2]) / 2)
    return (
        h * miss > RATES_ROUNDING * size and miss > (abs(speed) + h * (abs(a) + abs(u[2])) / 2) / 2
    )


def restored_past(system: System, raw: Any) -> tuple[Past, list[int]]:
    """The points that were saved, and what was set since.  Raises ValueError with what cannot be."""
    points, fresh = raw
    motions = tuple(tuple((float(t), float(u)) for t, u in motion) for motion in points)
    if motions and len(motions) != len(system.estimated):
        raise ValueError("its inputs have other pasts")
    for motion in motions:
        times = [t for t, _ in motion]
        if len(motion) > RATES_KEPT or not all(math.isfinite(x) for point in motion for x in point):
            raise ValueError("the past of its inputs is no list of points")
        if any(a <= b for a, b in pairwise(times)):
            raise ValueError("the past of its inputs does not go back in time")
    return Past(motions), [int(k) for k in fresh]
