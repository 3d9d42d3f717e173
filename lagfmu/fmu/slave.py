"""The FMI layer of the python target: what stands between pythonfmu and the solver.

This file travels inside each FMU, together with `lagfmu/solver`, in a package whose name carries the
hash of its content.  It needs NumPy and SciPy, no SymPy and no installed lagfmu.

Status of calls: a communication step that cannot be done returns False (fmi2Discard), with the reason
in the log and the instance as it was before the step.  pythonfmu turns every exception into fmi2Fatal
and knows no way to return fmi2Error; other refusals are therefore exceptions with a plain message.
"""

from __future__ import annotations

import functools
import json
import math
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, TypeVar

from pythonfmu.enums import Fmi2Status
from pythonfmu.fmi2slave import Fmi2Slave

from .. import names
from ..numeric.failure import StepFailureError
from ..numeric.start_priority import GIVEN, OMITTED, SET, left_out
from ..numeric.system import System
from ..numeric.thresholds import SMALLEST_TOLERANCE
from ..numeric.tolerance import tolerance_problem
from ..solver import optional_bars
from ..solver.advance import advance, beginning
from ..solver.initial import start
from ..solver.observe import Values, observe
from ..solver.rates import Past, estimated, half_connected, restored_past
from ..solver.restored import restored, restored_settings
from ..solver.state import Settings, State
from .references import end_once, keep, keep_module_of

Call = TypeVar("Call", bound=Callable[..., Any])
ROUNDING = 1e-6  # part of a step by which an importer's sums of times may differ from ours


class Refused(Exception):  # noqa: N818 - its name is what the importer's log shows
    """A call that the FMU does not carry out."""


