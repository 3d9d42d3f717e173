"""Which contacts touch, and which of those that touch at rest are closed: f'' >= 0, lambda >= 0, f'' lambda
= 0.

(Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, ch. 5.)
"""

from __future__ import annotations

from collections.abc import Collection, Iterable

import numpy as np

from ..numeric.system import System, Vector
from .complementarity import acting_together
from .equations import Motion, Terms
from .linear import rows_of
from .state import Settings

TOUCHING = 1e-9  # part of the terms of a contact's f, and of its rate, up to which they count as 0


def as_flags(system: System, rows: Collection[int]) -> tuple[bool, ...]:
    """One entry a contact: is its row among these?"""
    return tuple(k in rows for k in system.contacts)


def closed_rows(system: System, closed: Iterable[bool]) -> frozenset[int]:
    """The rows of the contacts that are closed."""
    return frozenset(k for k, shut in zip(system.contacts, closed, strict=True) if shut)


def gap_of_rounding(system: System, terms: Terms, q: Vector, settings: Settings) -> Vector:
    """(m) what f may be of a contact that touches."""
    span = np.array(settings.span)
    reach: Vector = TOUCHING * (np.abs(terms.G) @ np.maximum(system.across(np.abs(q), span), span))
    return reach


def speed_of_rounding(terms: Terms, v: Vector, settings: Settings) -> Vector:
    """(m) what |G v - nu| may be of a contact at rest."""
    speed = np.maximum(np.abs(v), settings.rate * np.array(settings.span))
    reach: Vector = TOUCHING * (np.abs(terms.G) @ speed + np.abs(terms.nu))
    return reach


def accelerations_at_hand(terms: Terms, settings: Settings) -> Vector:
    """(m) the size of f'' of each row: of the forces' share in it, or of the motion that is natural."""
    D = rows_of(terms.M, terms.G).D
    forced = np.maximum(D**2 * np.abs(terms.F), settings.rate**2 * np.array(settings.span))
    size: Vector = np.abs(terms.G) @ forced + np.abs(terms.gamma)
    return np.maximum(size, np.finfo(float).tiny)


def closed_at_rest(
    motion: Motion, terms: Terms, candidates: Collection[int], settings: Settings
) -> frozenset[int]:
    """Of the contacts (rows) that touch at rest, those that are closed; none of the others is.

    Raises StepFailureError if the conditions cannot be met.
    """
    system = motion.system
    length, size = rows_of(terms.M, terms.G).length, accelerations_at_hand(terms, settings)

    def trial(chosen: frozenset[int]) -> tuple[None, float]:
        rows = system.active(as_flags(system, chosen))
        vdot, lam, _ = motion.accelerations(terms.of(rows))
        pull = {k: -x * length[k] ** 2 for k, x in zip(rows, lam.tolist(), strict=True)}
        closing = terms.gamma - terms.G @ vdot
        wrong = [pull[k] / size[k] for k in chosen]
        wrong += [closing[k] / size[k] for k in candidates if k not in chosen]
        return None, max(wrong, default=0.0)

    return acting_together(candidates, trial)[0]
