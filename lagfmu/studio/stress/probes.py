"""The probes of `lagfmu stress`: what each does to an FMU, the verdict on it, and all of them as data.

What probes do: each is one run of the bench, or two that must agree, and what is checked of it.
"""

from __future__ import annotations

import math
import random
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ... import names
from ...fmu.session import RefusalError
from ...methods import FIXED_STEP
from ...names import derivative, read
from .bench import REFERENCE, Bench, Finding
from .invariants import Check
from .specimen import Facts, Run, clear

RIGHT, REFUSED, WRONG, UNFINISHED = "right", "refused", "wrong", "unfinished"
CONSISTENT = "consistent"  # right at each instant; nothing could be said of the motion's course


@dataclass(frozen=True)
class Probe:
    """`may_refuse`: false for what an FMU has to be able to do, where a refusal is wrong too; `near`: its
    values are within a factor of ten of the model's own."""

    family: str
    name: str
    do: Callable[[Bench], Finding]
    may_refuse: bool = True
    near: bool = False


@dataclass(frozen=True)
class Verdict:
    """The verdict on a probe; `closest`: the check that came nearest to its limit, `ratio` of it; `near` as
    in Probe."""

    family: str
    probe: str
    verdict: str
    detail: str
    closest: str
    ratio: float
    checks: int
    seconds: float
    near: bool = False

    @property
    def worry(self) -> bool:
        """A refusal that concerns the user: of values such as the model's own."""
        return self.verdict == REFUSED and self.near


def verdict(probe: Probe, finding: Finding, seconds: float) -> Verdict:
    """Wrong if a check fails or a refusal is unclear; else refused, if it was; else right.

    Where nothing but single instants could be judged it is only consistent.
    """
    worst = max(finding.checks, key=lambda c: c.ratio, default=None)
    closest, ratio = ("", 0.0) if worst is None else (worst.what, worst.ratio)
    answer, detail = RIGHT, finding.note
    if finding.refusal is not None:
        answer, detail = REFUSED, str(finding.refusal)
        if not clear(finding.refusal):
            answer, detail = WRONG, f"refused without a cause: {detail}"
        elif not probe.may_refuse:
            answer, detail = WRONG, f"has to be done and is refused: {detail}"
    elif not finding.checks:
        answer, detail = WRONG, "nothing could be checked"
    elif all(c.instant for c in finding.checks):
        answer = CONSISTENT
    failed = [c for c in finding.checks if not c.ratio <= 1]
    if failed:
        answer = WRONG
        told = [f"{c.what}: {c.error:.2e}, allowed {c.allowed:.2e}" for c in failed[:4]]
        told += [f"and {len(failed) - 4} more"] if len(failed) > 4 else []
        told += [f"then refused: {finding.refusal}"] if finding.refusal is not None else []
        detail = "; ".join(told)
    return Verdict(
        *(probe.family, probe.name, answer, detail, closest, ratio, len(finding.checks), seconds),
        near=probe.near,
    )


def attempt(probe: Probe, bench: Bench) -> Finding:
    """What came of it; a refusal outside a run counts as one."""
    try:
        return probe.do(bench)
    except RefusalError as refusal:
        return Finding((), refusal)


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


def _pieces(count: int, bench: Bench) -> Finding:
    """The default experiment in so many communication steps."""
    return _against(bench, bench.run({}, bench.times(bench.facts.stop_time, count)))


def _tolerated(tolerance: float, bench: Bench) -> Finding:
    """The default experiment at another tolerance."""
    run = bench.run({}, bench.times(bench.facts.stop_time), tolerance)
    return _against(bench, replace(run, tolerance=tolerance))


def _integrated(method: str, bench: Bench) -> Finding:
    """By another method; one with a fixed step has no tolerance: judged as at 1e-6, with a step for that."""
    values: dict[str, float | str] = {names.METHOD: method}
    if method in FIXED_STEP:
        values[names.STEP] = min(1e-3 / bench.ordinary_rate, 1e-2 / bench.fastest_rate)
    run = bench.run(values, bench.times(bench.facts.stop_time))
    if method in FIXED_STEP:
        run = replace(run, tolerance=1e-6)
    return _against(bench, run)


def _prolonged(factor: int, bench: Bench) -> Finding:
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


def _swung(name: str, bench: Bench) -> Finding:
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


