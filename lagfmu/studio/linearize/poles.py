"""Poles and modes of z' = A z, its zero poles apart.

A zero pole of several steps (a coordinate that may stand anywhere, and drifts) is what rounding moves
furthest, like eps^(1/2).  So they are taken out first: the null space of A by singular values, then that of
what A does across it, and so on (the staircase of Golub & Van Loan, sect. 7.6.5), of a balanced A.  The rest
has the other poles, as exact as they are well conditioned.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matrix_balance, qr

from .exchange import Floats

Complex = NDArray[np.complex128]
ZERO = 1e-9  # part of the norm of A, below which a singular value is none


@dataclass(frozen=True)
class Poles:
    """`values` [1/s] that are not zero, the slowest first, and their `vectors` in z (k, p); `indifferent`: of
    each step of zero poles the states that may be changed by it."""

    values: Complex
    vectors: Complex
    indifferent: tuple[tuple[str, ...], ...]

    @property
    def zeros(self) -> int:
        """How many poles are zero."""
        return sum(map(len, self.indifferent))


def poles(A: Floats, states: Sequence[str], least: float = ZERO) -> Poles:
    """Of A (k, k); `least`: the part of its norm that is 0."""
    if not len(A):
        return Poles(np.zeros(0, complex), np.zeros((0, 0), complex), ())
    block, (scale, _) = matrix_balance(A, permute=False, separate=True)
    norm = float(np.linalg.norm(block, 2)) or 1.0
    basis, steps = np.eye(len(A)), []
    found = []  # of each step: its null space, and the block before it
    while len(block):
        _, s, Vt = np.linalg.svd(block)
        rank = int((s > max(least, 0.0) * norm).sum())
        if rank == len(block):
            break
        null, across = Vt[rank:].T, Vt[:rank].T
        steps.append(_named(basis @ null, states))
        found.append((null, across, block))
        basis, block = basis @ across, across.T @ block @ across
    values, vectors = np.linalg.eig(block) if len(block) else (np.zeros(0), np.zeros((0, 0)))
    for null, across, before in reversed(found):
        lifted = across @ vectors
        part = (null.T @ before @ lifted) / values[None, :]
        vectors = lifted + null @ part
    order = np.lexsort((values.imag < 0, np.round(np.abs(values) / norm, 12)))
    whole = (scale[:, None] * vectors)[:, order]
    return Poles(values[order].astype(complex), whole.astype(complex), tuple(steps))


def _named(null: Floats, states: Sequence[str]) -> tuple[str, ...]:
    """The states of which as many as there are directions say where one stands among these."""
    _, order = qr(null.T, mode="r", pivoting=True)
    return tuple(states[k] for k in sorted(order[: null.shape[1]]))
