"""One-forms omega = sum_i a_i dx_i, with exact tests for the identities of Cartan's calculus.

    d(omega) = sum_(i<j) (da_j/dx_i - da_i/dx_j) dx_i ^ dx_j ,

omega is exact (locally) where d(omega) = 0, and has an integrating factor where d(omega) ^ omega = 0
(Arnold, *Mathematical Methods of Classical Mechanics*, ch. 7 and app. 4).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

from ...model.elements import Expr
from .fractions import admit_gcd
from .frobenius import pairs
from .tower import Tower


class OneForm:
    """A one-form sum_i a_i dx_i, without common factors and with no coefficient zero."""

    def __init__(self, row: Sequence[Expr], variables: Sequence[Expr]) -> None:
        self.tower = Tower(variables, row)
        elements = [self.tower.element(entry) for entry in row]
        kept = [i for i, element in enumerate(elements) if not self.tower.is_zero(element)]
        for element in elements:  # so that the field has the derivatives that are met later
            for x, y in itertools.product(variables, repeat=2):
                self.tower.diff(self.tower.diff(element, x), y)
        self.given = [row[i] for i in kept]
        self.x = [variables[i] for i in kept]
        self.a = self._primitive([elements[i] for i in kept])
        self.terms = [self.tower.back(a) for a in self.a]

    def _primitive(self, row: list[Any]) -> list[Any]:
        """The row times its common denominator, divided by the common factor of the rest."""
        row = [self.tower.lift(entry) for entry in row]
        if not row:
            return row
        below, above = row[0].denom, row[0].numer
        for entry in row[1:]:
            admit_gcd(below, entry.denom)
            admit_gcd(above, entry.numer)
            below, above = below.lcm(entry.denom), above.gcd(entry.numer)
        factor = self.tower.K.new(below) / self.tower.K.new(above)
        return [self.tower.reduce(entry * factor) for entry in row]

    def wedge(self, b: list[Any], c: list[Any], i: int, j: int) -> Any:
        lift = self.tower.lift
        return lift(b[i]) * lift(c[j]) - lift(b[j]) * lift(c[i])

    def gradient(self, element: Any) -> list[Any]:
        return [self.tower.diff(element, x) for x in self.x]

    def curl(self, a: list[Any], i: int, j: int) -> Any:
        one, two = self.tower.diff(a[j], self.x[i]), self.tower.diff(a[i], self.x[j])
        return self.tower.lift(one) - self.tower.lift(two)

    def exact(self, a: list[Any]) -> bool:
        return all(self.tower.is_zero(self.curl(a, i, j)) for i, j in pairs(len(a)))

    def closed(self, a: list[Any]) -> bool:
        """d(omega) = 0 with respect to all variables, those of which omega has no differential too."""
        others = [v for v in self.tower.variables if v not in self.x]
        return self.exact(a) and all(
            self.tower.is_zero(self.tower.diff(entry, v)) for entry in a for v in others
        )

    def integrable(self) -> bool:
        """d(omega) wedge omega = 0."""
        for i, j, k in itertools.combinations(range(len(self.x)), 3):
            total = self.tower.K.zero
            for p, q, r in ((i, j, k), (j, k, i), (k, i, j)):
                curl = self.curl(self.a, q, r)
                total = self.tower.lift(total) + self.tower.lift(self.a[p]) * self.tower.lift(curl)
            if not self.tower.is_zero(total):
                return False
        return True

    def solves(self, f: Expr) -> bool:
        """df wedge omega = 0, and df is not zero."""
        tower = Tower(self.tower.variables, [f, *self.terms])
        slope = [tower.diff(tower.element(f), x) for x in self.x]
        a = [tower.element(term) for term in self.terms]
        return not all(tower.is_zero(s) for s in slope) and all(
            tower.is_zero(
                tower.lift(slope[i]) * tower.lift(a[j]) - tower.lift(slope[j]) * tower.lift(a[i])
            )
            for i, j in pairs(len(a))
        )