# of each pair the first is what --quick takes
FACTORS = ((1e-3, 0.1, 10.0, 1e3), (1e-6, 1e-3, 0.1, 0.5, 2.0, 10.0, 1e3, 1e6))
ANGLES = {"0": 0.0, "pi/2": math.pi / 2, "pi": math.pi, "-pi/2": -math.pi / 2}
LENGTHS = {"0": 0.0, "-1": -1.0}
SPEEDS = ((10.0,), (1.0, -1.0, 10.0, 1e3))
SEEDS = (3, 6)
SHIFTS = ((0.0,), (0.0, -1e-6, 1e-6, 1e-2))  # of the velocities at a departure
SIZES = ((1e-9, 1.0, 1e2), (1e-9, 1e-3, 0.1, 1.0, 10.0, 1e3))  # communication steps, natural times
PIECES = ((1, 7), (1, 7, 333))  # communication steps in the default experiment
EXPONENTS = ((4, 12), (2, 4, 6, 10, 12))  # of tolerances
SHAPES = ("jumps", "chatters", "a spike")
PUSHES = ((1.0, 1e3), (1e-3, 1.0, 10.0, 1e3))  # of an input's start, or of one unit
NEAR = 10.0  # a factor off the model's own values that a user may well set


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """All of them, in the order of the report."""
    take = 0 if quick else 1
    found = [Probe("ordinary", "as described", partial(started, {}), False, True)]
    for make in (_parameters, _starts, _stepping, _inputs):
        found += make(facts, take)
    return found


def _near(value: float, own: float) -> bool:
    return value == own or (own != 0 and 1 / NEAR <= abs(value / own) <= NEAR)


def _parameters(facts: Facts, take: int) -> Iterator[Probe]:
    for p in facts.parameters:
        base = p.start or 1.0
        values = [base * factor for factor in FACTORS[take]]
        for value in [*values, -base] if p.minimum is None or p.minimum < 0 else values:
            if p.allows(value):
                near = _near(value, p.start) and value * p.start > 0
                do = partial(started, {p.name: value})
                yield Probe("parameters", f"{p.name} = {value:.6g}", do, near=near)


def _starts(facts: Facts, take: int) -> Iterator[Probe]:
    places = [s for s in facts.starts if s.name in facts.coordinates]
    speeds = [s for s in facts.starts if s.name not in facts.coordinates]
    rows = [
        ("at rest", {s.name: 0.0 for s in speeds}),
        ("all coordinates 0", {s.name: 0.0 for s in places}),
        ("everything 0", {s.name: 0.0 for s in facts.starts}),
        ("all velocities 1000", {s.name: 1e3 for s in speeds}),
    ]
    for s in places:
        angle = facts.dimensions[s.name][-1] == 1
        for text, value in (ANGLES if angle else LENGTHS).items():
            rows.append((f"{s.name} = {text}", {s.name: value}))
    rows += [(f"{s.name} = {v:g}", {s.name: v}) for s in speeds for v in SPEEDS[take]]
    known = {s.name: s.start for s in facts.starts}
    for name, values in rows:
        near = name == "at rest" or all(_near(v, known[n]) for n, v in values.items())
        yield Probe("starts", name, partial(started, values), name != "at rest", near)
    for seed in range(SEEDS[take]):
        do = partial(started, drawn(facts, seed))
        yield Probe("starts", f"random, seed {seed}", do, near=True)
    for c in facts.contacts:
        for shift in SHIFTS[take]:
            name = f"at the departure from {c}, velocities by 1 + {shift:g}"
            yield Probe("starts", name, partial(departing, c, shift), near=True)


def drawn(facts: Facts, seed: int) -> dict[str, float]:
    """Parameters within a factor of NEAR either way, coordinates and velocities of any sign."""
    chance = random.Random(zlib.crc32(facts.name.encode()) + seed)
    values: dict[str, float] = {}
    for p in facts.parameters:
        wanted = (p.start or 1.0) * NEAR ** chance.uniform(-1, 1)
        values[p.name] = wanted if p.allows(wanted) else p.start
    for s in facts.starts:
        size = abs(s.start) or 1.0
        values[s.name] = chance.choice((-1, 1)) * size * NEAR ** chance.uniform(-2, 1)
    return values


def _stepping(facts: Facts, take: int) -> Iterator[Probe]:
    family = "communication step"
    for size in SIZES[take]:
        far = size > 1 or (size == 1 and bool(facts.motions))  # where a motion that goes on leads
        do = partial(stepped, size)
        yield Probe(family, f"{size:g} natural times", do, far, not far)
    for count in PIECES[take]:
        name = f"{count} in the default experiment"
        yield Probe(family, name, partial(_pieces, count), False, True)
    for k in EXPONENTS[take]:
        yield Probe("tolerance", f"1e-{k}", partial(_tolerated, 10.0**-k), False, True)
    for method in facts.methods:
        near = method not in FIXED_STEP  # which is for some models only
        yield Probe("method", method, partial(_integrated, method), near=near)
    yield Probe("long run", "10 default experiments", partial(_prolonged, 10), near=True)


def _inputs(facts: Facts, take: int) -> Iterator[Probe]:
    for i in facts.inputs:
        if i.name not in facts.motions:  # a motion does not jump
            for shape in SHAPES:
                for factor in PUSHES[take]:
                    size = factor * (abs(i.start) or 1.0)
                    do = partial(driven, i.name, shape, size)
                    near = factor <= NEAR
                    yield Probe("inputs", f"{i.name} {shape}, {size:g}", do, not near, near)
        elif not read(i.name).order and derivative(i.name) not in facts.estimated:
            do = partial(_swung, i.name)
            yield Probe("inputs", f"{i.name} swings", do, near=True)
