"""An FMU in one setting, and what it should report: a converged run whose own error is known.

The reference is a run of dop853 at REFERENCE with steps no longer than the FMU's communication step.  Its
own error is the largest difference to one at FINER with steps half as long, through other communication
points: where the tolerance bounds the error that is the more accurate one, and where the longest step does,
too.

An error is relative to the largest magnitude of that quantity over the reference run.  A quantity that
is zero throughout, up to rounding, is measured against the largest one of its group and unit.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ... import names
from ...errors import SimulationError, VerificationError
from ...fmu.read import Trajectory, communication_points, kind_of
from ...fmu.session import RefusalError, Run, Session
from ...methods import FIXED_STEP
from ...names import METHOD, STEP, TOLERANCE
from ...verification.closed_forms import alone

HALVINGS = 10  # of a fixed step, at most


@dataclass(frozen=True)
class Setting:
    """One way to run an FMU.

    `tolerance` (relative) for methods with step-size control, `step` [s] for those with a fixed one,
    the other is 0; `communication` [s] is the importer's step.  Without a method the FMU runs as it
    was built.
    """

    method: str
    tolerance: float
    step: float
    communication: float

    @property
    def dial(self) -> str:
        """The tolerance or the step as text: 1e-6, 0.01 s or 0.5 ms."""
        if self.tolerance:
            return f"{self.tolerance:.0e}".replace("e-0", "e-")
        return f"{self.step:.3g} s" if self.step >= 1e-3 else f"{1e3 * self.step:.3g} ms"

    @property
    def values(self) -> dict[str, Any]:
        """The FMU's parameters; the tolerance is one of the experiment."""
        values: dict[str, Any] = {METHOD: self.method} if self.method else {}
        return values | {STEP: self.step} if self.step else values

    def __str__(self) -> str:
        return f"{self.method or 'as built'} {self.dial}"


def ladder(
    method: str, communication: float, tolerances: Sequence[float], halvings: int = HALVINGS
) -> list[Setting]:
    """The settings of one method at one communication step [s], from coarse to fine.

    A fixed step divides the communication step evenly: H, H/2, H/4, ...
    """
    if method in FIXED_STEP:
        steps = [communication / 2**k for k in range(halvings + 1)]
        return [Setting(method, 0.0, h, communication) for h in steps]
    return [Setting(method, tol, 0.0, communication) for tol in tolerances]


def opened(fmu: Path) -> Session:
    """A session of an FMU that lagfmu has built.  Raises VerificationError, SimulationError."""
    try:
        session = Session(fmu, "tradeoff")
    except RefusalError as error:
        raise SimulationError(f"{str(fmu)!r}: {error}") from None
    if TOLERANCE in session.rules:
        return session
    session.close()
    raise VerificationError(
        f"{str(fmu)!r} has no parameter {TOLERANCE!r}: it was not built by lagfmu, and there is no setting "
        "to vary"
    )


def observe(
    session: Session,
    setting: Setting,
    values: Mapping[str, Any] | None = None,
    stop: float | None = None,
) -> Trajectory:
    """All outputs and local variables at every communication point.  Raises SimulationError with the FMU's
    reason."""
    read = [v.name for v in session.description.modelVariables if _is_read(v)]
    run = _run(session, setting, read, values, stop)
    if run.refusal is not None:
        raise SimulationError(f"{session.description.modelName}, {setting}: {run.refusal.message}")
    return run.rows


def seconds(session: Session, setting: Setting, names: Sequence[str]) -> float:
    """Wall time [s] of stepping and of reading `names`, of a run that is known to succeed."""
    return _run(session, setting, names, None, None).seconds


def _run(
    session: Session,
    setting: Setting,
    read: Sequence[str],
    values: Mapping[str, Any] | None,
    stop: float | None,
) -> Run:
    times = communication_points(stop or session.experiment.stop_time, setting.communication)
    given = setting.values | dict(values or {})
    return session.run(times.tolist(), given, setting.tolerance or None, read)


def _is_read(v: Any) -> bool:
    return v.causality in ("output", "local") and kind_of(v) in ("Real", "Integer", "Boolean")


MULTIPLIER, FORCE, MOTION, EVENT = "lambda", "Q", "coordinates", "event time"
OWN = "outputs"
GROUPS = (MULTIPLIER, FORCE, MOTION, OWN, EVENT)
ZERO = 1e-9  # part of its group's magnitude below which a quantity counts as zero


@dataclass(frozen=True)
class Quantity:
    """One output that is measured: its group, its unit and, for an event time, the contact."""

    name: str
    group: str
    unit: str
    contact: str | None = None


