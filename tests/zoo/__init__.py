"""The zoo: the mechanical systems that tests are made with, by chapter.

`point_mass` is what most of them begin from.  contacts: several that close together; forces: that jump or
end; linkages; redundant: rows that follow from others; tops: rigid bodies in unit quaternions; whipple: a
bicycle; pendulums, and a particle on a hemisphere; puck, two_feet: model files, with friction.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Model, Parameter

m, g = symbols("m g", positive=True)


def point_mass(
    name: str,
    places: str,
    rows: Sequence[Any] = (),
    *,
    angles: str = "",
    up: Any = None,
    energy: Any = 0,
    mass: float = 1.0,
    gravity: float = 9.81,
    parameters: Sequence[Parameter] = (),
    **more: Any,
) -> Model:
    """A mass m [kg] at `places` [m], each with the energy m q'^2 / 2; in weight where `up` [m] is its height.

    `energy` are further terms of the Lagrangian, in `angles` [rad] too.  `parameters` may hold m and g.
    """
    at = dynamicsymbols(places, seq=True)
    given = {p.symbol for p in parameters}
    usual = [Parameter(m, mass, "kg"), Parameter(g, gravity, "m/s^2")][: 1 if up is None else 2]
    weight = 0 if up is None else m * g * up
    return Model(
        name=name,
        lagrangian=m * sum(q.diff() ** 2 for q in at) / 2 + energy - weight,
        coordinates={
            **dict.fromkeys(at, "m"),
            **dict.fromkeys(dynamicsymbols(angles, seq=True) if angles else (), "rad"),
        },
        constraints=rows,
        parameters=[*(p for p in usual if p.symbol not in given), *parameters],
        **more,
    )
