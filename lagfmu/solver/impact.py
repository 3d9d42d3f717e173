"""Impacts: all contacts that are struck at one instant are solved together (docs/impacts.md).

    M (v+ - v-) = G^T Lambda ,   s = G v - nu
    0 <= Lambda_k  _|_  s_k+ + e_k s_k- >= 0    contacts that touch with s_k- <= 0
    s_k+ = 0                                    rows that always act, or act with such a contact

Newton's law of restitution with complementarity (Moreau 1988; Pfeiffer & Glocker, Multibody Dynamics with
Unilateral Contacts, 1996, ch. 8; Glocker, Set-Valued Force Laws, 2001).  With 0 <= e <= 1 and s- <= 0 the
energy in the contacts' own frame does not rise,
Lambda^T (s+ + s-) / 2 = sum (1 - e_k) Lambda_k s_k- / 2 <= 0.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..numeric.failure import StartFailureError, StepFailureError
from ..numeric.system import Matrix, System, Vector
from ..numeric.thresholds import IMPACT_PULL, IMPACT_ROUNDING, IMPACT_ROUNDS
from .complementarity import complementary
from .instant import Instant
from .linear import solve


@dataclass(frozen=True)
class Impulse:
    """v (n): velocities after the impact; Lambda (m): impulses, 0 where a row did not act."""

    v: Vector
    Lambda: Vector


@dataclass(frozen=True)
class Struck:
    """What an impact starts from: M, G, s- (m) and e (m) at a state, contacts by positions."""

    system: System
    t: float
    M: Matrix
    G: Matrix
    v: Vector
    slip: Vector
    e: Vector
    contacts: tuple[int, ...]


Rub = Callable[[Instant, Vector, Vector, Struck, Impulse], Impulse]


def impact(
    at: Instant,
    q: Vector,
    v: Vector,
    contacts: Collection[int],
    plastic: bool = False,
    rub: Rub | None = None,
) -> Impulse:
    """One impact on `contacts` (positions in `system.contacts`), approached or at rest, together.

    `plastic`: e = 0; `rub` adds friction (rubbing.py).  Raises StepFailureError if no velocities satisfy the
    contacts.
    """
    system = at.system
    M, _, G, nu, _ = at.evaluate(q, v)
    assert system.restitution is not None
    e = np.zeros(system.m) if plastic else np.array(system.restitution(at.p), dtype=float)
    slip = G @ v - nu
    slip[np.abs(slip) <= IMPACT_ROUNDING * (np.abs(G) @ np.abs(v) + np.abs(nu))] = 0.0
    now = Struck(system, at.t, M, G, v, slip, e, tuple(sorted(contacts)))
    found = _bounded(now, _newton(now))
    return found if rub is None else rub(at, q, v, now, found)


def _newton(now: Struck) -> Impulse:
    """The law.  A row that acts with a contact does so unless the others lift the contact off."""
    system, holding = now.system, set(now.contacts)
    while True:
        base = base_rows(system, holding)
        A, b = _reduced(now, base)
        found = complementary(A, b)
        if found is None and now.e.any():  # rows that act with a contact leave no room to rebound
            now = replace(now, e=np.zeros(system.m))
            continue
        if found is None:
            names = ", ".join(repr(system.rows[system.contacts[c]].name) for c in now.contacts)
            raise StepFailureError(
                f"no velocities after the impact at t = {float(now.t)!r} s satisfy the contacts "
                f"{names} together: they are driven against each other"
            )
        z, w = found
        lifted = {c for c, gap in zip(now.contacts, w, strict=True) if gap > 0 and c in holding}
        if not any(_with(system, c) for c in lifted):
            return _solved(now, base, z, w)
        holding -= lifted


def _with(system: System, contact: int) -> list[int]:
    """The rows that act with a contact."""
    k = system.contacts[contact]
    rows = enumerate(system.rows)
    return [j for j, row in rows if row.while_closed == k and row.friction is None]


def base_rows(system: System, holding: Collection[int]) -> list[int]:
    """Rows that act with both signs."""
    return sorted([*system.permanent, *(j for c in holding for j in _with(system, c))])


def _reduced(now: Struck, base: Sequence[int]) -> tuple[Matrix, Vector]:
    """A (k, k) and b (k): s+ + e s- = A Lambda + b on the contacts, the base rows taken care of."""
    n, rows = now.system.n, [now.system.contacts[c] for c in now.contacts]
    still, G = np.zeros(len(base)), now.G[base]
    free = solve(now.M, np.zeros(n), G, -now.slip[base], nearest=True).x
    b = (1 + now.e[rows]) * now.slip[rows] + now.G[rows] @ free
    A = np.zeros((len(rows), len(rows)))
    for i, k in enumerate(rows):
        A[i] = now.G[rows] @ solve(now.M, now.G[k], G, still).x
    return (A + A.T) / 2, b


def _solved(now: Struck, base: Sequence[int], z: Vector, w: Vector) -> Impulse:
    """Velocities from the rows that were found, solved once more together.

    Lambda of dependent rows is that of least norm, if that pushes; else the one that was found.
    """
    system = now.system
    touching = [c for c, gap in zip(now.contacts, w, strict=True) if gap == 0]
    pushing = [c for c, push in zip(now.contacts, z, strict=True) if push > 0]
    for chosen in (touching, pushing):
        rows = [*base, *(system.contacts[c] for c in chosen)]
        contact = np.isin(rows, system.contacts)
        jump = -now.slip[rows] * (1 + np.where(contact, now.e[rows], 0.0))
        found = solve(now.M, np.zeros(system.n), now.G[rows], jump, nearest=True)
        if (found.lam[contact] >= -IMPACT_PULL * np.abs(found.lam).max(initial=0.0)).all():
            break
    Lambda = np.zeros(system.m)
    Lambda[rows] = found.lam
    return Impulse(now.v + found.x, Lambda)


def _gain(now: Struck, result: Impulse) -> float:
    """Energy gained in the contacts' own frame [J], Lambda^T (s+ + s-) / 2."""
    after = now.slip + now.G @ (result.v - now.v)
    return float(result.Lambda @ (after + now.slip)) / 2


