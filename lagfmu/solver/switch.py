"""What happens at an instant: contacts that close are struck, those that pull open, surfaces that jump are
met.

A state is taken to the one from which the motion goes on: on the constraints as they stand now, no contact
approached, and a choice of closed contacts that is consistent.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from ..numeric.contacts import restitution
from ..numeric.system import Vector
from .contacts import (
    accelerations_at_hand,
    as_flags,
    closed_at_rest,
    closed_rows,
    gap_of_rounding,
    speed_of_rounding,
)
from .equations import Motion, Terms
from .events import Found
from .impact import Impact, strike
from .linear import rows_of
from .projection import project_positions, project_velocities
from .state import Event, Settings, State

AT_ONCE = (
    1e-6  # of the accelerations at hand: f'' of a contact whose lambda is 0 may miss 0 by less
)


def begun(motion: Motion, settings: Settings, state: State) -> State:
    """The state with which a communication step begins, its inputs being set.

    A surface whose prescribed motion was set to another place or speed than it went to takes a closed
    contact along if, pressed as it is, the contact could have followed within the latest communication
    step; otherwise it has jumped away, and the contact departs.
    """
    system = motion.system
    if not system.m:
        return state
    q, v = np.array(state.q), np.array(state.v)
    terms, closed = motion.terms(state.t, q, v), closed_rows(system, state.closed)
    if system.prescribed:
        left = _left_behind(motion, settings, state, terms)
        closed -= left
        f, small = motion.residual(state.t, q), gap_of_rounding(motion, state.t, q, state)
        met = frozenset(k for k in system.contacts if k not in closed and f[k] < -small[k])
        rows = system.active(as_flags(system, closed | met))
        q = project_positions(motion, state.t, q, v, rows, np.array(settings.span))
        terms = motion.terms(state.t, q, v)
        if not met:
            v = project_velocities(terms.of(system.active(as_flags(system, closed))), v)
        closed |= met
    elif not system.contacts:
        return state
    return _settled(motion, settings, state, q, v, closed)


def at_event(motion: Motion, settings: Settings, state: State, found: Found) -> State:
    """The state after contacts closed or departed at the time of `state`."""
    system = motion.system
    q, v = np.array(state.q), np.array(state.v)
    closed = closed_rows(system, state.closed)
    together = system.active(as_flags(system, closed | found.closing))
    q = project_positions(motion, state.t, q, v, together, np.array(settings.span))
    return _settled(motion, settings, state, q, v, closed, found.departing)


def _settled(
    motion: Motion,
    settings: Settings,
    state: State,
    q: Vector,
    v: Vector,
    closed: frozenset[int],
    departing: frozenset[int] = frozenset(),
) -> State:
    """The state after the impacts of all contacts that touch, with those closed that then press."""
    system, t, was = motion.system, state.t, closed_rows(motion.system, state.closed)
    terms, f = motion.terms(t, q, v), motion.residual(t, q)
    small, slow = (
        gap_of_rounding(motion, t, q, state),
        speed_of_rounding(terms, v, settings),
    )
    touching = closed | {k for k in system.contacts if f[k] <= small[k]}
    s = terms.G @ v - terms.nu
    before, struck = v, None
    if any(s[k] < -slow[k] for k in touching):
        e = restitution(system, motion.p)
        struck = strike(motion, terms, v, touching, e, settings)
        resting, hops = _low(motion, terms, struck.v, touching, small, slow)
        while any(e[k] for k in hops):  # the last impulse is that of rest
            e[[*hops]] = 0
            struck = strike(motion, terms, v, touching, e, settings)
            resting, hops = _low(motion, terms, struck.v, touching, small, slow)
        v = struck.v
        if hops:
            rows = system.active(as_flags(system, resting | hops))
            v = project_velocities(terms.of(rows), v)
        caught = v - struck.v  # a plastic impact: M caught = G^T Lambda with s+ = 0
        lost = struck.lost + float(caught @ terms.M @ caught) / 2
        state = replace(state, dissipated=state.dissipated + lost)
        terms = motion.terms(t, q, v)
        s = terms.G @ v - terms.nu
    resting = {k for k in touching if abs(s[k]) <= slow[k]}
    now = _chosen(motion, settings, terms, resting, departing)
    if now != closed or struck is not None:
        rows = system.active(as_flags(system, now))
        v = project_velocities(terms.of(rows), v)
    state = replace(state, q=tuple(q.tolist()), v=tuple(v.tolist()), closed=as_flags(system, now))
    return _told(motion, state, before, was, struck, slow, terms)


def _chosen(
    motion: Motion,
    settings: Settings,
    terms: Terms,
    resting: Collection[int],
    departing: frozenset[int],
) -> frozenset[int]:
    """The contacts that are closed.

    One whose multiplier has just fallen through 0 departs, if it opens then.
    """
    if not resting:
        return frozenset()
    if departing:
        others = frozenset(resting) - departing
        now = closed_at_rest(motion, terms, others, settings)
        rows = motion.system.active(as_flags(motion.system, now))
        vdot, _, _ = motion.accelerations(terms.of(rows))
        opening, size = terms.G @ vdot - terms.gamma, accelerations_at_hand(terms, settings)
        if all(opening[k] >= -AT_ONCE * size[k] for k in departing):
            return now
    return closed_at_rest(motion, terms, resting, settings)


def _low(
    motion: Motion,
    terms: Terms,
    v: Vector,
    touching: Collection[int],
    small: Vector,
    slow: Vector,
) -> tuple[set[int], set[int]]:
    """Of the contacts that touch, after an impact: those that rest, and those that rise, but by no more than
    touching contacts may be apart, s^2 / (2 |f''|): so bounces, and a block's rocking, that would never end
    do end."""
    s = terms.G @ v - terms.nu
    resting = {k for k in touching if abs(s[k]) <= slow[k]}
    rising = {k for k in touching if s[k] > slow[k]}
    if not rising:
        return resting, set()
    rows = motion.system.active(as_flags(motion.system, resting))
    vdot, _, _ = motion.accelerations(terms.of(rows))
    fall = terms.gamma - terms.G @ vdot
    return resting, {k for k in rising if s[k] ** 2 <= 2 * fall[k] * small[k]}


def _left_behind(motion: Motion, settings: Settings, state: State, terms: Terms) -> frozenset[int]:
    """The closed contacts that cannot have followed their surface to where it stands now."""
    system = motion.system
    closed = closed_rows(system, state.closed)
    if not closed:
        return frozenset()
    q, v = np.array(state.q), np.array(state.v)
    rows = system.active(state.closed)
    _, lam, decomposed = motion.accelerations(terms.of(rows))
    pressed = {
        k: max(x, 0.0) * size**2
        for k, x, size in zip(rows, lam.tolist(), decomposed.length.tolist(), strict=True)
    }  # the accelerations with which they would follow
    f, s, h = motion.residual(state.t, q), terms.G @ v - terms.nu, state.span
    small, slow = (
        gap_of_rounding(motion, state.t, q, state),
        speed_of_rounding(terms, v, settings),
    )
    return frozenset(
        k
        for k in closed
        if f[k] > small[k] + pressed[k] * h**2 / 2 or s[k] > slow[k] + pressed[k] * h
    )


def _told(
    motion: Motion,
    state: State,
    before: Vector,
    was: frozenset[int],
    struck: Impact | None,
    slow: Vector,
    terms: Terms,
) -> State:
    """The same with what happened to each contact written down: a closing with the velocities of `before`, a
    departure with those that it begins with."""
    system, t = motion.system, state.t
    length = rows_of(terms.M, terms.G).length
    arriving = motion.whole(t, np.array(state.q), before)
    leaving = motion.whole(t, np.array(state.q), np.array(state.v))
    departures, closings = list(state.departures), list(state.closings)
    for c, k in enumerate(system.contacts):
        impulse = 0.0 if struck is None else float(struck.impulses[k])
        blow = impulse * length[k] ** 2 > slow[k]
        if blow or (state.closed[c] and k not in was):
            closings[c] = Event(closings[c].count + 1, t, *arriving, impulse)
        if k in was and not state.closed[c]:
            departures[c] = Event(departures[c].count + 1, t, *leaving)
    return replace(state, departures=tuple(departures), closings=tuple(closings))
