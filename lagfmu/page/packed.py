"""Expressions of variables as data: a number, the name of a variable, or a list [operation, operand, ...].

The live page evaluates them, and `values` does for films.  They are data: nothing of them is ever run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import sympy as sp

from ..model.attitude import Attitude, ClosedFunction
from ..model.elements import Expr
from ..model.spline import SplineBase
from ..numeric.closed import rotation
from ..numeric.cubic import Cubic

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


def names_of(packed: Any) -> set[str]:
    """The variables of expressions, however they are listed."""
    if isinstance(packed, str):
        return set() if packed in OPERATIONS else {packed}
    return set().union(*map(names_of, packed)) if isinstance(packed, list) else set()


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
