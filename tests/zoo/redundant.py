"""Systems with constraints that follow from others, each beside the same system without them."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

from sympy import cos, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Nonholonomic, Parameter

m, g, R = symbols("m g R", positive=True)
LOAD = [Parameter(m, 1.5, "kg"), Parameter(g, 9.81, "m/s^2")]
Form = Any


def _points(count: int, axes: str = "xy") -> list[tuple[Form, ...]]:
    return [tuple(dynamicsymbols(f"{a}{k}") for a in axes) for k in range(1, count + 1)]


def _distance(name: str, a: Any, b: Any, length: float) -> Holonomic:
    return Holonomic(name, sum((p - q) ** 2 for p, q in zip(a, b, strict=True)) - R**2 * length**2)


def _masses(points: list[tuple[Form, ...]]) -> Form:
    """Equal masses at points whose second coordinate is the height."""
    kinetic = sum(m * x.diff() ** 2 / 2 for p in points for x in p)
    return kinetic - sum(m * g * p[1] for p in points)


def _model(name: str, lagrangian: Form, coordinates: dict, constraints: list, start: dict) -> Model:
    return Model(
        name=name,
        lagrangian=lagrangian,
        coordinates=coordinates,
        constraints=constraints,
        parameters=[*LOAD, Parameter(R, 1.0, "m")],
        start=start,
    )


def platform(redundant: bool) -> Model:
    """A bar hung on parallel cranks of 1 m, three where two do."""
    x, y, turn = dynamicsymbols("x y turn")
    hung = []
    for k, at in enumerate((-1, 1, 0.25)[: 3 if redundant else 2], 1):
        end = (x + at * R * cos(turn), y + at * R * sin(turn))
        hung.append(_distance(f"crank{k}", end, (at * R, 0), 1.0))
    kinetic = m * (x.diff() ** 2 + y.diff() ** 2) / 2 + m * R**2 * turn.diff() ** 2 / 6
    start = {x: 0.6, y: -0.8, turn: 0.0}
    return _model("Platform", kinetic - m * g * y, {x: "m", y: "m", turn: "rad"}, hung, start)


def four_bar(redundant: bool) -> Model:
    """Two joints between two pins; each rod said twice, as a length and as its square."""
    p = _points(2)
    ends = [(0, 0), *p, (2 * R, 0)]
    rods = [
        _distance(f"rod{k}", a, b, (1, 2, 1.5)[k])
        for k, (a, b) in enumerate(itertools.pairwise(ends))
    ]
    if redundant:
        for k in (0, 2):
            span = sum((u - v) ** 2 for u, v in zip(ends[k], ends[k + 1], strict=True))
            rods.append(Holonomic(f"again{k}", sqrt(span) - R * (1, 2, 1.5)[k]))
    x, y = 0.0, 1.0  # first joint; the second where the circles of 2 m and 1.5 m meet
    dx, dy = 2.0 - x, 0.0 - y
    d = (dx * dx + dy * dy) ** 0.5
    along = (4 - 1.5**2 + d * d) / (2 * d)
    up = (4 - along * along) ** 0.5
    second = (x + (along * dx - up * dy) / d, y + (along * dy + up * dx) / d)
    start = dict(zip((*p[0], *p[1]), (x, y, *second), strict=True))
    start |= {p[0][0].diff(): 2.0}
    return _model("FourBar", _masses(p), {q: "m" for a in p for q in a}, rods, start)


def spatial_loop(redundant: bool) -> Model:
    """A four-bar in space, kept in its plane by z1 = z2 = 0 and by the volume that its corners span."""
    p = _points(2, "xyz")
    ends = [(0, 0, 0), *p, (2 * R, 0, 0)]
    rods = [
        _distance(f"rod{k}", a, b, (1, 2, 1.5)[k])
        for k, (a, b) in enumerate(itertools.pairwise(ends))
    ]
    rods += [Holonomic("plane1", p[0][2]), Holonomic("plane2", p[1][2])]
    if redundant:
        volume = p[0][1] * p[1][2] - p[0][2] * p[1][1]
        rods.append(Holonomic("volume", volume + (p[0][2] - p[1][2]) ** 2))
    flat = four_bar(False).start
    values = list(flat.values())
    start = {p[0][0]: values[0], p[0][1]: values[1], p[1][0]: values[2], p[1][1]: values[3]}
    start |= {p[0][2]: 0.0, p[1][2]: 0.0, p[0][0].diff(): 2.0}
    return _model("SpatialLoop", _masses(p), {q: "m" for a in p for q in a}, rods, start)


def ball(redundant: bool) -> Model:
    """A ball that rolls on a plane that is tilted; no slip as three rows, the third of which is z' = 0."""
    x, y, z, a, b, c = dynamicsymbols("x y z a b c")
    wx = a.diff() * cos(b) * cos(c) + b.diff() * sin(c)
    wy = -a.diff() * cos(b) * sin(c) + b.diff() * cos(c)
    wz = a.diff() * sin(b) + c.diff()
    # to the fixed axes, by the turns a about x, b about y, c about z
    ux, uy = wx * cos(c) - wy * sin(c), wx * sin(c) + wy * cos(c)
    spin = (ux * cos(b) + wz * sin(b), uy, wz * cos(b) - ux * sin(b))
    fixed = (spin[0], spin[1] * cos(a) - spin[2] * sin(a), spin[1] * sin(a) + spin[2] * cos(a))
    rolls = [
        Holonomic("plane", z - R),
        Nonholonomic("slipx", x.diff() - fixed[1] * R),
        Nonholonomic("slipy", y.diff() + fixed[0] * R),
    ]
    if redundant:
        rolls.append(Nonholonomic("slipz", z.diff()))
    kinetic = m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2
    kinetic += m * R**2 * (wx**2 + wy**2 + wz**2) / 5
    coordinates = {x: "m", y: "m", z: "m", a: "rad", b: "rad", c: "rad"}
    start = {x: 0.0, y: 0.0, z: 1.0, a: 0.2, b: 0.3, c: 0.1, x.diff(): 0.7, c.diff(): 2.0}
    return _model("Ball", kinetic - m * g * (z - x / 5 - y / 10), coordinates, rolls, start)


