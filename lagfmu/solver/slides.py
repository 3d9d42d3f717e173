"""Which frictions stick and which slip, together with the contacts, and when that changes.

Where sliding one way is Painleve's paradox, a body at rest may have several accelerations: it sticks, or its
contact opens (Genot & Brogliato 1999).  Both are looked at wherever the one or the other begins.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..numeric.failure import StepFailureError
from ..numeric.system import Matrix, System, Vector
from ..numeric.thresholds import FRICTION_BACK, FRICTION_JUMP, FRICTION_ROUNDS, FRICTION_SLACK
from .flow import Flow
from .friction import heading, loaded, slip_velocity
from .instant import Instant, Motion
from .motion import motion
from .painleve import NEVER_SLIPS
from .ranges import first_of_frictions
from .rest import Now, Rest, signed
from .state import Departure, Slide, State


@dataclass(frozen=True)
class Contacts:
    """The contacts at a state, for given frictions and from a guess of their modes.

    settled(at, closed): the modes; complementary(at, closed): by the accelerations alone; `touching` and
    `leaving`: positions, as in contacts.py.
    """

    settled: Callable[[Instant, tuple[bool, ...]], tuple[bool, ...]]
    complementary: Callable[[Instant, tuple[bool, ...]], tuple[bool, ...]]
    touching: Collection[int]
    leaving: Collection[int] = ()


def noises(system: System, G: Matrix, nu: Vector, speed: Vector) -> Vector:
    """The slip velocity [m/s] of each friction that rounding of velocities of the size `speed` makes."""
    unit = np.abs(G) @ np.abs(speed) + np.abs(nu)
    return np.array([FRICTION_SLACK * unit[list(f.rows)].sum() for f in system.frictions])


def _noises(at: Instant, q: Vector, v: Vector, state: State) -> Vector:
    """That of the motion as it is."""
    _, _, G, nu, _ = at.evaluate(q, v)
    return noises(at.system, G, nu, np.maximum(np.abs(v), np.array(state.size) * state.rate))


def begun(at: Instant, q: Vector, v: Vector, size: Vector) -> tuple[Slide, ...]:
    """How frictions stand before anything is settled: slipping where there is a slip velocity."""
    M, F, G, nu, _ = at.evaluate(q, v)
    mass = M.diagonal()
    natural = np.sqrt(size * np.abs(F) / np.where(mass > 0, mass, np.inf))
    speed = np.maximum(np.abs(v), natural)
    s = slip_velocity(at.system, G, v, nu)
    return tuple(
        _along(Slide(noise=float(n)), x)
        for n, x in zip(noises(at.system, G, nu, speed), s, strict=True)
    )


def _along(slide: Slide, s: Vector) -> Slide:
    """Slipping along s, where it is not rounding."""
    length = float(np.hypot(s[0], s[1]))
    if not length > slide.noise:
        return replace(slide, sticks=False)
    return replace(slide, sticks=False, direction=(float(s[0] / length), float(s[1] / length)))


def settle(
    at: Instant,
    q: Vector,
    v: Vector,
    closed: tuple[bool, ...],
    contacts: Contacts,
    ended: Collection[int] = (),
    begins: Collection[int] = (),
) -> tuple[Instant, tuple[bool, ...]]:
    """The modes of frictions and contacts together: the instant with its frictions, and the contacts.

    `ended`: frictions whose slip velocity has just come to zero; `begins`: those that have just reached
    the edge of their cone, where rounding must not decide.
    """
    stuck = [slide.sticks for slide in at.slides]
    for _ in range(FRICTION_ROUNDS):
        at = replace(at, slides=_choose(at, q, v, closed, ended, begins))
        found = contacts.settled(at, closed)
        if found == closed:
            _check_rest(at, q, v, closed, stuck, contacts)
            return at, closed
        closed = found
    raise StepFailureError(
        f"no combination of sticking, slipping and open contacts satisfies their laws at t = "
        f"{float(at.t)!r} s: the sliding problem has no solution, or several (Painleve)"
    )


def _choose(
    at: Instant,
    q: Vector,
    v: Vector,
    closed: Sequence[bool],
    ended: Collection[int],
    begins: Collection[int],
) -> tuple[Slide, ...]:
    """The frictions' modes for given contacts."""
    system = at.system
    active = system.active(closed)
    on = loaded(system, active)
    _, _, G, nu, _ = at.evaluate(q, v)
    s = slip_velocity(system, G, v, nu)
    resting = []
    slides = list(at.slides)
    for i, slide in enumerate(at.slides):
        length = float(np.hypot(s[i, 0], s[i, 1]))
        still = length <= slide.noise
        still |= (slide.sticks or i in ended) and length <= FRICTION_JUMP * slide.noise
        if on[i] and still:
            resting.append(i)
        else:
            slides[i] = _along(slide, s[i])
    now = Now(at, q, v, active)
    if not resting:
        return signed(now, slides)
    return Rest(now, resting, slides, begins).settled()


