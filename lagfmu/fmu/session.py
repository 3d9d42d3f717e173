"""One instance of an FMU by names: loaded once, reset and run again and again.  Any FMI 2.0 FMU will do.

It stands on fmpy's FMU2Slave.  Many runs in one call go through `lagfmu_batch` (runtime/fmi/batch.c) where
the binary has it, else through the same loop written here: slower, with the same numbers.
"""

from __future__ import annotations

import contextlib
import ctypes
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.logging import addLoggerProxy
from numpy.typing import NDArray

from ..methods import NUMBERS

STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")
TYPES = {"Real": 0, "Integer": 1, "Enumeration": 1, "Boolean": 2}  # BatchType in batch.h
KINDS = ("Real", "Integer", "Boolean")  # the suffix of the getter and setter of each BatchType
LAST, MAX, MIN, MEAN, TIME_OF_MAX = range(5)  # Keep in batch.h
MESSAGES: list[str] = []  # of one call: fmpy's proxy of the logger knows one logger a process


def _log(_: Any, __: bytes, status: int, category: bytes, message: bytes) -> None:
    if status < 2:
        return
    text = " ".join(message.decode(errors="replace").split())
    if _heard is not None:
        _heard.hear(text)
    else:
        MESSAGES.append(text)


LOGGER = fmi2CallbackLoggerTYPE(_log)  # kept for ever: fmpy's proxy goes on pointing to it


def reason() -> str:
    """What the FMU said of the latest call that failed; pythonfmu's wrapping is taken away."""
    text = " ".join("; ".join(MESSAGES).split()) or "no message was logged"
    raised = re.search(r"""Refused\((["'])(.*)\1\)""", text)
    return raised[2] if raised else text


class RefusalError(Exception):
    """A call that did not return fmi2OK or a warning: which, its status, the messages in the log."""

    def __init__(self, call: str, status: int, message: str) -> None:
        super().__init__(f"{call}: {STATUS[status]}: {message}")
        self.call, self.status, self.message = call, status, message


@dataclass(frozen=True)
class Plug:
    """What a process must know to load an FMU that was unpacked into `folder`.

    `variables`: name -> (value reference, FMI type).
    """

    folder: str
    guid: str
    identifier: str
    variables: Mapping[str, tuple[int, str]]

    def reference(self, name: str) -> int:
        """Value reference."""
        return self.variables[name][0]

    def type(self, name: str) -> int:
        """BatchType."""
        return TYPES[self.variables[name][1]]


def plug(fmu: Path, description: Any, folder: str) -> Plug:
    """What to know of an FMU that lies unpacked in `folder`; `description` is fmpy's."""
    variables = {v.name: (int(v.valueReference), str(v.type)) for v in description.modelVariables}
    return Plug(folder, description.guid, description.coSimulation.modelIdentifier, variables)


