"""The `minimal` formulation: dependent coordinates eliminated by q = phi(s, t).

    v = J sdot + dphi/dt ,   J = dphi/ds ,
    (J^T M J) sddot = J^T (F - M c) ,   c = dJ/dt sdot + d/dt dphi/dt       (ME 6590, scenario a)

The relations come from constraints that are linear in a coordinate (y - R theta = 0), found here, or
from an Embedding that the user gives, which is checked.  The multipliers drop out, because G J = 0, and
are recovered from the full system at the state.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from typing import Any

import sympy as sp

from ...errors import DerivationError
from ...model.elements import TIME, Expr
from ...model.model import Constraint, Holonomic
from .. import simplification
from ..equations import EquationsOfMotion

SMALL = 400  # operations below which a reduced expression is worth simplifying


@dataclass(frozen=True)
class Reduction:
    """q = phi(s, t) with v = J sdot + phi_t, and the reduced equations in s.

    s, sdot (N): independent coordinates and velocities; start: their start values by plain symbol;
    phi, vel (n): coordinates and velocities of the full system; reduced: equations in s, with the
    constraint rows that the embedding does not satisfy by itself (numbers in `rows`).
    """

    s: tuple[Expr, ...]
    sdot: tuple[Expr, ...]
    phi: tuple[Expr, ...]
    vel: tuple[Expr, ...]
    reduced: EquationsOfMotion
    rows: tuple[int, ...]

    @property
    def constraints(self) -> tuple[Constraint, ...]:
        """Those that still act on s."""
        return tuple(self.reduced.constraints[k] for k in self.rows)


def reduce(eom: EquationsOfMotion) -> Reduction:
    """Eliminate dependent coordinates.  Raises DerivationError if none can be, or the embedding fails."""
    if not eom.moves_plainly:
        raise DerivationError(
            "coordinates are eliminated together with their rates, which are no speeds where `kinematics` "
            "stand: choose the formulation 'multipliers' or 'nullspace'"
        )
    relations, independent = _relations(eom)
    table = eom.symbols
    if independent is None:  # keep the coordinates that no relation gives
        kept = [j for j, q in enumerate(eom.q) if q not in relations]
        s = tuple(eom.q[j] for j in kept)
        sdot = tuple(eom.v[j] for j in kept)
    else:
        s = tuple(table[c] for c in independent) + tuple(q for q in eom.q if q not in relations)
        speeds = {
            **dict(zip(eom.q, eom.v, strict=True)),
            **{table[c]: table[c.diff(TIME)] for c in independent},
        }
        sdot = tuple(speeds[c] for c in s)
    phi = tuple(sp.sympify(relations.get(q, q)) for q in eom.q)
    rates = {**dict(zip(s, sdot, strict=True)), **eom.rates}
    J = [[f.diff(c) for c in s] for f in phi]
    drift = [_total(f, eom.rates) for f in phi]
    vel = tuple(
        sp.Add(*(a * b for a, b in zip(row, sdot, strict=True)), d)
        for row, d in zip(J, drift, strict=True)
    )
    into = {**dict(zip(eom.q, phi, strict=True)), **dict(zip(eom.v, vel, strict=True))}
    c = [_total(f, rates) for f in vel]

    def inside(expression: Expr) -> Expr:
        return _tidy(sp.sympify(expression).xreplace(into))

    M = eom.M.todok()
    rest = [inside(f) for f in eom.F]
    mass = {ij: sp.sympify(m).xreplace(into) for ij, m in M.items()}
    for (i, j), m in mass.items():
        rest[i] -= m * c[j]
    N = len(s)
    Mr = {
        (a, b): _tidy(sp.Add(*(J[i][a] * m * J[j][b] for (i, j), m in mass.items())))
        for a in range(N)
        for b in range(N)
    }
    Fr = tuple(_tidy(sp.Add(*(J[i][a] * f for i, f in enumerate(rest)))) for a in range(N))
    rows, G, nu, gamma, f = _remaining(eom, J, drift, c, into, N)
    _check(eom, phi, into, s, sdot, rows)
    reduced = replace(
        eom,
        q=s,
        v=sdot,
        qdot=sdot,
        M=sp.SparseMatrix(N, N, {k: m for k, m in Mr.items() if m != 0}),
        F=Fr,
        G=G,
        nu=nu,
        gamma=gamma,
        f=f,
        kinetic=inside(eom.kinetic),
        potential=None if eom.potential is None else inside(eom.potential),
        outputs=(),  # those of the full system
    )
    return Reduction(s, sdot, phi, vel, reduced, rows)


def _total(expression: Expr, rates: dict[Expr, Expr]) -> Expr:
    """d/dt without the accelerations of s; of prescribed motions with them."""
    return sp.Add(*(expression.diff(x) * r for x, r in rates.items()), expression.diff(TIME))


def _tidy(expression: Expr) -> Expr:
    if expression.count_ops() > SMALL:
        return expression
    return sp.factor_terms(simplification.trigonometric(simplification.expanded(expression)))


def _relations(eom: EquationsOfMotion) -> tuple[dict[Expr, Expr], tuple[Expr, ...] | None]:
    """Dependent coordinate -> expression of the others; and the user's independent coordinates."""
    embedding = eom.model.embedding
    if embedding is not None:
        given = {eom.plain(q): eom.plain(phi) for q, phi in embedding.relations.items()}
        given = {q: phi for q, phi in given.items() if q in eom.q}
        used = set().union(*(phi.free_symbols for phi in given.values())) if given else set()
        return given, tuple(c for c in embedding.coordinates if eom.plain(c) in used)
    relations: dict[Expr, Expr] = {}
    for constraint, residual in zip(eom.constraints, eom.f, strict=True):
        if not isinstance(constraint, Holonomic) or constraint.while_closed is not None:
            continue
        f: Expr = residual
        if f.free_symbols & set(eom.u):
            continue  # a prescribed motion stays a constraint
        f = sp.expand(f.xreplace(relations))
        solved = _solve_linear(f, [q for q in eom.q if q not in relations])
        if solved is not None:
            q, phi = solved
            relations = {k: e.xreplace({q: phi}) for k, e in relations.items()} | {q: phi}
    if not relations:
        raise DerivationError(
            f"model {eom.model.name!r} has no minimal formulation: no holonomic constraint is linear "
            "in a coordinate with a coefficient that cannot vanish; give an Embedding q = phi(s), or "
            "use the formulation 'multipliers' or 'nullspace'"
        )
    return relations, None


