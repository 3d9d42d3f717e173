"""A model's picture as data: {"dimensions": 2 or 3, "shapes": [{"kind": "rod", "points": [...]}, ...]}.

It travels in the FMU (resources/picture.json); its expressions are those of packed.py.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import sympy as sp

from ..errors import BuildError, ModelError
from ..files import foreign, json_of
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
)
from ..model.reactions import multiplier
from ..prepare.prepare import Prepared
from .packed import Packed, checked, names_of, pack

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
IN_FMU = "resources/picture.json"


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
    return names_of(values) - {shape.get("over")}


def as_bytes(picture: Mapping[str, Any]) -> bytes:
    """The picture as it travels in an FMU."""
    return json.dumps(picture, ensure_ascii=False, sort_keys=True, allow_nan=False).encode()


def read_picture(text: bytes) -> dict[str, Any]:
    """The picture in an FMU.  Raises BuildError for what is none: an FMU may come from anywhere."""
    with foreign(
        lambda said: BuildError(f"{IN_FMU} is no picture of lagfmu's ({said}): build the FMU anew")
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
