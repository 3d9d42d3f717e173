"""Linear algebra over a differential field, by elimination with pivots that are proven not zero.

Gauss-Jordan elimination takes the shortest entry that is not zero as its pivot.  All ranks are
generic: they hold where no pivot vanishes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sympy import Integer

from .tower import Tower
from .undecided import Undecided


def rref(
    tower: Tower, rows: Sequence[Sequence[Any]], width: int
) -> tuple[list[list[Any]], list[int]]:
    """Reduced row echelon form with pivots in the first `width` columns; zero rows last."""
    matrix = [[tower.lift(entry) for entry in row] for row in rows]
    pivots: list[int] = []
    for column in range(width):
        top = len(pivots)
        chosen = _pivot(tower, matrix, top, column)
        if chosen is None:
            continue
        matrix[top], matrix[chosen] = matrix[chosen], matrix[top]
        head = matrix[top][column]
        matrix[top] = [tower.reduce(entry / head) if entry else entry for entry in matrix[top]]
        for k, row in enumerate(matrix):
            factor = row[column]
            if k != top and factor:
                matrix[k] = [
                    tower.reduce(a - factor * b) if b else a
                    for a, b in zip(row, matrix[top], strict=True)
                ]
                matrix[k][column] = tower.K.zero
        pivots.append(column)
    return matrix, pivots


def _pivot(tower: Tower, matrix: list[list[Any]], top: int, column: int) -> int | None:
    doubt: Undecided | None = None
    order = sorted(
        range(top, len(matrix)),
        key=lambda k: len(matrix[k][column].numer) + len(matrix[k][column].denom),
    )
    for k in order:
        try:
            if not tower.is_zero(matrix[k][column]):
                return k
            matrix[k][column] = tower.K.zero
        except Undecided as undecided:
            doubt = undecided
    if doubt is not None:
        raise doubt
    return None


def nullspace(tower: Tower, rows: Sequence[Sequence[Any]], width: int) -> list[list[Any]]:
    """A basis of the vectors v with rows v = 0."""
    matrix, pivots = rref(tower, rows, width)
    basis = []
    for free in (column for column in range(width) if column not in pivots):
        vector = [tower.K.zero] * width
        vector[free] = tower.K.one
        for k, pivot in enumerate(pivots):
            vector[pivot] = -matrix[k][free]
        basis.append(vector)
    return basis


def determinant(tower: Tower, matrix: list[list[Any]]) -> Any:
    """By expansion along the first row: the sets are small."""
    if not matrix:
        return tower.K.one
    total = tower.K.zero
    for j, entry in enumerate(matrix[0]):
        if entry:
            minor = [[*row[:j], *row[j + 1 :]] for row in matrix[1:]]
            total += Integer(-1) ** j * entry * determinant(tower, minor)
    return tower.reduce(total)
