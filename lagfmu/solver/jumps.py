"""Forces that jump at surfaces h(q, t, u) = 0, or, with floor, wherever h is a whole number.

Between two events the forces are evaluated on one side of each surface: they read not h but its level, which
stands behind the inputs in u,

    sign, Heaviside, conditions   -1, 0 or 1, the sign of h      floor   n + 1/2 for n <= h < n + 1

so that they are smooth.  h is an indicator (indicators.py): where it leaves the range of its level, the level
changes.  At 0 a motion rests on the surface, or has just been set there; it leaves it at once if it moves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..numeric.system import System, Vector
from .instant import Instant

Levels = tuple[float, ...]


def surfaces(system: System, t: float, q: Vector, u: Sequence[float], p: Sequence[float]) -> Vector:
    """h of each jump; u with or without levels behind the inputs."""
    assert system.surfaces is not None
    padded = [*u, *(0.0,) * (system.driven - len(u))]
    return np.array(system.surfaces(t, q.tolist(), padded, p), dtype=float)


def levels_at(
    system: System, t: float, q: Vector, u: Sequence[float], p: Sequence[float]
) -> Levels:
    """The level of each surface at a state, by its h alone."""
    if not system.floors:
        return ()
    h = surfaces(system, t, q, u, p).tolist()
    return tuple(_level(x, floor) for x, floor in zip(h, system.floors, strict=True))


def settled(at: Instant, q: Vector) -> Instant:
    """The same instant with the levels that belong to q behind its inputs."""
    inputs = list(at.u)[: len(at.u) - len(at.system.floors)]
    return replace(at, u=[*inputs, *levels_at(at.system, at.t, q, inputs, at.p)])


def _level(h: float, floor: bool) -> float:
    if floor:
        return math.floor(h) + 0.5 if math.isfinite(h) else h
    return float(np.sign(h))


def limits(level: float, floor: bool) -> tuple[float, float]:
    """The range of h in which a level holds."""
    if floor:
        return level - 0.5, level + 0.5
    return (0.0 if level >= 0 else -math.inf), (0.0 if level <= 0 else math.inf)


def passed(system: System, levels: Levels, ways: Mapping[int, int]) -> Levels:
    """The levels after surfaces were passed; ways: number of the surface -> 1 for upwards, -1 for down."""
    return tuple(
        level if k not in ways else level + ways[k] if floor else float(ways[k])
        for k, (level, floor) in enumerate(zip(levels, system.floors, strict=True))
    )
