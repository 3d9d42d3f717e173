"""Which frictions stick and which slip, and what is watched until that changes.

At s = 0 a friction sticks if the sticking solution lies within its cone, |lambda_t| <= mu_s N.  If not, it
slips in the direction in which it begins to move under the force of that very slip: s/|s| = s'/|s'| with
s' = G_t vdot - gamma_t of the equations of sliding.  For one row that is a choice of two; for two rows a
root on the circle, the one nearest to "against lambda_t".  All frictions that stand at s = 0 are settled
together: the worst slips first; where that goes wrong, every combination is tried, most sticking first
(Pfeiffer & Glocker 1996, chs. 5 and 6).

Where sliding one way is Painleve's paradox, a body at rest may have several accelerations: it sticks, or its
contact opens (Genot & Brogliato 1999).  Both are looked at wherever the one or the other begins.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .. import names
from .failure import StepFailureError
from .flow import Flow
from .friction import heading, loaded, slip_velocity
from .instant import Instant, Motion
from .motion import motion
from .painleve import paradox
from .ranges import Range, first_of_frictions
from .state import Departure, Slide, State
from .system import Matrix, System, Vector
from .thresholds import (
    SLIDES_ANGLES,
    SLIDES_BACK,
    SLIDES_JUMP,
    SLIDES_MOST,
    SLIDES_ROUNDS,
    SLIDES_SLACK,
)

NODES, WEIGHTS = np.polynomial.legendre.leggauss(5)  # of the work done by friction within a step


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
    return np.array([SLIDES_SLACK * unit[list(f.rows)].sum() for f in system.frictions])


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
    for _ in range(SLIDES_ROUNDS):
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
        still |= (slide.sticks or i in ended) and length <= SLIDES_JUMP * slide.noise
        if on[i] and still:
            resting.append(i)
        else:
            slides[i] = _along(slide, s[i])
    now = _Now(at, q, v, active)
    if not resting:
        return _signed(now, slides)
    return _Rest(now, resting, slides, begins).settled()


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
        except StepFailureError:
            continue
        if on[i] or now.press.reserve[i] >= 0:
            raise StepFailureError(
                f"friction {f.name!r}: at rest it has several accelerations at t = {float(at.t)!r} s: it "
                "sticks, or its contact opens (Painleve's paradox: in one direction of slip the normal "
                "force would drive itself): use a smaller coefficient of friction, or let the bodies "
                "deform (a spring in the contact)"
            )


class _Now:
    """Motions at one state in trial modes."""

    def __init__(self, at: Instant, q: Vector, v: Vector, active: Sequence[int]) -> None:
        self.at, self.q, self.v, self.active = at, q, v, active

    def motion(self, slides: Sequence[Slide]) -> Motion:
        return motion(replace(self.at, slides=tuple(slides)), self.q, self.v, self.active)


def _signed(now: _Now, slides: list[Slide]) -> tuple[Slide, ...]:
    """The slides with the signs of their normal forces.  Raises StepFailureError where neither fits."""
    for _ in range(len(slides) + 1):
        found = now.motion(slides)
        wrong = _pulling(now, found, slides)
        if not wrong:
            return tuple(slides)
        for i in wrong:
            slides[i] = replace(slides[i], sign=-slides[i].sign)
    raise paradox(now.at, wrong, -1.0)


def _pulling(now: _Now, found: Motion, slides: Sequence[Slide]) -> list[int]:
    """Frictions that slip with a negative normal force which no contact could give up."""
    frictions = now.at.system.frictions
    return [
        i
        for i, slide in enumerate(slides)
        if not slide.sticks
        and not frictions[i].gated
        and found.press.normal[i] < -SLIDES_SLACK * abs(found.lam).max(initial=0.0)
    ]


class _Rest:
    """The frictions `resting` at s = 0, settled together; the others slip as in `slides`."""

    def __init__(
        self, now: _Now, resting: list[int], slides: list[Slide], begins: Collection[int]
    ) -> None:
        self.now, self.resting = now, resting
        self.slides, self.begins = slides, set(begins)
        self.rows = [list(f.rows) for f in now.at.system.frictions]

    def settled(self) -> tuple[Slide, ...]:
        stuck = self._with(self.resting, {})
        try:
            held = self.now.motion(stuck)
        except StepFailureError:  # what drives the bodies accelerates some of them
            ahead = {i: self.slides[i].direction for i in self.resting}
            driven = self._within_cones(ahead)
            if driven is None:
                raise
            return driven
        against = {i: self._against(held, i) for i in self.resting}
        sticking = [i for i in self.resting if i not in self.begins]
        if self.begins:  # beyond its cone it slips against lambda_t, or not at all
            _signed(self.now, self._with(sticking, against))
        while True:  # the worst slips first
            found = self._trial(sticking, against)
            if found is None:
                break
            slides, now = found
            over = [i for i in sticking if now.press.reserve[i] < -SLIDES_SLACK]
            if not over:
                return slides
            worst = min(over, key=lambda i: now.press.reserve[i])
            against[worst] = self._against(now, worst)
            sticking = [i for i in sticking if i != worst]
        settled = self._within_cones(against)
        if settled is None:
            raise paradox(self.now.at, self.resting, 0.0)
        return settled

    def _within_cones(self, guess: dict[int, tuple[float, float]]) -> tuple[Slide, ...] | None:
        """The combination with most sticking in which all that stick are within their cones."""
        for slides, now in self._all(guess):
            if all(now.press.reserve[i] >= -SLIDES_SLACK for i in self.resting if slides[i].sticks):
                return slides
        return None

    def _with(
        self, sticking: Collection[int], towards: dict[int, tuple[float, float]]
    ) -> list[Slide]:
        slides = list(self.slides)
        for i in self.resting:
            slides[i] = replace(slides[i], sticks=i in sticking)
            if i in towards and i not in sticking:
                slides[i] = replace(slides[i], direction=towards[i])
        return slides

    def _against(self, held: Motion, i: int) -> tuple[float, float]:
        """The direction in which the friction would begin to slip, opposite to lambda_t."""
        t = held.press.tangential[i]
        length = float(np.hypot(t[0], t[1]))
        if not length > 0:
            return self.slides[i].direction
        return float(-t[0] / length), float(-t[1] / length)

    def _trial(
        self, sticking: Collection[int], guess: dict[int, tuple[float, float]]
    ) -> tuple[tuple[Slide, ...], Motion] | None:
        """With these sticking, the others slipping each in a direction of its own acceleration."""
        towards = dict(guess)
        slipping = [i for i in self.resting if i not in sticking]
        slides = self._with(sticking, towards)
        for _ in range(SLIDES_ROUNDS):
            try:
                slides = list(_signed(self.now, slides))
                turned = False
                for i in slipping:
                    new = self._steered(slides, i)
                    if new is None:
                        return None
                    turned |= new != slides[i].direction
                    slides[i] = replace(slides[i], direction=new)
                if not turned:
                    return tuple(slides), self.now.motion(slides)
            except StepFailureError:
                return None
            if len(slipping) == 1:
                slides = list(_signed(self.now, slides))
                return tuple(slides), self.now.motion(slides)
        return None

    def _all(
        self, guess: dict[int, tuple[float, float]]
    ) -> Iterator[tuple[tuple[Slide, ...], Motion]]:
        """Every combination, those with most sticking first."""
        free = self.resting[:SLIDES_MOST]
        for count in range(len(free) + 1):
            for slipping in itertools.combinations(free, count):
                sticking = [i for i in self.resting if i not in slipping]
                for signs in itertools.product((1.0, -1.0), repeat=count):
                    towards = dict(guess)
                    for i, sign in zip(slipping, signs, strict=True):
                        towards[i] = (sign * guess[i][0], sign * guess[i][1])
                    found = self._trial(sticking, towards)
                    if found is not None:
                        yield found

    def _rate(self, slides: Sequence[Slide], i: int) -> tuple[Vector, float]:
        """s' = G_t vdot - gamma_t of a friction, and what of it is rounding."""
        now = self.now.motion(slides)
        rows = self.rows[i]
        rate = np.zeros(2)
        rate[: len(rows)] = now.G[rows] @ now.vdot - now.gamma[rows]
        mass = now.M.diagonal()
        forces = np.abs(now.F) + np.abs(now.G).T @ np.abs(now.lam)
        free = np.maximum(np.abs(now.vdot), forces / np.where(mass > 0, mass, np.inf))
        floor = SLIDES_BACK * (np.abs(now.gamma[rows]) + np.abs(now.G[rows]) @ free).sum()
        return rate, float(floor)

    def _steered(self, slides: list[Slide], i: int) -> tuple[float, float] | None:
        """The direction that agrees with the acceleration; None if there is none."""
        e = slides[i].direction
        if len(self.rows[i]) == 1:
            rate, floor = self._rate(slides, i)
            if rate[0] * e[0] >= -floor:
                return e
            back = (-e[0], 0.0)
            slides[i] = replace(slides[i], direction=back)
            rate, floor = self._rate(slides, i)
            return back if rate[0] * back[0] >= -floor else None
        return self._on_circle(slides, i)

    def _on_circle(self, slides: list[Slide], i: int) -> tuple[float, float] | None:
        begin = float(np.arctan2(slides[i].direction[1], slides[i].direction[0]))

        def across(turn: float) -> tuple[float, float, float]:
            """s' across and along the direction at that angle, and what is rounding."""
            e = (float(np.cos(begin + turn)), float(np.sin(begin + turn)))
            slides[i] = replace(slides[i], direction=e)
            rate, floor = self._rate(slides, i)
            return e[0] * rate[1] - e[1] * rate[0], float(rate @ e), floor

        def at(turn: float) -> tuple[float, float]:
            return float(np.cos(begin + turn)), float(np.sin(begin + turn))

        c, along, floor = across(0.0)
        if abs(c) <= floor and along >= -floor:
            return at(0.0)
        step = 2 * np.pi / SLIDES_ANGLES
        for k in range(SLIDES_ANGLES // 2 + 1):  # nearest first, both ways
            for side in (1.0, -1.0):
                low, high = side * k * step, side * (k + 1) * step
                f_low, f_high = across(low)[0], across(high)[0]
                if f_low * f_high > 0:
                    continue
                for _ in range(60):
                    middle = (low + high) / 2
                    f = across(middle)[0]
                    if f_low * f > 0:
                        low, f_low = middle, f
                    else:
                        high = middle
                _, along, floor = across(low)
                if along >= -floor:
                    return at(low)
        return None


def is_slipping(flow: Flow) -> bool:
    """True if some friction does work."""
    on = loaded(flow.system, flow.rows)
    return any(presses and not s.sticks for presses, s in zip(on, flow.state.slides, strict=True))


def dissipated(flow: Flow, dense: Any, t0: float, t1: float) -> float:
    """- int sum lambda_t . s dt [J] over a part of a step (Gauss's rule of order 10)."""
    if not t1 > t0 or not is_slipping(flow):
        return 0.0
    work = 0.0
    for node, weight in zip(NODES, WEIGHTS, strict=True):
        t = t0 + (t1 - t0) * (1 + node) / 2
        q, v = flow.split(dense(t))
        work += weight * float(power(flow.near(t, q, v)).sum())
    return -work * (t1 - t0) / 2


def power(now: Motion) -> Vector:
    """lambda_t . s [W] of each friction."""
    press = now.press
    return np.asarray((press.tangential * press.slip).sum(axis=1))


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
        away = slide.sticks and np.hypot(x[0], x[1]) > SLIDES_JUMP * slide.noise
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


def observed(system: System, state: State, now: Motion) -> dict[str, float | int | bool]:
    """What frictions report, by name."""
    press, work = now.press, power(now)
    values: dict[str, float | int | bool] = {names.DISSIPATED: state.dissipated}
    for i, (f, slide) in enumerate(zip(system.frictions, state.slides, strict=True)):
        on = bool(press.loaded[i])
        force = float(np.hypot(*press.tangential[i]))
        values[names.name(names.STICKS, f.name)] = on and slide.sticks
        for j, k in enumerate(f.rows):
            values[names.name(names.SLIP, system.rows[k].name)] = float(press.slip[i, j])
        values[names.name(names.MARGIN, f.name)] = float(press.static[i] * press.normal[i]) - force
        values[names.name(names.POWER, f.name)] = 0.0 if slide.sticks else float(work[i])
        latest = state.slippings[i]
        values[names.name(names.SLIPS, f.name)] = latest.count
        values[names.name(names.SLIP_TIME, f.name)] = latest.time
        for j, name in enumerate(system.coordinates):
            values[names.name(names.SLIPPING, f.name, name)] = latest.q[j]
            values[names.name(names.SLIPPING, f.name, name, 1)] = latest.v[j]
    return values


def indicators(flow: Flow, now: Motion) -> list[float]:
    """Two a friction: the reserve of the cone while it sticks, the slip velocity along its direction
    while it slips; and the normal force while it slips on what is no contact."""
    press = now.press
    values = []
    for i, (f, slide) in enumerate(zip(flow.system.frictions, flow.state.slides, strict=True)):
        if not press.loaded[i]:
            values += [1.0, 1.0]
        elif slide.sticks:
            values += [float(press.reserve[i]), 1.0]
        else:
            values += [
                float(press.slip[i] @ np.array(slide.direction)),
                1.0 if f.gated else float(press.normal[i]),
            ]
    return values


def ranges(flow: Flow) -> list[Range]:
    """The range of each; what begins on the edge has to get inside before it can leave there."""
    found = []
    for slide in flow.state.slides:
        found += [
            Range(0.0, slack=SLIDES_SLACK if slide.sticks else slide.noise, rises=True),
            Range(0.0),
        ]
    return found
