"""Rigid bodies, and the markers on them: frames by which joints and loads take hold.

A point and an axis of inertia count from the body's own frame; `center` is the centre of mass in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..model.elements import Expr, Parameter

# a Parameter, an expression of such, or a number that becomes one
Number = float | Expr | Parameter


def several(values: Any) -> Sequence[Any]:
    """A number, or a list of them, as a list."""
    return values if isinstance(values, tuple | list) else (values,)


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
    tensor, so that a product of inertia has URDF's sign.  `shape` is how it looks, in its own frame: a
    lagfmu.Box, Rod, Sphere, Disk or Line, or several; without it bodies/solid.py chooses in space.
    """

    name: str
    mass: Number
    inertia: Any
    center: Sequence[Number] | None = None
    description: str = ""
    shape: Any = None
