"""From one communication point to the next: steps, projection after each, and contact events.

Within a leg the contact modes are fixed and the index-1 equations

    q' = v ,   v' = vdot(t, q, v)   with   M vdot = F + G^T lambda ,  G vdot = gamma

are integrated; every accepted step is projected onto f = 0 and G v = nu (Hairer & Wanner II, sect.
VII.2).  lambda of a closed contact and f of an open one are watched.  Where one changes its sign the
time is bracketed to rounding, each trial being an integration from the last accepted point, so that
the event does not depend on the communication step.
"""

from __future__ import annotations

import collections
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from .contacts import complementary_modes, impact
from .failure import StepFailureError
from .instant import Instant
from .magnitudes import complete, is_incomplete
from .methods import stepper
from .motion import EPS, motion, project
from .state import Departure, Settings, State
from .system import System, Vector

LARGEST_LOOK, SMALLEST_LOOK = 1 / 4, 1 / 200  # parts of a step in which events are looked for
DIPS, SHALLOW = 3, 0.1  # parabolas drawn, and how low, of the looks, they must go to be looked into
ROUNDS = 50  # in which an impact is passed on between contacts that touch
FAR, LEAST_FAR = 1e3, 1e-6  # how far a projection may move the state: in tolerances, and at least
HOPELESS = 1.0  # error of one rk4 step, relative to the state, at which it means nothing
CHATTER = 200  # contact events in next to no time after which the step is given up
PATIENCE = 200  # steps after which a communication step is judged by its average step
STEP_LIMIT = 1e7  # internal steps that a communication step may need
FEWEST_STEPS = 100  # rk4's steps in one natural time of the motion, unless solver.step is set


def advance(
    system: System,
    settings: Settings,
    state: State,
    u: Sequence[float],
    p: Sequence[float],
    t_end: float,
) -> State:
    """The state at t_end [s].  Raises StepFailureError; `state` is a value and stays what it was."""
    begun, first = state.t, state.steps
    events: collections.deque[float] = collections.deque(maxlen=CHATTER)
    if not np.isfinite(t_end) or t_end <= state.t:
        raise StepFailureError(
            f"a communication step must end after t = {state.t!r} s, got {t_end!r} s"
        )
    with np.errstate(all="ignore"):
        at = Instant(system, state.t, system.inputs_at(u, 0.0), p)
        state = _released(at, state)
        if is_incomplete(state):
            state = complete(at, settings, state, t_end - state.t)
        while state.t < t_end:
            leg = _Leg(system, settings, state, u, p, begun)
            state = _travel(leg, state, t_end, begun, first)
            events.append(state.t)
            if len(events) == CHATTER and events[-1] - events[0] < 1e-9 / state.rate:
                raise StepFailureError(
                    f"{CHATTER} contacts open or close in {events[-1] - events[0]:.1g} s at "
                    f"t = {state.t!r} s: the contacts chatter without end"
                )
    return state


def _released(at: Instant, state: State) -> State:
    """Contacts opened that a jump of a prescribed motion has left a gap in."""
    if not (at.system.prescribed and any(state.closed)):
        return state
    f = at.residual(np.array(state.q))[list(at.system.contacts)]
    gone = [shut and a > g for shut, a, g in zip(state.closed, f, state.gap, strict=True)]
    return replace(
        state,
        closed=tuple(bool(c and not g) for c, g in zip(state.closed, gone, strict=True)),
        armed=tuple(bool(a or g) for a, g in zip(state.armed, gone, strict=True)),
    )


