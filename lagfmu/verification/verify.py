"""verify(): an FMU simulated by fmpy and held against the closed forms that it carries."""

from __future__ import annotations

import math
import os
import time
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from fmpy.validation import validate_fmu
from numpy.typing import NDArray

from .. import names
from ..errors import SettingError, VerificationError
from ..fmu.archive import opened
from ..fmu.closed_forms import LARGEST_RECORD, CarriedForm, unpack_closed_forms
from ..fmu.read import Trajectory, experiment_of, numbers_of, read_description
from .evaluate import evaluate
from .simulate import simulate, steps_of

RECORD = "resources/lagfmu.json"
MODES = ("Boolean", "Real")  # what a mode may be: a Real where an FMU has Reals alone
NUMBERS = ("Real", "Integer")
OF_THE_FILE = 3  # checks that come before the statements on its physics


@dataclass(frozen=True)
class Check:
    """One statement: its largest error relative to its scale, and the error that is allowed.

    `points` is the number of communication points at which it was evaluated; with 0 it was not
    reached, and nothing is known.
    """

    name: str
    error: float
    allowed: float
    points: int
    detail: str = ""

    @property
    def passed(self) -> bool:
        """True if it was held at one point at least, and the error is within what is allowed."""
        return self.points > 0 and self.error <= self.allowed

    @property
    def failed(self) -> bool:
        """True if it was held, and the error is beyond what is allowed."""
        return self.points > 0 and not self.passed

    @property
    def verdict(self) -> str:
        """pass, FAIL, or not reached."""
        if self.points == 0:
            return "not reached"
        return "pass" if self.passed else "FAIL"

    def __str__(self) -> str:
        figures = f" {self.error:.1e}, allowed {self.allowed:.0e}" if self.allowed else ""
        return f"{self.name}: {self.verdict}{figures} {self.detail}".rstrip()


@dataclass(frozen=True)
class Verification:
    """The checks of one FMU, `closed_forms` of them closed forms, and what the run cost.

    `uncovered` are the outputs of which no closed form and no reference says anything.
    """

    name: str
    checks: tuple[Check, ...]
    simulated: float
    seconds: float
    steps: int
    closed_forms: int
    uncovered: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """True if no check failed."""
        return not any(c.failed for c in self.checks)

    @property
    def worst(self) -> Check | None:
        """The closed form whose error is the largest part of what it is allowed; None without any."""
        measured = [c for c in self.checks if c.points and c.allowed]
        return max(measured, key=lambda c: c.error / c.allowed, default=None)

    def rows(self) -> list[tuple[str, str, str, str, str]]:
        """(statement, largest error, allowed, at how many points, verdict) as text; no figures where it is
        yes or no."""
        return [
            (
                c.name,
                f"{c.error:.1e}" if c.points and c.allowed else "",
                f"{c.allowed:.0e}" if c.allowed else "",
                str(c.points) if c.allowed else "",
                c.verdict,
            )
            for c in self.checks
        ]


def verify(
    fmu: str | os.PathLike[str],
    start_values: Mapping[str, Any] | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
    tolerance: float | None = None,
    inputs: Trajectory | None = None,
    reference: Compared | None = None,
) -> Verification:
    """Simulate the FMU through fmpy and evaluate its closed forms on what it returns.

    Also checks what FMU checkers do not: that every output is finite, and that the start values in
    modelDescription.xml are those that the binary starts with.  Parameters and start values may be
    changed; the closed forms follow.

    `inputs` drives the FMU, as in simulate(); a `reference` (reference.Reference) is a table of another run
    that this one is held against besides; with one, an FMU of another tool will do.

    An FMU that was built for an accuracy is held to that, as long as its solver settings are left alone.

    Raises VerificationError if the file is corrupt or carries no closed forms of lagfmu, and
    SimulationError if it cannot be simulated.
    """
    path = Path(fmu)
    description = read_description(path)
    closed_forms = closed_forms_in(path) if reference is None or is_ours(path) else []
    _check_texts(description, start_values or {})
    problems = validate_fmu(str(path))
    begun = time.perf_counter()
    read = {v.name for v in description.modelVariables if v.causality in ("local", "input")}
    besides = sorted(read & set().union(*(closed_form.variables for closed_form in closed_forms)))
    if reference is not None and stop_time is None:
        stop_time = float(reference.table["time"][-1]) or None
    result = simulate(path, stop_time, step_size, tolerance, start_values, inputs, besides=besides)
    seconds = time.perf_counter() - begun
    used = tolerance or experiment_of(description).tolerance
    values = numbers_of(description)
    values |= {k: float(v) for k, v in (start_values or {}).items() if not isinstance(v, str)}
    used = values.get(names.TOLERANCE) or used
    checks = [
        Check("valid for fmpy", len(problems), 0, 1, "; ".join(problems)),
        _finite(result),
        _starts(description, start_values or {}, result),
    ]
    as_built = tolerance is None and not any(
        names.read(k).head == names.SOLVER for k in start_values or ()
    )
    checks += [
        check_closed_form(closed_form, result, values, used, as_built)
        for closed_form in closed_forms
    ]
    if reference is not None:
        checks += reference.checks(result)
    statements = checks[OF_THE_FILE:]
    if statements and not any(c.points for c in statements):
        told = f"none of {len(statements)} was: nothing is known of its physics"
        checks.append(Check("statements reached", 1, 0, 1, told))
    span = float(result["time"][-1] - result["time"][0])
    steps = steps_of(result)
    said = set().union(*(closed_form.variables for closed_form in closed_forms))
    said |= set(reference.table.dtype.names or ()) if reference is not None else set()
    outputs = [v.name for v in description.modelVariables if v.causality == "output"]
    return Verification(
        description.modelName,
        tuple(checks),
        span,
        seconds,
        steps,
        len(closed_forms),
        tuple(n for n in outputs if n not in said),
    )


