"""The functions that are watched within a step, event indicators: where one of them leaves its range, the
equations change.

    0 .. contacts - 1   of a contact: lambda >= 0 while it is closed; while it is open f >= 0, left only at
                        f < -gap, within which contacts touch
    then two a friction (slides.py): the reserve of its cone while it sticks, the slip velocity along its
                        direction while it slips; its normal force while it slips on what is no contact

A further kind takes the numbers after these: its values stand in `indicators`, its ranges in `ranges`, what
it does at an event in advance.py.
"""

from __future__ import annotations

import numpy as np

from . import at_slides
from .instant import Motion
from .leg import Leg
from .motion import motion
from .ranges import Range
from .system import System, Vector


def is_watched(system: System) -> bool:
    """True if there is anything to watch."""
    return bool(system.contacts or system.frictions)


def indicators(leg: Leg, t: float, y: Vector) -> Vector:
    """All values at (t, y), in the present modes."""
    if not leg.system.frictions:
        return _of_contacts(leg, t, y)
    now = motion(leg.at(t), *leg.split(y), leg.rows)
    of_frictions = at_slides.indicators(leg, now)
    return np.concatenate([_of_contacts(leg, t, y, now), of_frictions])


def ranges(leg: Leg) -> list[Range]:
    """The range of each, in the present modes."""
    state = leg.state
    found = [
        Range(0.0, slack=0.0 if shut else gap)
        for shut, gap in zip(state.closed, state.gap, strict=True)
    ]
    return found + at_slides.ranges(leg) if leg.system.frictions else found


def _of_contacts(leg: Leg, t: float, y: Vector, now: Motion | None = None) -> Vector:
    q, v = leg.split(y)
    at = leg.at(t)
    contacts = list(leg.system.contacts)
    values = at.residual(q)[contacts]
    if any(leg.state.closed):
        lam = (now or motion(at, q, v, leg.rows)).lam[contacts]
        values = np.where(leg.state.closed, lam, values)
    return values
