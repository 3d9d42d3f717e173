"""Which contacts are closed at the start.

    f >= 0 ,  lambda >= 0 ,  f lambda = 0        (Signorini's condition; Pfeiffer & Glocker 1996, ch. 4)

The modes of all contacts that touch are found together by an active set on the accelerations: a closed
contact that would have to pull is opened, an open one that would be penetrated is closed, the worst first,
until none is left.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from .failure import StepFailureError
from .instant import Instant
from .motion import motion
from .system import System, Vector
from .thresholds import CONTACT_PULL, CONTACTS_MOST

REBOUND = "expected 0 (no rebound) to 1 (no loss)"


def is_restitution(e: float) -> bool:
    """Newton's coefficient of no landing gains energy."""
    return 0 <= e <= 1


def restitution(system: System, p: Sequence[float]) -> Vector:
    """e of each row (m), 0 where it is no contact.  Raises StepFailureError naming those that are none."""
    if system.restitution is None:
        return np.zeros(system.m)
    e = np.array(system.restitution(p), dtype=float)
    wrong = [
        f"the coefficient of restitution of {system.rows[k].name!r} is {float(e[k])!r}, {REBOUND}"
        for k in system.contacts
        if not is_restitution(e[k])
    ]
    if wrong:
        raise StepFailureError("; ".join(wrong))
    return e


def closed_contacts(
    at: Instant, q: Vector, v: Vector, touching: Sequence[bool]
) -> tuple[bool, ...]:
    """One entry a contact: lambda > 0 where closed, d2f/dt2 >= 0 where open; those that are not
    `touching` are open.  Raises StepFailureError where no combination has both."""
    modes = list(touching)
    seen: set[tuple[bool, ...]] = set()
    while tuple(modes) not in seen:
        seen.add(tuple(modes))
        wrong = _wrong(at, q, v, modes, touching)
        if wrong is None:
            return tuple(modes)
        modes[wrong] = not modes[wrong]
    undecided = [c for c, near in enumerate(touching) if near]  # it went in a circle: try all
    for choice in itertools.product((True, False), repeat=min(len(undecided), CONTACTS_MOST)):
        trial = list(touching)
        for c, mode in zip(undecided, choice, strict=False):
            trial[c] = mode
        if _wrong(at, q, v, trial, touching) is None:
            return tuple(trial)
    names = ", ".join(repr(at.system.rows[at.system.contacts[c]].name) for c in undecided)
    raise StepFailureError(
        f"no combination of open and closed contacts {names} satisfies f >= 0, lambda >= 0 at "
        f"t = {float(at.t)!r} s"
    )


def _wrong(
    at: Instant, q: Vector, v: Vector, modes: Sequence[bool], touching: Sequence[bool]
) -> int | None:
    """The contact whose mode contradicts the accelerations most; None if none does."""
    now = motion(at, q, v, at.system.active(modes))
    felt, off = now.felt, now.gamma - now.G @ now.vdot
    whole = np.abs(now.F) + np.abs(now.G).T @ np.abs(now.lam)
    worst, found, contacts = -np.inf, None, list(at.system.contacts)
    for c, (k, g) in enumerate(zip(contacts, np.abs(now.G[contacts]).toarray(), strict=True)):
        if not np.isfinite(square := float(g @ g)):
            raise StepFailureError(
                f"contact {at.system.rows[k].name!r} has a derivative of {g.max():.3g}, whose square is "
                "beyond a double: choose larger units"
            )
        if modes[c]:
            alone = g @ whole / (square or 1.0)  # the multiplier that would carry all forces
            excess = -float(now.lam[k] / alone) if alone else 0.0
            contradicts = excess > -CONTACT_PULL
        else:
            excess = float(off[k])
            floor = CONTACT_PULL * (abs(now.gamma[k]) + g @ felt)
            contradicts = touching[c] and excess > floor
        if contradicts and excess > worst:
            worst, found = excess, c
    return found


def stays_low(
    at: Instant, q: Vector, v: Vector, closed: Sequence[bool], parting: Sequence[int], gap: Vector
) -> list[int]:
    """Of the contacts that part those that would not rise above the gap within which contacts touch,
    v^2 <= 2 a gap: they rest."""
    if not parting:
        return []
    now, contacts = motion(at, q, v, at.system.active(closed)), list(at.system.contacts)
    speed = (now.G @ v - now.nu)[contacts]
    pull = (now.gamma - now.G @ now.vdot)[contacts]
    return [c for c in parting if pull[c] > 0 and speed[c] ** 2 <= 2 * pull[c] * gap[c]]