@dataclass
class _Leg:
    """A stretch of time over which the contact modes do not change."""

    system: System
    settings: Settings
    state: State
    u: Sequence[float]
    p: Sequence[float]
    begun: float

    def __post_init__(self) -> None:
        self.rows = self.system.active(self.state.closed)
        self.offset = np.array(self.state.offset)
        self.scale = np.array(self.state.scale)
        self.size = np.array(self.state.size)
        self.cause = ""

    def at(self, t: float) -> Instant:
        return Instant(self.system, t, self.system.inputs_at(self.u, t - self.begun), self.p)

    def split(self, y: Vector) -> tuple[Vector, Vector]:
        return y[: self.system.n], y[self.system.n :]

    def rate(self, t: float, y: Vector) -> Vector:
        """y' (2 n); not a number where the equations cannot be evaluated: the step is cut there."""
        q, v = self.split(y)
        try:
            now = motion(self.at(t), q, v, self.rows)
        except StepFailureError as error:
            self.cause = str(error)
            return np.full_like(y, np.nan)
        return np.concatenate([v, now.vdot])

    def project(self, t: float, y: Vector) -> Vector:
        q, v = self.split(y)
        return np.concatenate(project(self.at(t), q, v, self.rows, self.offset, self.size))

    def check_projection(self, t: float, y: Vector, projected: Vector) -> None:
        """Raises StepFailureError if the projection after an adaptive step moved the state by far more
        than the step's error can be: next to a singular configuration it leads to another branch."""
        far = max(FAR * self.settings.tolerance, LEAST_FAR)
        unit = np.maximum(np.abs(y), np.concatenate([self.size, self.size * self.state.rate]))
        moved = np.abs(projected - y)
        if self.settings.method == "rk4" or (moved <= far * unit).all():
            return
        j = int((moved / unit).argmax())
        raise StepFailureError(
            f"the integration stops at t = {float(t)!r} s, the projection onto the constraints moves "
            f"{self.system.coordinates[j % self.system.n]} by {float(projected[j] - y[j]):.3g}: "
            "the configuration is singular, or nearly so"
        )

    def indicators(self, t: float, y: Vector) -> Vector:
        """One a contact: lambda while closed, f while open."""
        q, v = self.split(y)
        at = self.at(t)
        contacts = list(self.system.contacts)
        values = at.residual(q)[contacts]
        if any(self.state.closed):
            lam = motion(at, q, v, self.rows).lam[contacts]
            values = np.where(self.state.closed, lam, values)
        return values

    def stepper(self, t: float, y: Vector, t_bound: float, first_step: float | None) -> Any:
        if self.settings.method == "rk4" and not self.settings.step:
            first_step = 1 / (FEWEST_STEPS * self.state.rate)
        elif self.settings.method == "rk4":
            first_step = self.settings.step
        return stepper(self.settings, self.rate, t, y, t_bound, self.scale, first_step)

    def step(self, solver: Any) -> None:
        """One accepted step, or the reason why there is none."""
        try:
            message = solver.step()
        except (ArithmeticError, ValueError, np.linalg.LinAlgError) as error:
            raise self.failure(solver.t, str(error)) from error
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            raise self.failure(solver.t, message or "the state is not finite")
        if self.settings.method == "rk4":
            speed = self.size * self.state.rate
            unit = np.maximum(np.abs(solver.y), np.concatenate([self.size, speed]))
            if not (np.abs(solver.error) <= HOPELESS * unit).all():
                raise self.failure(
                    solver.t,
                    f"rk4's step of {solver.h_abs:.3g} s is far too large: reduce solver.step",
                )

    def failure(self, t: float, message: str) -> StepFailureError:
        if "step size" in message:
            message = "step size underflow"
        cause = f": {self.cause}" if self.cause else ""
        return StepFailureError(f"the integration stops at t = {float(t)!r} s, {message}{cause}")

    def reach(self, t: float, y: Vector, t1: float) -> Vector:
        """The state at t1, integrated from (t, y) and projected."""
        if t1 <= t:
            return y
        solver = self.stepper(t, y, t1, t1 - t)
        while solver.status == "running":
            self.step(solver)
        return self.project(t1, solver.y)


def _travel(leg: _Leg, state: State, t_end: float, begun: float, first: int) -> State:
    """Integrate until t_end or the first event, whichever comes first; at an event, switch modes."""
    y = np.array(state.q + state.v)
    f0 = leg.rate(state.t, y)
    if not np.isfinite(f0).all():
        raise StepFailureError(leg.cause)
    solver = leg.stepper(state.t, y, t_end, state.step or None)
    armed = list(state.armed)
    steps = state.steps
    watch = bool(leg.system.contacts)
    before = leg.indicators(state.t, y) if watch else np.zeros(0)
    while True:
        t0, y0 = solver.t, solver.y
        offered = solver.h_abs
        leg.step(solver)
        steps += 1
        y1 = leg.project(solver.t, solver.y)
        if not (leg.system.prescribed and t0 == begun):  # it may have jumped when it was set
            leg.check_projection(solver.t, solver.y, y1)
        if watch:
            event, before = _first_event(leg, solver, t0, y0, y1, before, armed, state.gap)
            if event is not None:
                here = replace(state, step=offered, steps=steps, armed=tuple(armed))
                return _switch(leg, here, t0, y0, *event)
        if solver.t == t_end:
            n = leg.system.n
            return replace(
                state,
                t=t_end,
                q=tuple(y1[:n].tolist()),
                v=tuple(y1[n:].tolist()),
                armed=tuple(armed),
                step=float(max(solver.h_abs, offered)),  # the last step may have been cut short
                steps=steps,
            )
        solver.y, solver.f = y1, leg.rate(solver.t, y1)
        done = steps - first
        if done >= PATIENCE and done * (t_end - begun) > STEP_LIMIT * (solver.t - begun):
            needed = done * (t_end - begun) / (solver.t - begun)
            raise StepFailureError(
                f"the communication step to t = {t_end!r} s would need about {needed:.0e} internal "
                f"steps, more than {STEP_LIMIT:.0e}: take a shorter one"
            )