def _check_rest(
    at: Instant,
    q: Vector,
    v: Vector,
    closed: tuple[bool, ...],
    stuck: Sequence[bool],
    contacts: Contacts,
) -> None:
    """Raises StepFailureError if a friction at rest that begins to stick might as well let its contact
    open, or one whose contact is open might as well stick.  `stuck`: those that stuck before."""
    system = at.system
    _, _, G, nu, _ = at.evaluate(q, v)
    s = slip_velocity(system, G, v, nu)
    on = loaded(system, system.active(closed))
    for i, (f, slide) in enumerate(zip(system.frictions, at.slides, strict=True)):
        if not f.gated or (stuck[i] if on[i] else not np.hypot(*s[i]) <= slide.noise):
            continue
        own = {c for c, k in enumerate(system.contacts) if k in f.normal and c in contacts.touching}
        if not own or own & {*contacts.leaving} or (on[i] and not slide.sticks):
            continue
        other = tuple(not on[i] if c in own else shut for c, shut in enumerate(closed))
        slides = list(at.slides)
        slides[i] = replace(slide, sticks=not on[i])
        trial = replace(at, slides=tuple(slides))
        try:
            if contacts.complementary(trial, other) != other:
                continue
            now = motion(trial, q, v, system.active(other))
            apart = now if on[i] else motion(at, q, v, system.active(closed))
        except StepFailureError:
            continue
        if not any(_parts(apart, system.contacts[c]) for c in own):
            continue  # one of several surfaces that share a load: the same motion
        if on[i] or now.press.reserve[i] >= 0:
            raise StepFailureError(
                f"friction {f.name!r}: at rest it has several accelerations at t = {float(at.t)!r} s: it "
                "sticks, or its contact opens (Painleve's paradox: in one direction of slip the normal "
                "force would drive itself): use a smaller coefficient of friction, or let the bodies "
                f"deform (a spring in the contact); {NEVER_SLIPS}"
            )


def _parts(now: Motion, row: int) -> bool:
    """Whether the surface of a contact goes away, beyond rounding of the accelerations at work."""
    mass = now.M.diagonal()
    forces = np.abs(now.F) + np.abs(now.G).T @ np.abs(now.lam)
    reach = np.maximum(np.abs(now.vdot), forces / np.where(mass > 0, mass, np.inf))
    floor = FRICTION_BACK * (abs(now.gamma[row]) + np.abs(now.G[row]) @ reach)
    return bool(now.G[row] @ now.vdot - now.gamma[row] > floor)


def turned(flow: Flow, t: float, y: Vector) -> tuple[Slide, ...]:
    """The slides with the directions that two rows have at the end of a step."""
    slides = flow.state.slides
    if all(
        s.sticks or len(f.rows) == 1 for s, f in zip(slides, flow.system.frictions, strict=True)
    ):
        return slides
    q, v = flow.split(y)
    _, _, G, nu, _ = flow.at(t).evaluate(q, v)
    s = slip_velocity(flow.system, G, v, nu)
    found = []
    for i, slide in enumerate(slides):
        e = heading(slide, s[i])
        found.append(
            slide if slide.sticks else replace(slide, direction=(float(e[0]), float(e[1])))
        )
    return tuple(found)


