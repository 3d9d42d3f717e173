"""Which of several contacts act together: 0 <= a_k, 0 <= b_k, a_k b_k = 0, found by trying.

a are multipliers (or impulses) of contacts that act, b the accelerations (or speeds) with which the others
open. The matrix that leads from a to b, G M^-1 G^T, is positive semidefinite, so that a solution exists
unless the other constraints forbid every one, and the motion is the same for all solutions (Cottle, Pang &
Stone, The Linear Complementarity Problem, sect. 3.1).  For a handful of contacts all sets are tried, the
largest first, so that of several solutions that one is taken in which most push.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from itertools import combinations
from typing import TypeVar

from ..numeric.failure import StepFailureError

HANDFUL = 12
EXACT = 1e-11  # of what is compared: a condition missed by less holds to rounding
ALLOWED = 1e-6  # likewise, of the best set, where none holds to rounding

Found = TypeVar("Found")


def acting_together(
    candidates: Collection[int],
    trial: Callable[[frozenset[int]], tuple[Found, float]],
) -> tuple[frozenset[int], Found]:
    """The set of `candidates` that acts, and what `trial` found for it: a pair (found, by how much the
    conditions are missed, relative).

    Raises StepFailureError if no set does.
    """
    some = sorted(candidates)
    if len(some) > HANDFUL:
        raise StepFailureError(
            f"{len(some)} contacts touch at once, and the python target tries all sets of at most "
            f"{HANDFUL}: build --target native"
        )
    best, failure = None, None
    for size in range(len(some), -1, -1):
        for chosen in map(frozenset, combinations(some, size)):
            try:
                found, missed = trial(chosen)
            except StepFailureError as error:
                failure = error
                continue
            if missed <= EXACT:
                return chosen, found
            if best is None or missed < best[2]:
                best = chosen, found, missed
    if best is None or best[2] > ALLOWED:
        raise failure or StepFailureError("no set of contacts that act satisfies their conditions")
    return best[0], best[1]
