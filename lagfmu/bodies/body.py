"""Rigid bodies, and the markers on them: frames by which joints and loads take hold.

A point and an axis of inertia count from the body's own frame; `center` is the centre of mass in it.

How a marker is turned in its body: a matrix, a quaternion (w, x, y, z), ('rpy', ...), or an axis for z.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy as sp

from ..model.elements import Expr, Parameter

# a Parameter, an expression of such, or a number that becomes one
Number = float | Expr | Parameter


def several(values: Any) -> Sequence[Any]:
    """A number, or a list of them, as a list."""
    return values if isinstance(values, tuple | list) else (values,)


def value_of(value: Any) -> Any:
    """Of a Parameter its value, else what was given."""
    return value.value if isinstance(value, Parameter) else value


@dataclass(frozen=True, eq=False)
class Marker:
    """A frame on a body: its origin `point` [m] and its axes, in the body's own frame.

    `rotation` turns the axes: in the plane an angle [rad]; in space a matrix, a quaternion (w, x, y, z) or
    ('rpy', roll, pitch, yaw) as URDF has it.  `axis` turns the z axis onto a direction by the least rotation.
    """

    body: Any
    point: Sequence[Number]
    rotation: Any = None
    axis: Sequence[float] | None = None


class _Carrier:
    """What markers are on."""

    def at(
        self, point: Sequence[Number], rotation: Any = None, axis: Sequence[float] | None = None
    ) -> Marker:
        """The marker at a point of this body [m], parallel to the body unless it is turned."""
        return Marker(self, point, rotation, axis)


@dataclass(frozen=True)
class Ground(_Carrier):
    """What does not move: the frame in which everything is counted; `shape` as of a body."""

    name: str = "ground"
    shape: Any = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, eq=False)
class Body(_Carrier):
    """A rigid body of `mass` [kg] and `inertia` [kg.m^2] about its centre of mass `center` [m].

    The inertia is one number in the plane; in space xx, yy, zz, or these and xy, xz, yz: elements of the
    tensor, so that a product of inertia has URDF's sign.  A body whose mass or inertia is 0 moves as its
    joints to others say.  `shape` is how it looks, in its own frame: a lagfmu.Box, Rod, Sphere, Disk or Line,
    or several; without it bodies/picture.py chooses in space.
    """

    name: str
    mass: Number
    inertia: Any
    center: Sequence[Number] | None = None
    description: str = ""
    shape: Any = None


Rotation = tuple[tuple[Any, Any, Any], tuple[Any, Any, Any], tuple[Any, Any, Any]]
ROUNDING = 1e-15


def rotation_of(marker: Marker) -> Rotation:
    """The matrix whose columns are the marker's axes in the body's frame."""
    R = _oblique(marker.axis) if marker.axis is not None else given_rotation(marker.rotation)
    return tuple(tuple(_number(x) for x in row) for row in R)  # type: ignore[return-value]


def problem_of(marker: Marker) -> str:
    """What is wrong with it, expected and given; empty if nothing is."""
    if marker.axis is not None and marker.rotation is not None:
        return "it has a rotation and an axis: leave out one of them"
    try:
        with np.errstate(all="ignore"):  # what is not finite is told
            R = (
                _oblique(marker.axis)
                if marker.axis is not None
                else given_rotation(marker.rotation)
            )
        R = np.array(R, dtype=float)
    except (TypeError, ValueError, ZeroDivisionError):
        R = np.zeros((3, 3))
    if (
        R.shape != (3, 3)
        or not np.isfinite(R).all()
        or abs(np.linalg.det(R) - 1) > 1e-9
        or abs(R @ R.T - np.eye(3)).max() > 1e-9
    ):
        what = (
            f"axis {marker.axis!r}" if marker.axis is not None else f"rotation {marker.rotation!r}"
        )
        return (
            f"its {what} turns nothing, expected a direction, or a rotation: a right-handed orthogonal "
            "matrix, a quaternion (w, x, y, z), or ('rpy', roll, pitch, yaw)"
        )
    return ""


def _number(x: Any) -> Expr:
    """0, 1 and -1 are exact."""
    value = float(x)
    nearest = round(value)
    return sp.Integer(nearest) if abs(value - nearest) < ROUNDING else sp.Float(value, 17)


def given_rotation(rotation: Any) -> Any:
    """Of a matrix, a quaternion or ('rpy', roll, pitch, yaw)."""
    if rotation is None:
        return np.eye(3)
    if isinstance(rotation, Sequence) and len(rotation) == 4 and rotation[0] == "rpy":
        roll, pitch, yaw = map(float, rotation[1:])
        return turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)
    values = np.array(rotation, dtype=float)
    return turned_by(values) if values.shape == (4,) else values


def turn(axis: int, angle: float) -> Any:
    """The rotation about an axis."""
    c, s = math.cos(angle), math.sin(angle)
    R = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[i, i], R[i, j], R[j, i], R[j, j] = c, -s, s, c
    return R


def turned_by(e: Any) -> Any:
    """The matrix of a quaternion (w, x, y, z).  Raises ZeroDivisionError where it is 0."""
    if not np.linalg.norm(e) > 0:
        raise ZeroDivisionError(e)
    w, v = e[0] / np.linalg.norm(e), e[1:] / np.linalg.norm(e)
    return np.eye(3) + 2 * w * _skew(v) + 2 * _skew(v) @ _skew(v)


def _skew(v: Any) -> Any:
    """[v x]."""
    return np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _oblique(axis: Any) -> Any:
    """The least rotation that turns z onto a direction."""
    a = np.array(axis, dtype=float)
    if a.shape != (3,) or not np.linalg.norm(a) > 0:
        raise ValueError(axis)
    return onto(np.array([0.0, 0.0, 1.0]), a / np.linalg.norm(a))


def onto(a: Any, b: Any) -> Any:
    """The least rotation that turns a unit vector onto another; half a turn about any axis if opposite."""
    a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
    c, n = float(a @ b), b - (a @ b) * a
    s = float(np.linalg.norm(n))
    if s <= ROUNDING:
        s, n = 0.0, np.eye(3)[int(np.argmin(np.abs(a)))]
    for _ in range(2):  # across a, to rounding
        n = n / np.linalg.norm(n)
        n = n - (a @ n) * a
    n = n / np.linalg.norm(n)
    size = math.hypot(c, s)
    c, s = c / size, s / size
    in_plane = np.outer(a, a) + np.outer(n, n)
    return np.eye(3) + (c - 1) * in_plane + s * (np.outer(n, a) - np.outer(a, n))


def quaternion(R: Any) -> Any:
    """The unit quaternion (w, x, y, z) with w >= 0 of a rotation (Shepperd 1978)."""
    trace = [np.trace(R), R[0, 0], R[1, 1], R[2, 2]]
    k = int(np.argmax(trace))
    e = np.empty(4)
    if k == 0:
        e[0] = 1 + trace[0]
        e[1:] = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
    else:
        i, j, m = k - 1, k % 3, (k + 1) % 3
        e[0] = R[m, j] - R[j, m]
        e[1 + i] = 1 + 2 * R[i, i] - trace[0]
        e[1 + j], e[1 + m] = R[i, j] + R[j, i], R[i, m] + R[m, i]
    e = e / np.linalg.norm(e)
    return e if e[0] >= 0 else -e
