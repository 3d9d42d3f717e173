"""Frobenius' theorem and the derived flag of a codistribution.

Reduced rows omega_i = dx_p + sum_f b_f dx_f, p being the pivots, span it; X_f = d/dx_f - sum_i b_if
d/dx_(p_i) are the fields they annul.  The codistribution is integrable where every d(omega_i)(X_f,
X_g) = X_f(b_g) - X_g(b_f) vanishes; else I(k+1) = {omega in I(k): d(omega) = 0 mod I(k)} ends in the
largest part that is (Bryant et al., *Exterior Differential Systems*, ch. II).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

from .echelon import determinant, nullspace, rref
from .tower import Tower


def pairs(count: int) -> Iterator[tuple[int, int]]:
    """All (i, j) with i < j < count."""
    return itertools.combinations(range(count), 2)


def exact(tower: Tower, row: list[Any]) -> bool:
    """d(omega) = 0 as it stands."""
    for i, j in pairs(len(tower.variables)):
        one = tower.diff(row[j], tower.variables[i])
        two = tower.diff(row[i], tower.variables[j])
        if not tower.is_zero(tower.lift(one) - tower.lift(two)):
            return False
    return True


def along(
    tower: Tower, basis: Sequence[Sequence[Any]], pivots: Sequence[int], f: int, value: Any
) -> Any:
    """X_f(value), with X_f = d/dx_f - sum_i b_if d/dx_(p_i)."""
    total = tower.diff(value, tower.variables[f])
    for row, pivot in zip(basis, pivots, strict=True):
        if row[f]:
            slope = tower.diff(value, tower.variables[pivot])
            total = tower.lift(total) - tower.lift(row[f]) * slope
    return tower.reduce(total)


def curvature(
    tower: Tower, basis: list[list[Any]], pivots: list[int]
) -> dict[tuple[int, int], list[Any]]:
    """d(omega_i)(X_f, X_g), omega_i being the reduced rows, and X_f the fields they annul.

    With omega_i = dx_p + sum_f b_f dx_f, it is X_f(b_g) - X_g(b_f).
    """
    free = [j for j in range(len(tower.variables)) if j not in pivots]
    table = {}
    for f, g in ((free[i], free[j]) for i, j in pairs(len(free))):
        column = []
        for row in basis:
            one = along(tower, basis, pivots, f, row[g])
            two = along(tower, basis, pivots, g, row[f])
            value = tower.reduce(tower.lift(one) - tower.lift(two))
            column.append(tower.K.zero if tower.is_zero(value) else value)
        table[f, g] = column
    return table


def obstruction(
    tower: Tower,
    matrix: list[list[Any]],
    bend: dict[tuple[int, int], list[Any]],
    pivots: list[int],
) -> tuple[int | None, Any, tuple[int, ...]]:
    """k, a coefficient of d(omega_k) wedge omega_1 ... that is not zero, and its place.

    The coefficient at dx_f, dx_g and the pivots is det(a_P) d(omega_k)(X_f, X_g), a_P being
    the pivot columns of independent forms; as omega_k = sum_i a_(k, p_i) (reduced row i),
    d(omega_k)(X_f, X_g) = sum_i a_(k, p_i) d(reduced row i)(X_f, X_g).
    """
    best: tuple[int | None, Any, tuple[int, ...]] = (None, tower.K.zero, ())
    for (f, g), column in bend.items():
        for k, row in enumerate(matrix):
            value = tower.K.zero
            for pivot, entry in zip(pivots, column, strict=True):
                value += tower.lift(row[pivot]) * tower.lift(entry)
            value = tower.reduce(value)
            if value and not tower.is_zero(value):
                value = tower.reduce(value * _minor(tower, matrix, pivots))
                size = len(value.numer) + len(value.denom)
                if best[0] is None or size < len(best[1].numer) + len(best[1].denom):
                    best = (k, value, (f, g, *pivots))
    return best


def _minor(tower: Tower, matrix: list[list[Any]], pivots: list[int]) -> Any:
    """The determinant of the pivot columns of the first independent forms."""
    transposed = [[tower.lift(row[p]) for row in matrix] for p in pivots]
    _, independent = rref(tower, transposed, len(matrix))
    square = [[tower.lift(matrix[k][p]) for p in pivots] for k in independent]
    return determinant(tower, square)


def derived_flag(
    tower: Tower, basis: list[list[Any]], bend: dict[tuple[int, int], list[Any]]
) -> tuple[list[int], list[list[Any]]]:
    """The ranks of the derived flag down to where it is stable, and the reduced rows there."""
    flag = [len(basis)]
    while basis and any(any(column) for column in bend.values()):
        kernel = nullspace(tower, list(bend.values()), len(basis))
        derived = []
        for vector in kernel:
            row = [tower.K.zero] * len(tower.variables)
            for factor, form in zip(vector, basis, strict=True):
                row = [
                    a + tower.lift(factor) * tower.lift(b) for a, b in zip(row, form, strict=True)
                ]
            derived.append([tower.reduce(entry) for entry in row])
        flag.append(len(derived))
        basis, pivots = rref(tower, derived, len(tower.variables))
        bend = curvature(tower, basis, pivots)
    return flag, basis
