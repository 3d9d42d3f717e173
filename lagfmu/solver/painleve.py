"""Does sliding have one acceleration, whatever the forces?

With B = G_n M^-1 (G_n^T - sign mu G_t^T s/|s|) over the contacts that touch, their laws have exactly one
solution if B is a P-matrix: all principal minors are positive (Cottle, Pang & Stone, The Linear
Complementarity Problem, 1992, th. 3.3.7; Pfeiffer & Glocker 1996).  The minor of the contacts that stay
closed is det B times the one of B^-1 over those that open; B^-1 = (1 + A)^-1 K^-1 comes from unit
accelerations of each contact.  Over the same minor without friction it is 1 + A with those open.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ..numeric.failure import StepFailureError
from ..numeric.system import Matrix, Vector
from ..numeric.thresholds import PAINLEVE_OPENED, PAINLEVE_ROWS, PAINLEVE_SAFE
from .instant import Instant

NEVER_SLIPS = (
    "if it is meant never to slip, leave the friction out and let its constraints act with the contact "
    "(while_closed)"
)


def paradox(at: Instant, frictions: Sequence[int], value: float) -> StepFailureError:
    """The refusal of a sliding problem without one solution."""
    names = ", ".join(repr(at.system.frictions[i].name) for i in frictions)
    return StepFailureError(
        f"friction {names}: sliding has no acceleration, or several, at t = {float(at.t)!r} s (Painleve's "
        f"paradox: the normal force would drive itself, 1 + A = {value:.3g}, expected above 0): use a "
        f"smaller coefficient of friction, or let the bodies deform (a spring in the contact); {NEVER_SLIPS}"
    )


def check_solvable(at: Instant, sliding: Sequence[int], A: Matrix) -> None:
    """With all contacts that are closed.  Raises StepFailureError."""
    for place, i in enumerate(sliding):
        own = A[place, place]
        least = 1 + own if at.system.frictions[i].gated else 1 - abs(own)
        if not least > PAINLEVE_SAFE:
            raise paradox(at, [i], least)
    if len(sliding) > 1:
        determinant = float(np.linalg.det(np.eye(len(sliding)) + A))
        if not determinant > PAINLEVE_SAFE:
            raise paradox(at, sliding, determinant)


def check_opened(
    at: Instant,
    sliding: Sequence[int],
    rows: Sequence[int],
    unique: NDArray[np.bool_],
    A: Matrix,
    share: Matrix,
    press: Matrix,
    unit: Callable[[int], Vector],
) -> None:
    """With some of them open.  Raises StepFailureError.

    `share` (m, sliding) takes normal forces to multipliers, `press` (sliding, m) multipliers to normal
    forces; unit(k): multipliers (m) to a unit acceleration of row k, without friction.
    """
    contacts = [k for k in at.system.contacts if k in rows]
    if not 2 <= len(contacts) <= PAINLEVE_OPENED:
        return
    found = contacts + [k for k in rows if _gates(at, k)]
    if len(found) > PAINLEVE_ROWS or not all(unique[k] for k in found):
        return  # redundant: there is no K^-1
    without = np.column_stack([unit(k) for k in found])
    whole = np.eye(len(sliding)) + A
    determinant = float(np.linalg.det(whole))
    B = (without - share @ np.linalg.solve(whole, press @ without))[found]
    K = without[found]
    for number in range(1, len(contacts) + 1):
        for opened in itertools.combinations(contacts, number):
            left = set(contacts) - set(opened)
            which = [
                place for place, k in enumerate(found) if k not in left and not left & _gates(at, k)
            ]
            part = np.ix_(which, which)
            value = determinant * float(np.linalg.det(B[part]) / np.linalg.det(K[part]))
            if not value > PAINLEVE_SAFE:
                raise paradox(at, sliding, value)


def _gates(at: Instant, k: int) -> set[int]:
    """The contacts of which one must be closed for row k to act; empty: it acts without, or is one."""
    row = at.system.rows[k]
    if row.while_closed is not None:
        return {row.while_closed}
    if row.friction is not None and at.system.frictions[row.friction].gated:
        return set(at.system.frictions[row.friction].normal)
    return set()
