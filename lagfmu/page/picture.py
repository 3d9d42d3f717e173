"""What travels in an FMU for its live page, as data: nothing of it is ever run.

A picture (resources/picture.json): {"dimensions": 2 or 3, "shapes": [{"kind": "rod", "points": [...]}, ...]}.
Its expressions are a number, the name of a variable, or a list [operation, operand, ...]; the page evaluates
them, and `values` does for films.

What the page shows at first (resources/page.json):
{"sliders": ["m", ...], "curves": [...], "ranges": {"m": [0.5, 2.0]}}.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..errors import BuildError, ModelError
from ..files import foreign, json_of
from ..interface.table import variable_table
from ..mechanics.formulations import Form
from ..model.attitude import Attitude, ClosedFunction
from ..model.closed_form import in_variables
from ..model.elements import TIME, Expr
from ..model.model import Model, Nonholonomic
from ..model.picture import (
    PIVOTS,
    Arrow,
    Direction,
    Disk,
    Pivot,
    Point,
    Shape,
    Sphere,
    Spring,
    Track,
    points_of,
    told,
)
from ..model.reactions import multiplier
from ..model.scene import EVERYTHING, select
from ..model.spline import SplineBase
from ..numeric.functions import Cubic, rotation
from ..prepare.steps import Prepared

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
DEEPEST = 200  # nested lists that are read


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


def _names_of(packed: Any) -> set[str]:
    """The variables of expressions, however they are listed."""
    if isinstance(packed, str):
        return set() if packed in OPERATIONS else {packed}
    return set().union(*map(_names_of, packed)) if isinstance(packed, list) else set()


def values(packed: Packed, look: Callable[[str], Any]) -> Any:
    """The value of an expression; `look` gives a variable's value, or an array of them."""
    if isinstance(packed, str):
        return look(packed)
    if isinstance(packed, list):
        return OPERATIONS[packed[0]](*(values(p, look) for p in packed[1:]))
    return packed


def checked(packed: Any, depth: int = 0) -> Packed:
    """An expression that was read.  Raises ValueError for what is none."""
    if depth > DEEPEST:
        raise ValueError("an expression is nested too deeply")
    if isinstance(packed, str):
        return packed
    if isinstance(packed, list) and packed and packed[0] in OPERATIONS and len(packed) > 1:
        if packed[0] == "spline" and (len(packed) < 8 or len(packed) % 5 != 3):
            raise ValueError(f"a table of {len(packed) - 3} numbers, expected five a row")
        if packed[0] == "attitude" and (len(packed) != 7 or {*packed[1:3]} - {0, 1, 2}):
            raise ValueError(f"an attitude {packed[1:]}, expected row, column and a quaternion")
        return [packed[0], *(checked(p, depth + 1) for p in packed[1:])]
    if isinstance(packed, int | float) and not isinstance(packed, bool) and math.isfinite(packed):
        return float(packed)
    raise ValueError(f"{packed!r} is no expression")


FIELDS = {  # kind -> names of its points, lists of points, single expressions, and the rest
    "line": ((), ("points",), ("length",), ()),
    "rod": ((), ("points",), ("radius",), ()),
    "box": (("center", "size"), ("axes",), (), ()),
    "spring": ((), ("points",), (), ("coils",)),
    "ground": ((), ("points",), (), ()),
    "disk": (("center",), (), ("radius", "angle"), ("trace",)),
    "path": (("point",), (), (), ("over", "range")),
    "pivot": (("at", "axis"), (), (), ("of", "strokes")),
    "frame": (("at",), ("axes",), (), ()),
    "arrow": (("at", "vector"), (), (), ("name",)),
    "direction": (("vector",), (), (), ("name",)),
}
KINDS = {Sphere: "disk", Track: "path"}  # others are called as their class
OPTIONAL = ("length", "radius", "angle", "axis", "coils", "trace", "strokes")
PICTURE = "resources/picture.json"


