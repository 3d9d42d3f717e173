"""A function that satisfies linear differential equations, as a sum with constant coefficients.

With f = sum_m c_m f_m, L(f) = sum_m c_m L(f_m) = 0 is a linear system for the constants c_m: every
coefficient of L(f) as a polynomial in the generators has to vanish.  It is solved with random numbers
for the parameters first, which tells quickly that there is no solution.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Sequence
from typing import Any

from sympy import Add, Mul, S
from sympy.polys.domains import QQ
from sympy.polys.matrices import DomainMatrix

from ...model.elements import Expr
from .fractions import admit_gcd
from .tower import Tower

_LARGEST = 90  # unknowns


def monomials(
    tower: Tower, variables: Sequence[Expr], rows: Sequence[Sequence[Expr]], degree: int
) -> list[Expr] | None:
    """Monomials of 1 to `degree` factors in the variables and functions of the rows."""
    present = set().union(*(entry.free_symbols for row in rows for entry in row))
    places = {j for row in rows for j, entry in enumerate(row) if entry != 0}
    atoms = [x for j, x in enumerate(variables) if x in present or j in places]
    atoms += tower.functions()
    basis: list[Expr] = []
    for count in range(1, degree + 1):
        for factors in itertools.combinations_with_replacement(atoms, count):
            basis.append(Mul(*factors))
            if len(basis) > _LARGEST:
                return None
    return basis


def relations(tower: Tower, columns: Sequence[Sequence[Any]]) -> list[list[Expr]]:
    """Vectors c of constants with sum_m c_m columns_m = 0 identically."""
    columns = [[tower.lift(entry) for entry in column] for column in columns]
    constants = tower.constants()
    places = [k for k, symbol in enumerate(tower.K.symbols) if symbol in constants]
    table: dict[Any, dict[int, Any]] = {}
    ring = tower.K.ring
    for equation in range(len(columns[0])):
        below = ring.one
        for column in columns:
            admit_gcd(below, column[equation].denom)
            below = below.lcm(column[equation].denom)
        for m, column in enumerate(columns):
            entry = column[equation]
            for monomial, coefficient in (entry.numer * below.exquo(entry.denom)).terms():
                outer = tuple(0 if k in places else e for k, e in enumerate(monomial))
                inner = tuple(e if k in places else 0 for k, e in enumerate(monomial))
                cells = table.setdefault((equation, outer), {})
                cells[m] = cells.get(m, ring.zero) + ring.term_new(inner, coefficient)
    width = len(columns)
    if not table:
        return [[S.One if i == m else S.Zero for i in range(width)] for m in range(width)]
    chance = random.Random(3)
    numbers = [QQ(chance.randint(2, 99), chance.randint(2, 99)) for _ in tower.K.symbols]
    sample = [
        [
            QQ.convert(cells[m].evaluate(list(zip(ring.gens, numbers, strict=True))))
            if m in cells
            else QQ.zero
            for m in range(width)
        ]
        for cells in table.values()
    ]
    plain = DomainMatrix(sample, (len(sample), width), QQ)
    if not constants or all(c.is_ground for cells in table.values() for c in cells.values()):
        return [[QQ.to_sympy(c) for c in row] for row in plain.nullspace().to_dense().to_list()]
    if plain.rank() == width or len(sample) * width > 20000:
        return []
    domain = QQ.frac_field(*[tower.K.symbols[k] for k in places])
    zero = domain.zero
    exactly = [
        [domain.from_sympy(cells[m].as_expr()) if m in cells else zero for m in range(width)]
        for cells in table.values()
    ]
    kernel = DomainMatrix(exactly, (len(exactly), width), domain).nullspace().to_dense()
    return [[tower.name(domain.to_sympy(c)) for c in row] for row in kernel.to_list()]


def combine(vector: Sequence[Expr], basis: Sequence[Expr]) -> Expr:
    first = next(c for c in vector if c != 0)
    return Add(*[(c / first).cancel() * term for c, term in zip(vector, basis, strict=True)])
