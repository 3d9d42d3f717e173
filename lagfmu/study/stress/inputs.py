"""Inputs that jump, chatter, are huge or no numbers; prescribed motions that swing."""

from __future__ import annotations

import math
from functools import partial

from ... import names
from .bench import Bench, Finding
from .facts import Facts
from .judge import Check
from .probe import Probe

FAMILY = "inputs"
SHAPES = ("jumps", "chatters", "a spike")
SWING = 0.05  # of a motion's start, or of one unit
SWINGS = 3  # in the default experiment


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """The probes of this family: none without inputs."""
    found = []
    for i in facts.inputs:
        for shape in SHAPES if i.name not in facts.motions else ():  # a motion does not jump
            for size in (1.0, 1e6) if quick else (1e-9, 1.0, 1e3, 1e6, 1e12):
                name = f"{i.name} {shape}, {size:g}"
                found.append(Probe(FAMILY, name, partial(_driven, i.name, shape, size), size > 1))
        for value in (float("nan"), float("inf"), -float("inf")):
            found.append(
                Probe(FAMILY, f"{i.name} = {value:g}", partial(_not_finite, i.name, value))
            )
        given = names.derivative(i.name) not in facts.estimated
        if i.name in facts.motions and not names.read(i.name).order and given:
            found.append(Probe(FAMILY, f"{i.name} swings", partial(_swings, i.name)))
    return found


def _swings(name: str, bench: Bench) -> Finding:
    """A prescribed motion that begins as described and swings, given with its rates at each point; between
    points its acceleration is constant, so that it is where the FMU takes it to be; what is read is the end
    of a step (a jump of the acceleration is an event of the next one)."""
    start = {i.name: i.start for i in bench.facts.inputs}
    times, orders = (
        bench.times(bench.facts.stop_time),
        [names.derivative(name, k) for k in range(3)],
    )
    w, h = 2 * math.pi * SWINGS / bench.facts.stop_time, times[1]
    size = SWING * (abs(start[name]) or 1.0)
    u, rate, way = start[name], start[names.derivative(name)], {}
    for t in times:
        pull = w**2 * size * math.cos(w * t)
        way[t] = dict(zip(orders, (u, rate, pull), strict=True))
        u, rate = u + rate * h + pull * h**2 / 2, rate + pull * h
    return bench.judged(bench.run({}, times, None, way.__getitem__, late=True))


def _driven(name: str, shape: str, size: float, bench: Bench) -> Finding:
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


def _not_finite(name: str, value: float, bench: Bench) -> Finding:
    return bench.refuses(lambda one: one.give({name: value}))
