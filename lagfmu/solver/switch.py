"""What happens at contacts: impacts by Newton's law of restitution, rest, and the modes of all contacts
together (contacts.py; Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chs. 4, 6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from . import at_slides
from .contacts import complementary_modes, impact
from .instant import Instant
from .leg import Leg
from .motion import motion, project
from .state import Departure, State
from .system import Vector

SLOW = 1e-9  # speed of a gap, relative to the motion's own, that counts as none
ROUNDS = 50  # in which an impact is passed on between contacts that touch


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


def switched(leg: Leg, state: State, t0: float, y0: Vector, t: float, left: list[int]) -> State:
    """The state right after the event at t: contacts opened or struck, modes settled together.

    `left`: the indicators that leave their ranges, of which the first are the contacts'.
    """
    system, at = leg.system, leg.at(t)
    q, v = leg.split(leg.reach(t0, y0, t))
    contacts, arriving = [c for c in left if c < len(system.contacts)], v
    closed, armed = list(state.closed), list(state.armed)
    offset = np.array(state.offset)
    leaving = [c for c in contacts if closed[c]]
    landing = [c for c in contacts if not closed[c]]
    for c in leaving:
        closed[c] = False
        armed[c] = False
    for c in landing:
        k = system.contacts[c]
        v = impact(at, q, v, closed, c)
        closed[c] = _comes_to_rest(at, q, v, closed, c, state.gap[c])
        armed[c] = False
        if closed[c]:
            f = at.residual(q)
            for j, row in enumerate(system.rows):
                if row.while_closed == k:
                    offset[j] = f[j]
    if landing:
        v = _pass_on(at, q, v, closed, state)
    touching = _touching(at, q, v, state, closed)
    modes = complementary_modes(at, q, v, closed, touching, leaving)
    if system.frictions:

        def settled(at: Instant, shut: Sequence[bool]) -> tuple[bool, ...]:
            return complementary_modes(at, q, v, shut, touching, leaving)

        here = replace(state, t=t, closed=modes, offset=tuple(offset.tolist()))
        at, here = at_slides.switched_slides(at, q, v, arriving, here, left, settled)
        state, modes, offset = replace(here, closed=state.closed), here.closed, np.array(here.offset)
    q, v = project(at, q, v, system.active(modes), offset, leg.size)
    departures = list(state.departures)
    for c, (old, new) in enumerate(zip(leg.state.closed, modes, strict=True)):
        if old and not new:
            count = departures[c].count + 1
            departures[c] = Departure(count, t, tuple(q.tolist()), tuple(v.tolist()))
    return replace(
        state,
        t=t,
        q=tuple(q.tolist()),
        v=tuple(v.tolist()),
        closed=modes,
        armed=tuple(armed),
        offset=tuple(offset.tolist()),
        departures=tuple(departures),
    )


def _pass_on(at: Instant, q: Vector, v: Vector, closed: Sequence[bool], state: State) -> Vector:
    """An impact passed on through contacts that touch: each that is approached is struck in turn.

    After `ROUNDS` rounds the rest is taken as one plastic impact.
    """
    system = at.system
    f = at.residual(q)
    near = [c for c, k in enumerate(system.contacts) if not closed[c] and abs(f[k]) <= state.gap[c]]
    for count in range(ROUNDS):
        _, _, G, nu, _ = at.evaluate(q, v)
        speed = {c: G[system.contacts[c]] @ v - nu[system.contacts[c]] for c in near}
        size = np.abs(G) @ (np.array(state.size) * state.rate)
        struck = [c for c in near if speed[c] < -1e-9 * size[system.contacts[c]]]
        if not struck:
            return v
        plastic = count == ROUNDS - 1
        for c in struck:
            v = impact(at, q, v, closed, c, plastic)
    return v


def _comes_to_rest(
    at: Instant, q: Vector, v: Vector, closed: Sequence[bool], contact: int, gap: float
) -> bool:
    """True if the rebound would not rise above the gap within which contacts touch, v^2/(2a) <= gap.

    Without it a ball would bounce infinitely often in a finite time.
    """
    free = motion(at, q, v, at.system.active(closed))
    k = at.system.contacts[contact]
    speed = free.G[k] @ v - free.nu[k]
    acceleration = free.G[k] @ free.vdot - free.gamma[k]
    return bool(speed <= 0 or (acceleration < 0 and speed**2 <= -2 * acceleration * gap))


def _touching(
    at: Instant,
    q: Vector,
    v: Vector,
    state: State,
    closed: Sequence[bool],
) -> list[int]:
    """Contacts with f and df/dt at zero: those whose mode the accelerations decide."""
    _, _, G, nu, _ = at.evaluate(q, v)
    f = at.residual(q)
    size = np.abs(G) @ np.array(state.scale[at.system.n :])
    return [
        c
        for c, k in enumerate(at.system.contacts)
        if closed[c] or (abs(f[k]) <= state.gap[c] and abs(G[k] @ v - nu[k]) <= 1e-9 * size[k])
    ]
