"""The functions that are watched within a step, event indicators: where one of them leaves its range, the
equations change.

    0 .. contacts - 1   of a contact: lambda >= 0 while it is closed; while it is open f >= 0, left only at
                        f < -gap, within which contacts touch
    then                of a jump of the forces: h on the side of its level (jumps.py)
    then two a friction (slipping.py): the reserve of its cone while it sticks, the slip velocity along its
                        direction while it slips; its normal force while it slips on what is no contact

A further kind takes the numbers after these: its values stand in `indicators`, its ranges in `ranges`, what
it does at an event in advance.py.
"""

from __future__ import annotations

import numpy as np

from ..numeric.system import Vector
from . import optional_slides
from .flow import Flow
from .instant import Motion
from .jumps import limits, surfaces
from .ranges import Range


def indicators(flow: Flow, t: float, y: Vector) -> Vector:
    """All values at (t, y), in the present modes."""
    q, v = flow.split(y)
    now = flow.near(t, q, v) if flow.system.frictions else None
    parts = [_of_contacts(flow, t, y, now)] if flow.system.contacts else []
    if flow.system.floors:
        at = flow.at(t)
        parts.append(surfaces(flow.system, t, q, at.u, at.p))
    if now is not None:
        parts.append(np.array(optional_slides.indicators(flow, now)))
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def ranges(flow: Flow) -> list[Range]:
    """The range of each, in the present modes."""
    state = flow.state
    contacts = [
        Range(0.0, slack=0.0 if shut else gap)
        for shut, gap in zip(state.closed, state.gap, strict=True)
    ]
    jumps = [
        Range(*limits(level, floor))
        for level, floor in zip(state.levels, flow.system.floors, strict=True)
    ]
    frictions = optional_slides.ranges(flow) if flow.system.frictions else []
    return contacts + jumps + frictions


def _of_contacts(flow: Flow, t: float, y: Vector, now: Motion | None = None) -> Vector:
    q, v = flow.split(y)
    at = flow.at(t)
    contacts = list(flow.system.contacts)
    values = at.residual(q)[contacts]
    if any(flow.state.closed):
        lam = (now or flow.near(t, q, v)).lam[contacts]
        values = np.where(flow.state.closed, lam, values)
    return values
