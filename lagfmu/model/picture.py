"""How a model looks: shapes whose points [m] are expressions of coordinates, parameters and time.

A point is (x, y), to the right and up, or (x, y, z) with z up; all points of a picture have as many
coordinates.  A shape may also hold velocities, inputs and `output(name)` of whatever the FMU reports.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import sympy as sp

from .attitude import rotation_matrix
from .elements import Expr, ModelFields, name_of
from .symbols import known_symbols, symbols_in

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
class Rod:
    """A bar between two joints; with a `radius` [m] a cylinder."""

    start: Point
    end: Point
    radius: Expr | None = None


@dataclass(frozen=True)
class Spring:
    """A coil spring between two points."""

    start: Point
    end: Point
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
class Ground:
    """What does not move: a line, hatched on the right-hand side of the way from start to end."""

    start: Point
    end: Point


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
    """A joint, as large as the picture needs it: a ball, or along its `axis` a `kind` of PIVOTS."""

    at: Point
    axis: Point | None = None
    kind: str = "pin"


@dataclass(frozen=True)
class Direction:
    """A direction beside the axes of a picture in space, as that of gravity."""

    name: str
    vector: Point


Shape = (
    Line | Rod | Spring | Disk | Sphere | Box | Ground | Track | Pivot | Frame | Arrow | Direction
)
SHAPES = (Line, Rod, Spring, Disk, Sphere, Box, Ground, Track, Pivot, Frame, Arrow, Direction)
PIVOTS = ("pin", "sleeve", "plate")  # turns about its axis, slides along it, slides across it


def points_of(shape: Shape) -> list[Point]:
    """The points and directions of a shape."""
    if isinstance(shape, Line):
        return list(shape.points)
    if isinstance(shape, Rod | Spring | Ground):
        return [shape.start, shape.end]
    if isinstance(shape, Disk | Sphere):
        return [shape.center]
    if isinstance(shape, Box):
        return [shape.center, shape.size]
    if isinstance(shape, Track):
        return [shape.point]
    if isinstance(shape, Direction):
        return [shape.vector]
    if isinstance(shape, Frame):
        return [shape.at]
    given = (shape.axis,) if isinstance(shape, Pivot) else (shape.along, shape.force)
    return [shape.at, *(p for p in given if p is not None)]


def check_picture(model: ModelFields, problems: list[str]) -> None:
    """What is wrong with the picture: kinds, points, symbols, constraints that are not there."""
    sizes = set()
    for number, shape in enumerate(model.picture, 1):
        what = f"picture, shape {number}"
        if not isinstance(shape, SHAPES):
            known = ", ".join(s.__name__ for s in SHAPES)
            problems.append(f"{what} is {shape!r}, expected one of {known}")
            continue
        what += f" ({type(shape).__name__})"
        wrong = [p for p in points_of(shape) if not _is_point(p)]
        problems += [
            f"{what}: {p!r} is no point, expected (x, y) or (x, y, z), each a number or a SymPy expression"
            for p in wrong
        ]
        if wrong:
            continue
        sizes |= {len(p) for p in points_of(shape)}
        if isinstance(shape, Line) and len(shape.points) < 2:
            problems.append(f"{what}: {len(shape.points)} points, expected two or more")
        if isinstance(shape, Line) and shape.length is not None and len(shape.points) > 2:
            problems.append(
                f"{what}: {len(shape.points)} points and a length, expected two: what hangs slack is a "
                "string between two points"
            )
        if isinstance(shape, Arrow):
            _check_arrow(model, shape, what, problems)
        if isinstance(shape, Box | Frame) and not _is_rotation(shape):
            problems.append(
                f"{what}: its rotation is {shape.rotation!r}, expected an angle in the plane; in space a "
                "matrix of 3 rows whose columns are its axes, or a unit quaternion (w, x, y, z)"
            )
            continue
        if isinstance(shape, Pivot) and shape.kind not in PIVOTS:
            problems.append(
                f"{what}: its kind is {shape.kind!r}, expected one of {', '.join(PIVOTS)}"
            )
        problems += [
            f"{what}: {name} is neither coordinate, parameter nor input: declare it, or use output(name)"
            for name in sorted(set(_unknown(model, shape)))
        ]
    if len(sizes) > 1:
        problems.append(
            "the picture has points in the plane and in space: write all with as many coordinates"
        )


def _is_point(point: object) -> bool:
    return (
        isinstance(point, tuple | list)
        and len(point) in (2, 3)
        and all(
            isinstance(sp.sympify(x, strict=False), sp.Expr) and not isinstance(x, str)
            for x in point
        )
    )


def _is_rotation(shape: Box | Frame) -> bool:
    try:
        return all(map(_is_point, shape.axes)) and len(set(map(len, points_of(shape)))) == 1
    except (TypeError, ValueError, sp.SympifyError):
        return False


def _check_arrow(model: ModelFields, arrow: Arrow, what: str, problems: list[str]) -> None:
    known = [c.name for c in model.constraints if hasattr(c, "expression")]
    if arrow.constraint not in known and arrow.force is None:
        problems.append(
            f"{what}: no constraint is called {arrow.constraint!r}, expected one of "
            f"{', '.join(known) or 'none: the model has no constraint'}"
        )


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


def _unknown(model: ModelFields, shape: Shape) -> Iterator[str]:
    """Names that are none of the model's; those with a dot are outputs."""
    extra = model.embedding.coordinates if model.embedding else {}
    known = known_symbols(model) | set(extra)
    own = {o.name for o in model.outputs}
    if isinstance(shape, Track):
        known.add(shape.over)
    for expression in expressions_of(shape):
        for symbol in symbols_in(expression):
            if symbol not in known and "." not in str(symbol) and str(symbol) not in own:
                yield name_of(symbol)
