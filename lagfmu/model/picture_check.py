"""What is wrong with the picture of a model, in words: kinds, points, symbols, missing constraints."""

from __future__ import annotations

from collections.abc import Iterator

import sympy as sp

from .elements import Expr, ModelFields, name_of
from .picture import (
    PIVOTS,
    SHAPES,
    Arrow,
    Box,
    Frame,
    Line,
    Pivot,
    Shape,
    Track,
    expressions_of,
    points_of,
)
from .symbols import known_symbols, symbols_in


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
    for expression in expressions_of(shape):
        for symbol in symbols_in(expression) - known - over:
            if "." not in str(symbol) and str(symbol) not in own:
                yield name_of(symbol)
