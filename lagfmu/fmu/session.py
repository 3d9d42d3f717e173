"""THE loop that runs an FMU: a session loads it once, and initializes, sets, steps and reads it by names.

Any FMU of FMI 2.0 with co-simulation will do, and a prepared model, whose slave then runs in this process.

Many runs in one call go through `lagfmu_batch` (runtime/fmi/batch.c) where the library has it, else by
the loop of the session: slower, with the same numbers.
"""

from __future__ import annotations

import contextlib
import ctypes
import itertools
import re
import shutil
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from ..errors import SimulationError
from ..model.rule import missing
from ..numeric.failure import MISSES
from .archive import unpack
from .binary import BATCH, instantiated, is_ours, listen
from .read import Trajectory, described_rules, experiment_of, obstacle, read_description

if TYPE_CHECKING:
    from .python import InProcess


STATUS = ("OK", "warning", "discard", "error", "fatal", "pending")
WARNING, DISCARD, ERROR = 1, 2, 3
KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}
COLUMNS: dict[str, Any] = {"Real": np.float64, "Integer": np.int32, "Boolean": np.bool_}
Columns = Mapping[str, Sequence[float]]  # of inputs by name, a value a communication point


class RefusalError(SimulationError):
    """A call that did not return OK or a warning: which, its status, what the FMU said of it, and of a step
    the time [s] from which it did not go on."""

    def __init__(self, call: str, status: int, message: str, time: float | None = None) -> None:
        super().__init__(f"{call}: {STATUS[status]}: {message}")
        self.call, self.status, self.message, self.time = call, status, message, time


@dataclass(frozen=True)
class Run:
    """Time and values, a row a communication point that was reached, and what ended the run early; `seconds`:
    wall time of stepping and reading; what the FMU said of each start value that it moved."""

    rows: Trajectory
    refusal: RefusalError | None
    seconds: float
    moved: tuple[str, ...] = ()


