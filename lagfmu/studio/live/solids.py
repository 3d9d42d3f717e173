"""Boxes, cylinders and balls of a film as flat facets: which of them are seen, and how light they are.

A facet is an array (frames, corners, 3) [m], counterclockwise from outside.  Each solid is convex, so that of
its own facets those that look at the reader do not cover each other; films draw what stands still, then what
moves from the farthest to the nearest.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ROUND = 24  # corners of a circle
LIGHT = np.array([0.35, -0.45, 0.82])  # towards it
DARKEST = 0.55
SQUARE = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def box(center: Array, size: Array, axes: Sequence[Array]) -> list[Array]:
    """Six facets; all arguments (frames, 3), axes are unit vectors along the sides."""
    half = np.abs(size) / 2
    sides = [axis * half[:, [k]] for k, axis in enumerate(axes)]
    found = []
    for k in range(3):
        u, v, w = sides[(k + 1) % 3], sides[(k + 2) % 3], sides[k]
        for side in (1, -1):
            corners = [center + side * w + i * side * u + j * v for i, j in SQUARE]
            found.append(np.stack(corners, axis=1))
    return found


def cylinder(start: Array, end: Array, radius: Array) -> list[Array]:
    """The wall and both ends; start and end (frames, 3), radius (frames)."""
    axis = _unit(end - start)
    helper = np.where(np.abs(axis[:, [2]]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    u = _unit(np.cross(helper, axis))
    v = np.cross(axis, u)
    angles = np.linspace(0, 2 * np.pi, ROUND + 1)
    out = [radius[:, None] * (np.cos(a) * u + np.sin(a) * v) for a in angles]
    wall = [
        np.stack([start + a, start + b, end + b, end + a], axis=1)
        for a, b in itertools.pairwise(out)
    ]
    ends = [
        np.stack([start + a for a in out[:0:-1]], axis=1),
        np.stack([end + a for a in out[1:]], axis=1),
    ]
    return wall + ends


def ball(center: Array, radius: Array) -> list[Array]:
    """Rings of facets."""
    angles = np.linspace(0, 2 * np.pi, ROUND + 1)
    heights = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1)

    def point(angle: float, height: float) -> Array:
        way = [np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle), np.sin(height)]
        return np.asarray(center + radius[:, None] * np.array(way))

    return [
        np.stack([point(a, low), point(b, low), point(b, high), point(a, high)], axis=1)
        for low, high in itertools.pairwise(heights)
        for a, b in itertools.pairwise(angles)
    ]


def shade(facet: Array, towards: Array) -> float | None:
    """How light a facet (corners, 3) is, 0 to 1; None where it is not seen from `towards`."""
    normal = np.cross(facet[2] - facet[0], facet[3] - facet[1])
    size = float(np.linalg.norm(normal))
    if size == 0 or not normal @ towards > 0:
        return None
    light = float(normal @ LIGHT) / size / float(np.linalg.norm(LIGHT))
    return DARKEST + (1 - DARKEST) * max(light, 0.0)


def _unit(vector: Array) -> Array:
    size = np.linalg.norm(vector, axis=1, keepdims=True)
    return np.asarray(vector / np.where(size > 0, size, 1.0))
