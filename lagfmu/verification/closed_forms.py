"""A closed form on what a run returned: where it says something, and how far the run is off."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from .. import names
from ..errors import VerificationError
from ..fmu.closed_forms import CarriedForm
from ..fmu.read import Trajectory
from ..model.elements import Expr
from .check import Check, Missed

SHAKEN = 1e-6  # of a size: a step of differences


def _function(symbols: Sequence[Expr], expressions: Any) -> Callable[..., Any]:
    """Of numbers in place of the symbols, as sp.lambdify makes one, which goes through all once for each
    symbol whose name Python does not allow: here once for all of them."""
    plain = [sp.Symbol(f"x{k}") for k in range(len(symbols))]
    named = dict(zip(symbols, plain, strict=True))
    several = isinstance(expressions, list)
    renamed = [sp.sympify(e).xreplace(named) for e in (expressions if several else [expressions])]
    made: Callable[..., Any] = sp.lambdify(
        plain, renamed if several else renamed[0], modules=["scipy", "numpy"]
    )
    return made


class Compiled:
    """An expression of the closed form `name`, as a function of a run."""

    def __init__(self, expression: Expr, name: str) -> None:
        self.name = name
        self.symbols = sorted(sp.sympify(expression).free_symbols, key=str)
        self.function = _function(self.symbols, expression)

    def at(
        self,
        rows: Trajectory,
        result: Trajectory,
        values: Mapping[str, float],
        floors: Mapping[str, float] | None = None,
    ) -> NDArray[np.float64]:
        """Its values at `rows` of the run `result`, parameters in `values`; magnitudes below `floors` are
        taken for those.  Raises VerificationError if it uses what the FMU does not have."""
        columns = self._columns(rows, result, values)
        if floors is not None:
            columns = {
                n: np.maximum(np.abs(x), floors[n]) if n in floors else x
                for n, x in columns.items()
            }
        return self._of(columns, len(rows))

    def shaken(
        self,
        rows: Trajectory,
        result: Trajectory,
        values: Mapping[str, float],
        sizes: Mapping[str, NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """The sum of |df/dx| size(x) over the columns x in `sizes`, by differences."""
        columns, count = self._columns(rows, result, values), len(rows)
        moved = sorted(columns.keys() & sizes.keys())
        aside = {
            n: columns[n] + SHAKEN * np.outer(np.arange(len(moved)) == k, sizes[n])
            for k, n in enumerate(moved)
        }
        there, here = self._of(columns | aside, (len(moved), count)), self._of(columns, count)
        found: NDArray[np.float64] = np.abs(there - here).sum(axis=0) / SHAKEN
        return found

    def _of(self, columns: Mapping[str, Any], shape: Any) -> NDArray[np.float64]:
        with np.errstate(all="ignore"):
            found = np.asarray(self.function(*columns.values()), dtype=float)
        return np.broadcast_to(found, shape).copy()

    def _columns(
        self, rows: Trajectory, result: Trajectory, values: Mapping[str, float]
    ) -> dict[str, Any]:
        """What stands for the symbols, in their order."""
        known, columns = rows.dtype.names or (), {}
        for text in map(str, self.symbols):
            inner = names.initially(text)
            if inner in known:
                column: Any = result[inner][0]
            elif text in known:
                column = rows[text]
            elif text in values:
                column = values[text]
            else:
                raise VerificationError(
                    f"closed form {self.name!r} uses {text!r}, which is no output or parameter of the FMU"
                )
            columns[text] = np.asarray(column, dtype=float)
        return columns


def alone(differ: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Points at which two runs differ, and beside which they do not: where an event lies between them and the
    next, the modes may differ by the error of its time."""
    found = differ.copy()
    found[1:] &= ~differ[:-1]
    found[:-1] &= ~differ[1:]
    return found


_compiled = lru_cache(maxsize=1024)(Compiled)  # SymPy takes longer for one than the run takes


def evaluate(
    expression: Expr,
    rows: Trajectory,
    result: Trajectory,
    values: Mapping[str, float],
    name: str,
) -> NDArray[np.float64]:
    """See Compiled.at."""
    return _compiled(expression, name).at(rows, result, values)


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
    detail = _first_miss(result, np.flatnonzero(chosen)[misses])
    missed = Missed(result["time"][chosen], actual, expected) if misses.any() else None
    return Check(name, error, allowed, len(actual), detail, missed)


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
