"""A model's picture as data: {"dimensions": 2 or 3, "shapes": [{"kind": "rod", "points": [...]}, ...]}.

An expression is a number, the name of an FMU's variable, or a list [operation, operand, ...].  It travels
in the FMU (resources/picture.json); the live page evaluates it, and `values` does for films.  It is data:
nothing of it is ever run.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import sympy as sp

from ..errors import BuildError, ModelError
from ..mechanics.equations import TIME
from ..model.attitude import Attitude, ClosedFunction
from ..model.closed_form import in_variables
from ..model.elements import Expr
from ..model.model import Model, Nonholonomic
from ..model.picture import (
    PIVOTS,
    Arrow,
    Box,
    Direction,
    Disk,
    Frame,
    Ground,
    Line,
    Pivot,
    Point,
    Rod,
    Shape,
    Sphere,
    Spring,
    Track,
    points_of,
)
from ..model.reactions import multiplier
from ..model.spline import SplineBase
from ..numeric.closed import rotation
from ..numeric.cubic import Cubic
from ..prepare.prepare import Prepared

Packed = float | str | list[Any]
FUNCTIONS: Mapping[Any, str] = {
    **{f: f.__name__ for f in (sp.sin, sp.cos, sp.tan, sp.asin, sp.acos, sp.atan, sp.atan2)},
    **{f: f.__name__ for f in (sp.sinh, sp.cosh, sp.tanh, sp.exp, sp.log, sp.sign)},
    **{sp.Abs: "abs", sp.Min: "min", sp.Max: "max", sp.Add: "+", sp.Mul: "*", sp.Pow: "^"},
}


def _spline(x: Any, periodic: float, *rows: float) -> Any:
    """A table at x: whether it repeats, then a knot and its four coefficients, row by row."""
    knots, *columns = (rows[k::5] for k in range(5))
    table = Cubic(knots, list(zip(*columns, strict=True)), bool(periodic))
    return np.vectorize(table, otypes=[float])(x)


OPERATIONS: Mapping[str, Callable[..., Any]] = {
    "+": lambda *x: sum(x),
    "*": lambda *x: math.prod(x),
    "^": np.power,
    **{name: getattr(np, name) for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh")},
    **{name: getattr(np, name) for name in ("exp", "log", "sign", "abs")},
    **{"asin": np.arcsin, "acos": np.arccos, "atan": np.arctan, "atan2": np.arctan2},
    "spline": _spline,
    "attitude": lambda i, j, *e: rotation(e)[3 * int(i) + int(j)] / sum(x**2 for x in e),
    **{"min": lambda *x: np.minimum.reduce(x), "max": lambda *x: np.maximum.reduce(x)},
}
FIELDS = {  # kind -> names of its points, lists of points, single expressions, and the rest
    "line": ((), ("points",), ("length",), ()),
    "rod": ((), ("points",), ("radius",), ()),
    "box": (("center", "size"), ("axes",), (), ()),
    "spring": ((), ("points",), (), ("coils",)),
    "ground": ((), ("points",), (), ()),
    "disk": (("center",), (), ("radius", "angle"), ("trace",)),
    "path": (("point",), (), (), ("over", "range")),
    "pivot": (("at", "axis"), (), (), ("of",)),
    "frame": (("at",), ("axes",), (), ()),
    "arrow": (("at", "vector"), (), (), ("name",)),
    "direction": (("vector",), (), (), ("name",)),
}
OPTIONAL = ("length", "radius", "angle", "axis", "coils", "trace")
DEEPEST = 200
IN_FMU = "resources/picture.json"


def picture_of(prepared: Prepared) -> dict[str, Any] | None:
    """The picture of a model in a scene; shapes that need what the FMU does not report are left out.

    Raises ModelError for an expression that cannot be drawn, and for an arrow without a direction.
    """
    model = prepared.model
    if not model.picture:
        return None
    told = ("output", "parameter", "input")
    names = {v.name for v in prepared.table.variables if v.causality in told} | {"time"}
    problems: list[str] = []
    shapes = []
    for number, shape in enumerate(model.picture, 1):
        try:
            shapes.append(_packed(model, shape, prepared.numbers))
        except ValueError as error:
            problems.append(f"picture, shape {number} ({type(shape).__name__}): {error}")
    if problems:
        raise ModelError(model.name, problems)
    kept = [s for s in shapes if names_in(s) <= names]
    if not kept:
        return None
    return {"dimensions": len(points_of(model.picture[0])[0]), "shapes": kept}


def _packed(model: Model, shape: Shape, numbers: Mapping[str, Any]) -> dict[str, Any]:
    def expression(e: Expr) -> Packed:
        return pack(in_variables(e), numbers)

    def point(p: Point) -> list[Packed]:
        return [expression(x) for x in p]

    def single(**values: Expr | None) -> dict[str, Any]:
        return {key: expression(sp.sympify(e)) for key, e in values.items() if e is not None}

    kind = type(shape).__name__.lower()
    if isinstance(shape, Line):
        points = [point(p) for p in shape.points]
        return {"kind": kind, "points": points, **single(length=shape.length)}
    if isinstance(shape, (Rod, Ground, Spring)):
        found: dict[str, Any] = {"kind": kind, "points": [point(shape.start), point(shape.end)]}
        if isinstance(shape, Spring):
            found["coils"] = int(shape.coils)
        return found | (single(radius=shape.radius) if isinstance(shape, Rod) else {})
    if isinstance(shape, Track):
        reach = [expression(shape.first), expression(shape.last)]
        over = {"over": str(shape.over), "range": reach}
        return {"kind": "path", "point": point(shape.point), **over}
    if isinstance(shape, Disk):
        found = single(radius=shape.radius, angle=shape.angle)
        found |= {"trace": True} if shape.trace else {}
        return {"kind": kind, "center": point(shape.center), **found}
    if isinstance(shape, Sphere):
        return {"kind": "disk", "center": point(shape.center), **single(radius=shape.radius)}
    if isinstance(shape, Box):
        axes = [point(axis) for axis in shape.axes]
        return {
            "kind": kind,
            "center": point(shape.center),
            "size": point(shape.size),
            "axes": axes,
        }
    if isinstance(shape, Frame):
        return {"kind": kind, "at": point(shape.at), "axes": [point(axis) for axis in shape.axes]}
    if isinstance(shape, Pivot):
        of = {"of": "ball"} if shape.axis is None else {"of": shape.kind, "axis": point(shape.axis)}
        return {"kind": kind, "at": point(shape.at), **of}
    if isinstance(shape, Direction):
        return {"kind": kind, "name": shape.name, "vector": point(shape.vector)}
    if shape.force is not None:
        vector = point(shape.force)
    else:
        along = direction(model, shape) if shape.along is None else shape.along
        force = multiplier(shape.constraint)
        vector = [pack(in_variables(sp.sympify(x)) * force, numbers) for x in along]
    return {"kind": "arrow", "name": shape.constraint, "at": point(shape.at), "vector": vector}


def direction(model: Model, arrow: Arrow) -> tuple[Expr, ...]:
    """The force on the point `at` for lambda = 1, from virtual work: J^T F = a, J = d(at)/dq (d, n).

    Only the coordinates that `at` depends on count.  With fewer of them than d it is the force along the
    point's motion.  Raises ValueError if no force at this point does the work of the constraint.
    """
    constraint = model.constraint(arrow.constraint)
    expression = sp.sympify(constraint.expression)
    at = sp.Matrix([sp.sympify(x) for x in arrow.at])
    q = [c for c in model.coordinates if at.has(c)]
    wanted = f"give the direction, Arrow({arrow.constraint!r}, at, along=(...))"
    if not q:
        raise ValueError(f"the point does not move with the coordinates: {wanted}")
    rates = [c.diff(TIME) if isinstance(constraint, Nonholonomic) else c for c in q]
    a = sp.Matrix([expression.diff(r) for r in rates])
    J = at.jacobian(q)
    if len(q) < at.rows:
        gram = J.T * J
        if sp.simplify(gram.det()) == 0:
            raise ValueError(f"the point's velocity is not settled by the coordinates: {wanted}")
        return tuple(sp.simplify(x) for x in J * gram.LUsolve(a))
    unknown = sp.symbols(f"F:{at.rows}")
    solved = sp.solve(list(J.T * sp.Matrix(unknown) - a), unknown, dict=True)
    if len(solved) != 1 or len(solved[0]) < at.rows:
        raise ValueError(f"no force at this point does the work of the constraint: {wanted}")
    return tuple(sp.simplify(solved[0][f]) for f in unknown)


def pack(expression: Expr, numbers: Mapping[str, Any] = {}) -> Packed:
    """An expression of the FMU's variables as data.  Raises ValueError for a function it cannot hold."""
    if expression.is_Symbol:
        name = str(expression)
        return float(numbers[name]) if name in numbers else name
    if expression.is_number:
        value = float(expression)
        if not math.isfinite(value):
            raise ValueError(f"{expression} is no finite number")
        return value
    if isinstance(expression, SplineBase) and expression.order == 0:
        table = expression.spline.table
        rows = [
            float(x) for k, c in zip(table.knots, table.coefficients, strict=True) for x in (k, *c)
        ]
        return ["spline", pack(expression.args[0], numbers), float(table.periodic), *rows]
    if isinstance(expression, Attitude):
        return ["attitude", *(pack(a, numbers) for a in expression.args)]
    if isinstance(expression, ClosedFunction):
        return pack(expression.opened(), numbers)
    operation = FUNCTIONS.get(expression.func)
    if operation is None:
        known = ", ".join(sorted(f for f in FUNCTIONS.values() if f.isalpha()))
        raise ValueError(
            f"{expression} cannot be drawn, expected sums, products, powers, tables, {known}"
        )
    return [operation, *(pack(a, numbers) for a in expression.args)]