class Compared(Protocol):
    """A table of another run, and how to hold one against it."""

    @property
    def table(self) -> Trajectory:
        """`time` [s], one column an output."""

    def checks(self, result: Trajectory) -> list[Check]:
        """One statement a column."""


def is_ours(path: Path) -> bool:
    """Whether a file carries closed forms of lagfmu."""
    with opened(path) as archive:
        return RECORD in archive.namelist()


def _check_texts(description: Any, given: Mapping[str, Any]) -> None:
    """A text is a value for an Enumeration only."""
    texts = {v.name for v in description.modelVariables if v.type == "Enumeration"}
    wrong = [f"{k} = {v!r}" for k, v in given.items() if isinstance(v, str) and k not in texts]
    if wrong:
        raise SettingError(f"{', '.join(wrong)}: expected a number")


def closed_forms_in(path: Path) -> list[CarriedForm]:
    """The closed forms that an FMU carries.  Raises VerificationError if it is none of lagfmu's."""
    variables = {v.name: v for v in read_description(path).modelVariables}
    with opened(path) as archive:
        if RECORD not in archive.namelist():
            raise VerificationError(
                f"{str(path)!r} carries no closed forms ({RECORD} is missing): it was not built "
                "by lagfmu, and there is nothing to hold it against: give it a --reference"
            )
        closed_forms = unpack_closed_forms(_record(archive), str(path))
    problems = []
    for closed_form in closed_forms:
        for name in sorted(closed_form.variables):
            v = variables.get(name)
            if v is None:
                problems.append(
                    f"closed form {closed_form.name!r} uses {name!r}, which is no variable"
                )
            elif v.type not in (MODES if names.read(name).quantity in names.MODES else NUMBERS):
                problems.append(
                    f"closed form {closed_form.name!r} uses {name!r}, which is a {v.type}"
                )
    if problems:
        raise VerificationError(f"{str(path)!r}: " + "; ".join(problems))
    return closed_forms


def _record(archive: zipfile.ZipFile) -> bytes:
    """Its content, but no more of it than is ever looked at."""
    with archive.open(RECORD) as file:
        return file.read(LARGEST_RECORD + 1)


def _finite(result: Trajectory) -> Check:
    bad = [n for n in result.dtype.names or () if not np.isfinite(result[n]).all()]
    return Check("all outputs finite", len(bad), 0, len(result), ", ".join(bad))


def _starts(description: Any, given: Mapping[str, Any], result: Trajectory) -> Check:
    """Outputs with an exact start begin with it."""
    worst, count, missed = 0.0, 0, []
    for v in description.modelVariables:
        if v.initial == "exact" and v.causality == "output" and v.type == "Real":
            expected = float(given.get(v.name, v.start))
            error = abs(float(result[v.name][0]) - expected)
            count += 1
            if error > 0:
                missed.append(
                    f"{v.name} starts at {result[v.name][0]!r}, described as {expected!r}"
                )
            worst = max(worst, error)
    return Check("starts as described", worst, 0, max(count, 1), "; ".join(missed))


