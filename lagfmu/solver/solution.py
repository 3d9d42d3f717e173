"""What the rungs of the ladder in linear.py return, and from where on rows count as dependent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .system import Vector

RANK = 1e-12  # singular values below this, relative to rows of unit norm, count as zero, ...
TURNED = 1e2  # ... and below so many times the state's relative distance from the constraints, ...
LOOSEST = 1e-3  # ... which says nothing of rows at a larger angle
ON = 1e-13  # a state closer to the constraints than this is on them


def loose(off: float) -> float:
    """The angle by which rows that depend on each other on the constraints differ `off` away from them."""
    return min(TURNED * off, LOOSEST)


@dataclass(frozen=True)
class Solution:
    """x (n), lambda (m), and for each multiplier whether it is unique."""

    x: Vector
    lam: Vector
    unique: NDArray[np.bool_]
