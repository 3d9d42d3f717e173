"""Communication steps from 1e-9 to 1e6 natural times, tolerances 1e-1 ... 1e-14, methods, long runs."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from ... import names
from ...methods import FIXED_STEP, INTEGRATORS
from .bench import REFERENCE, Bench, Finding
from .facts import Facts
from .judge import Check
from .parameters import departures
from .player import Run
from .probe import Probe


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """The probes of this family."""
    found = []
    sizes = (1e-9, 1.0, 1e3) if quick else (1e-9, 1e-6, 1e-3, 1e-1, 1.0, 10.0, 1e2, 1e3, 1e4, 1e6)
    for size in sizes:
        name = f"{size:g} natural times"
        far = size > 1 or (
            size == 1 and bool(facts.motions)
        )  # to where a motion that goes on leads
        found.append(Probe("communication step", name, partial(_steps, size), far))
    for count in (1, 7) if quick else (1, 7, 333, 3000):
        name = f"{count} in the default experiment"
        found.append(Probe("communication step", name, partial(_pieces, count), False))
    for bad in (0.0, -1.0, float("nan"), float("inf")):
        found.append(Probe("communication step", f"{bad:g} s", partial(_bad_step, bad)))
    for k in (1, 4, 14) if quick else range(1, 15):
        found.append(Probe("tolerance", f"1e-{k}", partial(_tolerance, 10.0**-k), k < 2 or k > 12))
    for bad in (0.0, -1e-6, float("nan"), 1e-300, 1.0, 1e3):
        found.append(Probe("tolerance", f"{bad:g}", partial(_tolerance, bad)))
    for method in INTEGRATORS:
        found.append(Probe("method", method, partial(_method, method)))
    found.append(Probe("method", "another name", partial(_method, "euler")))
    for factor in (10,) if quick else (100, 1000) if facts.target == "native" else (10,):
        name = f"{factor} default experiments"
        found.append(Probe("long run", name, partial(_long, factor)))
    return found


def _steps(size: float, bench: Bench) -> Finding:
    """A few steps of that many natural times, after one that brings it away from the start."""
    away = 0.1 * bench.facts.stop_time
    h = size / bench.ordinary_rate
    times = [0.0, away, *(away + h * k for k in range(1, 6 if size < 1e3 else 3))]
    run = bench.run({}, times)
    checks = bench.checks(run)
    if size <= 1e-3 and run.refusal is None:
        whole = bench.run({}, [0.0, away, times[-1]])
        ends = _ends(run, 3)
        growth = np.full(3, bench.amplification[-1])
        checks += bench.agreement(ends, whole, growth, "as in one step", bench.facts.stop_time)
    return Finding(tuple(checks), run.refusal, f"{h:.3g} s")


def _ends(run: Run, count: int) -> Run:
    chosen = [0, 1, len(run.rows) - 1][:count]
    return replace(run, rows=run.rows[chosen])


def _against(bench: Bench, run: Run, what: str) -> list[Check]:
    """Against the default experiment at the tightest tolerance, at common points."""
    right = bench.run({}, run.rows["time"].tolist(), REFERENCE)
    if right.refusal is not None:
        return []
    growth = np.interp(run.rows["time"], bench.ordinary.rows["time"], bench.amplification)
    checks = bench.agreement(run, right, growth, what, bench.facts.stop_time)
    if run.tolerance <= 1e-4:
        checks += departures(bench, run, right, float(growth[-1]))
    return checks


def _pieces(count: int, bench: Bench) -> Finding:
    run = bench.run({}, bench.times(bench.facts.stop_time, count))
    checks = bench.checks(run)
    return Finding((*checks, *_against(bench, run, "as at 1e-13")), run.refusal)


def _bad_step(size: float, bench: Bench) -> Finding:
    return bench.refuses(lambda one: one.call("doStep", one.time, size))


def _tolerance(tolerance: float, bench: Bench) -> Finding:
    run = bench.run({}, bench.times(bench.facts.stop_time), tolerance)
    if run.refusal is not None or len(run.rows) == 0:
        return bench.judged(run)
    run = replace(run, tolerance=tolerance if tolerance > 0 else bench.facts.tolerance)
    checks = [*bench.checks(run), *_against(bench, run, "as at 1e-13")]
    return Finding(tuple(checks), run.refusal)


def _method(method: str, bench: Bench) -> Finding:
    """Those with a fixed step have no tolerance: judged as at 1e-6, with a step made for that."""
    values: dict[str, float | str] = {names.METHOD: method}
    if method in FIXED_STEP:
        values[names.STEP] = min(1e-3 / bench.ordinary_rate, 1e-2 / bench.fastest_rate)
    run = bench.run(values, bench.times(bench.facts.stop_time))
    if method in FIXED_STEP:
        run = replace(run, tolerance=1e-6)
    if run.refusal is not None:
        return bench.judged(run)
    return Finding((*bench.checks(run), *_against(bench, run, "as dop853 at 1e-13")), None)


def _long(factor: int, bench: Bench) -> Finding:
    stop = factor * bench.facts.stop_time
    return bench.judged(bench.run({}, bench.times(stop)), None, f"{stop:g} s")
