"""The motion at one state: accelerations, multipliers, and what frictions do at the start.

A friction sticks (its rows act) where there is no slip velocity and |lambda_t| <= mu_s N; else it slips along
e, its slip velocity or against lambda_t, with lambda_t = -mu_k N e.  That serves the nominals alone: whether
the laws of frictions and contacts have one solution together is asked of the native FMU (fmu/native.py).

Which constraints follow from others, and what that leaves undetermined.

lambda_k is unique only if component k of the null space of G^T vanishes (Wojtyra 2005).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from .failure import MasslessError, StepFailureError
from .instant import Instant
from .linear import norms, solve, stand_apart
from .system import Matrix, Sparse, System, Vector
from .thresholds import FRICTION_SLACK, RANK

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


ALONE = 1e-6  # part of a unit vector of multipliers that push nothing, up to which one has no part in it
MISSED = 1e-9  # part of a constraint's terms by which it is missed


@dataclass(frozen=True)
class Rank:
    """The rank of G with all constraints acting, the rows that add nothing to those before them, all whose
    multipliers are not unique, and the frictions whose normal forces are not, by name."""

    rank: int
    redundant: tuple[str, ...]
    shared: tuple[str, ...]
    undecided: tuple[str, ...]


def rank_of(
    system: System, G: Sparse, f: Vector, size: Vector, law: FrictionLaw | None = None
) -> Rank:
    """Rows are scaled to unit norm; what is left of each beside the span of those before it by Gram and
    Schmidt, twice.  Those of frictions do not count, which hold as long as they stick.  Contacts come last:
    one that cannot be closed while those on which it depends are (a wall on either side) is no redundancy.
    f (m) are the residuals, `size` (m) the magnitudes of their terms; `law` gives the normal forces of the
    frictions, if there are any."""
    C = np.zeros((0, system.m)) if law is None else law.C
    norm = norms(G)
    norm = np.where(norm > 0, norm, 1.0)
    G, f, size, C = G / norm[:, None], f / norm, size / norm, C / norm
    held = [k for k, row in enumerate(system.rows) if row.friction is None]
    if stand_apart(G.tocsr()[held]):
        return Rank(len(held), (), (), ())
    G = G.toarray()
    span = np.zeros((0, system.nv))
    redundant: list[str] = []
    rows: list[int] = []
    for k in sorted(held, key=lambda k: k in system.contacts):
        rest = G[k].copy()
        for _ in range(2):
            rest -= span.T @ (span @ rest)
        length = float(np.linalg.norm(rest))
        if len(span) < system.nv and length > np.sqrt(RANK):
            span = np.vstack([span, rest / length])
        elif k in system.contacts and _apart(k, rows, G, f, size):
            continue
        else:
            redundant.append(system.rows[k].name)
        rows.append(k)
    rows.sort()
    left = _left_null_space(G[rows], len(redundant))
    shared = np.linalg.norm(left, axis=1) > ALONE
    grows = np.linalg.norm(C[:, rows] @ left, axis=1) > ALONE * np.linalg.norm(C[:, rows], axis=1)
    names = tuple(system.rows[k].name for k, part in zip(rows, shared, strict=True) if part)
    places = [] if law is None else law.places
    undecided = [any(grows[list(norm)].any() for norm in of) for of in places]
    frictions = tuple(x.name for x, part in zip(system.frictions, undecided, strict=True) if part)
    return Rank(len(span), tuple(redundant), names, frictions)


def _apart(k: int, rows: Sequence[int], G: Matrix, f: Vector, size: Vector) -> bool:
    """Whether row k, as it follows from `rows`, still has a gap when all of those have none."""
    share = np.linalg.lstsq(G[rows].T, G[k], rcond=RANK)[0]
    return bool(abs(f[k] - share @ f[rows]) > MISSED * (size[k] + np.abs(share) @ size[rows]))


def _left_null_space(G: Matrix, count: int) -> Matrix:
    """(rows, count), orthonormal: the multipliers that push nothing."""
    if not count or not len(G):
        return np.zeros((len(G), 0))
    return np.linalg.svd(G)[0][:, len(G) - count :]