def picture_of(prepared: Prepared, forces: bool = True) -> dict[str, Any] | None:
    """The picture of a model in a scene, with the arrows of its forces or without; shapes that need what the
    FMU does not report are left out.

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
        if not forces and isinstance(shape, (Arrow, Direction)):
            continue
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
        return pack(in_variables(sp.sympify(e)), numbers)

    def point(p: Point) -> list[Packed]:
        return [expression(x) for x in p]

    def line(points: Sequence[Point]) -> list[list[Packed]]:
        return [point(p) for p in points]

    kind = KINDS.get(type(shape), type(shape).__name__.lower())
    found: dict[str, Any] = {"kind": kind}
    for keys, packed in zip(FIELDS[kind], (point, line, expression), strict=False):
        for key in keys:
            if (value := getattr(shape, key, None)) is not None:
                found[key] = packed(value)
    match shape:
        case Spring():
            found["coils"] = int(shape.coils)
        case Track():
            found |= {"over": str(shape.over), "range": point((shape.first, shape.last))}
        case Disk():
            found |= {"trace": True} if shape.trace else {}
        case Pivot():
            found["of"] = "ball" if shape.axis is None else shape.kind
            if shape.strokes:
                found["strokes"] = [
                    [[round(x, 3) for x in p] for p in line] for line in shape.strokes
                ]
        case Direction():
            found["name"] = shape.name
        case Arrow():
            found |= {"name": shape.constraint, "vector": _force(model, shape, numbers)}
    return found


def _force(model: Model, arrow: Arrow, numbers: Mapping[str, Any]) -> list[Packed]:
    """Its components [N]."""
    if arrow.force is not None:
        return [pack(in_variables(sp.sympify(x)), numbers) for x in arrow.force]
    along = direction(model, arrow) if arrow.along is None else arrow.along
    force = multiplier(arrow.constraint)
    return [pack(in_variables(sp.sympify(x)) * force, numbers) for x in along]


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


def names_in(shape: Mapping[str, Any]) -> set[str]:
    """The variables of a shape; what its path runs over is none."""
    points, lists, single, _ = FIELDS[shape["kind"]]
    values = [shape[k] for k in (*points, *lists, *single, "range") if k in shape]
    return _names_of(values) - {shape.get("over")}


def picture_bytes(picture: Mapping[str, Any]) -> bytes:
    """The picture as it travels in an FMU."""
    return json.dumps(picture, ensure_ascii=False, sort_keys=True, allow_nan=False).encode()


def read_picture(text: bytes) -> dict[str, Any]:
    """The picture in an FMU.  Raises BuildError for what is none: an FMU may come from anywhere."""
    with foreign(
        lambda said: BuildError(f"{PICTURE} is no picture of lagfmu's ({said}): build the FMU anew")
    ):
        found = json_of(text)
        shapes = [_checked_shape(s) for s in found["shapes"]]
        if found["dimensions"] not in (2, 3):
            raise ValueError(f"dimensions = {found['dimensions']!r}")
        return {"dimensions": found["dimensions"], "shapes": shapes}


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
            value = [checked(x) for x in value]
        elif key in lists:
            value = [[checked(x) for x in p] for p in value]
        elif key in single:
            value = checked(value)
        elif key in ("over", "name"):
            value = str(value)
        elif key == "of":
            value = _one_of(value, ("ball", *PIVOTS))
        elif key == "coils":
            value = min(max(int(value), 0), 100)
        elif key == "strokes":
            value = [[[float(x), float(y)] for x, y in line] for line in value]
        else:
            value = bool(value)
        found[key] = value
    return found


def _one_of(value: object, known: tuple[str, ...]) -> str:
    if value not in known:
        raise ValueError(f"{value!r}, expected one of {', '.join(known)}")
    return str(value)


Preset = dict[str, Any]
PRESET = "resources/page.json"
SETTABLE = ("parameter", "input", "start")  # roles of what a slider may set


def preset_of(prepared: Prepared) -> Preset | None:
    """The model's, of what the FMU in this scene has.  Raises ModelError for names that no FMU of it has."""
    page = prepared.model.page
    if page is None:
        return None
    tables = [prepared.whole]
    if not prepared.scene.complete:
        tables.append(variable_table(Form(prepared.derived), prepared.asked))
    variables = {v.name: v for table in tables for v in table.variables}
    settable = [n for n, v in variables.items() if v.role in SETTABLE]
    readable = [n for n, v in variables.items() if v.causality == "output"]
    problems: list[str] = []
    sliders = [n for v in page.sliders for n in select([told(v)], settable, "slider", problems)]
    curves = [n for v in page.curves for n in select([told(v)], readable, "curve", problems)]
    select([told(v) for v in page.ranges], settable, "the slider of a range", problems)
    if problems and tuple(prepared.asked.frictions) == EVERYTHING:  # else it has outputs of others
        raise ModelError(prepared.model.name, [f"page: {p}" for p in problems])
    return {
        "sliders": [n for n in dict.fromkeys(sliders) if n in prepared.table],
        "curves": [n for n in dict.fromkeys(curves) if n in prepared.table],
        "ranges": {
            told(v): [float(low), float(high)]
            for v, (low, high) in page.ranges.items()
            if told(v) in prepared.table
        },
    }


def preset_bytes(preset: Preset) -> bytes:
    """The preset as it travels in an FMU."""
    return json.dumps(preset, ensure_ascii=False, sort_keys=True, allow_nan=False).encode()


def read_preset(text: bytes) -> Preset:
    """The preset in an FMU.  Raises BuildError for what is none: an FMU may come from anywhere."""
    with foreign(
        lambda said: BuildError(f"{PRESET} is no page of lagfmu's ({said}): build the FMU anew")
    ):
        found = json_of(text)
        ranges = {str(n): _ends(ends) for n, ends in dict(found["ranges"]).items()}
        lists = {what: [str(n) for n in list(found[what])] for what in ("sliders", "curves")}
        return {**lists, "ranges": ranges}


def _ends(ends: Any) -> list[float]:
    low, high = map(float, ends)
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise ValueError(f"a range {ends!r}")
    return [low, high]
