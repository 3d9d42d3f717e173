"""Which start values move first onto the constraints: omitted ones, then those given in the model, then
those that the importer set.  A rank moves only if the lower ones cannot reach the constraints alone.

With a stage's coordinates free and the others held, a projection onto G dq = c is

    (W M W) dq = G_free^T mu ,   G_free dq = c

W (diagonal) makes the ranks of a stage so unlike in mass that of two which could move the lower one does,
and the higher one least: the limit of least squares with unequal weights (Golub & Van Loan, Matrix
Computations, sect. 12.1.5).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..numeric.start_priority import GIVEN, OMITTED, SET
from ..numeric.system import Matrix, System, Vector
from ..numeric.thresholds import PRIORITY_EASE
from .instant import Instant
from .linear import solve
from .magnitudes import Mask


@dataclass(frozen=True)
class Stage:
    """Who may move: `free` (n), and how reluctantly: `weight` (n); `rank`: the highest that may."""

    rank: int
    free: Mask
    weight: Vector

    def rows(self, system: System, rows: Sequence[int]) -> list[int]:
        """Those of the rows that hold a free coordinate."""
        held = {k for k, j in zip(*system.jacobian, strict=True) if self.free[j]}
        return [k for k in rows if k in held]

    def nearest(self, M: Matrix, G: Matrix, c: Vector, off: float = 0.0) -> Vector:
        """dq (n), zero where nothing is free, with G dq = c as nearly as can be; `off` as in linear.py."""
        M = np.where(np.outer(self.free, self.free), M, np.diag(M.diagonal()))
        M = M * self.weight * self.weight[:, None]
        return solve(M, np.zeros(len(M)), np.where(self.free, G, 0.0), c, True, off).x


def stages(rank: Sequence[int]) -> Iterator[Stage]:
    """Of coordinates of these ranks (n), one after another."""
    ranks = np.array(rank, dtype=int)
    for highest in (OMITTED, GIVEN, SET):
        if (ranks == highest).any():
            free = ranks <= highest
            below = np.where(ranks == OMITTED, 2 if highest > OMITTED else 0, highest - ranks)
            yield Stage(highest, free, np.where(free, PRIORITY_EASE**below, 1.0))


def singular_omissions(
    at: Instant, q: Vector, v: Vector, row: int, rank: Sequence[int]
) -> list[str]:
    """Names of omitted coordinates whose 0 is to blame if the row cannot be satisfied: none of those in it
    has a derivative there, but these have one elsewhere."""
    system = at.system
    omitted = [j for k, j in zip(*system.jacobian, strict=True) if k == row and rank[j] == OMITTED]
    G = at.evaluate(q, v)[2]
    if any(G[row, j] != 0 for j in omitted):
        return []
    found = []
    for j in omitted:
        aside = q.copy()
        aside[j] += np.abs(q).max(initial=0.0) or 1.0
        if at.evaluate(aside, v)[2][row, j] != 0:
            found.append(system.coordinates[j])
    return found