def _solve_linear(f: Expr, candidates: list[Expr]) -> tuple[Expr, Expr] | None:
    """A coordinate in which f is linear, with a coefficient that cannot vanish; +-1 goes first."""
    found = []
    for order, q in enumerate(candidates):
        if not f.has(q):
            continue
        a = f.diff(q)
        if a.free_symbols & set(candidates) or a.has(TIME) or a.is_zero is not False:
            continue
        found.append((a not in (1, -1), -order, q, a))
    if not found:
        return None
    _, _, q, a = min(found, key=lambda item: item[:2])
    return q, sp.simplify(-(f - a * q) / a)


def _remaining(
    eom: EquationsOfMotion,
    J: list[list[Expr]],
    drift: list[Expr],
    c: list[Expr],
    into: dict[Expr, Expr],
    N: int,
) -> tuple[Any, Any, Any, Any, Any]:
    """The constraint rows that still act on s: G J, nu - G phi_t, gamma - G c."""
    rows: list[int] = []
    G: dict[tuple[int, int], Expr] = {}
    nu: list[Expr] = []
    gamma: list[Expr] = []
    f: list[Expr | None] = []
    for k in range(eom.m):
        a = {j: eom.G[k, j].xreplace(into) for j in range(eom.nv) if eom.G[k, j] != 0}
        reduced = [sp.simplify(sp.Add(*(a[j] * J[j][b] for j in a))) for b in range(N)]
        if all(r == 0 for r in reduced):
            continue
        G.update({(len(rows), b): r for b, r in enumerate(reduced) if r != 0})
        nu.append(eom.nu[k].xreplace(into) - sp.Add(*(a[j] * drift[j] for j in a)))
        gamma.append(eom.gamma[k].xreplace(into) - sp.Add(*(a[j] * c[j] for j in a)))
        position: Expr = eom.f[k]
        f.append(None if position is None else position.xreplace(into))
        rows.append(k)
    matrix = sp.SparseMatrix(len(rows), N, G)
    return tuple(rows), matrix, tuple(nu), tuple(gamma), tuple(f)


def _check(
    eom: EquationsOfMotion,
    phi: tuple[Expr, ...],
    into: dict[Expr, Expr],
    s: tuple[Expr, ...],
    sdot: tuple[Expr, ...],
    rows: tuple[int, ...],
) -> None:
    """The embedding satisfies each constraint that it removes, and leaves as many s as it should."""
    problems = []
    for k in range(eom.m):
        if k in rows:
            continue
        name = eom.constraints[k].name
        f = eom.f[k]
        if f is None:
            f = sp.Add(*(eom.G[k, j] * eom.v[j] for j in range(eom.nv))) - eom.nu[k]
        rest = sp.simplify(f.xreplace(into))
        if rest != 0 and not _vanishes(rest):
            problems.append(f"constraint {name!r} becomes {rest}, expected 0")
    J = sp.Matrix([[f.diff(c) for c in s] for f in phi])
    if J.rank(simplify=True) < len(s):
        problems.append(
            f"the independent coordinates {', '.join(map(str, s))} are not independent: "
            "dq/ds has dependent columns"
        )
    if problems:
        raise DerivationError(
            f"the embedding of model {eom.model.name!r} does not fit: " + "; ".join(problems)
        )


def _vanishes(expression: Expr) -> bool:
    """Numerically zero at ten random points to 30 digits (the symbolic test was undecided)."""
    generator = random.Random(7)
    symbols = sorted(expression.free_symbols, key=str)
    for _ in range(10):
        point = {s: sp.Rational(generator.randint(100, 2000), 997) for s in symbols}
        if abs(sp.N(expression.xreplace(point), 40)) > 1e-30:
            return False
    return True
