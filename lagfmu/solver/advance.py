"""One communication step: SciPy's integrator step by step, projection after each, events in between.

    y = (q, v) ,  y' = (B v + b, vdot)      the index-1 equations; lambda is eliminated or solved for in
    each one

The integrators are scipy.integrate's DOP853 (Hairer, Norsett & Wanner, Solving Ordinary Differential
Equations I, sect. II.5 and II.6) and Radau (Hairer & Wanner II, sect. IV.8).  After each accepted step y
is projected, and the next step begins there.  The error of a step is weighed by tolerance * max(|y_i|,
s_i), s_i being the size of the coordinate or, for a speed, what forces give it within that size.  The
integrator begins anew at each communication point and after each event.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.integrate import DOP853, Radau

from ..numeric.failure import StepFailureError
from ..numeric.system import System, Vector
from .equations import Motion, Ranks
from .events import Found, Search
from .projection import project_positions, project_velocities
from .state import Settings, State
from .switch import at_event, begun

INTEGRATORS = {"auto": DOP853, "dop853": DOP853, "radau": Radau}
HEADWAY = 1e-6  # of the natural time: shorter steps are counted
PATIENCE = 200  # steps after which a communication step is judged by its average step, ...
STEP_LIMIT = 1e6  # ... and the steps that it may need in all
NOTHING = 1e-100  # [1/s] in units of the error: the squares in SciPy's norm underflow, and it divides by 0
CROWD = (
    200  # events within 1e-9 of the natural time, and attempts at one step: there is no going on
)


def advance(
    system: System,
    settings: Settings,
    state: State,
    u: Sequence[float],
    p: Sequence[float],
    end: float,
) -> State:
    """The state at `end` [s], with the inputs u as they were set at state.t.

    Raises StepFailureError with the reason why that is not reached.
    """
    motion, start = Motion(system, u, p, state.t), state.t
    with np.errstate(all="ignore"):
        settings = _scaled(motion, settings, state, end - start)
        headway = _Headway(settings, state, end)
        state, latest, crowd = begun(motion, settings, state), state.t, 0
        while state.t < end:
            state, found = _segment(motion, settings, state, end, headway)
            if found is None:
                continue
            state = replace(at_event(motion, settings, state, found), step=0.0)
            crowd = crowd + 1 if state.t - latest <= 1e-9 / settings.rate else 0
            latest = state.t
            if crowd > CROWD:
                raise StepFailureError(
                    f"more than {CROWD} events follow each other at t = {state.t!r} s without headway"
                )
    return replace(state, span=end - start)


def looked_at(
    system: System,
    settings: Settings,
    state: State,
    u: Sequence[float],
    p: Sequence[float],
) -> State:
    """The state with which a step would begin, the inputs being set to u; its counts tell of the past
    alone.
    """
    with np.errstate(all="ignore"):
        seen = begun(Motion(system, u, p, state.t), settings, state)
    return replace(state, q=seen.q, v=seen.v, closed=seen.closed)


def _scaled(motion: Motion, settings: Settings, state: State, h: float) -> Settings:
    """With a size for each displacement and coordinate.  Where the start says none (all at 0, no lengths)
    it is the way that it goes in this communication step, or else one that takes as much kinetic energy as
    those of the others.
    """
    size, span = np.array(settings.size), np.array(settings.span)
    rate = settings.rate or 1 / h
    if (size == 0).any() or (span == 0).any():
        q, v = np.array(state.q), np.array(state.v)
        terms = motion.terms(state.t, q, v)
        vdot, _, rows = motion.accelerations(terms.of(motion.system.active(state.closed)))
        span = np.where(span > 0, span, np.abs(v) * h + np.abs(vdot) * h**2 / 2)
        span = np.where(span > 0, span, rows.D * float((span / rows.D).max() or 1.0))
        way = np.abs(motion.system.shift(state.t, q, span, motion.inputs(state.t), motion.p))
        way = np.maximum(way, np.abs(motion.rate(state.t, q, v)) * h)  # of what no speed moves
        size = np.where(size > 0, size, np.where(way > 0, way, 1.0))
    swift = np.where(np.array(settings.swift) > 0, settings.swift, rate * span)
    return replace(
        settings,
        size=tuple(size.tolist()),
        span=tuple(span.tolist()),
        swift=tuple(swift.tolist()),
        rate=rate,
    )


class _Headway:
    """What refuses a communication step that comes to no end."""

    def __init__(self, settings: Settings, state: State, end: float) -> None:
        self.begun, self.end, self.first, self.tiny = state.t, end, state.steps, 0
        self.shortest, self.most = HEADWAY / settings.rate, settings.maximum_steps

    def check(self, t: float, length: float, steps: int) -> None:
        """After a step of that length to t, by which there were so many steps.  Raises StepFailureError."""
        self.tiny += length < self.shortest
        if 0 < self.most < self.tiny:
            raise StepFailureError(
                f"no headway at t = {t!r} s: more than {self.most:.0f} internal steps (solver.maximum_steps) "
                f"were shorter than {self.shortest:.2g} s, {HEADWAY:.0e} of the motion's natural time"
            )
        done, gone = steps - self.first, t - self.begun
        if done >= PATIENCE and done * (self.end - self.begun) > STEP_LIMIT * gone:
            raise StepFailureError(
                f"the communication step to t = {self.end!r} s would need about "
                f"{done * (self.end - self.begun) / gone:.0e} internal steps, more than {STEP_LIMIT:.0e}: "
                "take a shorter one"
            )


def _segment(
    motion: Motion, settings: Settings, state: State, end: float, headway: _Headway
) -> tuple[State, Found | None]:
    """The smooth motion to `end` or to the next event; the state there, and the event."""
    system, n = motion.system, motion.system.nq
    span = np.array(settings.span)
    rows = system.active(state.closed)
    t, y = state.t, np.array([*state.q, *state.v])
    ranks = motion.ranks(motion.terms(t, y[:n], y[n:]), rows)
    stepper = _Stepper(motion, settings, (rows, ranks.all), t, y, end, state.step)
    search = Search(motion, state, rows, ranks.all) if system.contacts else None
    steps, proposed = state.steps, state.step
    while True:
        before, y = stepper.step(t, y)
        steps += 1
        found, now = None, stepper.t
        headway.check(now, stepper.length, steps)
        if search is not None:
            search.rank = ranks.all
            dense = stepper.dense()
            found = search.first(t, now, dense)
            if found is not None:
                now, y = found.t, dense(found.t)
            state = search.opened(state, now, dense)
        q, v, ranks = _projected(motion, now, y, rows, span, ranks)
        t, y, stepper.rank = now, np.concatenate([q, v]), ranks.all
        if found is not None or now >= end:
            proposed = stepper.proposal(before)
            break
        stepper.go_on_from(y)
    state = replace(
        state, t=t, q=tuple(q.tolist()), v=tuple(v.tolist()), steps=steps, step=proposed
    )
    return state, found


def _projected(
    motion: Motion, t: float, y: Vector, rows: Sequence[int], span: Vector, ranks: Ranks
) -> tuple[Vector, Vector, Ranks]:
    """q and v on the constraints, and how many of `rows` are independent there."""
    n = motion.system.nq
    q, v = y[:n], y[n:]
    q = project_positions(motion, t, q, v, rows, span, ranks.positions)
    if not rows:
        return q, v, ranks
    terms = motion.terms(t, q, v)
    ranks = motion.ranks(terms, rows)
    return q, project_velocities(terms.of(rows), v), ranks


class _Stepper:
    """One of SciPy's integrators on the index-1 equations of one mode."""

    def __init__(
        self,
        motion: Motion,
        settings: Settings,
        rows: tuple[Sequence[int], int],
        t: float,
        y: Vector,
        end: float,
        first: float,
    ) -> None:
        self.motion, self.settings, self.end = motion, settings, end
        self.rows, self.rank = rows
        scale = [*settings.size, *settings.swift]
        self.weights = settings.tolerance * np.array(scale)
        self.method: Any = self._begin(t, y, first)

    @property
    def t(self) -> float:
        """Where it stands [s]."""
        return float(self.method.t)

    @property
    def length(self) -> float:
        """Of the latest step [s]."""
        return float(self.method.step_size)

    def step(self, t: float, y: Vector) -> tuple[float, Vector]:
        """One accepted step from (t, y): the length [s] that was tried for it, and y at its end.

        A step on which the equations cannot be evaluated is tried again, shorter.
        """
        for _ in range(CROWD):
            tried = float(self.method.h_abs)
            try:
                message = self.method.step()
            except StepFailureError as error:
                shorter = tried / 4
                if not t + shorter > t:
                    raise
                cause = error
                self.method = self._begin(t, y, shorter)
                continue
            if self.method.status == "failed":
                raise StepFailureError(f"step size underflow at t = {self.t!r} s: {message}")
            return tried, self.method.y
        raise cause

    def dense(self) -> Any:
        """The continuous extension of the latest step: y(t)."""
        return self.method.dense_output()

    def go_on_from(self, y: Vector) -> None:
        """Let the next step begin at y instead of where the latest ended."""
        self.method.y, self.method.f = y, self._rates(self.t, y)

    def proposal(self, tried: float) -> float:
        """The next step [s]: the latest was cut at the end, so that it says little itself."""
        return max(tried, float(self.method.h_abs))

    def _begin(self, t: float, y: Vector, first: float) -> Any:
        settings = self.settings
        longest = settings.maximum_step or np.inf
        method = INTEGRATORS[settings.method](
            self._rates,
            t,
            y,
            self.end,
            max_step=longest,
            rtol=settings.tolerance,
            atol=self.weights,
            first_step=min(first, self.end - t, longest) or None,
        )
        if not 0 < method.h_abs < np.inf:  # SciPy's first step, of numbers beyond what doubles hold
            raise StepFailureError(f"no step can be chosen at t = {t!r} s")
        return method

    def _rates(self, t: float, y: Vector) -> Vector:
        """(q', vdot) at y = (q, v)."""
        n = self.motion.system.nq
        q, v = y[:n], y[n:]
        terms = self.motion.terms(t, q, v).of(self.rows)
        vdot, _, _ = self.motion.accelerations(terms, self.rank)
        rates = np.concatenate([self.motion.rate(t, q, v), vdot])
        rates[np.abs(rates) < NOTHING * self.weights] = 0.0
        return rates