def names_in(shape: Mapping[str, Any]) -> set[str]:
    """The variables of a shape."""
    return _names(shape) - {shape.get("over")}


def _names(packed: Any) -> set[str]:
    """The variables of a shape, and what its path runs over."""
    if isinstance(packed, Mapping):
        points, lists, single, _ = FIELDS[packed["kind"]]
        keys = (*points, *lists, *single, "range")
        return set().union(*(_names(packed[k]) for k in keys if k in packed))
    if isinstance(packed, str):
        return set() if packed in OPERATIONS else {packed}
    return set().union(*map(_names, packed)) if isinstance(packed, list) else set()


def values(packed: Packed, look: Callable[[str], Any]) -> Any:
    """The value of an expression; `look` gives a variable's value, or an array of them."""
    if isinstance(packed, str):
        return look(packed)
    if isinstance(packed, list):
        return OPERATIONS[packed[0]](*(values(p, look) for p in packed[1:]))
    return packed


def as_bytes(picture: Mapping[str, Any]) -> bytes:
    """The picture as it travels in an FMU."""
    return json.dumps(picture, ensure_ascii=False, sort_keys=True, allow_nan=False).encode()


def read_picture(text: bytes) -> dict[str, Any]:
    """The picture in an FMU.  Raises BuildError for what is none: an FMU may come from anywhere."""
    try:
        found = json.loads(text)
        shapes = [_checked_shape(s) for s in found["shapes"]]
        if found["dimensions"] not in (2, 3):
            raise ValueError(f"dimensions = {found['dimensions']!r}")
        return {"dimensions": found["dimensions"], "shapes": shapes}
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise BuildError(
            f"resources/picture.json is no picture of lagfmu's ({type(error).__name__}: {error}): "
            "build the FMU anew"
        ) from None


