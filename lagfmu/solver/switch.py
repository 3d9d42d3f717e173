"""What happens at contacts: impacts (impact.py), rest, and the modes of all contacts together (contacts.py;
Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chs. 4, 6).  Nothing depends on the
order in which contacts are declared."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from ..numeric.system import Vector
from ..numeric.thresholds import SLOW
from . import optional_slides
from .contacts import complementary_modes, low
from .flow import Flow
from .impact import impacts
from .instant import Instant
from .motion import motion, project
from .state import Departure, State


def released(at: Instant, state: State, span: float) -> State:
    """Contacts opened that a jump of a prescribed motion has left a gap in, or a speed at which they part:
    departures; the state on the rows that go on acting, which go with the motion.

    A gap that the contact, pressed as it is, would have closed within `span` [s] is none: the motion went
    on a little otherwise than its derivatives had foreseen over a step of that length.
    """
    system, q, v = at.system, np.array(state.q), np.array(state.v)
    closed, armed, departures = list(state.closed), list(state.armed), list(state.departures)
    for c, shut in enumerate(state.closed):
        if shut and _has_parted(at, q, v, closed, c, state, span):
            closed[c], armed[c] = False, True
            departures[c] = Departure(departures[c].count + 1, state.t, state.q, state.v)
    size, offset = np.array(state.size), np.array(state.offset)
    q, v = project(at, q, v, system.active(closed), offset, size)
    return replace(
        state,
        q=tuple(q.tolist()),
        v=tuple(v.tolist()),
        closed=tuple(closed),
        armed=tuple(armed),
        departures=tuple(departures),
    )


def _has_parted(
    at: Instant, q: Vector, v: Vector, closed: Sequence[bool], c: int, state: State, span: float
) -> bool:
    """True if contact c opens by more than it would have closed by itself, had it been free for `span`."""
    k = at.system.contacts[c]
    _, _, G, nu, _ = at.evaluate(q, v)
    gap, speed = at.residual(q)[k], G[k] @ v - nu[k]
    natural = np.abs(G[k]) @ np.array(state.size) * state.rate
    slow = SLOW * max(natural, np.abs(G[k]) @ np.abs(v) + abs(nu[k]))
    if not (gap > state.gap[c] or speed > slow):
        return False
    others = [shut and i != c for i, shut in enumerate(closed)]
    free = motion(at, q, v, at.system.active(others))
    approach = max(free.gamma[k] - free.G[k] @ free.vdot, 0.0)
    return bool(
        gap > max(state.gap[c], approach * span**2 / 2) or speed > max(slow, approach * span)
    )


def switched(flow: Flow, state: State, t0: float, y0: Vector, t: float, left: list[int]) -> State:
    """The state right after the event at t: contacts opened or struck, modes settled together.

    `left`: the indicators that leave their ranges, of which the first are the contacts'.
    """
    system, at = flow.system, flow.at(t)
    q, v = flow.split(flow.reach(t0, y0, t))
    contacts, arriving = [c for c in left if c < len(system.contacts)], v
    leaving = {c for c in contacts if state.closed[c]}
    landing = set(contacts) - leaving
    closed = [shut and c not in leaving for c, shut in enumerate(state.closed)]
    f = at.residual(q)[list(system.contacts)]
    near = {c for c, shut in enumerate(closed) if shut or c in landing or abs(f[c]) <= state.gap[c]}
    slow = _slow(at, q, v, state)
    struck: dict[int, float] = {}
    if landing:
        v, struck = impacts(
            at, q, v, near, slow, optional_slides.rubbed if system.frictions else None
        )
    bounced = {*struck, *landing}
    leaving -= {*struck}
    modes = _settled(at, q, v, state, closed, near, leaving, bounced)
    offset = _levels(at, q, state, modes)
    if system.frictions:

        def settled(at: Instant, shut: Sequence[bool]) -> tuple[bool, ...]:
            return _settled(at, q, v, state, shut, near, leaving, bounced)

        touching = _touching(at, q, v, state, near)

        def complementary(at: Instant, shut: Sequence[bool]) -> tuple[bool, ...]:
            return complementary_modes(at, q, v, shut, touching, leaving)

        found = optional_slides.Contacts(settled, complementary, touching, leaving)
        here = replace(state, t=t, closed=modes, offset=tuple(offset.tolist()))
        at, here = optional_slides.switched_slides(at, q, v, arriving, here, left, found)
        state, modes, offset = (
            replace(here, closed=state.closed),
            here.closed,
            np.array(here.offset),
        )
    q, v = project(at, q, v, system.active(modes), offset, flow.size)
    departures = list(state.departures)
    for c, (old, new) in enumerate(zip(state.closed, modes, strict=True)):
        if old and not new:
            count = departures[c].count + 1
            departures[c] = Departure(count, t, tuple(q.tolist()), tuple(v.tolist()))
    return replace(
        state,
        t=t,
        q=tuple(q.tolist()),
        v=tuple(v.tolist()),
        closed=modes,
        armed=tuple(a and c not in contacts and c not in struck for c, a in enumerate(state.armed)),
        offset=tuple(offset.tolist()),
        departures=tuple(departures),
        strikes=state.strikes + len(bounced),
        hits=tuple(k + (c in struck) for c, k in enumerate(state.hits)),
        hit_times=tuple(t if c in struck else x for c, x in enumerate(state.hit_times)),
        impulses=tuple(struck.get(c, x) for c, x in enumerate(state.impulses)),
    )


def _slow(at: Instant, q: Vector, v: Vector, state: State) -> Vector:
    """Speeds (m) of the rows that count as none."""
    G = np.abs(at.evaluate(q, v)[2])
    natural = np.array(state.size) * state.rate
    speed = np.maximum(G @ natural, G @ np.array(state.scale[at.system.n :]))
    return np.asarray(SLOW * speed)


def _touching(at: Instant, q: Vector, v: Vector, state: State, near: Collection[int]) -> set[int]:
    """Contacts with f = 0 and df/dt = 0: the accelerations decide."""
    slow = _slow(at, q, v, state)
    _, _, G, nu, _ = at.evaluate(q, v)
    return {c for c in near if abs((G @ v - nu)[k := at.system.contacts[c]]) <= slow[k]}


def _settled(
    at: Instant,
    q: Vector,
    v: Vector,
    state: State,
    closed: Sequence[bool],
    near: Collection[int],
    leaving: Collection[int],
    bounced: Collection[int],
) -> tuple[bool, ...]:
    """The modes after the impacts: accelerations decide where df/dt is zero; what parts is open.

    Contacts that were struck rest if the rebound would not rise above the gap (contacts.py).
    """
    touching = _touching(at, q, v, state, near)
    slow = _slow(at, q, v, state)
    _, _, G, nu, _ = at.evaluate(q, v)
    slip = (G @ v - nu)[list(at.system.contacts)]
    limit = slow[list(at.system.contacts)]
    guess = [c in touching and (shut or c in bounced) for c, shut in enumerate(closed)]
    modes = complementary_modes(at, q, v, guess, touching, leaving)
    parting = [c for c in near if (closed[c] or c in bounced) and slip[c] > limit[c]]
    rest = low(at, q, v, modes, parting, np.array(state.gap)) if parting else []
    if not rest:
        return modes
    guess = [shut or c in rest for c, shut in enumerate(modes)]
    return complementary_modes(at, q, v, guess, touching | {*rest}, leaving)


def _levels(at: Instant, q: Vector, state: State, modes: Sequence[bool]) -> Vector:
    """The levels f = offset: rows that come back with a contact keep the one at which they do."""
    system, offset, f = at.system, np.array(state.offset), at.residual(q)
    come = {
        k for k, old, new in zip(system.contacts, state.closed, modes, strict=True) if new > old
    }
    for j, row in enumerate(system.rows):
        if row.while_closed in come:
            offset[j] = f[j]
    return offset
