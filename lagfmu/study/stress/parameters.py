"""Parameters over many decades, one at a time and together, as a change of units would change them."""

from __future__ import annotations

from functools import partial

import numpy as np

from ... import names
from .bench import Bench, Finding
from .facts import Facts, Settable
from .judge import Check
from .player import Run
from .probe import Probe

FAMILY = "parameters"
DECADES = (-12, -9, -6, -3, -1, 1, 3, 6, 9, 12)
BINARY = (-60, -30, -10, 10, 30, 60)  # 2^10 is about 1e3
UNITS = ("kg", "m", "s")


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """The probes of this family."""
    found = [Probe("ordinary", "as described", _ordinary, False)]
    for p in facts.parameters:
        for value in _values(p, quick):
            found.append(Probe(FAMILY, f"{p.name} = {value:.6g}", partial(_one, p.name, value)))
    found += [
        Probe("bounds", f"{p.name} = {value!r}", partial(_one, p.name, value))
        for p in facts.parameters
        for value in _edges(p)
    ]
    if facts.tabulated:  # its tables stay in SI units
        return found
    for axis, unit in enumerate(UNITS):
        for power in (-30, 30) if quick else BINARY:
            name = f"unit of {unit} scaled by 2^{power}"
            found.append(Probe("scaling", name, partial(_scaled, axis, power), abs(power) > 10))
    for power in (-10, 10):
        found.append(
            Probe("scaling", f"all units scaled by 2^{power}", partial(_scaled, None, power), False)
        )
    return found


def _values(p: Settable, quick: bool) -> list[float]:
    base = p.start or 1.0
    wanted = [base * 10.0**k for k in ((-6, 6) if quick else DECADES)]
    if p.maximum is not None and p.minimum is not None:
        width = p.maximum - p.minimum
        wanted += [p.maximum - width * x for x in (1e-12, 1e-6, 1e-3, 0.3)]
    if p.minimum is None or p.minimum < 0:
        wanted += [-base]
    return [v for v in dict.fromkeys(wanted) if p.allows(v)]


def _edges(p: Settable) -> list[float]:
    """The bounds, a step outside of them, and what no double should be used for."""
    edges = [b for b in (p.minimum, p.maximum) if b is not None]
    outside = [] if p.minimum is None else [p.minimum - 1.0]
    outside += [] if p.maximum is None else [p.maximum + 1.0]
    return [*edges, *outside, 5e-324, 1e-300, 1e300, float("inf"), float("nan")]


def _ordinary(bench: Bench) -> Finding:
    run = bench.run({}, bench.times(bench.facts.stop_time))
    return bench.judged(run)


def _one(name: str, value: float, bench: Bench) -> Finding:
    span = bench.span({name: value})
    return bench.judged(bench.run({name: value}, bench.times(span)), span, f"{span:.3g} s")


def _scaled(axis: int | None, power: int, bench: Bench) -> Finding:
    """In other units everything is the same number times the scale of its unit."""
    facts = bench.facts

    def factor(name: str) -> float:
        exponents = facts.dimensions[name]
        if axis is None:  # kg, m and s at once, by different powers
            return float(2.0 ** (power * (exponents[0] + 2 * exponents[1] - exponents[2])))
        return float(2.0 ** (power * exponents[axis]))

    base = bench.ordinary
    settable = (*facts.parameters, *facts.starts, *facts.inputs)
    values = {s.name: s.start * factor(s.name) for s in settable}
    times = [t * factor("time") for t in base.rows["time"].tolist()]
    run = bench.run(values, times)
    span = facts.stop_time * factor("time")
    checks = bench.checks(run, span)
    rows = run.rows.copy()
    for name in rows.dtype.names or ():
        if name in facts.dimensions:
            rows[name] = rows[name] / factor(name)
    back = Run(rows, base.values, run.tolerance, run.refusal)
    checks += bench.agreement(
        base, back, bench.amplification, "same in the old units", facts.stop_time
    )
    checks += departures(bench, base, back, float(bench.amplification[-1]))
    return Finding(tuple(checks), run.refusal)


def departures(bench: Bench, run: Run, other: Run, growth: float) -> list[Check]:
    """Two runs that reach the same time count the same departures, the latest at the same time."""
    checks: list[Check] = []
    if len(run.rows) == 0 or len(other.rows) == 0 or other.refusal is not None:
        return checks
    a, b = run.rows[-1], other.rows[-1]
    tolerance = max(run.tolerance, other.tolerance, 1e-13)
    for c in bench.facts.contacts:
        count, time = names.name(names.DEPARTURES, c), names.name(names.DEPARTURE_TIME, c)
        checks.append(Check(f"{count} the same", float(abs(a[count] - b[count])), 0.5))
        if a[count] == b[count] and a[count] > 0:
            allowed = 30 * tolerance * (1 + growth) * float(a["time"])
            checks.append(Check(f"{time} the same", float(np.abs(a[time] - b[time])), allowed))
    return checks