def _bounded(now: Struck, newton: Impulse) -> Impulse:
    """Where rows that act with a contact make Newton's law raise the energy: between the plastic impact,
    which never does, and Newton's, the one that keeps it.  The energy is quadratic on the way."""
    if not any(_with(now.system, c) for c in now.contacts):
        return newton
    return bounded(now, newton, lambda: _newton(replace(now, e=np.zeros(now.system.m))))


def bounded(now: Struck, newton: Impulse, without: Callable[[], Impulse]) -> Impulse:
    """The impact between `without` rebound, which never raises the energy, and Newton's that keeps it."""
    gain = _gain(now, newton)
    if gain <= 0:
        return newton
    plastic = without()
    lost = -_gain(now, plastic)
    if lost <= 0:
        return plastic
    slope = 4 * _gain(now, _between(plastic, newton, 0.5)) + 3 * lost - gain
    bend = gain + lost - slope
    root = float(np.sqrt(max(slope**2 + 4 * lost * bend, 0.0)))
    part = (root - slope) / (2 * bend) if slope < 0 else 2 * lost / (slope + root)
    return _between(plastic, newton, min(max(part, 0.0), 1.0))


def _between(plastic: Impulse, newton: Impulse, part: float) -> Impulse:
    v = plastic.v + part * (newton.v - plastic.v)
    return Impulse(v, plastic.Lambda + part * (newton.Lambda - plastic.Lambda))


def impacts(
    at: Instant,
    q: Vector,
    v: Vector,
    touching: Collection[int],
    slow: Vector,
    rub: Rub | None = None,
) -> tuple[Vector, dict[int, float]]:
    """All impacts of an instant: velocities (n) after them, and the impulse on each contact that was struck.

    `touching` are those that an impact can reach.  One that separates takes no part; if it is driven back,
    that is the next impact.  `slow` (m): speeds that count as none.
    """
    struck: dict[int, float] = {}
    for count in range(IMPACT_ROUNDS):
        _, _, G, nu, _ = at.evaluate(q, v)
        speed = {c: (G @ v - nu)[k] for c, k in enumerate(at.system.contacts) if c in touching}
        limit = {c: slow[at.system.contacts[c]] for c in speed}
        if not any(s < -limit[c] for c, s in speed.items()):
            break
        plastic = count == IMPACT_ROUNDS - 1
        entering = [c for c, s in speed.items() if s <= limit[c] or plastic]
        found = impact(at, q, v, entering, plastic, rub)
        v = found.v
        for c in entering:
            if (push := float(found.Lambda[at.system.contacts[c]])) > 0:
                struck[c] = struck.get(c, 0.0) + push
    return v, struck


def check_restitution(system: System, p: Sequence[float]) -> None:
    """Raises StartFailureError if a coefficient of restitution is not between 0 and 1."""
    assert system.restitution is not None
    e = system.restitution(p)
    wrong = [
        f"the coefficient of restitution of {system.rows[k].name!r} is {float(e[k])!r}, expected 0 (no "
        "rebound) to 1 (no loss)"
        for k in system.contacts
        if not 0 <= e[k] <= 1
    ]
    if wrong:
        raise StartFailureError("the start is refused: " + "; ".join(wrong))
