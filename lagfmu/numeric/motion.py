"""The motion at one state: accelerations, multipliers, and what frictions do at the start.

A friction sticks (its rows act) where there is no slip velocity and |lambda_t| <= mu_s N; else it slips along
e, its slip velocity or against lambda_t, with lambda_t = -mu_k N e.  That serves the nominals alone: whether
the laws of frictions and contacts have one solution together is asked of the native FMU (fmu/native.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from .failure import MasslessError, StepFailureError
from .instant import Instant
from .linear import solve
from .system import Matrix, Sparse, Vector
from .thresholds import FRICTION_SLACK

Slips = Mapping[int, Vector]  # friction -> e, of those that slip
NONE: Slips = {}
ROUNDS = 100  # of normal forces, each of which the others change
ARRIVED = 1e-15  # of the largest multiplier: a change that is rounding


@dataclass(frozen=True)
class Motion:
    """M, F, G, nu, gamma at a state, accelerations (nv) and multipliers (m; 0 for rows that do not act)."""

    M: Sparse
    F: Vector
    G: Sparse
    nu: Vector
    gamma: Vector
    vdot: Vector
    lam: Vector

    @property
    def felt(self) -> Vector:
        """Accelerations (n) before forces cancel: at least what each coordinate's forces give it alone."""
        mass = self.M.diagonal()
        forces = np.abs(self.F) + np.abs(self.G).T @ np.abs(self.lam)
        alone: Vector = forces / np.where(mass > 0, mass, np.inf)
        return np.maximum(np.abs(self.vdot), alone)


@dataclass(frozen=True)
class FrictionLaw:
    """The coefficients of all frictions at a state; C (parts, m) takes lambda to the components of their
    normal forces less `load` (parts), `places` of each friction and each of its norms."""

    static: Vector
    kinetic: Vector
    load: Vector
    C: Matrix
    places: Sequence[Sequence[range]]

    def normal(self, lam: Vector) -> Vector:
        """The normal forces (frictions)."""
        parts = self.load + self.C @ lam
        return np.array([sum(math.hypot(*parts[norm]) for norm in of) for of in self.places])


def friction_law(at: Instant, q: Vector, v: Vector) -> FrictionLaw:
    """Raises StepFailureError if a coefficient is negative, or kinetic above static."""
    system = at.system
    assert system.coulomb is not None
    coefficients, load, normal = system.coulomb(at.t, q.tolist(), v.tolist(), at.u, at.p)
    static, kinetic = coefficients[::2], coefficients[1::2]
    C = np.zeros((len(load), system.m))
    values, part = iter(normal), 0
    places: list[list[range]] = []
    for i, friction in enumerate(system.frictions):
        places.append([])
        for norm in friction.norms:
            places[i].append(range(part, part + len(norm)))
            for rows in norm:
                C[part, list(rows)] = list(islice(values, len(rows)))
                part += 1
        if not 0 <= kinetic[i] <= static[i] < np.inf:
            raise StepFailureError(
                f"friction {friction.name!r} has the coefficients static = {static[i]!r} and kinetic = "
                f"{kinetic[i]!r} at t = {float(at.t)!r} s, expected 0 <= kinetic <= static"
            )
    return FrictionLaw(
        np.array(static, float), np.array(kinetic, float), np.array(load, float), C, places
    )


def motion(at: Instant, q: Vector, v: Vector, rows: Sequence[int], slips: Slips = NONE) -> Motion:
    """`rows` act, those that stick by friction among them; frictions slip as in `slips`, their normal forces
    found by iteration.  Raises StepFailureError."""
    system, rows = at.system, list(rows)
    M, F, G, nu, gamma = at.equations(q, v)
    law = friction_law(at, q, v) if slips else None
    pushed, lam = np.zeros(system.m), np.zeros(system.m)
    for _ in range(ROUNDS):
        try:
            x, found = solve(M, F + G.T @ pushed, G[rows], gamma[rows])
        except MasslessError as error:
            raise error.named(system.directions) from error
        lam = pushed.copy()
        lam[rows] = found
        if law is None:
            break
        before, pushed = pushed, np.zeros(system.m)
        N = law.normal(lam)
        for i, e in slips.items():
            pushed[list(system.frictions[i].rows)] = -law.kinetic[i] * N[i] * e
        if np.abs(pushed - before).max() <= ARRIVED * np.abs(lam).max():
            break
    return Motion(M, F, G, nu, gamma, x, lam)


def stick_slip(
    at: Instant, q: Vector, v: Vector, rows: Sequence[int], span: Vector
) -> tuple[list[int], Slips]:
    """The rows that act, those that stick by friction with them, and the frictions that slip; `span` (nv):
    sizes of displacements in speeds.  Of frictions at s = 0, the one farthest out of its cone slips
    first."""
    system, law = at.system, friction_law(at, q, v)
    M, F, G, nu, _ = at.equations(q, v)
    mass = np.where(M.diagonal() > 0, M.diagonal(), np.inf)
    speed = np.maximum(np.abs(v), np.sqrt(span * np.abs(F) / mass))
    s, noise = G @ v - nu, FRICTION_SLACK * (np.abs(G) @ speed + np.abs(nu))
    loaded = [i for i, f in enumerate(system.frictions) if not f.gated or {*f.normal} & {*rows}]
    tangential = {i: list(system.frictions[i].rows) for i in loaded}
    slips = {
        i: s[k] / np.linalg.norm(s[k])
        for i, k in tangential.items()
        if np.linalg.norm(s[k]) > noise[k].sum()
    }
    while True:
        sticking = {i: k for i, k in tangential.items() if i not in slips}
        acting = sorted({*rows, *(k for those in sticking.values() for k in those)})
        try:
            lam = motion(at, q, v, acting, slips).lam
        except StepFailureError:  # they are driven apart, and the simulation will say which slip
            return list(rows), NONE
        most = law.static * law.normal(lam)
        excess = {
            i: float(np.linalg.norm(lam[k]) / most[i] - 1)
            for i, k in sticking.items()
            if most[i] > 0 or lam[k].any()
        }
        worst = max(excess, key=lambda i: excess[i], default=None)
        if worst is None or excess[worst] <= FRICTION_SLACK:
            return acting, slips
        k = tangential[worst]
        slips[worst] = -lam[k] / np.linalg.norm(lam[k])
