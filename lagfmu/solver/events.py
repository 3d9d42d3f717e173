"""Event location: lambda of a closed contact and f of an open one are watched.

Where one changes its sign the time is bracketed to rounding, each trial being an integration from the
last accepted point, so that the event does not depend on the communication step (Hairer, Norsett &
Wanner I, sect. II.6, with exact trials).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scipy.optimize import brentq

from .leg import Leg
from .looks import look_into_dips, looks
from .motion import EPS
from .system import Vector


def first_event(
    leg: Leg,
    solver: Any,
    t0: float,
    y0: Vector,
    y1: Vector,
    before: Vector,
    armed: list[bool],
    gap: Sequence[float],
) -> tuple[tuple[float, list[int]] | None, Vector]:
    """The earliest sign change within the step just taken, as (time, contacts), if there is one."""
    times, values = looks(leg, solver, t0, y0, before)
    times.append(solver.t)
    values.append(leg.indicators(solver.t, y1))
    for c, closed in enumerate(leg.state.closed):
        if closed:
            look_into_dips(leg, solver, times, values, c)
    found: list[tuple[float, int]] = []
    for c, closed in enumerate(leg.state.closed):
        trigger = 0.0 if closed else -gap[c]
        risen = armed[c]
        for i in range(1, len(times)):
            risen = risen or values[i - 1][c] > gap[c]
            level = 0.0 if closed or risen else -gap[c]
            if values[i][c] < trigger:
                above = max((j for j in range(i) if values[j][c] > level), default=0)
                t = _locate(leg, t0, y0, times[above], times[i], c, level)
                if t is not None:
                    found.append((t, c))
                    break
    if not found:
        for c, closed in enumerate(leg.state.closed):
            armed[c] = bool(armed[c] or (not closed and any(v[c] > gap[c] for v in values)))
        return None, values[-1]
    earliest = min(t for t, _ in found)
    return (earliest, [c for t, c in found if t == earliest]), values[-1]


def _locate(
    leg: Leg, t0: float, y0: Vector, lo: float, hi: float, contact: int, level: float
) -> float | None:
    """The time in [lo, hi] at which the contact's indicator falls through `level`, to rounding."""

    def height(elapsed: float) -> float:
        t = t0 + elapsed
        return float(leg.indicators(t, leg.reach(t0, y0, t))[contact] - level)

    for a in dict.fromkeys((lo - t0, 0.0)):
        b = hi - t0
        if height(b) >= 0:
            return None  # it only grazed: within the tolerance there is no event
        if height(a) > 0:
            found = brentq(height, a, b, xtol=EPS * b, rtol=4 * EPS, maxiter=200)
            return float(t0 + found)
    return float(t0)
