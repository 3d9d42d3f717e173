"""Rates of prescribed motions: estimated from values where the model says so, checked where they are told.

A motion of which the values u alone are known goes on along the polynomial through its latest four values at
communication points (through fewer after the start, and at first at the rate that the model gives); its
derivatives at the latest point are u', u'', u'''.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...numeric.system import System

POINTS = 4
APART = 0.3  # of the way that a motion went: what its rates may miss

# the latest communication points: t, then the value of each motion
Past = tuple[tuple[float, ...], ...]


def estimated(
    system: System, past: Past, t: float, u: Sequence[float], fresh: Sequence[bool]
) -> tuple[list[float], Past]:
    """The inputs at t [s] with their rates, and the points with that one; `fresh`: which motions were set.

    One that was not set stands still.
    """
    values = [
        u[k] if new or not past else past[-1][1 + i]
        for i, (k, new) in enumerate(zip(system.estimated, fresh, strict=True))
    ]
    points = tuple(point for point in past if point[0] < t)[1 - POINTS :]
    points = (*points, (t, *values))
    driven = list(u)
    for i, k in enumerate(system.estimated):
        driven[k] = values[i]
        if len(points) == 1:
            driven[k + 2] = driven[k + 3] = 0.0
            continue
        times = np.array([point[0] for point in points]) - t
        unit = -times[0]  # the conditions of the fit are those of times of the order of 1
        powers = np.linalg.solve(
            np.vander(times / unit, increasing=True), [point[1 + i] for point in points]
        )
        rates = [0.0] * POINTS
        for order, c in enumerate(powers.tolist()):
            rates[order] = c * (1, 1, 2, 6)[order] / unit**order
        driven[k + 1 : k + POINTS] = rates[1:]
    return driven, points


def half_connected(u: Sequence[float], foreseen: Sequence[float], h: float) -> bool:
    """Has a motion, (u, u', u'') now, moved over the last h [s] otherwise than its rates say?

    `foreseen` is what it was to be by its rates at the time before.  The trapezoidal rule has an error of
    (w h)^2 / 12 of a harmonic motion of the frequency w, 1.3 % for sixteen points a period.
    """
    rate = foreseen[1] - h * foreseen[2]
    place = foreseen[0] - h * rate - h**2 * foreseen[2] / 2
    pairs = (
        (place, u[0], rate, u[1]),
        (rate, u[1], foreseen[2], u[2]),
    )
    for before, now, slope, slope_now in pairs:
        way, told = now - before, h * (slope + slope_now) / 2
        size = abs(way) + h * max(abs(slope), abs(slope_now))
        if abs(way) > 1e-9 * abs(now) and abs(way - told) > APART * size:
            return True
    return False