class Session:
    """One instance for co-simulation, of an FMU (a file, or a folder that one was unpacked into) or of a
    prepared model in this process.  Close it, or use it in a `with` statement.

    `rules`: what its variables may be set to; `outputs` and `inputs`: their names;
    `experiment`: the default one; `time`: where it stands
    [s]; `messages`: with `log` the statuses and texts of all that it has said; `moved`: what it said of each
    start value that it moved.  Raises VerificationError for
    what is no FMU, SimulationError for one that cannot be stepped here, RefusalError with its own reason if
    it cannot be instantiated.
    """

    def __init__(
        self, target: str | Path | InProcess, name: str = "session", log: bool = False
    ) -> None:
        self.name, self.log, self.used, self.time = name, log, False, 0.0
        self.messages: list[tuple[int, str]] = []
        self.instance: Any = None
        self._said: list[str] = []  # of calls that fail
        self.moved: list[str] = []
        self._unpacked = ""
        self.folder: Path | None = None
        if not isinstance(target, (str, Path)):
            self.rules, variables = target.rules, target.variables
            self.experiment, self.reference = target.experiment, target.reference
            self._make: Callable[[], Any] = lambda: target.instantiated(self._hear)
        else:
            path = Path(target)
            self.description = read_description(path)
            if problem := obstacle(path, self.description):
                raise SimulationError(f"{str(path)!r} {problem}")
            self.rules, variables = (
                described_rules(self.description),
                self.description.modelVariables,
            )
            self.reference = {v.name: int(v.valueReference) for v in variables}
            self.experiment = experiment_of(self.description)
            self._unpacked = "" if path.is_dir() else unpack(path)
            self.folder = folder = Path(self._unpacked or path)
            self._make = lambda: instantiated(folder, self.description, name, log)
        readable = [v for v in variables if self.rules[v.name].kind in KINDS]
        self.outputs = [v.name for v in readable if v.causality == "output"]
        self.inputs = [v.name for v in readable if v.causality == "input"]
        try:
            self.open()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # ------------------------------------------------------------------ life

    def open(self) -> None:
        """Instantiate.  Raises RefusalError with the FMU's reason."""
        self._said.clear()
        listen(self._hear)
        try:
            self.instance = self._make()
        except Exception as error:
            if self.folder is None:  # of the slave in this process
                raise
            said = f"{self.reason(str(error))}: build the FMU anew, or correct it"
            raise RefusalError("instantiate", ERROR, said) from None
        self.used = False

    def close(self) -> None:
        """Free the instance, and remove what was unpacked."""
        self._free()
        shutil.rmtree(self._unpacked, ignore_errors=True)

    def renew(self) -> None:
        """Another instance in place of one that can no longer be used."""
        self._free()
        self.open()

    def _free(self) -> None:
        if self.instance is not None:
            self.instance.freeInstance()
        self.instance = None

    def begin(
        self,
        values: Mapping[str, Any] | None = None,
        tolerance: float | None = None,
        stop: float | None = None,
        start: float = 0.0,
    ) -> None:
        """Reset if it was used; set up (times in s), set `values`, initialize."""
        given = dict(values or {})
        driven = {n: given.pop(n) for n in self.inputs if n in given}
        self.moved.clear()
        if self.used:
            self.call("reset")
        self.used, self.time = True, start
        self.call("setupExperiment", tolerance=tolerance, startTime=start, stopTime=stop)
        self.give(given)
        self.call("enterInitializationMode")
        self.give(driven)
        self.call("exitInitializationMode")

    # ------------------------------------------------------------------ calls

    def call(self, name: str, *arguments: Any, **named: Any) -> Any:
        """A method of fmpy's FMU2Slave.  Raises RefusalError unless the status is OK or a warning."""
        with self._refusing():
            return getattr(self.instance, name)(*arguments, **named)

    def reason(self, otherwise: str = "no message was logged") -> str:
        """What the FMU said of the latest call that failed; pythonfmu's wrapping is taken away."""
        text = " ".join("; ".join(self._said).split()) or otherwise
        raised = re.search(r"""Refused\((["'])(.*)\1\)""", text)
        return raised[2] if raised else text

    @contextlib.contextmanager
    def _refusing(self) -> Iterator[None]:
        self._said.clear()
        listen(self._hear)
        try:
            yield
        except FMICallException as error:
            raise RefusalError(error.function, error.status, self.reason()) from None

    def _hear(self, status: int, text: str) -> None:
        if self.log:
            self.messages.append((status, text))
        if MISSES in text:
            self.moved.append(text)
        if status > WARNING:
            self._said.append(text)

    def references(self, names: Sequence[str]) -> list[int]:
        """Value references."""
        return [self.reference[n] for n in names]

    def give(self, values: Mapping[str, Any]) -> None:
        """Set variables of any kind; an item of an Enumeration also by name.  Raises RefusalError."""
        unknown = [missing(n, self.rules) for n in values if n not in self.rules]
        if unknown:
            raise RefusalError("set", ERROR, "; ".join(unknown))
        for kind, names in reversed(self._by_kind(values)):
            numbers = [self.rules[n].number(values[n]) for n in names]
            self.call(f"set{kind}", self.references(names), numbers)

    def read(self, names: Sequence[str] | None = None) -> dict[str, Any]:
        """Values of variables, of all outputs without names, in the types of their kinds."""
        chosen = self.outputs if names is None else names
        with self._refusing():
            return dict(zip(chosen, self._reader(chosen)(), strict=True))

    def get(self, name: str) -> float:
        """The value of one, as a number."""
        return float(self.read([name])[name])

    def _by_kind(self, names: Any) -> list[tuple[str, list[str]]]:
        found: dict[str, list[str]] = {kind: [] for kind in COLUMNS}
        for n in names:
            found[KINDS[self.rules[n].kind]].append(n)
        return [(kind, those) for kind, those in found.items() if those]

    def _reader(self, names: Sequence[str]) -> Callable[[], list[Any]]:
        """Reads these variables, all of a kind in one call."""
        parts = [
            (getattr(self.instance, f"get{kind}"), self.references(those))
            for kind, those in self._by_kind(names)
        ]
        order = {n: k for k, n in enumerate(n for _, those in self._by_kind(names) for n in those)}
        places = [order[n] for n in names]
        if places == list(range(len(places))):
            return lambda: [x for get, those in parts for x in get(those)]

        def read() -> list[Any]:
            seen = [x for get, those in parts for x in get(those)]
            return [seen[k] for k in places]

        return read

    def step(self, size: float) -> None:
        """A communication step [s] from where it stands."""
        self.call("doStep", self.time, size)
        self.time += size

    def run(
        self,
        times: Sequence[float],
        values: Mapping[str, Any] | None = None,
        tolerance: float | None = None,
        read: Sequence[str] | None = None,
        inputs: Columns | None = None,
        late: bool = False,
    ) -> Run:
        """A run over the communication points `times` [s], as far as the FMU goes.

        `values` are set before it starts; `read` are the columns of its rows (all outputs).  `inputs` are set
        at each point before it is read, with `late` (as fmpy does) when it has been read.
        """
        points, names = [float(t) for t in times], self.outputs if read is None else list(read)
        rows: list[tuple[Any, ...]] = []
        refusal, begun = None, clock.perf_counter()
        try:
            first = {n: float(column[0]) for n, column in (inputs or {}).items()}
            self.begin(dict(values or {}) | first, tolerance, points[-1], points[0])
            with self._refusing():
                look, feed = self._reader(names), self._feeder(inputs or {})
                step, begun = self.instance.doStep, clock.perf_counter()
                rows.append((points[0], *look()))
                for k, (t, later) in enumerate(itertools.pairwise(points)):
                    if late:
                        feed(k)
                    step(t, later - t)
                    self.time = later
                    if not late:
                        feed(k + 1)
                    rows.append((later, *look()))
        except RefusalError as error:
            error.time = self.time if rows else None
            refusal = error
            self.renew()
        seconds = clock.perf_counter() - begun
        return Run(self._table(names, rows), refusal, seconds, tuple(self.moved))

    def _feeder(self, inputs: Columns) -> Callable[[int], None]:
        """Sets inputs to their values at point k."""
        parts = []
        for kind, names in self._by_kind(inputs):
            as_kind = float if kind == "Real" else int
            columns = [[as_kind(x) for x in inputs[n]] for n in names]
            rows = list(zip(*columns, strict=True))
            parts.append((getattr(self.instance, f"set{kind}"), self.references(names), rows))

        def feed(k: int) -> None:
            for put, references, rows in parts:
                put(references, list(rows[k]))

        return feed

    def _table(self, names: Sequence[str], rows: Sequence[tuple[Any, ...]]) -> Trajectory:
        columns = [("time", np.float64)]
        columns += [(n, COLUMNS[KINDS[self.rules[n].kind]]) for n in names]
        return np.array(rows, dtype=columns)