@dataclass(frozen=True)
class Plan:
    """Many runs of one FMU over the same communication points `times` (points) [s].

    `vary` are set before initialization, to another row of values in each run; `drive` are inputs, set at
    the communication points to the rows of `drives` (points, inputs).  `keep` are (variable, LAST ...
    TIME_OF_MAX); `events` are (count, time) of departures.  With `whole`, the values at all points are
    returned too.
    """

    vary: tuple[str, ...]
    keep: tuple[tuple[str, int], ...]
    times: NDArray[np.float64]
    tolerance: float = 0.0
    drive: tuple[str, ...] = ()
    drives: NDArray[np.float64] | None = None
    events: tuple[tuple[str, str], ...] = ()
    whole: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of runs: `result` (runs, keep), `trajectory` (runs, points, keep) or None, fmi2Status of
    each, the time [s] that it reached, and of those that were refused the reason, by number."""

    result: NDArray[np.float64]
    trajectory: NDArray[np.float64] | None
    status: NDArray[np.int32]
    reached: NDArray[np.float64]
    reasons: dict[int, str]


class _Batch(ctypes.Structure):
    _fields_ = [
        *((n, ctypes.c_size_t) for n in ("runs", "varied", "driven", "points", "kept", "events")),
        *((n, ctypes.c_void_p) for n in ("vary", "vary_type", "values", "drive", "drives")),
        ("times", ctypes.c_void_p),
        ("tolerance", ctypes.c_double),
        *((n, ctypes.c_void_p) for n in ("keep", "keep_type", "keep_what", "count", "when")),
        ("whole", ctypes.c_int),
        *((n, ctypes.c_void_p) for n in ("result", "trajectory", "status", "reached", "scratch")),
        ("current", ctypes.c_size_t),
    ]


class Session:
    """An instance for co-simulation; free it with close()."""

    def __init__(self, plugged: Plug, name: str = "session") -> None:
        self.plug, self.name = plugged, name
        self.used = False
        self.slave: Any = None
        self.open()

    def open(self) -> None:
        """Instantiate.  Raises RefusalError with the FMU's reason."""
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = LOGGER
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
        addLoggerProxy(ctypes.byref(callbacks))  # formats a message with its arguments
        MESSAGES.clear()
        try:
            with contextlib.chdir("."):  # fmpy stays in the folder of a library that it cannot load
                self.slave = FMU2Slave(
                    instanceName=self.name,
                    guid=self.plug.guid,
                    modelIdentifier=self.plug.identifier,
                    unzipDirectory=self.plug.folder,
                )
            ours = hasattr(self.slave.dll, "lagfmu_batch")  # it gives its reasons unasked
            self.slave.instantiate(callbacks=callbacks, loggingOn=not ours)
        except Exception as error:
            told = reason() if MESSAGES else str(error)
            raise RefusalError("instantiate", 3, told) from None
        self.used = False

    def close(self) -> None:
        """Free the instance."""
        if self.slave is not None and self.slave.component is not None:
            self.slave.freeInstance()
        self.slave = None

    def renew(self) -> None:
        """Another instance in place of one that can no longer be used."""
        self.close()
        self.open()

    def call(self, name: str, *arguments: Any, **named: Any) -> Any:
        """A method of FMU2Slave.  Raises RefusalError unless the status is OK or a warning."""
        MESSAGES.clear()
        try:
            return getattr(self.slave, name)(*arguments, **named)
        except FMICallException as error:
            raise RefusalError(name, error.status, reason()) from None

    def references(self, names: Sequence[str]) -> list[int]:
        """Value references."""
        return [self.plug.reference(n) for n in names]

    def give(self, values: Mapping[str, float | str]) -> None:
        """Set variables of any type; a method also by name, one that there is not as an unknown number."""
        for kind in reversed(KINDS):
            found: dict[str, Any] = {
                name: float(value) if kind == "Real" else int(value)
                for name, value in _numbers(values).items()
                if KINDS[self.plug.type(name)] == kind
            }
            if found:
                self.call(f"set{kind}", self.references(list(found)), list(found.values()))

    def prepare(
        self,
        values: Mapping[str, float | str],
        tolerance: float | None,
        stop: float | None = None,
        start: float = 0.0,
    ) -> None:
        """Reset if it was used; set up (times in s), set `values`, enter the initialization mode."""
        if self.used:
            self.call("reset")
        self.used = True
        self.call("setupExperiment", tolerance=tolerance, startTime=start, stopTime=stop)
        self.give(values)
        self.call("enterInitializationMode")

    def begin(
        self,
        values: Mapping[str, float | str],
        tolerance: float | None,
        stop: float | None = None,
    ) -> None:
        """The same, and initialize."""
        self.prepare(values, tolerance, stop)
        self.call("exitInitializationMode")

    def read(self, names: Sequence[str]) -> dict[str, Any]:
        """Values of variables, in the types of their kinds."""
        found: dict[str, Any] = {}
        for kind in KINDS:
            those = [n for n in names if KINDS[self.plug.type(n)] == kind]
            if those:
                seen = self.call(f"get{kind}", self.references(those))
                found |= dict(zip(those, seen, strict=True))
        return found

    def get(self, name: str) -> float:
        """The value of a Real, Integer, Enumeration or Boolean."""
        kind = KINDS[self.plug.type(name)]
        return float(self.call(f"get{kind}", [self.plug.reference(name)])[0])

    def batch(self, plan: Plan, values: NDArray[np.float64]) -> Outcome:
        """Runs with the rows of `values` (runs, varied); one that is refused does not end the others."""
        runs, points, kept = len(values), len(plan.times), len(plan.keep)
        found = Outcome(
            np.full((runs, kept), np.nan),
            np.full((runs, points, kept), np.nan) if plan.whole else None,
            np.zeros(runs, dtype=np.int32),
            np.full(runs, plan.times[0]),
            {},
        )
        values = np.ascontiguousarray(values, dtype=np.float64)
        if hasattr(self.slave.dll, "lagfmu_batch"):
            self._native(plan, values, found)
        else:
            self._looped(plan, values, found)
        failed = found.status > 1
        found.result[failed] = np.nan
        return found

    def _native(self, plan: Plan, values: NDArray[np.float64], found: Outcome) -> None:
        function = self.slave.dll.lagfmu_batch
        function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p], ctypes.c_int
        names = [n for n, _ in plan.keep]
        arrays: dict[str, Any] = {
            "vary": self._references(plan.vary),
            "vary_type": self._types(plan.vary),
            "values": values,
            "drive": self._references(plan.drive),
            "drives": None if plan.drives is None else np.ascontiguousarray(plan.drives, float),
            "times": np.ascontiguousarray(plan.times, dtype=np.float64),
            "keep": self._references(names),
            "keep_type": self._types(names),
            "keep_what": np.array([w for _, w in plan.keep], dtype=np.intc),
            "count": self._references([c for c, _ in plan.events]),
            "when": self._references([t for _, t in plan.events]),
            "result": found.result,
            "trajectory": found.trajectory,
            "status": found.status,
            "reached": found.reached,
            "scratch": np.zeros(2 * max(len(names), 1)),
        }
        batch = _Batch(
            runs=len(values),
            varied=len(plan.vary),
            driven=len(plan.drive),
            points=len(plan.times),
            kept=len(names),
            events=len(plan.events),
            tolerance=plan.tolerance,
            whole=int(plan.whole),
            current=0,
        )
        for field, array in arrays.items():
            setattr(batch, field, None if array is None else array.ctypes.data)
        self.used = True
        with _Listener(batch, found.reasons):
            while batch.current < batch.runs:
                status = function(self.slave.component, ctypes.byref(batch))
                if status <= 1:
                    break
                found.status[batch.current] = (
                    status  # it cannot be reset: the rest goes to another one
                )
                found.reasons.setdefault(int(batch.current), "the instance could not be reset")
                batch.current += 1
                self.renew()

    def _looped(self, plan: Plan, values: NDArray[np.float64], found: Outcome) -> None:
        for r, row in enumerate(values):
            try:
                self._run(plan, row, r, found)
            except RefusalError as error:
                found.status[r], found.reasons[r] = error.status, error.message
                self.renew()

    def _run(self, plan: Plan, row: NDArray[np.float64], r: int, found: Outcome) -> None:
        """One run, as run() in batch.c."""
        times = plan.times
        values = dict(zip(plan.vary, row.tolist(), strict=True)) | self._driven(plan, 0)
        self.prepare(values, plan.tolerance or None, float(times[-1]), float(times[0]))
        self.call("exitInitializationMode")
        kept, whole = found.result[r], found.trajectory
        points = np.zeros((len(times), len(kept))) if whole is None else whole[r]
        points[0] = self._seen(plan)
        seen, when = [points[0]], [float(times[0])]  # with what was seen at departures
        count, earlier = self._departures(plan)[0], None
        for k in range(1, len(times)):
            t, h = float(times[k - 1]), float(times[k] - times[k - 1])
            if plan.events:
                earlier = self.call("getFMUstate")
            self.call("doStep", t, h)
            found.reached[r] = times[k]
            if plan.events:
                now, latest = self._departures(plan)
                if now > count and t < latest < times[k]:
                    later = self.call("getFMUstate")
                    self.call("setFMUstate", earlier)
                    self.call("doStep", t, latest - t)
                    seen.append(self._seen(plan))
                    when.append(latest)
                    self.call("setFMUstate", later)
                    self.call("freeFMUstate", later)
                self.call("freeFMUstate", earlier)
                count = now
            self.give(self._driven(plan, k))
            points[k] = self._seen(plan)
            seen.append(points[k])
            when.append(float(times[k]))
        for k, (column, (_, what)) in enumerate(zip(np.transpose(seen), plan.keep, strict=True)):
            if what == MEAN:
                at, width = points[:, k], float(times[-1] - times[0])
                parts = (at[1:] + at[:-1]) / 2 * np.diff(times) / width
                kept[k] = sum(parts.tolist())
            else:
                place = {MAX: column.argmax(), MIN: column.argmin(), TIME_OF_MAX: column.argmax()}
                last = int(place.get(what, len(column) - 1))
                kept[k] = when[last] if what == TIME_OF_MAX else column[last]

    def _seen(self, plan: Plan) -> NDArray[np.float64]:
        return np.array([self.get(name) for name, _ in plan.keep])

    def _driven(self, plan: Plan, k: int) -> dict[str, float]:
        """The inputs at a communication point."""
        if plan.drives is None:
            return {}
        return dict(zip(plan.drive, plan.drives[k].tolist(), strict=True))

    def _departures(self, plan: Plan) -> tuple[float, float]:
        """How many so far, and the time [s] of the latest."""
        counts = [(self.get(count), when) for count, when in plan.events]
        happened = [self.get(when) for count, when in counts if count]
        return sum(c for c, _ in counts), max(happened, default=-np.inf)

    def _references(self, names: Sequence[str]) -> NDArray[np.uintc]:
        return np.array(self.references(names), dtype=np.uintc)

    def _types(self, names: Sequence[str]) -> NDArray[np.intc]:
        return np.array([self.plug.type(n) for n in names], dtype=np.intc)


def _numbers(values: Mapping[str, float | str]) -> dict[str, float]:
    """Methods by their numbers; a text that is none by a number that is none."""
    unknown = 1 + max(NUMBERS.values())
    return {k: NUMBERS.get(v, unknown) if isinstance(v, str) else v for k, v in values.items()}


class _Listener:
    """While many runs go on in one call: the messages of each, by its number."""

    def __init__(self, batch: _Batch, reasons: dict[int, str]) -> None:
        self.batch, self.reasons = batch, reasons

    def __enter__(self) -> None:
        MESSAGES.clear()
        global _heard
        _heard = self

    def __exit__(self, *_: object) -> None:
        global _heard
        _heard = None

    def hear(self, text: str) -> None:
        """Of several messages of a run, all."""
        run = int(self.batch.current)
        known = self.reasons.get(run)
        self.reasons[run] = f"{known}; {text}" if known else text


_heard: _Listener | None = None
