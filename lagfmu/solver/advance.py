"""From one communication point to the next: flow after flow, each up to an event."""

from __future__ import annotations

import collections
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..numeric.failure import StepFailureError
from ..numeric.system import System, Vector
from ..numeric.thresholds import AT_ONCE, CHATTER, HEADWAY, PATIENCE, STEP_LIMIT
from . import optional_contacts, optional_events, optional_slides
from .flow import AfterStep, Flow
from .indicators import indicators
from .instant import Instant
from .jumps import levels_at, passed
from .magnitudes import complete, is_incomplete
from .motion import project
from .state import Settings, State
from .stiffness import Choice, Slope, explicit, explicit_step, implicit_step, is_due, unjudged_step


def advance(
    system: System,
    settings: Settings,
    state: State,
    u: Sequence[float],
    p: Sequence[float],
    t_end: float,
    after_step: AfterStep | None = None,
) -> State:
    """The state at t_end [s].  Raises StepFailureError; `state` is a value and stays what it was.

    `after_step`: with error bars (bars.py), what is done to the integrator after a step, and makes of
    State.local.
    """
    begun = state.t
    events: collections.deque[float] = collections.deque(maxlen=CHATTER)
    if not np.isfinite(t_end) or t_end <= state.t:
        raise StepFailureError(
            f"a communication step must end after t = {state.t!r} s, got {t_end!r} s"
        )
    with np.errstate(all="ignore"):
        at, state = beginning(system, state, u, p)
        if is_incomplete(state):
            state = complete(at, settings, state, t_end - state.t)
        headway = Headway(settings, begun, t_end, state.rate)
        while state.t < t_end:
            flow = Flow(system, settings, state, u, p, begun, after_step)
            state = _travel(flow, state, t_end, headway)
            events.append(state.t)
            if len(events) == CHATTER and events[-1] - events[0] < AT_ONCE / state.rate:
                raise StepFailureError(
                    f"{CHATTER} events in {events[-1] - events[0]:.1g} s at t = {state.t!r} s: contacts "
                    "chatter without end, or a force jumps to and fro"
                )
    return replace(state, span=t_end - begun)


def beginning(
    system: System, state: State, u: Sequence[float], p: Sequence[float]
) -> tuple[Instant, State]:
    """What each step begins with: the inputs may have been set.  Levels of jumps are those of now, contacts
    whose surface went away open, the others go with it; a prescribed motion may have another place and other
    rates than it went by.  Raises StepFailureError."""
    inputs = system.inputs_at(u, 0.0)
    if system.floors:
        levels = levels_at(system, state.t, np.array(state.q), inputs, p)
        state = replace(state, levels=levels)
    at = Instant(system, state.t, [*inputs, *state.levels], p, state.slides)
    if system.contacts and system.prescribed:
        state = optional_contacts.released(at, state, state.span)
    elif system.prescribed:
        q, v, rows = np.array(state.q), np.array(state.v), system.active(state.closed)
        q, v = project(at, q, v, rows, np.array(state.offset), np.array(state.size))
        state = replace(state, q=tuple(q.tolist()), v=tuple(v.tolist()))
    if system.frictions:
        state = optional_slides.renewed(at, state)
        at = replace(at, slides=state.slides)
    return at, state


@dataclass
class Headway:
    """Do the steps of one communication step, from `begun` to `t_end` [s], get anywhere?"""

    settings: Settings
    begun: float
    t_end: float
    rate: float
    steps: int = 0
    tiny: int = 0

    def check(self, t0: float, t: float) -> None:
        """Counts the step from t0 to t.  Raises StepFailureError if t_end is too far off for its kind."""
        most, gone, way = self.settings.maximum_steps, t - self.begun, self.t_end - self.begun
        self.steps += 1
        self.tiny += (t - t0) * self.rate < HEADWAY
        if 0 < most < self.tiny:
            raise StepFailureError(
                f"the communication step to t = {self.t_end!r} s makes no headway at t = {t!r} s: more "
                f"than {most:.0f} internal steps (solver.maximum_steps) were shorter than "
                f"{HEADWAY / self.rate:.2g} s, {HEADWAY:.0e} of the motion's natural time: is there a force "
                "that jumps to and fro?"
            )
        if self.steps >= PATIENCE and self.steps * way > STEP_LIMIT * gone:
            needed = self.steps * way / max(gone, HEADWAY * way)
            raise StepFailureError(
                f"the communication step to t = {self.t_end!r} s would need about {needed:.0e} internal "
                f"steps, more than {STEP_LIMIT:.0e}: take a shorter one"
            )


