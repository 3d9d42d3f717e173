"""Impacts with friction: Coulomb's cone on the impulses of contacts that are struck (docs/friction.md).

    0 <= Lambda_n  _|_  s_n+ + e s_n- >= 0 ,   |Lambda_t| <= mu_k N ,  N = sum c Lambda_n ,
    Lambda_t = -mu_k N s_t+/|s_t+|  where s_t+ is not 0

Moreau's law (Moreau 1988; Glocker, Set-Valued Force Laws, 2001), solved by projected sweeps over the rows
(Jourdan, Alart & Jean 1998).  Without rebound (e = 0) it never raises the energy; Newton's rebound with
friction can (Kane & Levinson 1985).  Between the two, both within the convex cones, the impact is taken that
keeps it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..numeric.system import Matrix, Vector
from ..numeric.thresholds import FRICTIONAL_CLOSE, FRICTIONAL_ROUGH, FRICTIONAL_SWEEPS
from .friction import Law, law
from .impact import Impulse, Struck, base_rows, bounded
from .instant import Instant
from .linear import solve


@dataclass(frozen=True)
class _Rows:
    """The contacts' rows, then those of the frictions that they press, with A and s- of all of them."""

    rows: tuple[int, ...]
    count: int
    frictions: tuple[int, ...]
    A: Matrix
    free: Vector


def rubbed(at: Instant, q: Vector, v: Vector, now: Struck, smooth: Impulse) -> Impulse:
    """The impact with the friction of the contacts that are struck; `smooth`: without."""
    contacts = [now.system.contacts[c] for c in now.contacts]
    pressed = [
        i
        for i, f in enumerate(now.system.frictions)
        if f.gated and any(k in contacts for k in f.normal)
    ]
    if not pressed:
        return smooth
    rows = _reduced(now, contacts, pressed)
    coefficients = law(at, q, v)
    newton = _swept(now, rows, coefficients)
    if newton is None:
        return smooth

    def plastic() -> Impulse:
        soft = _swept(replace(now, e=np.zeros(now.system.m)), rows, coefficients)
        return smooth if soft is None else soft

    return bounded(now, newton, plastic)


def _reduced(now: Struck, contacts: Sequence[int], pressed: Sequence[int]) -> _Rows:
    system, n = now.system, now.system.n
    rows = [*contacts, *(k for i in pressed for k in system.frictions[i].rows)]
    base = base_rows(system, set(now.contacts))
    G, still = now.G[base], np.zeros(len(base))
    free = solve(now.M, np.zeros(n), G, -now.slip[base], nearest=True).x
    A = np.array([now.G[rows] @ solve(now.M, now.G[k], G, still).x for k in rows])
    return _Rows(
        tuple(rows),
        len(contacts),
        tuple(pressed),
        (A + A.T) / 2,
        now.slip[rows] + now.G[rows] @ free,
    )


def _swept(now: Struck, x: _Rows, coefficients: Law) -> Impulse | None:
    """The impulses by projected sweeps; None if they do not arrive."""
    system, rows = now.system, list(x.rows)
    b = x.free.copy()
    b[: x.count] += now.e[rows[: x.count]] * now.slip[rows[: x.count]]
    place = {k: i for i, k in enumerate(rows)}
    groups = [[place[k] for k in system.frictions[i].rows] for i in x.frictions]
    z, change = np.zeros(len(rows)), np.inf
    for _ in range(FRICTIONAL_SWEEPS):
        before = z.copy()
        for i in range(x.count):
            if x.A[i, i] > 0:
                z[i] = max(0.0, z[i] - (x.A[i] @ z + b[i]) / x.A[i, i])
        Lambda = np.zeros(system.m)
        Lambda[rows[: x.count]] = z[: x.count]
        for i, group in zip(x.frictions, groups, strict=True):
            most = x.A[group, group].max()
            if not most > 0:
                continue
            radius = coefficients.kinetic[i] * max(float(coefficients.C[i] @ Lambda), 0.0)
            z[group] -= (x.A[group] @ z + b[group]) / most
            length = math.hypot(*z[group])
            if length > radius:
                z[group] *= radius / length
        change = float(np.abs(z - before).max())
        if change <= FRICTIONAL_CLOSE * np.abs(z).max():
            break
    if not change <= FRICTIONAL_ROUGH * np.abs(z).max():
        return None
    base = base_rows(system, set(now.contacts))
    found = solve(now.M, now.G[rows].T @ z, now.G[base], -now.slip[base], nearest=True)
    Lambda = np.zeros(system.m)
    Lambda[rows] = z
    Lambda[base] = found.lam
    return Impulse(now.v + found.x, Lambda)
