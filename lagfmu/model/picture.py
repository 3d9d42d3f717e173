"""How a model looks: shapes whose points [m] are expressions of coordinates, parameters and time.

A point is (x, y), to the right and up, or (x, y, z) with z up; all points of a picture have as many
coordinates.  A shape may also hold velocities, inputs and `output(name)` of whatever the FMU reports.

What the live page of a model shows at first: the sliders that matter, the curves that tell, the ranges.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from .attitude import rotation_matrix
from .closed_form import variable_name
from .elements import Expr, ModelFields, is_number, known_symbols, name_of, symbols_in

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
        return _axes_of(len(self.center), self.rotation)


@dataclass(frozen=True)
class Frame:
    """The axes of a frame with that origin, as large as the picture needs them; `rotation` as of a Box."""

    at: Point
    rotation: Any = None

    @property
    def axes(self) -> list[Point]:
        """Unit vectors along them."""
        return _axes_of(len(self.at), self.rotation)


def _axes_of(dimensions: int, rotation: Any) -> list[Point]:
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


def _expressions_of(shape: Shape) -> Iterator[Expr]:
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


def check_picture(model: ModelFields, problems: list[str]) -> None:
    """Add what is wrong with it to `problems`."""
    extra = model.embedding.coordinates if model.embedding else {}
    known, own = known_symbols(model) | set(extra), {o.name for o in model.outputs}
    sizes = set()
    for number, shape in enumerate(model.picture, 1):
        what = f"picture, shape {number}"
        if not isinstance(shape, SHAPES):
            kinds = ", ".join(s.__name__ for s in SHAPES)
            problems.append(f"{what} is {shape!r}, expected one of {kinds}")
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
            for name in sorted(set(_unknown(known, own, shape)))
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
    if arrow.force is not None:
        return
    known = [c.name for c in model.constraints if hasattr(c, "expression")]
    if arrow.constraint not in known:
        problems.append(
            f"{what}: no constraint is called {arrow.constraint!r}, expected one of "
            f"{', '.join(known) or 'none: the model has no constraint'}"
        )


def _unknown(known: set[Expr], own: set[str], shape: Shape) -> Iterator[str]:
    """Names that are none of the model's symbols, nor of its outputs; those with a dot are outputs too."""
    over = {shape.over} if isinstance(shape, Track) else set()
    for expression in _expressions_of(shape):
        for symbol in symbols_in(expression) - known - over:
            if "." not in str(symbol) and str(symbol) not in own:
                yield name_of(symbol)


Named = str | Expr  # a variable by its name in the FMU, or what a model has for it


@dataclass(frozen=True)
class Page:
    """What the live page shows at first; everything else is there, folded away.

    `sliders` are parameters, inputs and start values, in this order; `curves` outputs of the FMU, the
    first of them beside the picture; `ranges` the lowest and highest value [SI] of a slider.  Variables are
    named as in the FMU ("lambda.surface", "der(theta)"), or as in the model (theta, theta.diff(), m).
    """

    sliders: Sequence[Named] = ()
    curves: Sequence[Named] = ()
    ranges: Mapping[Named, tuple[float, float]] = field(default_factory=dict)


def told(variable: Named) -> str:
    """Its name in the FMU."""
    return variable if isinstance(variable, str) else variable_name(variable)


def check_page(model: ModelFields, problems: list[str]) -> None:
    """What is wrong with the page of a model, but for names: those are known when its FMU is."""
    page: Any = model.page
    if page is None:
        return
    if not isinstance(page, Page):
        problems.append(f"page = {page!r}, expected Page(sliders=[...], curves=[...], ranges=...)")
        return
    for what in ("sliders", "curves", "ranges"):
        given, kind = getattr(page, what), Mapping if what == "ranges" else Sequence
        if isinstance(given, str) or not isinstance(given, kind):
            expected = "{m: (0.5, 2)}" if what == "ranges" else "[m, 'lambda.wire']"
            problems.append(f"page: {what} = {given!r}, expected e.g. {what}={expected}")
            continue
        problems += [
            f"page: {what} hold {v!r}, expected the name of a variable, or a symbol of the model"
            for v in given
            if not isinstance(v, str | sp.Symbol | sp.Function | sp.Derivative)
        ]
    if not isinstance(page.ranges, Mapping):
        return
    values = {name_of(p.symbol): p for p in model.parameters}
    for variable, ends in page.ranges.items():
        what = f"page: the range of {told(variable)}"
        if not isinstance(ends, tuple | list) or len(ends) != 2 or not all(map(is_number, ends)):
            problems.append(f"{what} is {ends!r}, expected two numbers (low, high)")
            continue
        low, high = ends
        if not low < high:
            problems.append(f"{what} is {ends!r}, expected the lower number first")
        p = values.get(told(variable))
        if p is None:
            continue
        if (p.min is not None and low < p.min) or (p.max is not None and high > p.max):
            problems.append(f"{what} is {ends!r}, beyond its bounds [{p.min}, {p.max}]")
        if not low <= float(p.value) <= high:
            problems.append(f"{what} is {ends!r} without its own value {p.value}")
