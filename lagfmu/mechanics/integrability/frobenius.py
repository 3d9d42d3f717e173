"""Frobenius' theorem and the derived flag of a codistribution, by linear algebra over its functions.

Reduced rows omega_i = dx_p + sum_f b_f dx_f, p being the pivots, span it; X_f = d/dx_f - sum_i b_if
d/dx_(p_i) are the fields they annul.  The codistribution is integrable where every d(omega_i)(X_f,
X_g) = X_f(b_g) - X_g(b_f) vanishes; else I(k+1) = {omega in I(k): d(omega) = 0 mod I(k)} ends in the
largest part that is (Bryant et al., *Exterior Differential Systems*, ch. II).  All ranks are generic:
they hold where no pivot vanishes.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import sympy as sp

from ...model.elements import Expr
from .zero import is_zero, short, slope

Row = Sequence[Expr]  # the coefficients of a one-form
Curvature = dict[tuple[int, int], list[Expr]]  # (f, g) -> d(omega_i)(X_f, X_g) of each reduced row


class Reduced(NamedTuple):
    """Rows in reduced echelon form, zero rows last, and the columns of their pivots."""

    rows: list[list[Expr]]
    pivots: list[int]


def rref(rows: Sequence[Row], width: int) -> Reduced:
    """Reduced row echelon form, with the pivots in the first `width` columns; raises Undecided."""
    matrix, pivots = sp.Matrix(rows).rref(iszerofunc=is_zero, simplify=short, normalize_last=False)
    return Reduced(matrix.applyfunc(short).tolist(), [p for p in pivots if p < width])


def closed(row: Row, variables: Row) -> bool:
    """d(omega) = 0 as it stands."""
    pairs = itertools.combinations(zip(row, variables, strict=True), 2)
    return all(is_zero(slope(b, x) - slope(a, y)) for (a, x), (b, y) in pairs)


def along(f: int, value: Expr, basis: Reduced, variables: Row) -> Expr:
    """X_f(value), with X_f = d/dx_f - sum_i b_if d/dx_(p_i)."""
    pairs = zip(basis.rows, basis.pivots, strict=False)
    return slope(value, variables[f]) - sum(row[f] * slope(value, variables[p]) for row, p in pairs)


def curvature(basis: Reduced, variables: Row) -> Curvature:
    """d(omega_i)(X_f, X_g) = X_f(b_g) - X_g(b_f), omega_i being the reduced rows."""
    free = [j for j in range(len(variables)) if j not in basis.pivots]
    table = {}
    for f, g in itertools.combinations(free, 2):
        column = []
        for row in basis.rows:
            value = along(f, row[g], basis, variables) - along(g, row[f], basis, variables)
            column.append(sp.S.Zero if is_zero(value) else short(value))
        table[f, g] = column
    return table


def obstruction(
    matrix: Sequence[Row], bend: Curvature, pivots: Sequence[int]
) -> tuple[int | None, Expr, tuple[int, ...]]:
    """k, a coefficient of d(omega_k) wedge omega_1 ... that is not zero, and its place.

    The coefficient at dx_f, dx_g and the pivots is det(a_P) d(omega_k)(X_f, X_g), a_P being the pivot
    columns of independent forms, and omega_k = sum_i a_(k, p_i) (reduced row i).
    """
    found = []
    for (f, g), column in bend.items():
        for k, row in enumerate(matrix):
            value = sp.Add(*(row[p] * b for p, b in zip(pivots, column, strict=True)))
            if not is_zero(value):
                found.append((k, value, (f, g, *pivots)))
    if not found:
        return None, sp.S.Zero, ()
    k, value, where = min(found, key=lambda one: one[1].count_ops())
    independent = rref([[row[p] for row in matrix] for p in pivots], len(matrix)).pivots
    minor = sp.Matrix([[matrix[i][p] for p in pivots] for i in independent]).det(method="berkowitz")
    return k, short(value * minor), where


def derived_flag(
    basis: Reduced, bend: Curvature, variables: Row
) -> tuple[tuple[int, ...], Reduced]:
    """The ranks of the derived flag down to where it is stable, and the reduced rows there."""
    flag = [len(basis.rows)]
    while any(any(column) for column in bend.values()):
        kernel = sp.Matrix(list(bend.values())).nullspace(simplify=short, iszerofunc=is_zero)
        flag.append(len(kernel))
        rows = sp.Matrix(basis.rows)
        derived = [list(vector.T * rows) for vector in kernel]
        basis = rref(derived, len(variables)) if derived else Reduced([], [])
        bend = curvature(basis, variables)
    return tuple(flag), basis
