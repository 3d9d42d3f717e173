"""Many runs of one FMU in one call: through `lagfmu_batch` (runtime/fmi/batch.c) where the library has it,
else by the loop of the session: slower, with the same numbers."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..numeric.start_priority import MISSES
from .binary import BATCH, is_ours, listen
from .session import WARNING, RefusalError, Run, Session

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
