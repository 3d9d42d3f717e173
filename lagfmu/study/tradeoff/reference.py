"""What the measured outputs should be: the closed form in time where the FMU carries one, else a
converged run whose own error is estimated.

A closed form is one in time if it needs the time, parameters and start values only, also after other
such closed forms are put in for the outputs that it holds (lambda of phi, with phi of t).  Closed forms
that need the state along the run cannot tell where the state should be: they are evaluated on each run
instead (verify.py), beside its errors.

The converged run is dop853 at the tightest tolerance, its steps no longer than the FMU's communication
step.  Its own error is the largest difference to runs with other sequences of steps (another
communication step, steps half and 1.5 times as long, the same and ten times the tolerance); another
method at a tight tolerance is the second opinion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from ... import names
from ...errors import SimulationError
from ...fmu.closed_forms import CarriedForm
from ...fmu.described import Trajectory, numbers_of
from ...model.closed_form import output
from ...model.elements import Expr
from ...verification.evaluate import evaluate
from ...verification.verify import applies
from .importer import Importer
from .quantities import Quantity, magnitudes, quantities
from .setting import Setting

TIGHTEST = 1e-14
ROUNDING = 16 * float(np.finfo(float).eps)  # of a closed form or a run in double precision
COARSER = 10  # communication steps of the reference in one of the run that it is compared with
OPINION = ("radau5", 1e-12)  # it has nothing in common with the method of the converged run


@dataclass(frozen=True)
class Reference:
    """Right values at the points of `run`, and how right they are.

    `own` is the estimated error and `scale` the magnitude of each quantity (own is relative to it);
    `source` says where its values come from; `opinion` is the method that was asked besides, and the
    largest relative difference to it; `checked` the largest difference between run and closed form.
    """

    run: Trajectory
    known: tuple[Quantity, ...]
    values: Mapping[str, NDArray[np.float64]]
    own: Mapping[str, float]
    scale: Mapping[str, float]
    source: Mapping[str, str]
    opinion: tuple[str, float]
    checked: float | None

    def errors(self, run: Trajectory) -> dict[str, float]:
        """The largest error of each quantity in another run, relative to its scale."""
        rows, alike = _shared(self.run, run)
        found = {}
        for q in self.known:
            right = self.values[q.name][rows]
            if q.contact is not None:
                count = names.name(names.DEPARTURES, q.contact)
                if run[count][-1] != self.run[count][-1]:
                    found[q.name] = float("inf")  # an event that is missed, or one too many
                    continue
                same = run[count] == self.run[count][rows]
            else:
                same = alike
            difference = np.abs(run[q.name] - right)[same]
            found[q.name] = float(difference.max(initial=0.0)) / self.scale[q.name]
        return found


def refer(
    importer: Importer,
    closed_forms: Sequence[CarriedForm],
    values: Mapping[str, Any] | None = None,
    communication: float | None = None,
    stop: float | None = None,
    second_opinion: bool = True,
) -> Reference:
    """The reference for an FMU at these start values.  Raises SimulationError if it cannot be run."""
    given = dict(values or {})
    known = quantities(importer.description)
    h = communication or importer.step_size
    end = stop or importer.stop_time
    wide = next(k for k in (COARSER, 5, 2, 1) if k * h <= end / 4 or k == 1)

    def tight(tolerance: float, width: float, longest: float) -> Trajectory:
        setting = Setting("dop853", tolerance, 0.0, width)
        return importer.observe(setting, given | {names.MAXIMUM_STEP: longest}, end)

    run = tight(TIGHTEST, h, importer.step_size)
    others = [
        tight(TIGHTEST, wide * h, importer.step_size / 2),
        tight(10 * TIGHTEST, wide * h, importer.step_size * 1.5),
    ]
    scale = magnitudes(known, run)
    right = {q.name: run[q.name].astype(float) for q in known}
    converged = Reference(run, known, right, {}, scale, {}, ("", 0.0), None)
    differences = [converged.errors(other) for other in others]
    own = {q.name: max(ROUNDING, *(d[q.name] for d in differences)) for q in known}
    source = {q.name: "converged run" for q in known}
    opinion = ("no other method", float("nan"))
    if second_opinion:
        opinion = _opinion(importer, converged, given, wide * h, end)
    checked: float | None = None
    for name, closed_form, expected in _in_time(closed_forms, importer, given, run):
        where = applies(closed_form, run, _numbers(importer, given)) & np.isfinite(expected)
        if name not in right or not where.any():
            continue
        miss = float(np.abs(right[name] - expected)[where].max()) / scale[name]
        checked = max(checked or 0.0, miss)
        right[name] = np.where(where, expected, right[name])
        if where.all():
            own[name], source[name] = ROUNDING, "closed form in time"
        else:
            source[name] = "closed form in time where it applies, converged run elsewhere"
    scale = magnitudes(known, _replaced(run, right))
    return Reference(run, known, right, own, scale, source, opinion, checked)


def _opinion(
    importer: Importer, converged: Reference, given: Mapping[str, Any], h: float, end: float
) -> tuple[str, float]:
    method, tolerance = OPINION
    setting = Setting(method, tolerance, 0.0, h)
    try:
        found = converged.errors(importer.observe(setting, given, end))
    except SimulationError:
        return "no other method", float("nan")
    return f"{method} {setting.dial}", max(found.values())


def _shared(fine: Trajectory, run: Trajectory) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Rows of `fine` at the times of `run`, and where the contact modes of both are alike.

    At a communication point beside an event the modes may differ by the error of the event's time:
    such single points are left to that error.  Longer differences are errors like any other.
    """
    times = fine["time"]
    rows = np.clip(np.searchsorted(times, run["time"]), 1, len(times) - 1)
    rows -= np.abs(times[rows - 1] - run["time"]) < np.abs(times[rows] - run["time"])
    alike = np.ones(len(run), dtype=bool)
    for name in names.those(run.dtype.names or (), names.CONTACT):
        differ = run[name] != fine[name][rows]
        alone = differ.copy()
        alone[1:] &= ~differ[:-1]
        alone[:-1] &= ~differ[1:]
        alike &= ~alone
    return rows, alike


