"""The inertia of what is one body, though a file tells of its parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # xx, yy, zz, xy, xz, yz


def together(parts: Sequence[tuple[float, Array, Array]]) -> tuple[float, Array, Array]:
    """Mass [kg], centre [m] (3,) and inertia about it [kg.m^2] (3, 3) of parts of which each is given by
    the same, in one frame (Steiner's theorem)."""
    if len(parts) == 1:
        return parts[0]
    mass = sum(m for m, _, _ in parts)
    J = sum((J for _, _, J in parts), np.zeros((3, 3)))
    if not mass > 0:
        return 0.0, np.zeros(3), J
    center = sum((m * c for m, c, _ in parts), np.zeros(3)) / mass
    for m, c, _ in parts:
        d = c - center
        J = J + m * (d @ d * np.eye(3) - np.outer(d, d))
    return mass, center, J


def components(J: Array) -> tuple[float, ...]:
    """xx, yy, zz, xy, xz, yz."""
    return tuple(float(J[place]) for place in PLACES)