def pendulum(redundant: bool) -> Model:
    """A bob on a rod in a plane in space, whose velocities are tied by the derivatives of both again."""
    x, y, z = dynamicsymbols("x y z")
    held = [Holonomic("rod", x**2 + y**2 + z**2 - R**2), Holonomic("plane", z)]
    if redundant:
        held += [
            Nonholonomic("along", x * x.diff() + y * y.diff() + z * z.diff()),
            Nonholonomic("across", z.diff()),
        ]
    start = {x: 0.8, y: -0.6, z: 0.0}
    return _model("PlanePendulum", _masses([(x, y, z)]), dict.fromkeys((x, y, z), "m"), held, start)


def closed_chain(redundant: bool) -> Model:
    """Three rods in absolute angles, closed onto a pin by both components and by the distance as well."""
    turns = dynamicsymbols("a1:4")
    lengths = (1, 2, 1.5)
    x = y = 0
    lagrangian = 0
    ends = [(0, 0)]
    for turn, length in zip(turns, lengths, strict=True):
        x, y = x + length * R * cos(turn), y + length * R * sin(turn)
        t = dynamicsymbols._t
        lagrangian += m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 - m * g * y
        ends.append((x, y))
    closes = [Holonomic("closex", x - 2 * R), Holonomic("closey", y)]
    if redundant:
        closes.append(_distance("reach", ends[2], (2 * R, 0), 1.5))
    from math import atan2

    at = list(four_bar(False).start.values())[:4]
    starts = (
        atan2(at[1], at[0]),
        atan2(at[3] - at[1], at[2] - at[0]),
        atan2(-at[3], 2 - at[2]),
    )
    start = dict(zip(turns, starts, strict=True)) | {turns[0].diff(): -2.0}
    return _model("ClosedChain", lagrangian, dict.fromkeys(turns, "rad"), closes, start)


def trammel(redundant: bool) -> Model:
    """A bar whose ends slide along two lines at right angles, and its middle, as follows, on a circle, which
    and one line alone do not hold the bar where it passes along the other (after 0.82 s)."""
    x, y, a = dynamicsymbols("x y a")
    held = [Holonomic("floor", y - 0.75 * R * sin(a)), Holonomic("wall", x - 0.75 * R * cos(a))]
    if redundant:
        held.append(Holonomic("circle", x**2 + y**2 - (0.75 * R) ** 2))
    kinetic = m * (x.diff() ** 2 + y.diff() ** 2) / 2 + m * (1.5 * R) ** 2 * a.diff() ** 2 / 24
    start = {x: 0.45, y: 0.6, a: 0.9272952180016122}
    return _model("Trammel", kinetic - m * g * y, {x: "m", y: "m", a: "rad"}, held, start)


SYSTEMS: dict[str, Callable[[bool], Model]] = {
    "platform": platform,
    "four_bar": four_bar,
    "spatial_loop": spatial_loop,
    "ball": ball,
    "pendulum": pendulum,
    "closed_chain": closed_chain,
    "trammel": trammel,
}
