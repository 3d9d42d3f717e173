"""What the rungs of the ladder in linear.py return, and from where on rows count as dependent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..numeric.system import Vector
from ..numeric.thresholds import RANK_LOOSEST, RANK_TURNED


def loose(off: float) -> float:
    """The angle by which rows that depend on each other on the constraints differ `off` away from them."""
    return float(min(RANK_TURNED * off, RANK_LOOSEST))


@dataclass(frozen=True)
class Solution:
    """x (n), lambda (m), and for each multiplier whether it is unique."""

    x: Vector
    lam: Vector
    unique: NDArray[np.bool_]
