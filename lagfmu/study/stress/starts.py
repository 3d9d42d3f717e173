"""Start values: at and near singular configurations and departures, at random, at rest, very fast."""

from __future__ import annotations

import math
import random
import zlib
from functools import partial

from ... import names
from .bench import Bench, Finding
from .facts import Facts
from .probe import Probe

FAMILY = "starts"
LONGEST = (
    100.0  # default experiments: at an equilibrium nothing but rounding gives the motion a rate
)
ANGLES = {"0": 0.0, "pi/2": math.pi / 2, "pi": math.pi, "-pi/2": -math.pi / 2, "1e6": 1e6}


def probes(facts: Facts, quick: bool) -> list[Probe]:
    """The probes of this family."""
    found = []

    def add(name: str, values: dict[str, float], may_refuse: bool = True) -> None:
        found.append(Probe(FAMILY, name, partial(_from, values), may_refuse))

    coordinates = [s for s in facts.starts if s.name in facts.coordinates]
    velocities = [s for s in facts.starts if s.name not in facts.coordinates]
    add("at rest", {s.name: 0.0 for s in velocities}, False)
    add("all coordinates 0", {s.name: 0.0 for s in coordinates})
    add("everything 0", {s.name: 0.0 for s in facts.starts})
    add("all coordinates 1e-9", {s.name: 1e-9 for s in coordinates})
    for s in coordinates:
        places = {"0": 0.0, "1e-300": 1e-300, "1e6": 1e6, "-1": -1.0}
        angle = facts.dimensions[s.name][-1] == 1
        for text, value in (ANGLES if angle else places).items():
            add(f"{s.name} = {text}", {s.name: value})
            if not quick and abs(value) < 10:
                add(f"{s.name} = {text} + 1e-8", {s.name: value + 1e-8})
                add(f"{s.name} = {text} - 1e-4", {s.name: value - 1e-4})
    for s in velocities:
        for factor in (1e3,) if quick else (1e-6, 1.0, -1.0, 1e3, 1e6, 1e9):
            add(f"{s.name} = {factor:g}", {s.name: factor})
    for factor in (1e3, 1e9):
        add(f"all velocities {factor:g}", {s.name: factor for s in velocities})
    for s in facts.starts:
        for value in (float("nan"), float("inf"), 1e300):
            add(f"{s.name} = {value:g}", {s.name: value})
    for k in range(3 if quick else 12):
        found.append(Probe(FAMILY, f"random, seed {k}", partial(_random, k)))
    for c in facts.contacts:
        for shift in (0.0,) if quick else (0.0, -1e-12, 1e-12, -1e-6, 1e-6, 1e-2):
            found.append(
                Probe(
                    FAMILY,
                    f"at the departure from {c}, velocities by 1 + {shift:g}",
                    partial(_at_departure, c, shift),
                )
            )
    return found


def _from(values: dict[str, float], bench: Bench) -> Finding:
    span = min(bench.span(values), LONGEST * bench.facts.stop_time)
    return bench.judged(bench.run(values, bench.times(span)), span, f"{span:.3g} s")


def _random(seed: int, bench: Bench) -> Finding:
    """Parameters within a factor of 10 either way, coordinates and velocities of any sign."""
    chance = random.Random(zlib.crc32(bench.facts.name.encode()) + seed)
    values: dict[str, float] = {}
    for p in bench.facts.parameters:
        wanted = (p.start or 1.0) * 10 ** chance.uniform(-1, 1)
        values[p.name] = wanted if p.allows(wanted) else p.start
    for s in bench.facts.starts:
        size = abs(s.start) or 1.0
        values[s.name] = chance.choice((-1, 1)) * size * 10 ** chance.uniform(-2, 1)
    return _from(values, bench)


def _at_departure(contact: str, shift: float, bench: Bench) -> Finding:
    """Where lambda is zero already: either mode is right, what follows must be."""
    last = bench.ordinary.rows[-1]
    if last[names.name(names.DEPARTURES, contact)] == 0:
        return bench.judged(bench.ordinary, None, "no departure in the default experiment")
    values = {}
    for s in bench.facts.starts:
        if s.name in bench.facts.coordinates:
            name = names.name(names.DEPARTURE, contact, s.name)
            values[s.name] = float(last[name])
        else:
            name = names.name(names.DEPARTURE, contact, names.read(s.name).coordinate, 1)
            values[s.name] = float(last[name]) * (1 + shift)
    return _from(values, bench)
