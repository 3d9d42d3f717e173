"""A variable eliminated by an integral already known: on f = c, the system has one integral less.

x = x(c, rest) is substituted in the rows; g(c, ...) constant on each level c makes g(f, ...) an
integral of the system itself (Forsyth, *Theory of Differential Equations* I, ch. II).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence

from sympy import Dummy

from ...model.elements import Expr
from .echelon import rref
from .inverse import invert
from .pfaffians import Pfaffians
from .tower import Tower
from .undecided import FAILURES, late


def restricted(
    system: Pfaffians,
    f: Expr,
    integrate: Callable[[Sequence[Sequence[Expr]], Sequence[Expr]], list[Expr]],
) -> Iterator[Expr]:
    """Restrict the system to f = c, where it has one integral less, and integrate that."""
    c = Dummy("c", real=True)
    for place, x in enumerate(system.variables):
        if system.complete() or late() or not f.has(x):
            continue
        inverse = invert(f, c, x)
        if inverse is None:
            continue
        rest = [v for v in system.variables if v != x]
        try:
            rows = []
            for row in system.rows:
                entries = []
                for v, entry in zip(system.variables, row, strict=True):
                    if v != x:
                        part = entry + row[place] * inverse.diff(v)
                        entries.append(part.xreplace({x: inverse}))
                rows.append(entries)
            tower = Tower(rest, itertools.chain(*rows))
            matrix = [[tower.element(entry) for entry in row] for row in rows]
            reduced, pivots = rref(tower, matrix, len(rest))
            rows = [[tower.back(e) for e in row] for row in reduced[: len(pivots)]]
        except FAILURES:
            continue
        for g in integrate(rows, rest):
            yield g.xreplace({c: f})
