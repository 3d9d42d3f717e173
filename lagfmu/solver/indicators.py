"""The functions that are watched within a step, event indicators: where one of them leaves its range, the
equations change.

    0 .. contacts - 1   of a contact: lambda >= 0 while it is closed; while it is open f >= 0, left only at
                        f < -gap, within which contacts touch
    then                of a jump of the forces: h on the side of its level (jumps.py)
    then two a friction (slides.py): the reserve of its cone while it sticks, the slip velocity along its
                        direction while it slips; its normal force while it slips on what is no contact

A further kind takes the numbers after these: its values stand in `indicators`, its ranges in `ranges`, what
it does at an event in advance.py.
"""

from __future__ import annotations

import numpy as np

from . import at_slides
from .instant import Motion
from .jumps import limits, surfaces
from .leg import Leg
from .ranges import Range
from .system import System, Vector


def is_watched(system: System) -> bool:
    """True if there is anything to watch."""
    return bool(system.contacts or system.floors or system.frictions)


def indicators(leg: Leg, t: float, y: Vector) -> Vector:
    """All values at (t, y), in the present modes."""
    q, v = leg.split(y)
    now = leg.near(t, q, v) if leg.system.frictions else None
    parts = [_of_contacts(leg, t, y, now)] if leg.system.contacts else []
    if leg.system.floors:
        at = leg.at(t)
        parts.append(surfaces(leg.system, t, q, at.u, at.p))
    if now is not None:
        parts.append(np.array(at_slides.indicators(leg, now)))
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def ranges(leg: Leg) -> list[Range]:
    """The range of each, in the present modes."""
    state = leg.state
    contacts = [
        Range(0.0, slack=0.0 if shut else gap)
        for shut, gap in zip(state.closed, state.gap, strict=True)
    ]
    jumps = [
        Range(*limits(level, floor))
        for level, floor in zip(state.levels, leg.system.floors, strict=True)
    ]
    frictions = at_slides.ranges(leg) if leg.system.frictions else []
    return contacts + jumps + frictions


def _of_contacts(leg: Leg, t: float, y: Vector, now: Motion | None = None) -> Vector:
    q, v = leg.split(y)
    at = leg.at(t)
    contacts = list(leg.system.contacts)
    values = at.residual(q)[contacts]
    if any(leg.state.closed):
        lam = (now or leg.near(t, q, v)).lam[contacts]
        values = np.where(leg.state.closed, lam, values)
    return values
