"""First integrals of an integrable Pfaffian system in closed form, by a bounded list of methods.

In this order: known candidates, each form alone, and an ansatz for f.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress

from ...model.elements import Expr
from .ansatz import combine, monomials, relations
from .frobenius import along
from .pfaffians import Pfaffians
from .single import single
from .tower import Tower
from .undecided import FAILURES, late


def first_integrals(
    forms: Sequence[Sequence[Expr]],
    rows: Sequence[Sequence[Expr]],
    variables: Sequence[Expr],
    known: Sequence[Expr] = (),
) -> list[Expr]:
    """Independent first integrals of the integrable system that the reduced `rows` span.

    `forms` are further one-forms worth trying, and `known` candidates for integrals.
    """
    system = Pfaffians(rows, variables)
    for f in known:
        system.offer(f)
    for row in forms if len(forms) == 1 else (*forms, *rows):  # one row is that of one form
        if not system.complete() and not late() and system.contains(row):
            system.offer(single(row, variables))
    for degree in (1, 2, 3):
        if not system.complete() and not late():
            with suppress(*FAILURES):
                for f in _polynomial_integrals(system, degree):
                    system.offer(f)
    return system.found


def _polynomial_integrals(system: Pfaffians, degree: int) -> Iterator[Expr]:
    """f = sum of monomials with constant coefficients: a linear system for these."""
    tower = Tower(system.variables, itertools.chain(*system.rows))
    rows = [[tower.element(entry) for entry in row] for row in system.rows]
    basis = monomials(tower, system.variables, system.rows, degree)
    if basis is None:
        return
    columns = []
    for monomial in basis:
        element = tower.element(monomial)
        columns.append([along(tower, rows, system.pivots, j, element) for j in system.free])
    for vector in relations(tower, columns)[:40]:
        yield combine(vector, basis)