def _replaced(run: Trajectory, right: Mapping[str, NDArray[np.float64]]) -> Trajectory:
    copy = run.copy()
    for name, column in right.items():
        copy[name] = column
    return copy


def _numbers(importer: Importer, given: Mapping[str, Any]) -> dict[str, float]:
    """The values of parameters, inputs and given start values by name."""
    values = numbers_of(importer.description)
    return values | {k: float(v) for k, v in given.items() if not isinstance(v, str)}


def _in_time(
    closed_forms: Sequence[CarriedForm],
    importer: Importer,
    given: Mapping[str, Any],
    run: Trajectory,
) -> list[tuple[str, CarriedForm, NDArray[np.float64]]]:
    """(output, closed form, expected values) for the closed forms that need time and start values only."""
    values = _numbers(importer, given)
    constant = values.keys() - set(run.dtype.names or ()) | {"time"}

    def explicit(e: Expr) -> bool:
        return all(
            str(s) in constant or names.initially(str(s)) for s in sp.sympify(e).free_symbols
        )

    open_forms = [
        c
        for c in closed_forms
        if c.expected is not None and sp.sympify(c.actual).is_Symbol and c.at_departure is None
    ]
    always = [c for c in open_forms if c.while_closed is None and c.while_open is None]
    solved: dict[Expr, Expr] = {}
    for _ in always:
        for c in always:
            expected = sp.sympify(c.expected).xreplace(solved)
            if c.actual not in solved and explicit(expected):
                solved[output(str(c.actual))] = expected
    found, taken = [], set()
    for c in open_forms:
        expected = sp.sympify(c.expected).xreplace(solved)
        if explicit(expected) and (str(c.actual), c.while_closed, c.while_open) not in taken:
            taken.add((str(c.actual), c.while_closed, c.while_open))
            found.append((str(c.actual), c, evaluate(expected, run, run, values, c.name)))
    return found
