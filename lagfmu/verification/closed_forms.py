"""A closed form on what a run returned: where it says something, and how far the run is off."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from .. import names
from ..fmu.closed_forms import CarriedForm
from ..fmu.read import Trajectory
from ..model.elements import Expr
from .check import Check, Missed
from .evaluate import evaluate


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
    if not chosen.any():
        return Check(closed_form.name, 0.0, allowed, 0)

    def of(expression: Expr) -> NDArray[np.float64]:
        return evaluate(expression, result[chosen], result, values, closed_form.name)

    actual = of(closed_form.actual)
    first = np.full_like(actual, actual[0])
    expected = first if closed_form.expected is None else of(closed_form.expected)
    scale = expected if closed_form.scale is None else of(closed_form.scale)
    return measured(closed_form.name, allowed, result, chosen, actual, expected, scale)


def measured(
    name: str,
    allowed: float,
    result: Trajectory,
    chosen: NDArray[np.bool_],
    actual: NDArray[np.float64],
    expected: NDArray[np.float64],
    scale: NDArray[np.float64],
    absolute: float = 0.0,
) -> Check:
    """What was found at the points that are `chosen` of a run, held against what is expected there: an error
    may be `absolute` + `allowed` times the largest magnitude of `scale`."""
    off, size = np.abs(actual - expected), float(np.abs(scale).max()) or 1.0
    error = max(float(off.max()) - absolute, 0.0) / size
    if not math.isfinite(error):
        return Check(name, math.inf, allowed, len(actual), "not a finite number")
    misses = off > absolute + allowed * size
    detail = first_miss(result, np.flatnonzero(chosen)[misses])
    missed = Missed(result["time"][chosen], actual, expected) if misses.any() else None
    return Check(name, error, allowed, len(actual), detail, missed)


def first_miss(result: Trajectory, missed: NDArray[np.int_]) -> str:
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
    for contact in _departures(closed_form):
        # before the first one there is nothing to compare with
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
        if count in known:
            # one that opens twice between two points, or while it was open, had closed
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
