"""The probes of `lagfmu stress` as data: what is varied, over what."""

from __future__ import annotations

import math
import random
import zlib
from collections.abc import Iterator
from functools import partial

from ...methods import FIXED_STEP
from ...names import derivative, read
from . import runs
from .facts import Facts
from .probe import Probe

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
    found = [Probe("ordinary", "as described", partial(runs.started, {}), False, True)]
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
                do = partial(runs.started, {p.name: value})
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
        yield Probe("starts", name, partial(runs.started, values), name != "at rest", near)
    for seed in range(SEEDS[take]):
        do = partial(runs.started, drawn(facts, seed))
        yield Probe("starts", f"random, seed {seed}", do, near=True)
    for c in facts.contacts:
        for shift in SHIFTS[take]:
            name = f"at the departure from {c}, velocities by 1 + {shift:g}"
            yield Probe("starts", name, partial(runs.departing, c, shift), near=True)


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
        do = partial(runs.stepped, size)
        yield Probe(family, f"{size:g} natural times", do, far, not far)
    for count in PIECES[take]:
        name = f"{count} in the default experiment"
        yield Probe(family, name, partial(runs.pieces, count), False, True)
    for k in EXPONENTS[take]:
        yield Probe("tolerance", f"1e-{k}", partial(runs.tolerated, 10.0**-k), False, True)
    for method in facts.methods:
        near = method not in FIXED_STEP  # which is for some models only
        yield Probe("method", method, partial(runs.integrated, method), near=near)
    yield Probe("long run", "10 default experiments", partial(runs.prolonged, 10), near=True)


def _inputs(facts: Facts, take: int) -> Iterator[Probe]:
    for i in facts.inputs:
        if i.name not in facts.motions:  # a motion does not jump
            for shape in SHAPES:
                for factor in PUSHES[take]:
                    size = factor * (abs(i.start) or 1.0)
                    do = partial(runs.driven, i.name, shape, size)
                    near = factor <= NEAR
                    yield Probe("inputs", f"{i.name} {shape}, {size:g}", do, not near, near)
        elif not read(i.name).order and derivative(i.name) not in facts.estimated:
            do = partial(runs.swung, i.name)
            yield Probe("inputs", f"{i.name} swings", do, near=True)
