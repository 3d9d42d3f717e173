"""A table as a twice differentiable function of one SymPy expression: a road, a cam, a characteristic.

    road = Spline("road", [0, 1, 2], [0, 0.1, 0], "m", "m")
    Contact("wheel", z - R - road(x))

A cubic spline through the points (de Boor, A Practical Guide to Splines, ch. IV).  SymPy sees a function
with derivatives road_x, road_xx, road_xxx and never its pieces; code that is printed for it searches
the knots and evaluates a polynomial (numeric/functions.py).
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from ..errors import LagfmuWarning, TableError, UnitError
from ..files import content_of, csv_of, foreign
from ..numeric.functions import Cubic
from .elements import NAME, Expr
from .units import DisplayUnit, parse_scaled

LARGEST = 20_000_000  # bytes of a file
FEWEST = {"natural": 2, "clamped": 2, "not-a-knot": 4, "periodic": 3}
HIGHEST = 3  # order of the derivative that is constant between knots


class SplineBase(sp.Function):  # type: ignore[misc]  # the name by which SymPy's printers find it
    """A spline, or a derivative of it, of one argument; each table has subclasses of its own."""

    spline: Spline
    order: int
    nargs = 1

    def fdiff(self, argindex: int = 1) -> Expr:
        """The derivative by the argument; 0 beyond the third, whose jumps are not differentiated."""
        if self.order == HIGHEST:
            return sp.S.Zero
        return self.spline.derivative(self.order + 1)(self.args[0])

    def _eval_is_extended_real(self) -> bool | None:
        return True if self.args[0].is_extended_real else None

    def _eval_evalf(self, prec: int) -> Expr:
        x = self.args[0]
        if not x.is_number:
            return None
        return sp.Float(self.spline.table(float(x), self.order))


class Spline:
    """A cubic spline through points; `road(x)` is its value at a SymPy expression.

    `x` [x_unit] ascends, `y` [y_unit] are the values there; both are kept in SI.  `ends`: 'natural' (no
    curvature), 'clamped' (no slope), 'not-a-knot' or 'periodic' (y repeats, last value = first).  Outside of
    the table a straight line goes on; unless the ends are natural or periodic its curvature begins with a
    jump, of which a LagfmuWarning tells.  Raises TableError with every problem at once.
    """

    def __init__(
        self,
        name: str,
        x: Sequence[float],
        y: Sequence[float],
        x_unit: str,
        y_unit: str,
        ends: str = "natural",
    ) -> None:
        problems = [*_of_name(name), *_of_ends(ends)]
        xs, ys = _numbers("x", x, problems), _numbers("y", y, problems)
        units: list[DisplayUnit] = []
        for what, text in (("x_unit", x_unit), ("y_unit", y_unit)):
            try:
                units.append(parse_scaled(text, f"{what} of spline {name!r}"))
            except UnitError as error:
                problems.append(str(error))
        if not problems:
            problems += _of_points(xs, ys, ends)
        if problems:
            raise TableError(name, problems)
        self.name, self.ends = name, ends
        self.x, self.y = (tuple(map(u.to_si, z)) for u, z in zip(units, (xs, ys), strict=True))
        self.x_unit, self.y_unit = (u.unit for u in units)
        try:
            self.table = _table(self.x, self.y, ends)
        except ValueError:
            far = "its points are too far apart, or too near, for double precision: correct them"
            raise TableError(name, [far]) from None
        self._functions: dict[int, Any] = {}
        if ends in ("clamped", "not-a-knot"):
            warnings.warn(
                f"spline {name!r}: with ends={ends!r} the straight lines beyond x = {self.x[0]!r} and "
                f"{self.x[-1]!r} begin with a jump of the second derivative; 'natural' has none",
                LagfmuWarning,
                stacklevel=2,
            )

    @classmethod
    def read(
        cls,
        name: str,
        path: str | os.PathLike[str],
        x_unit: str,
        y_unit: str,
        ends: str = "natural",
        columns: tuple[int | str, int | str] = (0, 1),
    ) -> Spline:
        """The points from a CSV file, by columns' numbers or, where it has a head, names.

        It is read now, when the model is made: the FMU holds the numbers.  Raises TableError.
        """
        file = Path(path)
        with foreign(
            lambda said: TableError(
                name, [f"{str(file)!r} cannot be read ({said}): expected rows of numbers"]
            )
        ):
            rows = list(csv_of(content_of(file, LARGEST)))
        problems: list[str] = []
        head = rows[0] if rows and not _is_number(rows[0][0]) else []
        places = [_column(c, head, rows, problems) for c in columns]
        found: tuple[list[Any], list[Any]] = [], []
        for count, row in enumerate(rows[bool(head) :], 1 + bool(head)):
            for place, values in zip(places if not problems else (), found, strict=False):
                text = row[place].strip() if place < len(row) else ""
                if not _is_number(text):
                    problems.append(
                        f"{str(file)!r}, row {count}: {text!r} is no number: correct it, or leave the row out"
                    )
                values.append(text)
        if problems:
            raise TableError(name, problems)
        return cls(
            name, [float(a) for a in found[0]], [float(a) for a in found[1]], x_unit, y_unit, ends
        )

    def __call__(self, x: Expr) -> Expr:
        """The spline at an expression in [x_unit]."""
        return self.derivative(0)(sp.sympify(x))

    def derivative(self, order: int) -> Any:
        """The SymPy function that is the derivative of that order."""
        if order not in self._functions:
            self._functions[order] = self._function(order)
        return self._functions[order]

    def _function(self, order: int) -> Any:
        table = self.table

        def value(x: Any) -> Any:
            return np.vectorize(lambda a: table(float(a), order), otypes=[float])(x)

        fields = {"spline": self, "order": order, "nargs": 1, "_imp_": staticmethod(value)}
        name = f"{self.name}_{'x' * order}" if order else self.name
        made: Any = type(SplineBase)
        return made(name, (SplineBase,), {**fields, "__module__": __name__})

    def __repr__(self) -> str:
        return f"Spline({self.name!r}, {len(self.x)} points)"


def splines_in(expressions: Iterable[Expr]) -> list[Spline]:
    """The splines that stand in expressions, by name."""
    found = {f.spline for e in expressions for f in sp.sympify(e).atoms(SplineBase)}
    return sorted(found, key=lambda s: s.name)


def _table(x: Sequence[float], y: Sequence[float], ends: str) -> Cubic:
    from scipy.interpolate import CubicSpline

    with np.errstate(all="ignore"):
        spline = CubicSpline(x, y, bc_type=ends)
    if not np.isfinite(spline.c).all():
        raise ValueError
    rows = [tuple(float(c) for c in row[::-1]) for row in spline.c.T]
    rows.append((float(y[-1]), float(spline(x[-1], 1)), 0.0, 0.0))
    return Cubic(x, rows, ends == "periodic")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _column(
    column: int | str, head: Sequence[str], rows: Sequence[Sequence[str]], problems: list[str]
) -> int:
    names = [n.strip() for n in head]
    if isinstance(column, str) and column in names:
        return names.index(column)
    width = min(map(len, rows), default=0)
    if isinstance(column, int) and 0 <= column < width:
        return column
    known = f"{', '.join(map(repr, names))}, or " if names else ""
    problems.append(f"column {column!r} is not there, expected {known}a number below {width}")
    return 0


def _of_name(name: object) -> Iterable[str]:
    if not isinstance(name, str) or not NAME.match(name):
        yield f"its name {name!r} cannot be: use letters a-z, A-Z, digits and _"
    elif hasattr(sp, name):
        yield f"its name {name!r} is one of SymPy's own: choose another"


def _of_ends(ends: object) -> Iterable[str]:
    if ends not in FEWEST:
        yield f"ends = {ends!r}, expected one of {', '.join(map(repr, FEWEST))}"


def _numbers(what: str, given: Any, problems: list[str]) -> list[float]:
    try:
        values = [float(a) for a in given]
    except (TypeError, ValueError):
        problems.append(f"{what} = {given!r}, expected a list of numbers")
        return []
    bad = [k for k, a in enumerate(values) if not math.isfinite(a)]
    if bad:
        problems.append(f"{what}[{bad[0]}] = {values[bad[0]]!r}, expected finite numbers")
    return values


def _of_points(x: Sequence[float], y: Sequence[float], ends: str) -> Iterable[str]:
    if len(x) != len(y):
        yield f"{len(x)} values of x and {len(y)} of y, expected as many of one as of the other"
    elif len(x) < FEWEST[ends]:
        yield f"{len(x)} points, expected at least {FEWEST[ends]} for ends={ends!r}"
    for k, (a, b) in enumerate(pairwise(x)):
        if a == b:
            yield f"x[{k}] = x[{k + 1}] = {a!r}: a function has one value there; leave one out"
            return
        if a > b:
            yield f"x[{k}] = {a!r} is followed by {b!r}, expected ascending x: sort the points"
            return
    if ends == "periodic" and y and y[0] != y[-1]:
        yield f"y begins with {y[0]!r} and ends with {y[-1]!r}, expected the same for a periodic one"
