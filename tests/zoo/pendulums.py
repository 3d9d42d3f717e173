"""Bobs on rods, and a particle on a hemisphere, which is one that may leave."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from sympy import cos, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Holonomic, Model, Parameter

from . import g, m

x, y, r, theta = dynamicsymbols("x y r theta")
L, a = symbols("L a", positive=True)
ROD = x**2 + y**2 - L**2


def _given(mass: float) -> list[Parameter]:
    return [Parameter(m, mass, "kg"), Parameter(g, 9.81, "m/s^2")]


def pendulum(
    name: str = "Pendulum",
    rows: Sequence[Any] = (Holonomic("rod", ROD),),
    mass: float = 1.0,
    length: float = 1.0,
    **changes: Any,
) -> Model:
    """A bob on a rod of length L, in x and y; the rod's multiplier is -tension/(2 L).

    `changes` are further fields of the Model, or others than these.
    """
    fields = {
        "name": name,
        "lagrangian": m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
        "coordinates": {x: "m", y: "m"},
        "constraints": rows,
        "parameters": [*_given(mass), Parameter(L, length, "m")],
    }
    return Model(**(fields | changes))


def chain(
    n: int,
    name: str,
    row: str = "link",
    first: int = 1,
    mass: float = 1.0,
    length: float = 1.0,
    **more: Any,
) -> Model:
    """n bobs of equal mass, each on a rod to the one before it: row1 from the origin to (x1, y1), and so on,
    counted from `first`."""
    count = range(first, first + n)
    xs, ys = (dynamicsymbols([f"{c}{k}" for k in count]) for c in "xy")
    ends = itertools.pairwise([(0, 0), *zip(xs, ys, strict=True)])
    return Model(
        name,
        lagrangian=sum(
            m * (p.diff() ** 2 + q.diff() ** 2) / 2 - m * g * q for p, q in zip(xs, ys, strict=True)
        ),
        coordinates=dict.fromkeys((*xs, *ys), "m"),
        constraints=[
            Holonomic(f"{row}{k}", (q[0] - p[0]) ** 2 + (q[1] - p[1]) ** 2 - L**2)
            for k, (p, q) in zip(count, ends, strict=True)
        ],
        parameters=[*_given(mass), Parameter(L, length, "m")],
        **more,
    )


def on_hemisphere(
    name: str,
    begin: float,
    rows: Sequence[Any] = (),
    weight: float = 1,
    mass: float = 1.0,
    **more: Any,
) -> Model:
    """A particle that slides from `begin` [rad] beside the top of a hemisphere of a = 1 m, in r and theta,
    under `weight` times its weight."""
    return Model(
        name,
        lagrangian=m * (r.diff() ** 2 + r**2 * theta.diff() ** 2) / 2
        - weight * m * g * r * cos(theta),
        coordinates={r: "m", theta: "rad"},
        constraints=[Contact("surface", r - a), *rows],
        parameters=[*_given(mass), Parameter(a, 1.0, "m"), *more.pop("parameters", ())],
        start={r: 1.0, theta: begin},
        **more,
    )