def _first_event(
    leg: _Leg,
    solver: Any,
    t0: float,
    y0: Vector,
    y1: Vector,
    before: Vector,
    armed: list[bool],
    gap: Sequence[float],
) -> tuple[tuple[float, list[int]] | None, Vector]:
    """The earliest sign change within the step just taken, as (time, contacts), if there is one."""
    times, values = _looks(leg, solver, t0, y0, before)
    times.append(solver.t)
    values.append(leg.indicators(solver.t, y1))
    for c, closed in enumerate(leg.state.closed):
        if closed:
            _look_into_dips(leg, solver, times, values, c)
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


def _looks(
    leg: _Leg, solver: Any, t0: float, y0: Vector, before: Vector
) -> tuple[list[float], list[Vector]]:
    """Times within the step at which the indicators are looked at, and their values, y0's first.

    A quarter of the step at most; while a contact is open, no further than half of the way to it at
    the present speed, |f| / (|G| |v|), so that a step is not taken across an obstacle; first where a
    rebound is highest, so that it is not taken across a bounce.
    """
    h, dense = solver.t - t0, solver.dense_output()
    highest = t0 + _top_of_rebound(leg, t0, y0, before)
    rows = [k for k, c in zip(leg.system.contacts, leg.state.closed, strict=True) if not c]
    times, values, y = [t0], [before], y0
    while True:
        stride = h * LARGEST_LOOK
        if rows:
            q, v = leg.split(y)
            _, _, G, nu, _ = leg.at(times[-1]).evaluate(q, v)
            f = np.abs(values[-1][[not c for c in leg.state.closed]])
            speed = np.abs(G[rows]) @ np.abs(v) + np.abs(nu[rows])
            ahead = 0.5 * f / np.where(speed > 0, speed, np.inf)
            near = float(ahead[speed > 0].min(initial=stride))
            stride = min(stride, max(near, h * SMALLEST_LOOK))
        t = times[-1] + stride
        if times[-1] < highest:
            t = min(t, highest)
        if t >= solver.t - h * SMALLEST_LOOK or t <= times[-1]:
            return times, values
        times.append(t)
        y = dense(t)
        values.append(leg.indicators(t, y))


def _top_of_rebound(leg: _Leg, t: float, y: Vector, values: Vector) -> float:
    """The time [s] in which an open contact that has just been left parts most, f' / (-f'')."""
    left = [
        (c, k)
        for c, k in enumerate(leg.system.contacts)
        if not leg.state.closed[c] and values[c] <= leg.state.gap[c]
    ]
    if not left:
        return float("inf")
    q, v = leg.split(y)
    now = motion(leg.at(t), q, v, leg.rows)
    speed, pull = now.G @ v - now.nu, now.gamma - now.G @ now.vdot
    return min(
        (
            float(speed[k] / pull[k])
            for c, k in left
            if speed[k] > 0
            and pull[k] > 0
            and speed[k] ** 2 > 2 * pull[k] * (leg.state.gap[c] - values[c])
        ),
        default=float("inf"),
    )


def _look_into_dips(
    leg: _Leg, solver: Any, times: list[float], values: list[Vector], contact: int
) -> None:
    """One more look, put in its place, if the multiplier passes below zero and back between two looks.

    The lowest point is that of a parabola through three neighbours, drawn again with it as one of them.
    """
    for i in range(len(times) - 2):
        t, lam = times[i : i + 3], [float(v[contact]) for v in values[i : i + 3]]
        for _ in range(DIPS):
            if min(lam) < 0:
                break
            lowest, depth = _vertex(t, lam)
            if not (t[0] < lowest < t[2]) or lowest in t or depth > SHALLOW * max(lam):
                break
            seen = leg.indicators(lowest, solver.dense_output()(lowest))
            if seen[contact] < 0:
                k = next(k for k, other in enumerate(times) if other > lowest)
                times.insert(k, lowest)
                values.insert(k, seen)
                return
            first = int(lowest > t[1])  # its neighbours: 0 and 1, or 1 and 2
            t = [t[first], lowest, t[first + 1]]
            lam = [lam[first], float(seen[contact]), lam[first + 1]]


def _vertex(t: Sequence[float], y: Sequence[float]) -> tuple[float, float]:
    """The lowest point of the parabola through three points; not a number if it has none."""
    left, right = (y[1] - y[0]) / (t[1] - t[0]), (y[2] - y[1]) / (t[2] - t[1])
    bend = (right - left) / (t[2] - t[0])
    if not bend > 0:
        return float("nan"), float("nan")
    slope = left + bend * (t[1] - t[0])  # at t[1]
    return t[1] - slope / (2 * bend), y[1] - slope * (slope / (4 * bend))


def _locate(
    leg: _Leg, t0: float, y0: Vector, lo: float, hi: float, contact: int, level: float
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


def _switch(leg: _Leg, state: State, t0: float, y0: Vector, t: float, contacts: list[int]) -> State:
    """The state right after the event at t: contacts opened or struck, modes settled together."""
    system, at = leg.system, leg.at(t)
    q, v = leg.split(leg.reach(t0, y0, t))
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