def _travel(flow: Flow, state: State, t_end: float, headway: Headway) -> State:
    """Integrate until t_end or the first event, whichever comes first; at an event, switch modes."""
    y = np.array(state.q + state.v)
    f0 = flow.accept(state.t, y)
    if not np.isfinite(f0).all():
        raise StepFailureError(flow.cause)
    solver = flow.stepper(state.t, y, t_end, state.step or None)
    armed = list(state.armed)
    steps, choice, local = state.steps, state.choice, state.local
    watch, lost = flow.system.is_watched, state.dissipated
    before = indicators(flow, state.t, y) if watch else np.zeros(0)
    while True:
        t0, y0 = solver.t, solver.y
        offered = solver.h_abs
        try:
            flow.step(solver)
            before_it = local
            if flow.after_step is not None:
                local = flow.after_step(solver, state, local)
            y1 = flow.project(solver.t, solver.y)
            if not (
                flow.system.prescribed and t0 == flow.begun
            ):  # it may have jumped when it was set
                flow.check_projection(t0, solver.t, solver.y, y1)
        except StepFailureError:
            if not choice.implicit:
                raise
            choice = explicit(choice, paid=False)
            solver = _take_over(flow, choice, t0, y0, t_end)
            continue
        steps += 1
        if watch:
            event, before = optional_events.first_event(flow, solver, t0, y0, y1, before, armed)
            if event is not None:
                headway.check(t0, event[0])
                if flow.after_step is not None:  # the way to the event counts, not the whole step
                    flow.local = before_it
                    flow.reach(t0, y0, event[0])
                    local = flow.local
                step = offered
                if choice.implicit:
                    choice, step = explicit(choice, paid=True), min(offered, choice.longest)
                here = replace(
                    state, step=step, steps=steps, armed=tuple(armed), choice=choice, local=local
                )
                if flow.system.frictions:
                    lost += optional_slides.dissipated(flow, solver.dense_output(), t0, event[0])
                    here = replace(here, slides=flow.state.slides, dissipated=lost)
                return _meet(flow, here, t0, y0, *event)
        if flow.system.frictions:
            lost += optional_slides.dissipated(flow, solver.dense_output(), t0, solver.t)
            flow.state = replace(flow.state, slides=optional_slides.turned(flow, solver.t, y1))
        if choice.implicit:
            choice = implicit_step(choice, float(solver.t - t0))
        if solver.t == t_end:
            n = flow.system.n
            step = float(max(solver.h_abs, offered))  # the last step may have been cut short
            if flow.settings.method == "radau5" and flow.auto and not choice.implicit:
                step = choice.longest
            return replace(
                state,
                t=t_end,
                q=tuple(y1[:n].tolist()),
                v=tuple(y1[n:].tolist()),
                armed=tuple(armed),
                step=step,
                steps=steps,
                choice=choice,
                slides=flow.state.slides,
                dissipated=lost,
                local=local,
            )
        solver.y, solver.f = y1, flow.accept(solver.t, y1)
        if flow.auto and flow.settings.method == "dop853":
            choice = _judged(flow, choice, solver, t0, y0)
        if flow.auto and choice.implicit != (flow.settings.method == "radau5"):
            solver = _take_over(flow, choice, solver.t, y1, t_end)
        headway.check(t0, float(solver.t))


def _meet(flow: Flow, state: State, t0: float, y0: Vector, t: float, left: dict[int, int]) -> State:
    """The state right after the event at t at which these indicators left their ranges."""
    n, contacts = flow.system.n, len(flow.system.contacts)
    jumps = range(contacts, contacts + len(flow.system.floors))
    ways = {k - contacts: way for k, way in left.items() if k in jumps}
    if ways:
        y0, t0 = flow.reach(t0, y0, t), t
        levels = passed(flow.system, state.levels, ways)
        state = replace(
            state, t=t, q=tuple(y0[:n].tolist()), v=tuple(y0[n:].tolist()), levels=levels
        )
        flow = replace(flow, state=state)
    if not (contacts or flow.system.frictions):
        return state
    return optional_contacts.switched(flow, state, t0, y0, t, [k for k in left if k not in jumps])


def _judged(flow: Flow, choice: Choice, solver: Any, t0: float, y0: Vector) -> Choice:
    """The choice after the step that dop853 has just taken."""
    if not is_due(choice):
        return unjudged_step(choice)
    stage, rate = solver.last_stage(y0)
    stages = Slope(stage, rate, solver.y, solver.f)
    step = Slope(y0, solver.K[0], solver.y, solver.f)
    return explicit_step(choice, float(solver.t), float(solver.t - t0), stages, step, flow.size)


def _take_over(flow: Flow, choice: Choice, t: float, y: Vector, t_end: float) -> Any:
    """The other method of `auto`, at (t, y); it begins with the steps that dop853 took last."""
    flow.choose(choice)
    return flow.stepper(t, y, t_end, choice.longest)
