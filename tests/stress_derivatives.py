"""Directional derivatives: what every law of the model says of small changes.

A law R(outputs, inputs, t) = 0 of the model (lagrange.py) holds beside a state as well as at it, so that
along any direction

    sum_k  dR/do_k  do_k = 0

with the changes do_k that fmi2GetDirectionalDerivative names: nothing but the FMU's own values stands in
it, and no difference quotient.  It may be off by WITHIN of the sum of the terms' magnitudes, or of the law's
own size (in the metric of M, lagrange.py) over that of what is changed.  Where constraints follow from
others there may be no accelerations beside them, and a refusal is right.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp

from lagfmu import names
from lagfmu.testing import (
    Bench,
    Check,
    Facts,
    Finding,
    JudgedForm,
    Probe,
    RefusalError,
    applies,
    function,
    magnitude,
)
from lagfmu.testing import table_of_run as table

FAMILY = "derivatives"
WITHIN = 1e-11
PARTS = (1e-3, 0.13, 0.41, 0.77)  # of the default experiment
KINKED = (sp.Abs, sp.Max, sp.Min, sp.sign, sp.Heaviside, sp.floor, sp.Piecewise)


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """One, where the FMU has such derivatives and the laws are known."""
    if not facts.laws or not facts.description.coSimulation.providesDirectionalDerivative:
        return []
    return [Probe(FAMILY, "along each state and input", _along_each, False)]


@dataclass(frozen=True)
class _Law:
    """R's partial derivatives by the variables `moving` and last its size, of the variables `needs`."""

    judged: JudgedForm
    moving: tuple[str, ...]
    needs: tuple[str, ...]
    slopes: Callable[..., Any]


def _law(form: JudgedForm, variables: set[str]) -> _Law | None:
    """None where R has no derivative everywhere."""
    R = sp.sympify(form.closed_form.actual) - sp.sympify(form.closed_form.expected)
    parts = [sp.sympify(e) for e in (form.closed_form.actual, form.closed_form.expected)]
    size = sp.Add(*(magnitude(e) for e in parts), form.closed_form.scale or 0)
    symbols = sorted(R.free_symbols | size.free_symbols, key=str)
    by = [s for s in symbols if s in R.free_symbols and str(s) in variables]
    slopes = [] if R.has(*KINKED) else [R.diff(s) for s in by]
    if not slopes or any(e.has(sp.Derivative, sp.Subs) for e in slopes):
        return None
    return _Law(
        form, tuple(map(str, by)), tuple(map(str, symbols)), function(symbols, [*slopes, size])
    )


def _along_each(bench: Bench) -> Finding:
    facts, session = bench.facts, bench.session
    reals = [v.name for v in facts.outputs if v.type == "Real" and v.variability != "discrete"]
    seeds = [s.name for s in (*facts.starts, *facts.inputs)]
    forms = [_law(form, {*reals, *seeds}) for form in bench.forms if form.law]
    uniques = [names.name(names.UNIQUE, c) for c in facts.constraints]
    known = {p.name: p.start for p in facts.parameters}
    checks: list[Check] = []
    session.begin({}, None)
    for part in PARTS:
        session.step(part * facts.stop_time - session.time)
        rows = table(facts, 1)
        values = session.read() | session.read(session.inputs) | {"time": session.time}
        for name, value in values.items():
            rows[name][0] = value
        asked = [n for n in reals if _defined(n, values)]
        laws = [x for x in forms if x is not None and {*x.moving} <= {*asked, *seeds}]
        laws = [x for x in laws if applies(x.judged.closed_form, rows, known)[0]]
        for seed in seeds:
            references = session.references(asked), session.references([seed])
            try:
                found = session.call("getDirectionalDerivative", *references, [1.0])
            except RefusalError:
                if all(values[n] for n in uniques):
                    raise
                continue  # what follows from others does so on the constraints alone
            changes = dict.fromkeys(seeds, 0.0) | dict(zip(asked, found, strict=True)) | {seed: 1.0}
            size = _size(bench, seed, known | values)
            checks += [_missed(x, known | values, changes, seed, size) for x in laws]
    note = "" if checks else "off the constraints nothing is defined"
    return Finding(tuple(checks) or (Check("derivatives", 0.0, 1.0),), None, note)


def _defined(name: str, values: Mapping[str, Any]) -> bool:
    """A multiplier that is not unique has no derivative."""
    of = names.read(name)
    if of.quantity != names.MULTIPLIER:
        return True
    return bool(values[names.name(names.UNIQUE, of.constraint)])


def _size(bench: Bench, name: str, values: Mapping[str, Any]) -> float:
    """How large a coordinate is, a velocity in a natural time, an input."""
    facts, q = bench.facts, name.removeprefix("der(").removesuffix(")")
    if q not in facts.coordinates:
        return abs(float(values[name])) or 1.0
    size = max(abs(float(values[q])), facts.same_unit(q, values)) or facts.usual(q)
    return size if q == name else max(size * bench.ordinary_rate, abs(float(values[name])))


def _missed(
    law: _Law, values: Mapping[str, Any], changes: Mapping[str, float], seed: str, size: float
) -> Check:
    *slopes, own = (float(x) for x in law.slopes(*(float(values[n]) for n in law.needs)))
    terms = np.array(slopes) * [changes[n] for n in law.moving]
    allowed = WITHIN * (float(np.abs(terms).sum()) + own / size) + float(np.finfo(float).tiny)
    what = f"{law.judged.closed_form.name} along {seed}"
    return Check(what, abs(float(terms.sum())), allowed)
