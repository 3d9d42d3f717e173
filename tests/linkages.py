"""Linkages of uniform rods in the coordinates of their ends, for tests of starts and of projections."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

from sympy import S, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter

TIME = dynamicsymbols._t


def rods(name: str, joints: Sequence[tuple[float, float]]) -> Model:
    """Uniform rods of 1 kg from the origin through the joints, whose last is held; lengths are the
    joints' distances.  Coordinates x1, y1, ... [m], held by x = D, y = E."""
    n = len(joints)
    x, y = dynamicsymbols(f"x1:{n + 1}"), dynamicsymbols(f"y1:{n + 1}")
    m, g = symbols("m g", positive=True)
    lengths = symbols(f"L1:{n + 1}", positive=True)
    D, E = symbols("D E", real=True)
    ends = [(S.Zero, S.Zero), *zip(x, y, strict=True)]
    pairs = list(itertools.pairwise(ends))
    kinetic = S.Zero
    for a, b in pairs:  # m/6 (va . va + va . vb + vb . vb)
        for p, q in zip(a, b, strict=True):
            u, w = p.diff(TIME), q.diff(TIME)
            kinetic += m / 6 * (u**2 + u * w + w**2)
    height = sum((a[1] + b[1]) / 2 for a, b in pairs)
    constraints = [
        Holonomic(f"rod{k}", (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 - L**2)
        for k, ((a, b), L) in enumerate(zip(pairs, lengths, strict=True), 1)
    ]
    constraints += [Holonomic("endx", x[-1] - D), Holonomic("endy", y[-1] - E)]
    places = [(0.0, 0.0), *joints]
    spans = [
        ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 0.5 for a, b in itertools.pairwise(places)
    ]
    start = {}
    for a, b, (at_x, at_y) in zip(x, y, joints, strict=True):
        start |= {a: at_x, b: at_y}
    return Model(
        name=name,
        lagrangian=kinetic - m * g * height,
        coordinates=dict.fromkeys((*x, *y), "m"),
        constraints=constraints,
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(D, joints[-1][0], "m"),
            Parameter(E, joints[-1][1], "m"),
            *(Parameter(L, span, "m") for L, span in zip(lengths, spans, strict=True)),
        ],
        start=start,
    )


FOUR_BAR = ((0.5, 0.75**0.5), (1.9, 1.6), (2.2, 0.0))


def pinned_rod(start: Mapping[Any, float]) -> Model:
    """A uniform rod on a pivot in a vertical plane, in its angle and the place of its middle."""
    x, y, theta = dynamicsymbols("x y theta")
    m, g, length = symbols("m g l", positive=True)
    return Model(
        name="PinnedRod",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2
        + m * length**2 * theta.diff() ** 2 / 24
        - m * g * y,
        coordinates={x: "m", y: "m", theta: "rad"},
        constraints=[
            Holonomic("pinx", x - length / 2 * cos(theta)),
            Holonomic("piny", y - length / 2 * sin(theta)),
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, 9.81, "m/s^2"),
            Parameter(length, 1.5, "m"),
        ],
        start=start,
    )
