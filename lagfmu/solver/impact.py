"""Contacts that are struck: Newton's law of restitution for all that touch, solved together.

    M (v+ - v-) = G^T Lambda ,   s = G v - nu
    contacts with s_k- <= 0:     0 <= Lambda_k ,  s_k+ + e_k s_k- >= 0 ,  one of the two is 0
    contacts with s_k- > 0:      Lambda_k = 0;  driven back by the others they are struck in a second round
    rows that act with them:     s_k+ = 0

(Glocker, Set-Valued Force Laws, Springer 2001; Pfeiffer & Glocker, ch. 8.)  The energy in the contacts'
frame falls by -1/2 Lambda^T (s+ + s-) >= 0 for 0 <= e <= 1.  Rows that act with a contact and are caught
without rebound can turn that round (Kane & Levinson, Dynamics, 1985): then v+ goes from the plastic impact
(e = 0), which never raises the energy, towards Newton's only as far as the energy of before.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from ..numeric.system import Vector
from .complementarity import acting_together
from .contacts import as_flags, speed_of_rounding
from .equations import Motion, Terms
from .linear import rows_of, solve
from .state import Settings

ROUNDS = 1000  # a light body between heavy ones is thrown to and fro; then the rest is plastic


class Impact(NamedTuple):
    """Velocities after it (n), impulses of all rows (m), energy lost [J]."""

    v: Vector
    impulses: Vector
    lost: float


def strike(
    motion: Motion,
    terms: Terms,
    v: Vector,
    touching: Collection[int],
    e: Vector,
    settings: Settings,
) -> Impact:
    """The impact of the contacts (rows) that touch, with the coefficients e (m).

    Raises StepFailureError if no velocities satisfy the constraints.
    """
    small = speed_of_rounding(terms, v, settings)
    done = Impact(v, np.zeros(len(terms.nu)), 0.0)
    for k in range(ROUNDS + 1):
        s = terms.G @ done.v - terms.nu
        struck = [k for k in touching if s[k] <= small[k]]
        if all(s[k] >= -small[k] for k in struck):
            break
        more = _together(motion, terms, done.v, struck, e if k < ROUNDS else 0 * e)
        done = Impact(more.v, done.impulses + more.impulses, done.lost + more.lost)
    return done


def _together(
    motion: Motion, terms: Terms, v: Vector, struck: Collection[int], e: Vector
) -> Impact:
    newton = _newton(motion, terms, v, struck, e)
    if newton.lost >= 0 or not any(e[k] for k in struck):
        return newton
    plastic = _newton(motion, terms, v, struck, 0 * e)
    s = terms.G @ v - terms.nu

    def between(part: float) -> Impact:
        found = plastic.v + part * (newton.v - plastic.v)
        impulses = plastic.impulses + part * (newton.impulses - plastic.impulses)
        return Impact(found, impulses, _lost(terms, s, found, impulses))

    if plastic.lost <= 0:
        return plastic
    return between(brentq(lambda part: between(part).lost, 0.0, 1.0, xtol=1e-15))


def _newton(motion: Motion, terms: Terms, v: Vector, struck: Collection[int], e: Vector) -> Impact:
    system = motion.system
    s = terms.G @ v - terms.nu
    length = rows_of(terms.M, terms.G).length
    size = max(float(np.abs(s[list(struck)]).max()), np.finfo(float).tiny)

    def trial(chosen: frozenset[int]) -> tuple[Impact, float]:
        rows = system.active(as_flags(system, chosen))
        some = terms.of(rows)
        back = np.array([1 + e[k] if k in chosen else 1.0 for k in rows])
        decomposed = rows_of(some.M, some.G)
        dv, part = solve(some.M, np.zeros(len(v)), decomposed, -back * s[rows])
        impulses = np.zeros(len(s))
        impulses[rows] = part
        after = terms.G @ (v + dv) - terms.nu
        wrong = [-impulses[k] * length[k] ** 2 / size for k in chosen]
        wrong += [-(after[k] + e[k] * s[k]) / size for k in struck if k not in chosen]
        wrong += (np.abs(after[rows] + (back - 1) * s[rows]) / size).tolist()
        return Impact(v + dv, impulses, _lost(terms, s, v + dv, impulses)), max(wrong)

    return acting_together(struck, trial)[1]


def _lost(terms: Terms, before: Vector, v: Vector, impulses: Vector) -> float:
    after = terms.G @ v - terms.nu
    return float(-impulses @ (after + before) / 2)
