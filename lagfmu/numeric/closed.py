"""Rotation matrices, and vectors that are fixed on bodies (model/attitude.py): of numbers or of arrays.

A matrix is a list of nine elements by rows, a vector one of three.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

List = list[Any]


def rotation(e: Sequence[Any]) -> List:
    """R of a unit quaternion (Goldstein, Classical Mechanics, eq. 4.47)."""
    w, x, y, z = e
    return [
        *(w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)),
        *(2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)),
        *(2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z),
    ]


def turned(R: Sequence[Any], s: Sequence[Any]) -> List:
    """R s."""
    x, y, z = s
    return [R[k] * x + R[k + 1] * y + R[k + 2] * z for k in (0, 3, 6)]


def across(w: Sequence[Any], s: Sequence[Any]) -> List:
    """w x s."""
    return [w[1] * s[2] - w[2] * s[1], w[2] * s[0] - w[0] * s[2], w[0] * s[1] - w[1] * s[0]]


def levers(R: Sequence[Any], s: Sequence[Any]) -> List:
    """R (e_k x s) (9) of each axis k: what a speed about it does."""
    x, y, z = s
    return [
        *(R[k + 2] * y - R[k + 1] * z for k in (0, 3, 6)),
        *(R[k] * z - R[k + 2] * x for k in (0, 3, 6)),
        *(R[k + 1] * x - R[k] * y for k in (0, 3, 6)),
    ]


OPERATIONS = {f.__name__: f for f in (rotation, turned, across, levers)}
