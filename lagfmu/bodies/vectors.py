"""Vectors as tuples of three SymPy expressions; a vector of the plane has no third component."""

from __future__ import annotations

from typing import Any

import sympy as sp

from ..model.elements import Expr

Vector = tuple[Any, Any, Any]
AXES = "xyz"
ZERO: Vector = (sp.S.Zero, sp.S.Zero, sp.S.Zero)


def plus(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def times(factor: Expr, a: Vector) -> Vector:
    """factor * a."""
    return factor * a[0], factor * a[1], factor * a[2]


def minus(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return plus(a, times(-1, b))


def dot(a: Vector, b: Vector) -> Expr:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def length(a: Vector) -> Expr:
    """|a|."""
    return sp.sqrt(dot(a, a))