LAST, MAX, MIN, MEAN, TIME_OF_MAX = range(5)  # Keep in batch.h


@dataclass(frozen=True)
class Plan:
    """Many runs of one FMU over the same communication points `times` (points) [s].

    `vary` are set before initialization, to another row of values in each run; `drive` are inputs, set at
    the communication points to the rows of `drives` (points, inputs).  `keep` are (variable, LAST ...
    TIME_OF_MAX).  With `whole`, the values at all points are returned too.
    """

    vary: tuple[str, ...]
    keep: tuple[tuple[str, int], ...]
    times: NDArray[np.float64]
    tolerance: float = 0.0
    drive: tuple[str, ...] = ()
    drives: NDArray[np.float64] | None = None
    whole: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of runs: `result` (runs, keep), `trajectory` (runs, points, keep) or None, the status of
    each, the time [s] that it reached, and by number: of those that were refused the reason, of those that
    begin elsewhere than was asked for which start values were moved."""

    result: NDArray[np.float64]
    trajectory: NDArray[np.float64] | None
    status: NDArray[np.int32]
    reached: NDArray[np.float64]
    reasons: dict[int, str]
    moved: dict[int, str] = field(default_factory=dict)


def run_batch(session: Session, plan: Plan, values: NDArray[np.float64]) -> Outcome:
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
    if is_ours(session.instance):
        _in_library(session, plan, values, found)
    else:
        in_session(session, plan, values, found)
    found.result[found.status > WARNING] = np.nan
    return found


# ------------------------------------------------------------------ in the FMU's own library


class _Batch(ctypes.Structure):
    """Batch of batch.h."""

    _fields_ = [
        *((n, ctypes.c_size_t) for n in ("runs", "varied", "driven", "points", "kept")),
        *((n, ctypes.c_void_p) for n in ("vary", "values", "drive", "drives")),
        ("times", ctypes.c_void_p),
        ("tolerance", ctypes.c_double),
        *((n, ctypes.c_void_p) for n in ("keep", "what")),
        ("whole", ctypes.c_int),
        *((n, ctypes.c_void_p) for n in ("result", "trajectory", "status", "reached", "scratch")),
        ("current", ctypes.c_size_t),
    ]


def _in_library(session: Session, plan: Plan, values: NDArray[np.float64], found: Outcome) -> None:
    names = [n for n, _ in plan.keep]
    drives = None if plan.drives is None else np.ascontiguousarray(plan.drives, float)
    arrays: dict[str, Any] = {
        "vary": _references(session, plan.vary),
        "values": values,
        "drive": _references(session, plan.drive),
        "drives": drives,
        "times": np.ascontiguousarray(plan.times, dtype=np.float64),
        "keep": _references(session, names),
        "what": np.array([w for _, w in plan.keep], dtype=np.intc),
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
        tolerance=plan.tolerance,
        whole=int(plan.whole),
        current=0,
    )
    for name, array in arrays.items():
        setattr(batch, name, None if array is None else array.ctypes.data)

    def hear(status: int, text: str) -> None:
        """Of several messages of a run, all."""
        told = found.reasons if status > WARNING else found.moved if MISSES in text else None
        if told is not None:
            run = int(batch.current)
            told[run] = f"{told[run]}; {text}" if run in told else text

    function = getattr(session.instance.dll, BATCH)
    function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p], ctypes.c_int
    listen(hear)
    status = function(session.instance.component, ctypes.byref(batch))
    if status > WARNING:
        raise RefusalError(BATCH, status, found.reasons.get(0, "no message was logged"))


def _references(session: Session, names: Any) -> NDArray[np.uintc]:
    return np.array(session.references(names), dtype=np.uintc)


# ------------------------------------------------------------------ in this process


def in_session(session: Session, plan: Plan, values: NDArray[np.float64], found: Outcome) -> None:
    """One run after the other."""
    names = list(dict.fromkeys(n for n, _ in plan.keep))
    drives = () if plan.drives is None else plan.drives.T.tolist()
    inputs = dict(zip(plan.drive, drives, strict=True))
    tolerance = plan.tolerance or None
    for r, row in enumerate(values):
        given = dict(zip(plan.vary, row.tolist(), strict=True))
        run = session.run(plan.times.tolist(), given, tolerance, names, inputs)
        if run.moved:
            found.moved[r] = "; ".join(run.moved)
        if len(run.rows):
            found.reached[r] = run.rows["time"][-1]
        if found.trajectory is not None:
            for k, (n, _) in enumerate(plan.keep):
                found.trajectory[r, : len(run.rows), k] = run.rows[n]
        if run.refusal is not None:
            found.status[r], found.reasons[r] = run.refusal.status, run.refusal.message
        else:
            found.result[r] = [_kept(run, n, what) for n, what in plan.keep]


def _kept(run: Run, name: str, what: int) -> float:
    """As observe() in batch.c."""
    times, points = run.rows["time"], run.rows[name].astype(float)
    if what == MEAN:
        parts = (points[1:] + points[:-1]) / 2 * np.diff(times) / (times[-1] - times[0])
        return float(sum(parts.tolist()))
    if what in (MAX, MIN):
        return float(points.max() if what == MAX else points.min())
    return float(times[points.argmax()] if what == TIME_OF_MAX else points[-1])
