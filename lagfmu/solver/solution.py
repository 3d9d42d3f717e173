"""What the rungs of the ladder in linear.py return, and from where on rows count as dependent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .system import Vector

RANK = 1e-12  # singular values below this, relative to rows of unit norm, count as zero


@dataclass(frozen=True)
class Solution:
    """x (n), lambda (m), and for each multiplier whether it is unique."""

    x: Vector
    lam: Vector
    unique: NDArray[np.bool_]
