"""Which contacts touch, and which of those that touch at rest are closed: f'' >= 0, lambda >= 0, f'' lambda
= 0.

(Pfeiffer & Glocker, Multibody Dynamics with Unilateral Contacts, ch. 5.)
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace

import numpy as np

from ..numeric.system import System, Vector
from ..numeric.thresholds import ROUNDINGS, TOUCH
from .complementarity import acting_together
from .equations import Motion, Terms
from .linear import rows_of
from .state import Settings, State

EPS = float(np.finfo(float).eps)


def as_flags(system: System, rows: Collection[int]) -> tuple[bool, ...]:
    """One entry a contact: is its row among these?"""
    return tuple(k in rows for k in system.contacts)


def closed_rows(system: System, closed: Iterable[bool]) -> frozenset[int]:
    """The rows of the contacts that are closed."""
    return frozenset(k for k, shut in zip(system.contacts, closed, strict=True) if shut)


def opened(motion: Motion, t: float, q: Vector, state: State) -> State:
    """The state with how far its open contacts have been, q having been passed at t."""
    f, terms = motion.residual(t, q), None
    heights, extents = list(state.heights), list(state.extents)
    for c, k in enumerate(motion.system.contacts):
        if state.closed[c] or not f[k] > heights[c]:
            continue
        terms = motion.magnitudes(t, q) if terms is None else terms
        heights[c], extents[c] = float(f[k]), max(extents[c], float(terms[k]))
    if terms is None:
        return state
    return replace(state, heights=tuple(heights), extents=tuple(extents))


def gap_of_rounding(motion: Motion, t: float, q: Vector, state: State) -> Vector:
    """(m) what f may be of a contact that touches: rounding of its terms, or next to nothing of the way that
    it has been open, or of its terms there where these are smaller, so that bounces end."""
    gap: Vector = ROUNDINGS * EPS * motion.magnitudes(t, q)
    for c, k in enumerate(motion.system.contacts):
        own = max(gap[k], ROUNDINGS * EPS * state.extents[c])
        gap[k] = max(own, TOUCH * min(state.heights[c], state.extents[c]))
    return gap


def speed_of_rounding(terms: Terms, v: Vector, settings: Settings) -> Vector:
    """(m) what |G v - nu| may be of a contact at rest."""
    speed = np.maximum(np.abs(v), np.array(settings.swift))
    reach: Vector = TOUCH * (np.abs(terms.G) @ speed + np.abs(terms.nu))
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
