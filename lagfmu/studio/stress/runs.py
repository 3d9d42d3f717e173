"""What probes do: each is one run of the bench, or two that must agree, and what is checked of it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ... import names
from ...methods import FIXED_STEP
from .bench import REFERENCE, Bench, Finding
from .judge import Check
from .player import Run

LONGEST = 100.0  # default experiments: at rest nothing but rounding gives the motion a rate
SWING, SWINGS = 0.05, 3  # of a motion's start, or of one unit; in the default experiment


def started(values: Mapping[str, float], bench: Bench) -> Finding:
    """A run from other parameters or starts, over as many natural times as the default experiment."""
    span = bench.span(values)
    if not {p.name for p in bench.facts.parameters} & set(values):
        span = min(span, LONGEST * bench.facts.stop_time)
    return bench.judged(bench.run(values, bench.times(span)), span, f"{span:.3g} s")


def departing(contact: str, shift: float, bench: Bench) -> Finding:
    """Where lambda is zero already: either mode is right, what follows must be."""
    last = bench.ordinary.rows[-1]
    if last[names.name(names.DEPARTURES, contact)] == 0:
        return bench.judged(bench.ordinary, None, "no departure in the default experiment")
    values = {}
    for s in bench.facts.starts:
        of = names.read(s.name)
        name = names.name(names.DEPARTURE, contact, of.coordinate, of.order)
        if name in bench.facts.variables:
            values[s.name] = float(last[name]) * (1 + shift if of.order else 1)
    if not values:
        return bench.judged(bench.ordinary, None, "the FMU does not tell where it departed")
    return started(values, bench)


# ------------------------------------------------------------------ steps, tolerances, methods


def stepped(size: float, bench: Bench) -> Finding:
    """A few steps of that many natural times, after one that brings it away from the start."""
    away = 0.1 * bench.facts.stop_time
    h = size / bench.ordinary_rate
    times = [0.0, away, *(away + h * k for k in range(1, 6 if size < 1e3 else 3))]
    run = bench.run({}, times)
    checks = bench.checks(run)
    if size <= 1e-3 and run.refusal is None:
        whole = bench.run({}, [0.0, away, times[-1]])
        ends = replace(run, rows=run.rows[[0, 1, len(run.rows) - 1]])
        growth = np.full(3, bench.amplification[-1])
        checks += bench.agreement(ends, whole, growth, "as in one step", bench.facts.stop_time)
    return Finding(tuple(checks), run.refusal, f"{h:.3g} s")


def pieces(count: int, bench: Bench) -> Finding:
    """The default experiment in so many communication steps."""
    return _against(bench, bench.run({}, bench.times(bench.facts.stop_time, count)))


def tolerated(tolerance: float, bench: Bench) -> Finding:
    """The default experiment at another tolerance."""
    run = bench.run({}, bench.times(bench.facts.stop_time), tolerance)
    return _against(bench, replace(run, tolerance=tolerance))


def integrated(method: str, bench: Bench) -> Finding:
    """By another method; one with a fixed step has no tolerance: judged as at 1e-6, with a step for that."""
    values: dict[str, float | str] = {names.METHOD: method}
    if method in FIXED_STEP:
        values[names.STEP] = min(1e-3 / bench.ordinary_rate, 1e-2 / bench.fastest_rate)
    run = bench.run(values, bench.times(bench.facts.stop_time))
    if method in FIXED_STEP:
        run = replace(run, tolerance=1e-6)
    return _against(bench, run)


def prolonged(factor: int, bench: Bench) -> Finding:
    """Many default experiments in one."""
    stop = factor * bench.facts.stop_time
    return bench.judged(bench.run({}, bench.times(stop)), None, f"{stop:g} s")


def _against(bench: Bench, run: Run) -> Finding:
    """The invariants, and the default experiment at REFERENCE, at common points.

    Two runs near REFERENCE differ by what rounding makes of the model: no run can be nearer than that.
    """
    checks, times = bench.checks(run), run.rows["time"].tolist()
    if run.refusal is not None or not times:
        return Finding(tuple(checks), run.refusal)
    right, other = (bench.run({}, times, tolerance) for tolerance in (REFERENCE, 2 * REFERENCE))
    if right.refusal is None:
        growth = bench.amplified({}, right)
        noise = bench.differences(right, other, len(other.rows))
        what = f"as at {REFERENCE:g}"
        checks += bench.agreement(run, right, growth, what, bench.facts.stop_time, noise)
        if run.tolerance <= 1e-4:
            checks += departures(bench, run, right, float(growth[-1]))
    return Finding(tuple(checks), run.refusal)


def departures(bench: Bench, run: Run, other: Run, growth: float) -> list[Check]:
    """Two runs that reach the same time count the same departures, the latest at the same time."""
    if len(run.rows) == 0 or len(other.rows) == 0 or other.refusal is not None:
        return []
    a, b = run.rows[-1], other.rows[-1]
    tolerance = max(run.tolerance, other.tolerance, REFERENCE)
    allowed, checks = 30 * tolerance * (1 + growth) * float(a["time"]), []
    for c in bench.facts.contacts:
        count, time = names.name(names.DEPARTURES, c), names.name(names.DEPARTURE_TIME, c)
        checks.append(Check(f"{count} same", float(abs(a[count] - b[count])), 0.5))
        if a[count] == b[count] and a[count] > 0:
            checks.append(Check(f"{time} same", float(abs(a[time] - b[time])), allowed))
    return checks


# ------------------------------------------------------------------ inputs


def driven(name: str, shape: str, size: float, bench: Bench) -> Finding:
    """An input that jumps, chatters or has a spike; twice, with the same bits."""
    stop = bench.facts.stop_time
    times = bench.times(stop, 60)
    rest = {i.name: i.start for i in bench.facts.inputs if i.name not in bench.facts.motions}

    def drive(t: float) -> dict[str, float]:
        k = round(60 * t / stop)
        value = {
            "jumps": size * (0, 1, -1)[k // 20 % 3],
            "chatters": size * (-1.0) ** k,
            "a spike": size * float(k == 30),
        }[shape]
        return rest | {name: value}

    run = bench.run({}, times, None, drive)
    checks = bench.checks(run)
    if run.refusal is None:
        again = bench.run({}, times, None, drive)
        same = again.rows.tobytes() == run.rows.tobytes()
        checks.append(Check("same bits again", float(not same), 0.5))
    return Finding(tuple(checks), run.refusal)


def swung(name: str, bench: Bench) -> Finding:
    """A prescribed motion that begins as described and swings, given with its rates at each point; between
    points its acceleration is constant, so that it is where the FMU takes it to be; what is read is the end
    of a step (a jump of the acceleration is an event of the next one)."""
    start = {i.name: i.start for i in bench.facts.inputs}
    times = bench.times(bench.facts.stop_time)
    orders = [names.derivative(name, k) for k in range(3)]
    w, h = 2 * math.pi * SWINGS / bench.facts.stop_time, times[1]
    size = SWING * (abs(start[name]) or 1.0)
    u, rate, way = start[name], start[names.derivative(name)], {}
    for t in times:
        pull = w**2 * size * math.cos(w * t)
        way[t] = dict(zip(orders, (u, rate, pull), strict=True))
        u, rate = u + rate * h + pull * h**2 / 2, rate + pull * h
    return bench.judged(bench.run({}, times, None, way.__getitem__, late=True))
