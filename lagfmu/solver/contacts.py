"""Which contacts are closed.

    f >= 0 ,  lambda >= 0 ,  f lambda = 0        (Signorini's condition; Pfeiffer & Glocker 1996, ch. 4)

The modes of all contacts are found together by an active set on the accelerations: a closed contact
that would have to pull is opened, an open one that touches and would be penetrated is closed, the
worst first, until none is left.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Sequence

import numpy as np

from ..numeric.failure import StepFailureError
from ..numeric.system import Vector
from ..numeric.thresholds import CONTACT_PULL, CONTACTS_MOST
from .instant import Instant, Motion
from .motion import motion


def complementary_modes(
    at: Instant,
    q: Vector,
    v: Vector,
    closed: Sequence[bool],
    touching: Collection[int],
    leaving: Collection[int] = (),
) -> tuple[bool, ...]:
    """Modes, one a contact, with lambda > 0 where closed and d2f/dt2 >= 0 where open and touching.

    `touching` and `leaving` are positions in `system.contacts`; one in `leaving` was opened right
    now because its multiplier passed through zero: there f and its first two derivatives vanish, and
    the sign of what rounding leaves of them must not close it again.
    """

    system = at.system

    def change(modes: Sequence[bool]) -> int | None:
        """The contact whose mode contradicts the accelerations most; None if none does."""
        now = motion(at, q, v, system.active(modes))
        size = _force_scale(now, at)
        mass = now.M.diagonal()
        forces = np.abs(now.F) + np.abs(now.G).T @ np.abs(now.lam)
        free = np.maximum(np.abs(now.vdot), forces / np.where(mass > 0, mass, np.inf))
        worst, found = 0.0, None
        for c, k in enumerate(system.contacts):
            if modes[c]:
                excess = -(now.lam[k] / size[k]) if size[k] else 0.0
                pulls = excess > -CONTACT_PULL if c in touching else excess > CONTACT_PULL
                if pulls and (found is None or excess > worst):
                    worst, found = excess, c
            elif c in touching and c not in leaving:
                approach = now.gamma[k] - now.G[k] @ now.vdot
                floor = CONTACT_PULL * (abs(now.gamma[k]) + np.abs(now.G[k]) @ free)
                if approach > floor and approach > worst:
                    worst, found = approach, c
        return found

    modes = list(closed)
    seen: set[tuple[bool, ...]] = set()
    while tuple(modes) not in seen:
        seen.add(tuple(modes))
        wrong = change(modes)
        if wrong is None:
            return tuple(modes)
        modes[wrong] = not modes[wrong]
    undecided = sorted(touching)  # the active set went in a circle: try all combinations
    for choice in itertools.product((True, False), repeat=min(len(undecided), CONTACTS_MOST)):
        trial = list(closed)
        for c, mode in zip(undecided, choice, strict=False):
            trial[c] = mode and c not in leaving
        if change(trial) is None:
            return tuple(trial)
    names = ", ".join(repr(system.rows[system.contacts[c]].name) for c in undecided)
    raise StepFailureError(
        f"no combination of open and closed contacts {names} satisfies f >= 0, lambda >= 0 at "
        f"t = {float(at.t)!r} s"
    )


def low(
    at: Instant, q: Vector, v: Vector, closed: Sequence[bool], parting: Sequence[int], gap: Vector
) -> list[int]:
    """Of the contacts that part those that would not rise above the gap within which contacts touch, v^2 <=
    2 a gap: they rest.  Without it a ball would bounce infinitely often in a finite time."""
    now = motion(at, q, v, at.system.active(closed))
    found = []
    for c in parting:
        k = at.system.contacts[c]
        speed, pull = now.G[k] @ v - now.nu[k], now.gamma[k] - now.G[k] @ now.vdot
        if pull > 0 and speed**2 <= 2 * pull * gap[c]:
            found.append(c)
    return found


def _force_scale(now: Motion, at: Instant) -> Vector:
    """For each row the multiplier that would carry all forces alone, those of constraint included.

    Raises StepFailureError where a double does not hold it.
    """
    G = np.abs(now.G)
    square = np.einsum("ij,ij->i", G, G)
    for k in at.system.contacts:
        if not np.isfinite(square[k]):
            raise StepFailureError(
                f"contact {at.system.rows[k].name!r} has a derivative of {G[k].max():.3g}, whose square is "
                "beyond a double: choose larger units"
            )
    forces = np.abs(now.F) + G.T @ np.abs(now.lam)
    return np.asarray((G @ forces) / np.where(square > 0, square, 1.0))
