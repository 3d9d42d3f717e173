"""An integrable Pfaffian system and its first integrals.

f is one if X_f(f) = 0 for each field X_f that the system's rows annul (`frobenius.py`); integrals are
independent if their derivatives by the pivots are.  A candidate counts only if both are proven.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from contextlib import suppress

from ...model.elements import Expr
from .echelon import rref
from .form import OneForm
from .frobenius import along
from .tower import Tower
from .undecided import FAILURES, late


class Pfaffians:
    """dx_p + sum_f b_f dx_f = 0, in reduced rows, and the integrals found so far."""

    def __init__(self, rows: Sequence[Sequence[Expr]], variables: Sequence[Expr]) -> None:
        self.rows = [list(row) for row in rows]
        self.variables = list(variables)
        self.pivots = [next(j for j, entry in enumerate(row) if entry != 0) for row in rows]
        self.free = [j for j in range(len(self.variables)) if j not in self.pivots]
        self.found: list[Expr] = []

    def complete(self) -> bool:
        return len(self.found) == len(self.rows)

    def contains(self, form: Sequence[Expr]) -> bool:
        """The form is a combination of the rows, and integrable on its own."""
        try:
            tower = Tower(self.variables, [*form, *itertools.chain(*self.rows)])
            for f in self.free:
                value = tower.element(form[f])
                for row, pivot in zip(self.rows, self.pivots, strict=True):
                    head, entry = tower.element(form[pivot]), tower.element(row[f])
                    value = tower.lift(value) - tower.lift(head) * tower.lift(entry)
                if not tower.is_zero(value):
                    return False
            return OneForm(form, self.variables).integrable()
        except FAILURES:
            return False

    def offer(self, f: Expr | None) -> None:
        """Keep f if df = 0 along the system, and if it is independent of those found."""
        if f is not None and not self.complete() and not late():
            with suppress(*FAILURES):
                if self._independent_integral(f):
                    self.found.append(f)

    def _independent_integral(self, f: Expr) -> bool:
        tower = Tower(self.variables, [f, *self.found, *itertools.chain(*self.rows)])
        slope = tower.element(f)
        rows = [[tower.element(entry) for entry in row] for row in self.rows]
        if not all(tower.is_zero(along(tower, rows, self.pivots, j, slope)) for j in self.free):
            return False
        matrix = [
            [tower.diff(tower.element(g), self.variables[p]) for p in self.pivots]
            for g in (*self.found, f)
        ]
        return len(rref(tower, matrix, len(self.pivots))[1]) > len(self.found)