def guarded(method: Call) -> Call:
    """Let an exception reach the importer as text, and the instance survive it (references.py)."""

    @functools.wraps(method)
    def call(self: LagfmuSlave, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except Exception as error:
            keep(self, type(self), self.log_queue)
            self.log_queue.clear()  # what waits to be logged would take the exception's text with it
            text = str(error).encode("ascii", "backslashreplace").decode()
            text = text.replace("%", "%%")  # the importer's logger reads it as a format of printf
            if isinstance(error, (Refused, StepFailureError)):
                raise Refused(text) from None
            raise Refused(f"internal error, {type(error).__name__}: {text}") from error

    return call  # type: ignore[return-value]


class LagfmuSlave(Fmi2Slave):  # type: ignore[misc]
    """A simulation of `system` behind the FMI functions.

    The generated subclass gives `system`, `variables` (name, kind, role, start, min, max, must it be
    positive, does the model give the start; the position is the value reference), `default_tolerance`, the
    `numbers` of the methods that can be chosen, the default method and fixed step, and `identity`.
    """

    system: System
    variables: Sequence[tuple[str, str, str, Any, float | None, float | None, bool, bool]]
    default_tolerance: float
    numbers: Mapping[int, str]
    default_method: str
    default_step: float
    identity: str
    barred: Sequence[
        tuple[int, int]
    ] = ()  # references of error bars, and of the variables that have them

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        keep_module_of(self)
        end_once(self)
        self.values: list[Any] = [v[3] for v in self.variables]
        self.names = [v[0] for v in self.variables]
        bars = {bar for bar, _ in self.barred}
        self.outputs = [
            k for k, v in enumerate(self.variables) if v[2] in ("output", "start") and k not in bars
        ]
        self.with_bars = [self.names[k] for _, k in self.barred]
        self.bars: Any = None
        roles = [v[2] for v in self.variables]
        self.parameters = [k for k, role in enumerate(roles) if role == "parameter"]
        self.inputs = [k for k, role in enumerate(roles) if role in ("input", "estimate")]
        self.past = Past()
        self.fresh: set[int] = set()  # what was set since the latest communication point
        self.reference = {name: k for k, name in enumerate(self.names)}
        self.start_time, self.stop_time, self.tolerance = 0.0, math.inf, 0.0
        self.running = False
        self.state: State | None = None
        self.observed: list[Any] | None = None
        self.expected: list[float] = []
        self.warned = False
        self.outside: set[str] = set()  # tables that were looked up beyond their ends

    # -------------------------------------------------------------- life cycle

    @guarded
    def setup_experiment(
        self, start_time: float, stop_time: float | None, tolerance: float | None
    ) -> None:
        """Start and stop time [s]; the tolerance is the dial between speed and accuracy."""
        self.start_time = start_time
        self.stop_time = math.inf if stop_time is None else stop_time
        if tolerance is not None and (problem := tolerance_problem(tolerance)):
            raise Refused(f"fmi2SetupExperiment: {problem}")
        if not math.isfinite(start_time) or not self.stop_time > start_time:
            raise Refused(
                f"fmi2SetupExperiment: start time {start_time!r} s and stop time {stop_time!r} s, "
                "expected a finite start before the stop"
            )
        self.tolerance = tolerance or 0.0
        self.state = None

    def enter_initialization_mode(self) -> None:
        """Nothing is computed before a value is read or the mode is left."""

    @guarded
    def exit_initialization_mode(self) -> None:
        """Project the start values, choose the contact modes."""
        if self.state is None:
            self._initialize()
        self.row()
        self.running = True

    def terminate(self) -> None:
        """Nothing to release."""

    @guarded
    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance by `step_size` [s]; False (fmi2Discard) leaves everything as it was.

        A prescribed motion goes on by its derivatives until it is set again, so that what is read
        after the step belongs to the time at its end.
        """
        before, values, bars = self.state, list(self.values), self.bars
        past, fresh = self.past, set(self.fresh)
        told = ""
        try:
            before = self._checked(current_time, step_size)
            u = self._driven(before.t)
            self._warn_of_rates(u, before.span)
            end, settings = current_time + step_size, self.settings
            if self.barred:
                if before.t == self.start_time:  # its magnitudes
                    self.observed = None
                    self.row(keep=True)
                    bars = self.bars
                settings, self.coarse = optional_bars.paired_settings(settings, before, end)
            after_step = optional_bars.after_step if self.barred else None
            self.state = advance(self.system, settings, before, u, self.p, end, after_step)
            if self.barred:
                self.bars, told = optional_bars.followed(
                    self.system, self.coarse, bars, u, self.p, end
                )
            self.expected = self.system.inputs_at(u, self.state.t - before.t)
            for k, value in zip(self.inputs, self.expected, strict=True):
                self.values[k] = value
            self.observed = None
            self.row(keep=True)
        except StepFailureError as error:
            self.state, self.values, self.observed, self.bars = before, values, None, bars
            self.past, self.fresh = past, fresh
            self.log(str(error), Fmi2Status.discard, "logStatusDiscard")
            return False
        if told:
            self._warn(told)
        self._warn_of_tables()
        self._report_events(before, self.state)
        self._report_method(before, self.state)
        return True

    def _report_method(self, before: State, after: State) -> None:
        """Why `auto` took radau5, the first time; then each change that a step ends with."""
        was = before.choice.implicit
        if after.choice.product and not before.choice.product:
            self.log(after.choice.message(), Fmi2Status.ok, "logEvents")
            was = True
        if was != after.choice.implicit:
            name = "radau5" if after.choice.implicit else "dop853"
            text = f"at t = {after.t!r} s: going on with {name} again"
            self.log(text, Fmi2Status.ok, "logEvents")

    def _checked(self, current_time: float, step_size: float) -> State:
        """The state that a step may start from.  Raises StepFailureError."""
        state = self.state
        if state is None or not self.running:
            raise StepFailureError("fmi2DoStep before the end of the initialization")
        if not step_size > 0 or not math.isfinite(step_size):
            raise StepFailureError(
                f"the communication step is {step_size!r} s, expected a positive number"
            )
        slack = ROUNDING * step_size + 1e-12 * abs(state.t)
        if not abs(current_time - state.t) <= slack:
            raise StepFailureError(
                f"the communication point is {current_time!r} s, but this FMU stands at "
                f"{state.t!r} s: continue there, or restore a state saved at that time"
            )
        end = current_time + step_size
        if end > self.stop_time + slack:
            raise StepFailureError(
                f"the step ends at {end!r} s, after the stop time {self.stop_time!r} s that "
                "fmi2SetupExperiment defined"
            )
        return state

    def _driven(self, t: float) -> list[float]:
        """The inputs, with the rates of those whose rates are estimated."""
        u = self._values(self.inputs)
        if self.system.estimated:
            fresh = [self.inputs[k] in self.fresh for k in self.system.estimated]
            u, self.past = estimated(self.system, self.past, t, u, fresh)
            for k, value in zip(self.inputs, u, strict=True):
                self.values[k] = value
        self.fresh.clear()
        return u

    def _warn_of_rates(self, u: Sequence[float], h: float) -> None:
        """Once, at the first step that shows it: not all three inputs of a motion are connected."""
        if self.warned or not self.expected or not h > 0:
            return
        bad = [
            self.names[self.inputs[k]]
            for k in self.system.prescribed
            if k not in self.system.estimated
            and half_connected(u[k : k + 3], self.expected[k : k + 3], h)
        ]
        if bad:
            self._warn(
                f"prescribed motion {', '.join(bad)} has moved over the last {h:.3g} s otherwise than its "
                "rates der() and der(,2) say, so that the forces of constraint are wrong: connect all "
                'three inputs, or build the FMU with Input(..., rates="estimated")'
            )
            self.warned = True

    def _warn_of_tables(self) -> None:
        """Once for each: a table is looked up beyond its ends."""
        lookups, state = self.system.lookups, self.state
        if lookups is None or state is None:
            return
        u = [*self._values(self.inputs), *state.levels]
        places = lookups.places(state.t, state.q, state.v, u, self.p)
        for (name, first, last), x in zip(lookups.reach, places, strict=True):
            if not first <= x <= last and name not in self.outside:
                self.outside.add(name)
                self._warn(
                    f"table {name} is looked up at {x!r}, outside of its points from {first!r} to "
                    f"{last!r}: it goes on as a straight line"
                )

    # -------------------------------------------------------------- values

    @guarded
    def get_real(self, vrs: list[int]) -> list[float]:
        """Values of Real variables."""
        return [float(x) for x in self._get(vrs, "Real")]

    @guarded
    def get_integer(self, vrs: list[int]) -> list[int]:
        """Values of Integer variables."""
        return [int(x) for x in self._get(vrs, "Integer")]

    @guarded
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        """Values of Boolean variables."""
        return [bool(x) for x in self._get(vrs, "Boolean")]

    @guarded
    def get_string(self, vrs: list[int]) -> list[str]:
        """Values of String variables."""
        return [str(x) for x in self._get(vrs, "String")]

    @guarded
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        """Set parameters, start values (before the end of initialization) or inputs."""
        for vr, value in zip(vrs, values, strict=True):  # all are checked before one is set
            name, _, _, _, low, high, positive, _ = self._settable(vr, "Real", value)
            if not math.isfinite(value):
                raise Refused(f"{name!r} = {value!r}, expected a finite number")
            if (low is not None and value < low) or (high is not None and value > high):
                raise Refused(f"{name!r} = {value!r} is outside its bounds [{low}, {high}]")
            if positive and not value > 0:
                raise Refused(f"{name!r} = {value!r}, expected a positive number")
        self._set(vrs, values)

    @guarded
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        """No variable is a String."""
        for vr, value in zip(vrs, values, strict=True):
            self._settable(vr, "String", value)

    @guarded
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        """Set `solver.method`, an Enumeration; no other Integer can be set."""
        for vr, value in zip(vrs, values, strict=True):
            name = self._settable(vr, "Integer", value)[0]
            if value not in self.numbers:
                offered = ", ".join(f"{k} ({method})" for k, method in self.numbers.items())
                raise Refused(f"{name!r} = {value!r}, expected one of {offered}")
        self._set(vrs, values)

    @guarded
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        """No Boolean can be set."""
        for vr, value in zip(vrs, values, strict=True):
            self._settable(vr, "Boolean", value)

    def _variable(self, vr: int, kind: str) -> Any:
        if not 0 <= vr < len(self.variables) or self.variables[vr][1] != kind:
            raise Refused(f"value reference {vr} is no {kind} variable of this FMU")
        return self.variables[vr]

    def _settable(self, vr: int, kind: str, value: Any) -> Any:
        """The variable, if it may be set to the value now: a fixed parameter only to what it is."""
        variable = self._variable(vr, kind)
        name, role = variable[0], variable[2]
        if role in ("output", "estimate"):
            raise Refused(f"{name!r} is calculated and cannot be set")
        if self.running and role != "input" and not self._is_same(vr, value):
            raise Refused(f"{name!r} can only be set before the end of the initialization")
        return variable

    def _is_same(self, vr: int, value: Any) -> bool:
        """A fixed parameter that is set once more to the bits that it has: some importers do."""
        fixed = self.variables[vr][2] in ("parameter", "solver")
        return fixed and float(value).hex() == float(self.values[vr]).hex()

    def _set(self, vrs: list[int], values: Sequence[Any]) -> None:
        if all(self._is_same(vr, value) for vr, value in zip(vrs, values, strict=True)):
            return
        for vr, value in zip(vrs, values, strict=True):
            self.values[vr] = value
        self.fresh.update(vrs)
        self.observed = None
        if not self.running:
            self.state = None

    def _get(self, vrs: list[int], kind: str) -> list[Any]:
        roles = [self._variable(vr, kind)[2] for vr in vrs]
        if not any(role in ("output", "start") for role in roles):
            return [self.values[vr] for vr in vrs]
        row = self.row()
        return [row[vr] for vr in vrs]

    def row(self, keep: bool = False) -> list[Any]:
        """All values by reference, the outputs solved anew where something was set or moved; `keep`: error
        bars are no smaller from here on."""
        if self.observed is None:
            if self.state is None:
                self._initialize()
            assert self.state is not None
            state, u = self._seen(self.state), self._values(self.inputs)
            seen: Values = observe(self.system, state, u, self.p)
            row = list(self.values)
            for k in self.outputs:
                row[k] = seen[self.names[k]]
            if self.barred:
                bars, found = self._widened(state, seen)
                self.bars = bars if keep or bars.state is None else self.bars
                for (k, _), value in zip(self.barred, found, strict=True):
                    row[k] = value
            self.observed = row
        return self.observed

    def _seen(self, state: State) -> State:
        """The state that is read: where a prescribed motion was set to another place or other rates than it
        went by, the one with which the next step begins."""
        u, motions = self._values(self.inputs), {*self.system.prescribed} - {*self.system.estimated}
        if not self.running or all(u[k : k + 3] == self.expected[k : k + 3] for k in motions):
            return state
        return beginning(self.system, state, u, self.p)[1]

    def _widened(self, state: State, seen: Values) -> tuple[Any, list[float]]:
        """The error bars with the present differences in them, and their values."""
        u, now, kept = self._values(self.inputs), (state, seen), self.bars
        companion = None if kept.state is None else self._seen(kept.state)
        bars, found, told = optional_bars.widened(
            self.system,
            self.coarse,
            replace(kept, state=companion),
            self.with_bars,
            now,
            u,
            self.p,
        )
        if told:
            self._warn(told)
        return bars if bars.state is None else replace(bars, state=kept.state), found

    def _values(self, references: list[int]) -> list[float]:
        return [self.values[k] for k in references]

    # -------------------------------------------------------------- simulation

    def _initialize(self) -> None:
        """The consistent start; what had to be moved is logged, every value and how far."""
        value = {name: self.values[k] for name, k in self.reference.items()}
        tolerance = value[names.TOLERANCE] or self.tolerance or self.default_tolerance
        if tolerance < SMALLEST_TOLERANCE:
            self._warn(
                f"tolerance {tolerance!r} is below what double precision allows, "
                f"{SMALLEST_TOLERANCE!r} is used"
            )
        self.settings = Settings(
            method=self.numbers.get(value.get(names.METHOD, 0), self.default_method),
            tolerance=max(tolerance, SMALLEST_TOLERANCE),
            step=value.get(names.STEP, self.default_step),
            maximum_step=value[names.MAXIMUM_STEP],
            maximum_steps=value[names.MAXIMUM_STEPS],
        )
        self.p = self._values(self.parameters)
        states = names.motion(self.system.coordinates)
        y, rank = [value[name] for name in states], [self._rank(name) for name in states]
        n, u = self.system.n, self._values(self.inputs)
        for j, x in self._formulas():
            if rank[j] == SET:
                continue
            if not math.isfinite(x):
                raise StepFailureError(
                    f"the start value of {states[j]} is an expression of parameters, which has no finite "
                    "value at those that are set: set other parameters, or this start"
                )
            y[j] = x
        found = start(self.system, self.settings, self.start_time, y[:n], y[n:], u, self.p, rank)
        for moved in found.moved:
            if moved.priority != OMITTED:
                self._warn(str(moved))
        if line := left_out(found.moved):
            self.log(line, Fmi2Status.ok, "logEvents")
        self.state, self.observed, self.expected = found.state, None, u
        if self.barred:
            self.bars = optional_bars.begun(found.state, self.with_bars)
            self.coarse = optional_bars.paired_settings(self.settings, found.state, found.state.t)[
                1
            ]
            told = optional_bars.halved(self.settings, found.state)
            if told and self.settings.step:
                self._warn(told)
            elif told:
                self.log(told, Fmi2Status.ok, "logEvents")

    def _formulas(self) -> list[tuple[int, float]]:
        """The start values that are expressions of parameters, with their position; NaN without a value."""
        found: Sequence[float] = ()
        if self.system.starts is not None:
            try:
                found = self.system.starts(self.p)
            except (ArithmeticError, ValueError):  # what is NaN or infinite in C
                found = [math.nan] * len(self.system.started)
        return list(zip(self.system.started, found, strict=True))

    def _rank(self, name: str) -> int:
        """Who said a start value: the importer if it differs from what is described, the model, nobody."""
        k = self.reference[name]
        described, given = self.variables[k][3], self.variables[k][7]
        return SET if self.values[k] != described else GIVEN if given else OMITTED

    def _warn(self, message: str) -> None:
        self.log(message, Fmi2Status.warning, "logStatusWarning")

    def _report_events(self, before: State, after: State) -> None:
        for c, k in enumerate(self.system.contacts):
            name, latest = self.system.rows[k].name, after.departures[c]
            struck = after.hits[c] - before.hits[c]
            if struck:
                told = (
                    f"contact {name} was struck at t = {after.hit_times[c]!r} s, impulse "
                    f"{after.impulses[c]!r} (of its lambda times s)"
                )
                told += f", the latest of {struck}" if struck > 1 else ""
                self.log(told, Fmi2Status.ok, "logEvents")
            if latest.count != before.departures[c].count:
                self.log(
                    f"contact {name} opened at t = {latest.time!r} s", Fmi2Status.ok, "logEvents"
                )
            elif after.closed[c] and not before.closed[c]:
                self.log(f"contact {name} closed", Fmi2Status.ok, "logEvents")
        for i, friction in enumerate(self.system.frictions):
            name, latest = friction.name, after.slippings[i]
            if latest.count != before.slippings[i].count:
                told = f"friction {name} began to slip at t = {latest.time!r} s"
                self.log(told, Fmi2Status.ok, "logEvents")
            elif after.slides[i].sticks and not before.slides[i].sticks:
                self.log(f"friction {name} sticks", Fmi2Status.ok, "logEvents")

    # -------------------------------------------------------------- saved states

    @guarded
    def _get_fmu_state(self) -> dict[str, Any]:
        settings = getattr(self, "settings", None)
        return {
            "identity": self.identity,
            "values": list(self.values),
            "running": self.running,
            "experiment": [self.start_time, self.stop_time, self.tolerance],
            "settings": None if settings is None else asdict(settings),
            "state": None if self.state is None else self.state.to_json(),
            "expected": list(self.expected),
            "past": [list(self.past.points), sorted(self.fresh)],
            "bars": None if None in (self.bars, self.state) else optional_bars.to_list(self.bars),
        }

    @guarded
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        if "refused" in state:
            raise Refused(state["refused"])
        if state.get("identity") != self.identity:
            raise Refused("the saved state belongs to another FMU, or to another version of this")
        try:
            kept = self._checked_state(state)
            restored_past(self.system, state.get("past"))
            bars = self._checked_bars(state["bars"], kept[-1])
        except (ValueError, TypeError, KeyError) as error:
            raise Refused(f"the saved state is none of this FMU's: {error}") from None
        self.past, fresh = restored_past(self.system, state.get("past"))
        self.fresh, self.expected = set(fresh), list(map(float, state["expected"]))
        self.values, self.running, experiment, settings, self.state = kept
        self.bars = bars
        self.start_time, self.stop_time, self.tolerance = experiment
        if settings is not None:
            self.settings = settings
        if self.bars is not None and self.state is not None:
            self.coarse = optional_bars.paired_settings(self.settings, self.state, self.state.t)[1]
        self.p = self._values(self.parameters)
        self.observed = None

    def _checked_bars(self, raw: Any, state: State | None) -> Any:
        """The error bars that were saved, or None before the start.  Raises ValueError."""
        if not self.barred or state is None:
            if raw is not None:
                raise ValueError("it has error bars")
            return None
        return optional_bars.restored_bars(self.system, raw, len(self.barred), state)

    def _checked_state(self, state: dict[str, Any]) -> tuple[Any, ...]:
        """Everything that was read is what this FMU can have saved.  Raises ValueError."""
        values, running = state["values"], state["running"]
        if not isinstance(values, list) or len(values) != len(self.variables):
            raise ValueError("it has other variables")
        for variable, value in zip(self.variables, values, strict=True):
            if variable[2] != "output":
                self._check_saved(variable, value)
        start, stop, tolerance = (float(x) for x in state["experiment"])
        good = tolerance == 0 or not tolerance_problem(tolerance)
        if not (math.isfinite(start) and stop > start and good):
            raise ValueError(f"its experiment is {state['experiment']!r}")
        expected = list(map(float, state["expected"]))
        if len(expected) not in (0, len(self.inputs)) or not all(map(math.isfinite, expected)):
            raise ValueError(f"its inputs are {state['expected']!r}")
        settings, kept = state["settings"], state["state"]
        settings = (
            None if settings is None else restored_settings(settings, tuple(self.numbers.values()))
        )
        kept = None if kept is None else restored(self.system, kept)
        begun = None not in (settings, kept) and len(expected) == len(self.inputs)
        if not isinstance(running, bool) or (running and not begun):
            raise ValueError(f"its mode is {running!r}")
        return list(values), running, (start, stop, tolerance), settings, kept

    def _check_saved(self, variable: Any, value: Any) -> None:
        name, kind, _, _, low, high, positive = variable[:7]
        if kind == "Real":
            number = float(value)
            good = isinstance(value, (int, float)) and math.isfinite(number)
            good = good and (low is None or number >= low) and (high is None or number <= high)
            good = good and (not positive or number > 0)
        else:
            good = value in self.numbers if name == names.METHOD else True
        if not good:
            raise ValueError(f"its {name} is {value!r}")

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        text = json.dumps(state, sort_keys=True).encode("ascii")
        return b"%08x %s" % (zlib.crc32(text), text)

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> dict[str, Any]:
        try:
            check, _, text = state.rstrip(b"\0").partition(b" ")
            if check != b"%08x" % zlib.crc32(text):
                raise ValueError("their check sum is wrong")
            return dict(json.loads(text.decode("ascii")))
        except (
            TypeError,
            ValueError,
            RecursionError,
        ) as error:  # raised here, it would crash pythonfmu's binary
            return {"refused": f"the bytes are no saved state of an FMU ({error})"}