def _checked_shape(shape: Mapping[str, Any]) -> dict[str, Any]:
    points, lists, single, rest = FIELDS[shape["kind"]]
    found: dict[str, Any] = {"kind": str(shape["kind"])}
    for key in (*points, *lists, *single, *rest):
        if key not in shape:
            if key not in OPTIONAL:
                raise ValueError(f"a {shape['kind']} without {key}")
            continue
        value = shape[key]
        if key in points or key == "range":
            value = [_checked(x) for x in value]
        elif key in lists:
            value = [[_checked(x) for x in p] for p in value]
        elif key in single:
            value = _checked(value)
        elif key in ("over", "name"):
            value = str(value)
        elif key == "of":
            value = _one_of(value, ("ball", *PIVOTS))
        elif key == "coils":
            value = min(max(int(value), 1), 100)
        else:
            value = bool(value)
        found[key] = value
    return found


def _one_of(value: object, known: tuple[str, ...]) -> str:
    if value not in known:
        raise ValueError(f"{value!r}, expected one of {', '.join(known)}")
    return str(value)


def _checked(packed: Any, depth: int = 0) -> Packed:
    if depth > DEEPEST:
        raise ValueError("an expression is nested too deeply")
    if isinstance(packed, str):
        return packed
    if isinstance(packed, list) and packed and packed[0] in OPERATIONS and len(packed) > 1:
        if packed[0] == "spline" and (len(packed) < 8 or len(packed) % 5 != 3):
            raise ValueError(f"a table of {len(packed) - 3} numbers, expected five a row")
        if packed[0] == "attitude" and (len(packed) != 7 or {*packed[1:3]} - {0, 1, 2}):
            raise ValueError(f"an attitude {packed[1:]}, expected row, column and a quaternion")
        return [packed[0], *(_checked(p, depth + 1) for p in packed[1:])]
    if isinstance(packed, int | float) and not isinstance(packed, bool) and math.isfinite(packed):
        return float(packed)
    raise ValueError(f"{packed!r} is no expression")