def renewed(at: Instant, state: State) -> State:
    """Frictions that stuck and of which an input has moved the surface away now slip."""
    if not any(slide.sticks for slide in state.slides):
        return state
    q, v = np.array(state.q), np.array(state.v)
    _, _, G, nu, _ = at.evaluate(q, v)
    s = slip_velocity(at.system, G, v, nu)
    noise = _noises(at, q, v, state)  # at the start nothing may have been at work
    slides = [replace(x, noise=float(n)) for x, n in zip(state.slides, noise, strict=True)]
    moved, slippings = [], list(state.slippings)
    for i, (slide, x) in enumerate(zip(slides, s, strict=True)):
        away = slide.sticks and np.hypot(x[0], x[1]) > FRICTION_JUMP * slide.noise
        moved.append(_along(slide, x) if away else slide)
        if away:
            slippings[i] = Departure(slippings[i].count + 1, state.t, state.q, state.v)
    return replace(state, slides=tuple(moved), slippings=tuple(slippings))


def switched_slides(
    at: Instant,
    q: Vector,
    v: Vector,
    arriving: Vector,
    state: State,
    left: Collection[int],
    contacts: Contacts,
) -> tuple[Instant, State]:
    """After the event at which the indicators `left` left their ranges, and after its impacts: the
    frictions and contacts settled together, with the level that sticking rows keep, what impacts have
    dissipated (`arriving`: velocities before them) and the latest starts of slipping.

    state.closed are the contacts as they were settled without frictions.
    """
    system, before = at.system, at.slides
    mine = [i - first_of_frictions(system) for i in left if i >= first_of_frictions(system)]
    M, _, G, nu, _ = at.evaluate(q, v)
    noise = _noises(at, q, v, state)
    slides = [replace(s, noise=float(n)) for s, n in zip(before, noise, strict=True)]
    for i in mine:
        if i % 2:  # the normal force of a bilateral constraint turns over
            slides[i // 2] = replace(slides[i // 2], sign=-slides[i // 2].sign)
    begins = {i // 2 for i in mine if i % 2 == 0 and before[i // 2].sticks}
    ended = {i // 2 for i in mine if i % 2 == 0} - begins
    at = replace(at, slides=tuple(slides))
    at, closed = settle(at, q, v, state.closed, contacts, ended, begins)
    offset, f = np.array(state.offset), at.residual(q)
    slippings = list(state.slippings)
    on = loaded(system, system.active(closed))
    for i, (old, new) in enumerate(zip(before, at.slides, strict=True)):
        if new.sticks and not old.sticks:
            rows = list(system.frictions[i].rows)
            offset[rows] = f[rows]
        if on[i] and old.sticks and not new.sticks:
            count = slippings[i].count + 1
            slippings[i] = Departure(count, at.t, tuple(q.tolist()), tuple(v.tolist()))
    return at, replace(
        state,
        closed=closed,
        offset=tuple(offset.tolist()),
        slides=at.slides,
        slippings=tuple(slippings),
        dissipated=state.dissipated + _lost(M, G, nu, arriving, v),
    )


def _lost(M: Matrix, G: Matrix, nu: Vector, before: Vector, after: Vector) -> float:
    """- Lambda . (s+ + s-)/2 = T- - T+ + Lambda . nu [J] of an impact M (v+ - v-) = G^T Lambda."""
    push = M @ (after - before)
    if not push.any():
        return 0.0
    loss = -float(push @ (after + before)) / 2
    if nu.any():
        loss += float(np.linalg.lstsq(G.T, push, rcond=None)[0] @ nu)
    return loss
