"""Rows of joints between rigid bodies, as functions of a Look; axes are those of the first body."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from rigid import Joint, Look, Row, Vector

ZERO = np.zeros(3)


def pin(first: int, s1: Sequence[float], second: int, s2: Sequence[float], look: Look) -> list[Row]:
    """The points coincide; lam is the force [N] on the second body, in space."""
    a, b = look.arm(first, s1), look.arm(second, s2)
    gamma = look.bend(first, s1) - look.bend(second, s2)
    return [
        Row(first, -np.array([*e, *np.cross(a, e)]), second, np.array([*e, *np.cross(b, e)]), g)
        for e, g in zip(np.eye(3), gamma, strict=True)
    ]


def turns(first: int, axes: Sequence[Sequence[float]], second: int, look: Look) -> list[Row]:
    """No turning about these axes of the first body; lam are the torques [N m] about them on the second."""
    w = look.w[first]
    rows = []
    for axis in axes:
        e = look.arm(first, axis)
        gamma = -(look.w[second] - w) @ np.cross(w, e)
        rows.append(Row(first, np.array([*ZERO, *-e]), second, np.array([*ZERO, *e]), gamma))
    return rows


def turned(
    first: int, axis: Sequence[float], second: int, rate: Callable[[float], float], look: Look
) -> list[Row]:
    """A motor about an axis of the first body, whose angle has the second derivative `rate`(t)."""
    row = turns(first, [axis], second, look)[0]
    return [Row(first, row.J1, second, row.J2, row.gamma + rate(look.t))]


def square(
    first: int, a: Sequence[float], second: int, b: Sequence[float], look: Look
) -> list[Row]:
    """An axis of the first body stays square to one of the second; lam is the torque [N m] along b x a."""
    u, v = look.arm(first, a), look.arm(second, b)
    n = np.cross(v, u)
    turn = np.cross(np.cross(look.w[second], v), u) + np.cross(v, np.cross(look.w[first], u))
    gamma = -(look.w[second] - look.w[first]) @ turn
    return [Row(first, np.array([*ZERO, *-n]), second, np.array([*ZERO, *n]), gamma)]


def along(
    first: int,
    s1: Sequence[float],
    axis: Sequence[float],
    second: int,
    s2: Sequence[float],
    look: Look,
) -> list[Row]:
    """The second's point keeps its place along an axis of the first; lam is the force [N] on it."""
    e, w = look.arm(first, axis), look.w[first]
    d = look.point(second, s2) - look.point(first, s1)
    rate = look.rate(second, s2) - look.rate(first, s1)
    gamma = (
        e @ (look.bend(first, s1) - look.bend(second, s2))
        - 2 * np.cross(w, e) @ rate
        - np.cross(w, np.cross(w, e)) @ d
    )
    J1 = -np.array([*e, *np.cross(look.arm(first, s1) + d, e)])
    return [Row(first, J1, second, np.array([*e, *np.cross(look.arm(second, s2), e)]), gamma)]


def rod(first: int, s1: Sequence[float], second: int, s2: Sequence[float], look: Look) -> list[Row]:
    """The points keep their distance; lam is the push [N] of a rod without mass between them."""
    d = look.point(second, s2) - look.point(first, s1)
    size = np.sqrt(d @ d)
    e, rate = d / size, look.rate(second, s2) - look.rate(first, s1)
    gamma = e @ (look.bend(first, s1) - look.bend(second, s2))
    gamma -= (rate @ rate - (e @ rate) ** 2) / size
    J1 = -np.array([*e, *np.cross(look.arm(first, s1), e)])
    return [Row(first, J1, second, np.array([*e, *np.cross(look.arm(second, s2), e)]), gamma)]


def hinge(
    first: int,
    s1: Sequence[float],
    axis: Sequence[float],
    second: int,
    s2: Sequence[float],
) -> list[Joint]:
    """A revolute joint about an axis of the first body."""
    return [
        partial(pin, first, s1, second, s2),
        partial(turns, first, across(axis), second),
    ]


def across(axis: Sequence[float]) -> tuple[Vector, Vector]:
    """Two unit vectors square to an axis and to each other."""
    a = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    b = np.cross(a, np.eye(3)[int(np.argmin(np.abs(a)))])
    b /= np.linalg.norm(b)
    return b, np.cross(a, b)
