"""Expressions in an FMU's variables, evaluated on what a run returned."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from .. import names
from ..errors import VerificationError
from ..fmu.read import Trajectory
from ..model.elements import Expr

SHAKEN = 1e-6  # of a size: a step of differences


def function(symbols: Sequence[Expr], expressions: Any) -> Callable[..., Any]:
    """Of numbers in place of the symbols, as sp.lambdify makes one, which goes through all once for each
    symbol whose name Python does not allow: here once for all of them."""
    plain = [sp.Symbol(f"x{k}") for k in range(len(symbols))]
    named = dict(zip(symbols, plain, strict=True))
    several = isinstance(expressions, list)
    renamed = [sp.sympify(e).xreplace(named) for e in (expressions if several else [expressions])]
    made: Callable[..., Any] = sp.lambdify(
        plain, renamed if several else renamed[0], modules=["scipy", "numpy"]
    )
    return made


class Compiled:
    """An expression of the closed form `name`, as a function of a run."""

    def __init__(self, expression: Expr, name: str) -> None:
        self.name = name
        self.symbols = sorted(sp.sympify(expression).free_symbols, key=str)
        self.function = function(self.symbols, expression)

    def at(
        self,
        rows: Trajectory,
        result: Trajectory,
        values: Mapping[str, float],
        floors: Mapping[str, float] | None = None,
    ) -> NDArray[np.float64]:
        """Its values at `rows` of the run `result`, parameters in `values`; magnitudes below `floors` are
        taken for those.  Raises VerificationError if it uses what the FMU does not have."""
        columns = self._columns(rows, result, values)
        if floors is not None:
            columns = {
                n: np.maximum(np.abs(x), floors[n]) if n in floors else x
                for n, x in columns.items()
            }
        return self._of(columns, len(rows))

    def shaken(
        self,
        rows: Trajectory,
        result: Trajectory,
        values: Mapping[str, float],
        sizes: Mapping[str, NDArray[np.float64]],
    ) -> NDArray[np.float64]:
        """The sum of |df/dx| size(x) over the columns x in `sizes`, by differences."""
        columns, count = self._columns(rows, result, values), len(rows)
        moved = sorted(columns.keys() & sizes.keys())
        aside = {
            n: columns[n] + SHAKEN * np.outer(np.arange(len(moved)) == k, sizes[n])
            for k, n in enumerate(moved)
        }
        there, here = self._of(columns | aside, (len(moved), count)), self._of(columns, count)
        found: NDArray[np.float64] = np.abs(there - here).sum(axis=0) / SHAKEN
        return found

    def _of(self, columns: Mapping[str, Any], shape: Any) -> NDArray[np.float64]:
        with np.errstate(all="ignore"):
            found = np.asarray(self.function(*columns.values()), dtype=float)
        return np.broadcast_to(found, shape).copy()

    def _columns(
        self, rows: Trajectory, result: Trajectory, values: Mapping[str, float]
    ) -> dict[str, Any]:
        """What stands for the symbols, in their order."""
        known, columns = rows.dtype.names or (), {}
        for text in map(str, self.symbols):
            inner = names.initially(text)
            if inner in known:
                column: Any = result[inner][0]
            elif text in known:
                column = rows[text]
            elif text in values:
                column = values[text]
            else:
                raise VerificationError(
                    f"closed form {self.name!r} uses {text!r}, which is no output or parameter of the FMU"
                )
            columns[text] = np.asarray(column, dtype=float)
        return columns


def alone(differ: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Points at which two runs differ, and beside which they do not: where an event lies between them and the
    next, the modes may differ by the error of its time."""
    found = differ.copy()
    found[1:] &= ~differ[:-1]
    found[:-1] &= ~differ[1:]
    return found


_compiled = lru_cache(maxsize=1024)(Compiled)  # SymPy takes longer for one than the run takes


def evaluate(
    expression: Expr,
    rows: Trajectory,
    result: Trajectory,
    values: Mapping[str, float],
    name: str,
) -> NDArray[np.float64]:
    """See Compiled.at."""
    return _compiled(expression, name).at(rows, result, values)