def check_closed_form(
    closed_form: CarriedForm,
    result: Trajectory,
    values: Mapping[str, float],
    tolerance: float,
    as_built: bool = False,
) -> Check:
    """One closed form on what a run returned; `values` are the parameters, by name.

    `as_built`: held to the accuracy that the FMU was built for, if it was built for one.
    """
    result = _with_modes(result)
    chosen = applies(closed_form, result, values)
    allowed = closed_form.allowed(tolerance, as_built)
    count = int(chosen.sum())
    if count == 0:
        return Check(closed_form.name, 0.0, allowed, 0)
    rows = result[chosen]
    actual = evaluate(closed_form.actual, rows, result, values, closed_form.name)
    if closed_form.expected is None:
        expected = np.full_like(actual, actual[0])
    else:
        expected = evaluate(closed_form.expected, rows, result, values, closed_form.name)
    if closed_form.scale is None:
        scale = float(np.abs(expected).max())
    else:
        scale = float(
            np.abs(evaluate(closed_form.scale, rows, result, values, closed_form.name)).max()
        )
    error = float(np.abs(actual - expected).max())
    if not math.isfinite(error):
        return Check(closed_form.name, math.inf, allowed, count, "not a finite number")
    misses = np.abs(actual - expected) > allowed * (scale if scale > 0 else 1.0)
    detail = _first_miss(result, np.flatnonzero(chosen)[misses])
    return Check(closed_form.name, error / scale if scale > 0 else error, allowed, count, detail)


def _first_miss(result: Trajectory, missed: NDArray[np.int_]) -> str:
    """When a statement is missed first (`missed`: numbers of rows), and which contact changed then."""
    if not len(missed):
        return ""
    k = int(missed[0])
    text = f"first missed at t = {float(result['time'][k]):.9g} s"
    contacts = names.constraints(result.dtype.names or (), names.CONTACT)
    for c in contacts if k else ():
        before, now = (bool(result[names.name(names.CONTACT, c)][i]) for i in (k - 1, k))
        if before != now:
            text += f", where contact {c!r} has just {'closed' if now else 'opened'}"
    return text


def _with_modes(result: Trajectory) -> Trajectory:
    """Modes as Booleans, also of an FMU that has Reals alone (Scene.reals_only)."""
    known = result.dtype.names or ()
    modes = set(names.those(known, *names.MODES))
    types = [(n, np.bool_ if n in modes else result.dtype[n]) for n in known]
    return result.astype(types)


def applies(
    closed_form: CarriedForm, result: Trajectory, values: Mapping[str, float]
) -> NDArray[np.bool_]:
    """The communication points of a run at which a closed form says something; `values`: parameters."""

    def closed(contact: str) -> NDArray[np.bool_]:
        return np.asarray(result[names.name(names.CONTACT, contact)], dtype=bool)

    def left(contact: str) -> NDArray[np.bool_]:
        return np.asarray(result[names.name(names.DEPARTURES, contact)] > 0)

    chosen = np.ones(len(result), dtype=bool)
    if closed_form.lasts_until_landing:
        chosen &= ~landed(result)
    if closed_form.while_closed is not None:
        chosen &= closed(closed_form.while_closed)
    if closed_form.while_open is not None:
        chosen &= ~closed(closed_form.while_open)
    for contact in _departures(
        closed_form
    ):  # before the first one there is nothing to compare with
        chosen &= left(contact)
    if (until := closed_form.until_departure) is not None:
        chosen &= np.logical_and.accumulate(closed(until) & ~left(until))
    if closed_form.when is not None:
        when = evaluate(closed_form.when, result, result, values, closed_form.name)
        chosen &= (when != 0) & ~np.isnan(when)  # a condition without a value does not hold
    if (at := closed_form.at_departure) is not None:
        chosen &= (np.cumsum(left(at)) == 1) & closed(at)[0]
    return chosen


def landed(result: Trajectory) -> NDArray[np.bool_]:
    """From the first point on at which a contact is seen to have closed, or to have opened again, since the
    start: an impact takes energy, and a start's closed forms end."""
    known = result.dtype.names or ()
    found = np.zeros(len(result), dtype=bool)
    for contact in names.constraints(known, names.CONTACT):
        closed = np.asarray(result[names.name(names.CONTACT, contact)], dtype=bool)
        found[1:] |= closed[1:] & ~closed[:-1]
        count = names.name(names.DEPARTURES, contact)
        if (
            count in known
        ):  # one that opens twice between two points, or while it was open, had closed
            found[1:] |= np.diff(np.asarray(result[count], dtype=float)) > closed[:-1]
        if (impacts := names.name(names.CLOSINGS, contact)) in known:  # a bounce, too
            found |= np.asarray(result[impacts]) > 0
    return np.logical_or.accumulate(found)


def _departures(closed_form: CarriedForm) -> list[str]:
    """Contacts whose departure the closed form speaks of, if its `when` does not count them itself."""
    symbols = {
        str(s)
        for e in (closed_form.actual, closed_form.expected)
        if e is not None
        for s in e.free_symbols
    }
    counted = set() if closed_form.when is None else {str(s) for s in closed_form.when.free_symbols}
    told = {s.constraint for s in map(names.read, symbols) if s.head == names.DEPARTURE}
    return sorted(c for c in told if names.name(names.DEPARTURES, c) not in counted)