def quantities(description: Any) -> tuple[Quantity, ...]:
    """Every output of an FMU (fmpy's ModelDescription) that is a lambda, Q, coordinate, departure time
    or output of the model's own."""
    reals = [v for v in description.modelVariables if kind_of(v) == "Real"]
    units = {v.name: v.unit or "1" for v in reals if v.causality == "output"}
    known = {v.name for v in description.modelVariables}
    own = [n for n in units if _is_own(n, known)]
    moving = [n for n in names.those(units, names.VALUE) if not names.read(n).order]
    coordinates = [n for n in moving if n not in own]
    found = [Quantity(n, MULTIPLIER, units[n]) for n in names.those(units, names.MULTIPLIER)]
    forces = names.those(units, names.FORCE)
    found += [Quantity(n, FORCE, units[n]) for n in forces if not names.read(n).constraint]
    found += [Quantity(c, MOTION, units[c]) for c in coordinates]
    found += [Quantity(n, OWN, units[n]) for n in own]
    times = names.those(units, names.DEPARTURE_TIME)
    found += [Quantity(n, EVENT, units[n], names.read(n).constraint) for n in times]
    return tuple(found)


def _is_own(name: str, known: Collection[str]) -> bool:
    """True for an output that the model names itself: neither the FMU's own, nor one that moves.

    A full FMU reports the velocity of each of its coordinates.
    """
    of = names.read(name)
    if of.quantity != names.VALUE or of.order:
        return of.head in names.OF_FRICTION
    full = "." in name or any(names.read(n).order for n in known)
    return full and names.derivative(name) not in known


def selected(known: Sequence[Quantity], asked: Sequence[str]) -> tuple[Quantity, ...]:
    """Those that match a name, a pattern (Q.*) or a group; all without names.

    Raises SimulationError if a name matches nothing.
    """
    chosen: list[Quantity] = []
    for name in asked:
        hits = [q for q in known if fnmatch.fnmatchcase(q.name, name) or q.group == name]
        if not hits:
            raise SimulationError(
                f"no measured quantity is called {name!r}, expected one of "
                f"{', '.join(q.name for q in known)}, a pattern such as 'Q.*', or a group: "
                f"{', '.join(repr(g) for g in GROUPS)}"
            )
        chosen += [q for q in hits if q not in chosen]
    return tuple(chosen) if asked else tuple(known)


def _magnitudes(known: Sequence[Quantity], run: Trajectory) -> dict[str, float]:
    """The magnitude that each quantity's error is relative to; 1 where all of its kind are zero."""
    largest = {q.name: float(np.abs(run[q.name]).max()) for q in known}
    found = {}
    for q in known:
        peers = [largest[p.name] for p in known if (p.group, p.unit) == (q.group, q.unit)]
        own = largest[q.name]
        found[q.name] = (own if own > ZERO * max(peers) else max(peers)) or 1.0
    return found


REFERENCE, FINER = 1e-13, 1e-14
ROUNDING = 16 * float(np.finfo(float).eps)  # of a run in double precision
WIDER = (10, 5, 2)


@dataclass(frozen=True)
class Reference:
    """Right values: those of `run`; `own` error and `scale` of each quantity (own is relative to it)."""

    run: Trajectory
    known: tuple[Quantity, ...]
    scale: Mapping[str, float]
    own: Mapping[str, float]

    def errors(self, run: Trajectory) -> dict[str, float]:
        """The largest error of each quantity in another run, relative to its scale."""
        rows, alike = _shared(self.run, run)
        found = {}
        for q in self.known:
            same = alike
            if q.contact is not None:
                count = names.name(names.DEPARTURES, q.contact)
                if run[count][-1] != self.run[count][-1]:
                    found[q.name] = float("inf")  # an event that is missed, or one too many
                    continue
                same = run[count] == self.run[count][rows]
            difference = np.abs(run[q.name] - self.run[q.name][rows])[same]
            found[q.name] = float(difference.max(initial=0.0)) / self.scale[q.name]
        return found


def wider(session: Session, step: float | None = None) -> float:
    """Ten times the communication step [s], or less where a quarter of the run is shorter."""
    h = step or session.experiment.step_size
    return next((k * h for k in WIDER if k * h <= session.experiment.stop_time / 4), h)


def refer(
    session: Session,
    values: Mapping[str, Any] | None = None,
    communication: float | None = None,
) -> Reference:
    """The reference for an FMU at these start values.  Raises SimulationError if it cannot be run."""
    known = quantities(session.description)
    h, longest = communication or session.experiment.step_size, session.experiment.step_size

    def tight(tolerance: float, width: float, longest: float) -> Trajectory:
        setting = Setting("dop853", tolerance, 0.0, width)
        return observe(session, setting, {**(values or {}), names.MAXIMUM_STEP: longest})

    run = tight(REFERENCE, h, longest)
    found = Reference(run, known, _magnitudes(known, run), {})
    missed = found.errors(tight(FINER, wider(session, h), longest / 2))
    return Reference(run, known, found.scale, {n: max(ROUNDING, e) for n, e in missed.items()})


def _shared(fine: Trajectory, run: Trajectory) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Rows of `fine` at the times of `run`, and where contacts and counts of events of both are alike, or
    differ at longer than a single point: that is an error like any other."""
    times = fine["time"]
    rows = np.clip(np.searchsorted(times, run["time"]), 1, len(times) - 1)
    rows -= np.abs(times[rows - 1] - run["time"]) < np.abs(times[rows] - run["time"])
    alike = np.ones(len(run), dtype=bool)
    for name in names.those(run.dtype.names or (), names.CONTACT, *names.COUNTS):
        alike &= ~alone(run[name] != fine[name][rows])
    return rows, alike
