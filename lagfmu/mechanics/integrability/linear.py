"""Linear systems dx = (A x + c(s)) ds with a constant matrix A: f = l exp(-A s) x - int l exp(-A s) c ds.

The row vectors l are taken from the kernels of (A - a)**m and of A**2 - 2 m A + d, for the factors of
the characteristic polynomial: the second ones give cosines and sines (Arnold, *Ordinary Differential
Equations*, ch. 3).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from sympy import (
    Abs,
    Add,
    Dummy,
    Matrix,
    Poly,
    S,
    cancel,
    cos,
    cosh,
    exp,
    expand,
    eye,
    factor,
    factor_list,
    factor_terms,
    factorial,
    sin,
    sinh,
    sqrt,
    together,
)

from ...model.elements import Expr
from .echelon import rref
from .pfaffians import Pfaffians
from .quadrature import quadrature
from .tower import Tower
from .undecided import late


def exponential_integrals(system: Pfaffians) -> Iterator[Expr]:
    """The integrals of the parts of the system that are linear on their own.

    Every variable that the system holds is tried as s: time, or an angle that drives the others.
    """
    used = set().union(*(entry.free_symbols for row in system.rows for entry in row))
    active = [
        x
        for j, x in enumerate(system.variables)
        if x in used or any(row[j] != 0 for row in system.rows)
    ]
    for s in reversed(active):
        if system.complete() or late():
            return
        others = [x for x in active if x != s]
        yield from _linear(_speeds(system, others, s), others, s)


def _speeds(system: Pfaffians, others: list[Expr], s: Expr) -> dict[Expr, Expr]:
    """dx/ds of the variables that move with s alone."""
    places = [system.variables.index(x) for x in (*others, s)]
    tower = Tower(system.variables, itertools.chain(*system.rows))
    matrix = [[tower.element(row[j]) for j in places] for row in system.rows]
    reduced, pivots = rref(tower, matrix, len(places))
    free = [j for j in range(len(others)) if j not in pivots]
    return {
        others[p]: -tower.back(row[-1])
        for row, p in zip(reduced, pivots, strict=False)
        if p < len(others) and not any(row[j] for j in free)
    }


def _linear(speeds: dict[Expr, Expr], others: list[Expr], s: Expr) -> Iterator[Expr]:
    """The integrals of the equations dx/ds = speeds that are linear in x among themselves."""
    x = list(speeds)
    while True:
        table = [[expand(speeds[u]).coeff(v) for v in x] for u in x]
        rest = [
            expand(speeds[u] - Add(*[a * v for a, v in zip(line, x, strict=True)]))
            for u, line in zip(x, table, strict=True)
        ]
        good = [
            u
            for u, line, c in zip(x, table, rest, strict=True)
            if not any(a.has(s, *others) for a in line) and not c.has(*others)
        ]
        if good == x:
            break
        x = good
    if not 1 < len(x) <= 6:
        return
    for vector in _exponentials(Matrix(table), s):
        drive = Add(*[a * c for a, c in zip(vector, rest, strict=True)])
        forced = S.Zero if drive == 0 else quadrature(drive, s)
        if forced is not None:
            yield Add(*[a * v for a, v in zip(vector, x, strict=True)]) - forced


def _exponentials(A: Expr, s: Expr) -> Iterator[list[Expr]]:
    """Real row vectors l exp(-A s), where the characteristic polynomial's factors allow it."""
    count = A.shape[0]
    z = Dummy("z")
    polynomial = together(A.charpoly(z).as_expr(z)).as_numer_denom()[0]
    for part, power in factor_list(polynomial)[1]:
        degree = Poly(part, z).degree()
        if degree not in (1, 2) or (degree == 2 and power > 1):
            continue
        if degree == 1:
            one, zero = Poly(part, z).all_coeffs()
            value = (-zero / one).cancel()
            N = (A - value * eye(count)).applyfunc(cancel)
            for column in (N.T**power).applyfunc(cancel).nullspace():
                vector = total = column.T
                for k in range(1, power):
                    vector = (vector * N).applyfunc(cancel)
                    total += vector * (-s) ** k / factorial(k)
                yield list((total * exp(-value * s)).applyfunc(factor_terms))
            continue
        two, one, zero = Poly(part, z).all_coeffs()
        middle = (-one / two / 2).cancel()
        square = factor_terms(factor(middle**2 - zero / two))
        N = (A - middle * eye(count)).applyfunc(cancel)
        kernel = (N**2 - square * eye(count)).T.applyfunc(cancel).nullspace()
        turns = square.is_negative or (not square.is_positive and square.could_extract_minus_sign())
        rate = sqrt(-square if turns else square).replace(Abs, lambda u: u)
        for column in kernel:
            one_, other = column.T, (column.T * N).applyfunc(cancel) / rate
            if turns:
                total = one_ * cos(rate * s) - other * sin(rate * s)
            else:
                total = one_ * cosh(rate * s) - other * sinh(rate * s)
            yield list((total * exp(-middle * s)).applyfunc(factor_terms))
