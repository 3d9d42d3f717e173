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
from typing import Any

from .functions import Functions
from .generators import Undecided

Row = list[Any]  # of elements: the coefficients of a one-form


def size(element: Any) -> int:
    """Terms above and below."""
    return len(element.numer) + len(element.denom)


def rref(field: Functions, rows: Sequence[Row], width: int) -> tuple[list[Row], list[int]]:
    """Reduced row echelon form with pivots in the first `width` columns; zero rows last."""
    matrix = [list(row) for row in rows]
    pivots: list[int] = []
    for column in range(width):
        top = len(pivots)
        chosen = _pivot(field, matrix, top, column)
        if chosen is None:
            continue
        matrix[top], matrix[chosen] = matrix[chosen], matrix[top]
        head = matrix[top][column]
        matrix[top] = [field.over(entry, head) for entry in matrix[top]]
        for k, row in enumerate(matrix):
            factor = row[column]
            if k != top and factor:
                matrix[k] = [
                    field.minus(a, field.times(factor, b)) if b else a
                    for a, b in zip(row, matrix[top], strict=True)
                ]
                matrix[k][column] = field.zero
        pivots.append(column)
    return matrix, pivots


def _pivot(field: Functions, matrix: list[Row], top: int, column: int) -> int | None:
    """The row of the shortest entry that is proven not zero."""
    doubt: Undecided | None = None
    for k in sorted(range(top, len(matrix)), key=lambda k: size(matrix[k][column])):
        try:
            if not field.is_zero(matrix[k][column]):
                return k
            matrix[k][column] = field.zero
        except Undecided as undecided:
            doubt = undecided
    if doubt is not None:
        raise doubt
    return None


def determinant(field: Functions, matrix: list[Row]) -> Any:
    """By expansion along the first row: the sets are small."""
    if not matrix:
        return field.one
    parts = []
    for j, entry in enumerate(matrix[0]):
        if entry:
            minor = determinant(field, [[*row[:j], *row[j + 1 :]] for row in matrix[1:]])
            parts.append(field.times(entry, -minor if j % 2 else minor))
    return field.plus(*parts)


def closed(field: Functions, row: Row) -> bool:
    """d(omega) = 0 as it stands."""
    return all(
        field.is_zero(field.minus(field.diff(row[j], x), field.diff(row[i], y)))
        for (i, x), (j, y) in itertools.combinations(enumerate(field.variables), 2)
    )


def along(field: Functions, basis: Sequence[Row], pivots: Sequence[int], f: int, value: Any) -> Any:
    """X_f(value), with X_f = d/dx_f - sum_i b_if d/dx_(p_i)."""
    slopes = [
        field.times(-row[f], field.diff(value, field.variables[pivot]))
        for row, pivot in zip(basis, pivots, strict=True)
        if row[f]
    ]
    return field.plus(field.diff(value, field.variables[f]), *slopes)


Curvature = dict[tuple[int, int], Row]  # (f, g) -> d(omega_i)(X_f, X_g) of each reduced row


def curvature(field: Functions, basis: list[Row], pivots: list[int]) -> Curvature:
    """d(omega_i)(X_f, X_g) = X_f(b_g) - X_g(b_f), omega_i being the reduced rows."""
    free = [j for j in range(len(field.variables)) if j not in pivots]
    table = {}
    for f, g in itertools.combinations(free, 2):
        column = []
        for row in basis:
            one = along(field, basis, pivots, f, row[g])
            value = field.minus(one, along(field, basis, pivots, g, row[f]))
            column.append(field.zero if field.is_zero(value) else value)
        table[f, g] = column
    return table


def obstruction(
    field: Functions, matrix: list[Row], bend: Curvature, pivots: list[int]
) -> tuple[int | None, Any, tuple[int, ...]]:
    """k, a coefficient of d(omega_k) wedge omega_1 ... that is not zero, and its place.

    The coefficient at dx_f, dx_g and the pivots is det(a_P) d(omega_k)(X_f, X_g), a_P being the pivot
    columns of independent forms, and omega_k = sum_i a_(k, p_i) (reduced row i).
    """
    found: list[tuple[int, Any, tuple[int, ...]]] = []
    for (f, g), column in bend.items():
        for k, row in enumerate(matrix):
            value = field.plus(
                *[field.times(row[p], b) for p, b in zip(pivots, column, strict=True)]
            )
            if not field.is_zero(value):
                found.append((k, value, (f, g, *pivots)))
    if not found:
        return None, field.zero, ()
    _, independent = rref(field, [[row[p] for row in matrix] for p in pivots], len(matrix))
    minor = determinant(field, [[matrix[k][p] for p in pivots] for k in independent])
    whole = [(k, field.times(value, minor), where) for k, value, where in found]
    return min(whole, key=lambda one: size(one[1]))


def derived_flag(
    field: Functions, basis: list[Row], bend: Curvature
) -> tuple[list[int], list[Row]]:
    """The ranks of the derived flag down to where it is stable, and the reduced rows there."""
    flag = [len(basis)]
    while basis and any(any(column) for column in bend.values()):
        derived = []
        for vector in _nullspace(field, list(bend.values()), len(basis)):
            columns = zip(*basis, strict=True)
            derived.append(
                [
                    field.plus(*[field.times(c, a) for c, a in zip(vector, column, strict=True)])
                    for column in columns
                ]
            )
        flag.append(len(derived))
        basis, pivots = rref(field, derived, len(field.variables))
        bend = curvature(field, basis, pivots)
    return flag, basis


def _nullspace(field: Functions, rows: Sequence[Row], width: int) -> list[Row]:
    """A basis of the vectors v with rows v = 0."""
    matrix, pivots = rref(field, rows, width)
    basis = []
    for free in (column for column in range(width) if column not in pivots):
        vector = [field.zero] * width
        vector[free] = field.one
        for k, pivot in enumerate(pivots):
            vector[pivot] = -matrix[k][free]
        basis.append(vector)
    return basis
