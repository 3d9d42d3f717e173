"""One simulation by value references: what may be set when, the start, a communication step, what is read.

No FMI here: a call that is refused raises Refused, a step that cannot be done StepFailureError, and what is
to be told stands in `messages`.  Between `advance` and the importer, this is all there is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ... import names
from ...model.rule import MESSAGES
from ...numeric.failure import GIVEN, OMITTED, SET, StepFailureError, left_out
from ...numeric.start import start
from ...numeric.system import System
from ...numeric.thresholds import SMALLEST_TOLERANCE, tolerance_problem
from ...solver.advance import advance, looked_at
from ...solver.crossing import check_crossing
from ...solver.equations import Motion
from ...solver.observe import observe
from ...solver.state import Event, Settings, State, restored, restored_settings
from .script import Facts, Variable

POINTS = 4
APART = 0.3  # of the way that a motion went: what its rates may miss

# the latest communication points: t, then the value of each motion
Past = tuple[tuple[float, ...], ...]


def _estimated(
    system: System, past: Past, t: float, u: Sequence[float], fresh: Sequence[bool]
) -> tuple[list[float], Past]:
    """The inputs at t [s] with their rates, and the points with that one; `fresh`: which motions were set.

    One that was not set stands still.
    """
    values = [
        u[k] if new or not past else past[-1][1 + i]
        for i, (k, new) in enumerate(zip(system.estimated, fresh, strict=True))
    ]
    points = tuple(point for point in past if point[0] < t)[1 - POINTS :]
    points = (*points, (t, *values))
    driven = list(u)
    for i, k in enumerate(system.estimated):
        driven[k] = values[i]
        if len(points) == 1:
            driven[k + 2] = driven[k + 3] = 0.0
            continue
        times = np.array([point[0] for point in points]) - t
        unit = -times[0]  # the conditions of the fit are those of times of the order of 1
        powers = np.linalg.solve(
            np.vander(times / unit, increasing=True), [point[1 + i] for point in points]
        )
        rates = [0.0] * POINTS
        for order, c in enumerate(powers.tolist()):
            rates[order] = c * (1, 1, 2, 6)[order] / unit**order
        driven[k + 1 : k + POINTS] = rates[1:]
    return driven, points


def _half_connected(u: Sequence[float], foreseen: Sequence[float], h: float) -> bool:
    """Has a motion, (u, u', u'') now, moved over the last h [s] otherwise than its rates say?

    `foreseen` is what it was to be by its rates at the time before.  The trapezoidal rule has an error of
    (w h)^2 / 12 of a harmonic motion of the frequency w, 1.3 % for sixteen points a period.
    """
    rate = foreseen[1] - h * foreseen[2]
    place = foreseen[0] - h * rate - h**2 * foreseen[2] / 2
    pairs = (
        (place, u[0], rate, u[1]),
        (rate, u[1], foreseen[2], u[2]),
    )
    for before, now, slope, slope_now in pairs:
        way, told = now - before, h * (slope + slope_now) / 2
        size = abs(way) + h * max(abs(slope), abs(slope_now))
        if abs(way) > 1e-9 * abs(now) and abs(way - told) > APART * size:
            return True
    return False


ROUNDING = 1e-6  # part of a step by which an importer's sums of times may differ from ours
EVENT, WARNING = "event", "warning"


class Refused(Exception):  # noqa: N818 - its name is what the importer's log shows
    """A call that the FMU does not carry out."""


class Instance:
    """See the head of this file."""

    def __init__(self, facts: Facts) -> None:
        self.facts, self.system, self.variables = facts, facts.system, facts.variables
        self.rules = [v.rule for v in self.variables]
        self.values: list[Any] = [v.start for v in self.variables]
        self.reference = {v.name: k for k, v in enumerate(self.variables)}
        self.parameters = [k for k, v in enumerate(self.variables) if v.role == "parameter"]
        self.inputs = [k for k, v in enumerate(self.variables) if v.role in ("input", "estimate")]
        self.start_time, self.stop_time, self.tolerance = 0.0, math.inf, 0.0
        self.running = False
        self.settings: Settings | None = None
        self.state: State | None = None
        self.seen: list[Any] | None = None  # the values of all variables, while they hold
        self.past: Past = ()
        self.fresh: set[int] = set()  # what was set since the latest communication point
        self.foreseen: list[float] = []  # the inputs as they went to the latest communication point
        self.told: set[str] = set()  # what is told once
        self.messages: list[tuple[str, str]] = []

    # -------------------------------------------------------------- values

    def set(self, references: Sequence[int], values: Sequence[Any], kind: str) -> None:
        """Set variables of that kind; all are checked before one is set.  Raises Refused."""
        for k, value in zip(references, values, strict=True):
            self._check_settable(k, value, kind)
        if all(self._is_same(k, x) for k, x in zip(references, values, strict=True)):
            return
        for k, value in zip(references, values, strict=True):
            self.values[k] = value
        self.fresh.update(references)
        self.seen = None
        if not self.running:
            self.state = None

    def get(self, references: Sequence[int], kind: str) -> list[Any]:
        """The values of variables of that kind.  Raises Refused, StepFailureError."""
        if any(self._known(k, kind).computed for k in references):
            row = self.row()
            return [row[k] for k in references]
        return [self.values[k] for k in references]

    def row(self) -> list[Any]:
        """All values by reference: those of the state with which the next step begins, if that began now."""
        if self.seen is None:
            state, u = self._started(), self._of(self.inputs)
            if self.running and u != self.foreseen:
                state = looked_at(self.system, self._settings, state, u, self.p)
            values = observe(self.system, state, u, self.p)
            self.seen = [
                values[v.name] if v.computed else x
                for v, x in zip(self.variables, self.values, strict=True)
            ]
        return self.seen

    @property
    def p(self) -> list[float]:
        """The values of the parameters."""
        return self._of(self.parameters)

    @property
    def _settings(self) -> Settings:
        assert self.settings is not None
        return self.settings

    def _of(self, references: Sequence[int]) -> list[float]:
        return [self.values[k] for k in references]

    def _known(self, k: int, kind: str) -> Variable:
        if not 0 <= k < len(self.variables) or self.variables[k].kind != kind:
            raise Refused(f"value reference {k} is no {kind} variable of this FMU")
        return self.variables[k]

    def _check_settable(self, k: int, value: Any, kind: str) -> None:
        variable = self._known(k, kind)
        if variable.role in ("output", "estimate"):
            raise Refused(MESSAGES["settable"].format(name=variable.name))
        if self.running and variable.role != "input" and not self._is_same(k, value):
            raise Refused(f"{variable.name!r} can only be set before the end of the initialization")
        if problem := self._problem(k, value):
            raise Refused(problem)

    def _problem(self, k: int, value: Any) -> str:
        """Why a variable cannot have the value; empty if it can."""
        name, methods = self.variables[k].name, self.facts.methods
        if name != names.METHOD:
            return self.rules[k].problem(value)
        offered = ", ".join(f"{number} ({method})" for number, method in methods.items())
        return "" if value in methods else f"{name!r} = {value!r}, expected one of {offered}"

    def _is_same(self, k: int, value: Any) -> bool:
        """A fixed parameter that is set once more to the bits that it has: some importers do."""
        fixed = self.variables[k].role in ("parameter", "solver")
        return fixed and float(value).hex() == float(self.values[k]).hex()

    # -------------------------------------------------------------- life cycle

    def experiment(self, begin: float, end: float | None, tolerance: float | None) -> None:
        """Start and stop time [s]; the tolerance is the dial between speed and accuracy.  Raises Refused."""
        if tolerance is not None and (problem := tolerance_problem(tolerance)):
            raise Refused(f"fmi2SetupExperiment: {problem}")
        stop = math.inf if end is None else end
        if not math.isfinite(begin) or not stop > begin:
            raise Refused(
                f"fmi2SetupExperiment: start time {begin!r} s and stop time {stop!r} s, expected a finite "
                "start before the stop"
            )
        self.start_time, self.stop_time, self.tolerance = begin, stop, tolerance or 0.0
        self.state = self.seen = None

    def begin(self) -> None:
        """The end of the initialization.  Raises StepFailureError."""
        self.row()
        self.running = True

    def step(self, now: float, h: float) -> None:
        """Advance by h [s].  Raises StepFailureError, and everything is as it was before."""
        before, kept = self.state, (list(self.values), set(self.fresh), self.past, self.foreseen)
        try:
            self._step(now, h)
        except StepFailureError:
            self.state, (self.values, self.fresh, self.past, self.foreseen) = before, kept
            self.seen = None
            raise
        assert before is not None
        assert self.state is not None
        self._tell_events(before, self.state)
        self._tell_tables(self.state)

    def _step(self, now: float, h: float) -> None:
        state = self._checked(now, h)
        u = self._driven(state.t)
        self._tell_rates(u, state.span)
        after = advance(self.system, self._settings, state, u, self.p, now + h)
        self.foreseen = self.system.inputs_at(u, after.t - state.t)
        for k, value in zip(self.inputs, self.foreseen, strict=True):
            self.values[k] = value
        self.state, self.seen = after, None
        self.row()

    def _checked(self, now: float, h: float) -> State:
        """The state that a step may start from.  Raises StepFailureError."""
        state = self.state
        if state is None or not self.running:
            raise StepFailureError("fmi2DoStep before the end of the initialization")
        if not h > 0 or not math.isfinite(h):
            raise StepFailureError(f"the communication step is {h!r} s, expected a positive number")
        if state.t + h == state.t:
            raise StepFailureError(
                f"the communication step of {h!r} s is too short to be told from none at t = {state.t!r} s"
            )
        slack = ROUNDING * h + 1e-12 * abs(state.t)
        if not abs(now - state.t) <= slack:
            raise StepFailureError(
                f"the communication point is {now!r} s, but this FMU stands at {state.t!r} s: continue "
                "there, or restore a state saved at that time"
            )
        if now + h > self.stop_time + slack:
            raise StepFailureError(
                f"the step ends at {now + h!r} s, after the stop time {self.stop_time!r} s that "
                "fmi2SetupExperiment defined"
            )
        return state

    def _driven(self, t: float) -> list[float]:
        """The inputs, with the rates of those whose rates are estimated."""
        u = self._of(self.inputs)
        if self.system.estimated:
            fresh = [self.inputs[k] in self.fresh for k in self.system.estimated]
            u, self.past = _estimated(self.system, self.past, t, u, fresh)
        self.fresh.clear()
        return u

    def _started(self) -> State:
        """The state; at first the consistent start, and what had to be moved is told."""
        if self.state is not None:
            return self.state
        value = {name: self.values[k] for name, k in self.reference.items()}
        tolerance = value[names.TOLERANCE] or self.tolerance or self.facts.tolerance
        if tolerance < SMALLEST_TOLERANCE:
            self._warn(
                f"tolerance {tolerance!r} is below what double precision allows, "
                f"{SMALLEST_TOLERANCE!r} is used"
            )
        n, u = self.system.nq, self._of(self.inputs)
        y, priority = self._start_values(self.system.states)
        found = start(self.system, y[:n], y[n:], u, self.p, priority, self.start_time)
        for moved in found.moved:
            if moved.priority != OMITTED:
                self._warn(str(moved))
        if line := left_out(found.moved):
            self.messages.append((EVENT, line))
        self.settings = Settings(
            self.facts.methods.get(value.get(names.METHOD, 0), self.facts.method),
            max(tolerance, SMALLEST_TOLERANCE),
            value[names.MAXIMUM_STEP],
            value[names.MAXIMUM_STEPS],
            tuple(float(x) for x in found.size),
            tuple(float(x) for x in found.span),
            tuple(float(x) for x in found.swift),
            float(found.rate),
        )
        never = (Event(),) * len(found.closed)
        q, v = (tuple(float(x) for x in part) for part in (found.q, found.v))
        heights, extents = (
            tuple(float(x) for x in part) for part in (found.heights, found.extents)
        )
        self.state = State(
            self.start_time,
            q,
            v,
            tuple(found.closed),
            never,
            never,
            heights=heights,
            extents=extents,
        )
        check_crossing(Motion(self.system, u, self.p, self.start_time), self.settings, self.state)
        self.foreseen, self.seen = u, None
        return self.state

    def _start_values(self, states: Sequence[str]) -> tuple[list[float], list[int]]:
        """The start values of coordinates and velocities, and who said each."""
        formulas: Mapping[int, float] = {}
        if self.system.starts is not None:
            try:
                formulas = dict(zip(self.system.started, self.system.starts(self.p), strict=True))
            except (ArithmeticError, ValueError):
                formulas = dict.fromkeys(self.system.started, math.nan)
        y, priority = [], []
        for j, name in enumerate(states):
            k = self.reference[name]
            value, described = self.values[k], self.variables[k]
            minus_zero = (
                value == 0 and math.copysign(1.0, value) < 0
            )  # a 0 that Rule.asked hands over
            meant = value != described.start or minus_zero
            said = SET if meant else GIVEN if described.given else OMITTED
            if said != SET and j in formulas:
                value = formulas[j]
                if not math.isfinite(value):
                    raise StepFailureError(
                        f"the start value of {name} is an expression of parameters, which has no finite "
                        "value at those that are set: set other parameters, or this start"
                    )
            y.append(value + 0.0)
            priority.append(said)
        return y, priority

    # -------------------------------------------------------------- messages

    def _warn(self, text: str) -> None:
        self.messages.append((WARNING, text))

    def _tell_events(self, before: State, after: State) -> None:
        for c, k in enumerate(self.system.contacts):
            contact, latest = self.system.rows[k].name, after.closings[c]
            struck = latest.count - before.closings[c].count
            if struck and latest.impulse:
                text = f"contact {contact} was struck at t = {latest.time!r} s, impulse {latest.impulse!r} "
                text += "(of its lambda times s)" + (
                    f", the latest of {struck}" if struck > 1 else ""
                )
                self.messages.append((EVENT, text))
            if after.departures[c].count != before.departures[c].count:
                text = f"contact {contact} opened at t = {after.departures[c].time!r} s"
                self.messages.append((EVENT, text))
            elif after.closed[c] and not before.closed[c]:
                self.messages.append((EVENT, f"contact {contact} closed"))

    def _tell_rates(self, u: Sequence[float], h: float) -> None:
        """Once, at the first step that shows it: not all three inputs of a motion are connected."""
        motions = set(self.system.prescribed) - set(self.system.estimated)
        if "rates" in self.told or not h > 0:
            return
        bad = [
            self.variables[self.inputs[k]].name
            for k in sorted(motions)
            if _half_connected(u[k : k + 3], self.foreseen[k : k + 3], h)
        ]
        if bad:
            self.told.add("rates")
            self._warn(
                f"prescribed motion {', '.join(bad)} has moved over the last {h:.3g} s otherwise than its "
                "rates der() and der(,2) say, so that the forces of constraint are wrong: connect all "
                'three inputs, or build the FMU with Input(..., rates="estimated")'
            )

    def _tell_tables(self, state: State) -> None:
        """Once for each: a table is looked up beyond its ends."""
        lookups = self.system.lookups
        if lookups is None:
            return
        places = lookups.places(state.t, state.q, state.v, self._of(self.inputs), self.p)
        for (name, first, last), x in zip(lookups.reach, places, strict=True):
            if not first <= x <= last and f"table {name}" not in self.told:
                self.told.add(f"table {name}")
                self._warn(
                    f"table {name} is looked up at {x!r}, outside of its points from {first!r} to "
                    f"{last!r}: it goes on as a straight line"
                )

    # -------------------------------------------------------------- saved states

    def saved(self) -> dict[str, Any]:
        """Everything that the future depends on, in types that JSON has."""
        return {
            "identity": self.facts.identity,
            "values": list(self.values),
            "running": self.running,
            "experiment": [self.start_time, self.stop_time, self.tolerance],
            "settings": None if self.settings is None else asdict(self.settings),
            "state": None if self.state is None else asdict(self.state),
            "foreseen": list(self.foreseen),
            "past": [list(point) for point in self.past],
            "fresh": sorted(self.fresh),
            "told": sorted(self.told),
        }

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Go back to what was saved.

        Raises Refused, and nothing is changed, if this FMU cannot have saved it.
        """
        if saved.get("identity") != self.facts.identity:
            raise Refused("the saved state belongs to another FMU, or to another version of this")
        fresh = Instance(self.facts)
        try:
            fresh._take(saved)
        except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError) as error:
            raise Refused(f"the saved state is none of this FMU's: {error}") from None
        fresh.messages = self.messages
        vars(self).update(vars(fresh))

    def _take(self, saved: Mapping[str, Any]) -> None:
        """Raises one of many errors where it is not what `saved` made."""
        values, running = saved["values"], saved["running"]
        if not isinstance(values, list) or len(values) != len(self.variables):
            raise ValueError("it has other variables")
        for k, value in enumerate(values):
            if self.variables[k].role != "output" and (problem := self._problem(k, value)):
                raise ValueError(problem)
        self.values = list(values)
        begin, end, tolerance = (float(x) for x in saved["experiment"])
        if not (math.isfinite(begin) and end > begin) or (
            tolerance and tolerance_problem(tolerance)
        ):
            raise ValueError(f"its experiment is {saved['experiment']!r}")
        self.start_time, self.stop_time, self.tolerance = begin, end, tolerance
        self.foreseen = [float(x) for x in saved["foreseen"]]
        self.past = tuple(tuple(float(x) for x in point) for point in saved["past"])
        self.fresh, self.told = set(saved["fresh"]), set(saved["told"])
        of_past = [1 + len(self.system.estimated)] * len(self.past)
        numbers = [*self.foreseen, *(x for point in self.past for x in point)]
        if [len(point) for point in self.past] != of_past or not all(map(math.isfinite, numbers)):
            raise ValueError(f"its inputs were {saved['foreseen']!r}, {saved['past']!r}")
        if saved["settings"] is not None:
            methods = (*self.facts.methods.values(), self.facts.method)
            self.settings = restored_settings(dict(saved["settings"]), methods, self.system)
        if saved["state"] is not None:
            self.state = restored(self.system, dict(saved["state"]))
        whole = None not in (self.settings, self.state) and len(self.foreseen) == len(self.inputs)
        if not isinstance(running, bool) or (running and not whole):
            raise ValueError(f"its mode is {running!r}")
        self.running = running
