"""How a model looks: shapes whose points [m] are expressions of coordinates, parameters and time.

A point is (x, y), to the right and up, or (x, y, z) with z up; all points of a picture have as many
coordinates.  A shape may also hold velocities, inputs and `output(name)` of whatever the FMU reports.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import sympy as sp

from .attitude import rotation_matrix
from .elements import Expr

Point = tuple[Expr, ...]


@dataclass(frozen=True, init=False)
class Line:
    """A thin line through points: a string, a wire, the outline of a cart.

    A string between two points that has a `length` [m] hangs slack where they are nearer than that.
    """

    points: tuple[Point, ...]
    length: Expr | None

    def __init__(self, *points: Point, length: Expr | None = None) -> None:
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "length", length)


@dataclass(frozen=True)
class _Between:
    """What lies between two points."""

    start: Point
    end: Point

    @property
    def points(self) -> tuple[Point, ...]:
        """Both."""
        return self.start, self.end


@dataclass(frozen=True)
class Rod(_Between):
    """A bar between two joints; with a `radius` [m] a cylinder."""

    radius: Expr | None = None


@dataclass(frozen=True)
class Spring(_Between):
    """A coil spring between two points; without `coils` a damper."""

    coils: int = 8


@dataclass(frozen=True)
class Disk:
    """A disk or sphere; without `radius` [m] a particle.  `angle` [rad], counterclockwise from the right,
    draws a spoke, `trace` the path of the centre."""

    center: Point
    radius: Expr | None = None
    angle: Expr | None = None
    trace: bool = False


@dataclass(frozen=True)
class Sphere:
    """A ball of `radius` [m]; in the plane a disk."""

    center: Point
    radius: Expr


@dataclass(frozen=True)
class Box:
    """A block of `size` [m] along its own axes.

    `rotation` turns them: in the plane an angle [rad]; in space a matrix whose columns are the axes, or a
    unit quaternion (w, x, y, z).
    """

    center: Point
    size: Point
    rotation: Any = None

    @property
    def axes(self) -> list[Point]:
        """Unit vectors along its sides."""
        return axes_of(len(self.center), self.rotation)


@dataclass(frozen=True)
class Frame:
    """The axes of a frame with that origin, as large as the picture needs them; `rotation` as of a Box."""

    at: Point
    rotation: Any = None

    @property
    def axes(self) -> list[Point]:
        """Unit vectors along them."""
        return axes_of(len(self.at), self.rotation)


def axes_of(dimensions: int, rotation: Any) -> list[Point]:
    """The columns of a rotation that is an angle [rad] in the plane; in space a matrix or a quaternion."""
    if dimensions == 2:
        angle = sp.sympify(rotation or 0)
        c, s = sp.cos(angle), sp.sin(angle)
        return [(c, s), (-s, c)]
    if rotation is None:
        R = sp.eye(3)
    elif len(rotation) == 4:
        R = rotation_matrix([sp.sympify(e) for e in rotation])
    else:
        R = sp.Matrix(rotation)
    return [tuple(R[:, k]) for k in range(3)]


@dataclass(frozen=True)
class Ground(_Between):
    """What does not move: a line, hatched on the right-hand side of the way from start to end."""


@dataclass(frozen=True)
class Track:
    """A curve: the point, for the symbol `over` from `first` to `last`."""

    point: Point
    over: Expr
    first: Expr
    last: Expr


@dataclass(frozen=True)
class Arrow:
    """The force of constraint of `constraint` on the body at the point `at` [N].

    Its direction follows from virtual work: F . d(at)/dq_j = lambda a_kj for the coordinates that `at`
    depends on.  Where that leaves it open, `along` gives it, with F = lambda along.  Or `force` is the vector
    itself, of outputs: then `constraint` is only what it is called.
    """

    constraint: str
    at: Point
    along: Point | None = None
    force: Point | None = None


@dataclass(frozen=True)
class Pivot:
    """A joint, as large as the picture needs it: a ball, or along its `axis` a `kind` of PIVOTS.

    In the plane `strokes` say how it looks: lines of points along the axis and to its left, in half sizes.
    """

    at: Point
    axis: Point | None = None
    kind: str = "pin"

    @property
    def strokes(self) -> list[list[tuple[float, float]]]:
        """Of the kind, in the plane; none of a ball."""
        if self.axis is None or len(self.at) != 2:
            return []
        return STROKES.get(self.kind, [])


@dataclass(frozen=True)
class Direction:
    """A direction beside the axes of a picture in space, as that of gravity."""

    name: str
    vector: Point


Shape = (
    Line | Rod | Spring | Disk | Sphere | Box | Ground | Track | Pivot | Frame | Arrow | Direction
)
SHAPES = (Line, Rod, Spring, Disk, Sphere, Box, Ground, Track, Pivot, Frame, Arrow, Direction)
POINTS = ("center", "size", "point", "vector", "at", "axis", "along", "force")
# turns about its axis, slides along it, slides across it, does not move; about it is what turns it
PIVOTS = ("pin", "sleeve", "plate", "weld", "motor", "torsion", "gear")


def _round(count: int, begin: float, end: float, *radii: float) -> list[tuple[float, float]]:
    """Points about the origin, by turns, at one radius after the other."""
    angles = [2 * math.pi * (begin + (end - begin) * k / count) for k in range(count + 1)]
    return [
        (radii[k % len(radii)] * math.cos(a), radii[k % len(radii)] * math.sin(a))
        for k, a in enumerate(angles)
    ]


def _box(x: float, y: float) -> list[tuple[float, float]]:
    return [(x, y), (-x, y), (-x, -y), (x, -y), (x, y)]


STROKES: dict[str, list[list[tuple[float, float]]]] = {
    "sleeve": [_box(1.3, 0.8), [(-2.2, 0), (2.2, 0)]],
    "plate": [[(0, -2), (0, 2)], *([(0, y), (-0.6, y - 0.6)] for y in (-1.2, -0.4, 0.4, 1.2, 2.0))],
    "weld": [_box(0.8, 0.8), [(0.8, 0.8), (-0.8, -0.8)], [(-0.8, 0.8), (0.8, -0.8)]],
    "motor": [_round(30, 0.1, 0.9, 1.7), [(1.9, -0.4), (1.38, -1.0), (0.75, -0.65)]],
    "torsion": [
        [
            (r * x, r * y)
            for r, (x, y) in zip(
                (0.4 + 0.025 * k for k in range(49)), _round(48, 0, 2.5, 1.0), strict=True
            )
        ]
    ],
    "gear": [_round(24, 0, 1, 1.6, 2.0)],
}


def points_of(shape: Shape) -> list[Point]:
    """The points and directions of a shape."""
    if isinstance(shape, Line | _Between):
        return list(shape.points)
    found = (getattr(shape, name, None) for name in POINTS)
    return [p for p in found if p is not None]


def expressions_of(shape: Shape) -> Iterator[Expr]:
    """Every expression of a shape."""
    for point in points_of(shape):
        yield from (sp.sympify(x) for x in point)
    for name in ("radius", "angle", "length"):
        if (value := getattr(shape, name, None)) is not None:
            yield sp.sympify(value)
    if isinstance(shape, Box | Frame):
        yield from (sp.sympify(x) for axis in shape.axes for x in axis)
    if isinstance(shape, Track):
        yield from (sp.sympify(x) for x in (shape.first, shape.last))
