"""The form in which a model is simulated: its equations, or what they are reduced to.

The `minimal` formulation: dependent coordinates eliminated by q = phi(s, t).

    v = J sdot + dphi/dt ,   J = dphi/ds ,
    (J^T M J) sddot = J^T (F - M c) ,   c = dJ/dt sdot + d/dt dphi/dt       (ME 6590, scenario a)

The relations come from constraints that are linear in a coordinate (y - R theta = 0), found here, or
from an Embedding that the user gives, which is checked.  The multipliers drop out, because G J = 0, and
are recovered from the full system at the state.

The `nullspace` formulation in symbols: lambda eliminated from Lagrange's equations.

    G S = 0 ,   S^T (M vdot - F) = 0 ,   G vdot = gamma              (ME 6590, eq. 9)

because S^T multiplies G^T lambda away.  A column of S is the generalized cross product of the rows
of G over r + 1 columns, S_i = (-1)^i det(G without column i): no division, so that S is a null vector
wherever G is defined.  With one free coordinate it vanishes nowhere but where G loses rank.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from itertools import combinations
from math import comb
from typing import Any

import sympy as sp
from sympy.polys.polyerrors import PolynomialError
from sympy.utilities.iterables import connected_components

from ..errors import DerivationError
from ..model.elements import TIME, Expr
from ..model.model import Constraint, Holonomic
from . import simplification
from .equations import EquationsOfMotion
from .kinematics import JointCoordinate

Group = tuple[frozenset[int], frozenset[int]]  # speeds, rows


def coupled(eom: EquationsOfMotion) -> list[Group]:
    """What one linear solve ties together, by the sparsity of M, G and frictions."""
    position = {c.name: eom.nv + k for k, c in enumerate(eom.constraints)}
    pairs = list(eom.M.todok())
    for law in eom.frictions:
        first, *others = (position[name] for name in (*law.of, *law.normal_rows))
        pairs += [(first, i) for i in others]
    return _tied(eom, pairs)


def _constrained_together(eom: EquationsOfMotion) -> list[Group]:
    """What the constraints alone tie together; rows that hold nothing are left out."""
    return [group for group in _tied(eom, []) if group[0]]


def sharing_inertia(eom: EquationsOfMotion) -> list[frozenset[int]]:
    """The speeds that the mass matrix alone ties together."""
    return [frozenset(g) for g in connected_components((range(eom.nv), list(eom.M.todok())))]


def _tied(eom: EquationsOfMotion, pairs: list[tuple[int, int]]) -> list[Group]:
    pairs = [*pairs, *((eom.nv + k, j) for k, j in eom.G.todok())]
    groups = connected_components((range(eom.nv + eom.m), pairs))
    return [
        (frozenset(i for i in g if i < eom.nv), frozenset(i - eom.nv for i in g if i >= eom.nv))
        for g in sorted(groups, key=min)
    ]


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


@dataclass(frozen=True)
class Form:
    """`equations` of all coordinates; the `reduction` to independent ones, where the formulation is
    'minimal' and more than these is read."""

    equations: EquationsOfMotion
    reduction: Reduction | None = None
    formulation: str = "multipliers"

    @property
    def joint_coordinates(self) -> tuple[JointCoordinate, ...]:
        """Those by which an importer may give the start: where all coordinates are stepped."""
        return self.equations.joint_coordinates if self.reduction is None else ()

    @property
    def stepped(self) -> EquationsOfMotion:
        """The equations of the coordinates that are stepped."""
        return self.equations if self.reduction is None else self.reduction.reduced


Pivots = tuple[int, ...]
TRIALS = 100  # choices of pivot columns that are compared


def null_space(eom: EquationsOfMotion) -> Expr:
    """S (n, N) with G S = 0, all constraints acting; N = n - r, r being the generic rank of G.

    Coordinates that constraints tie together are taken group by group; a coordinate without a
    constraint has a unit vector.  Redundant rows are left out.
    """
    columns: list[dict[int, Expr]] = []
    for coordinates, rows in _constrained_together(eom):
        columns += _group_columns(eom.G, sorted(coordinates), sorted(rows))
    entries = {(i, b): e for b, column in enumerate(columns) for i, e in column.items()}
    return sp.SparseMatrix(eom.nv, len(columns), entries)


def lambda_free(eom: EquationsOfMotion) -> list[Expr]:
    """n - r equations S^T (M vdot - F) = 0, then the m equations G vdot - gamma = 0.

    Expressions in q, v and the symbols der(q,2), without the factors that all terms share.
    """
    vdot = eom.vdot
    inertia = [-f for f in eom.F]
    for (i, j), mass in eom.M.todok().items():
        inertia[i] += mass * vdot[j]
    S = null_space(eom)
    found = []
    for b in range(S.cols):
        column = [(i, S[i, b]) for i in range(eom.nv) if S[i, b] != 0]
        found.append(_reduced(sp.Add(*(s * inertia[i] for i, s in column)), eom))
    for k in range(eom.m):
        row = (eom.G[k, j] * vdot[j] for j in range(eom.nv) if eom.G[k, j] != 0)
        found.append(_reduced(sp.Add(*row, -eom.gamma[k]), eom))
    return found


def largest_group(eom: EquationsOfMotion) -> int:
    """The largest number of constraints in one group of coordinates: the size of S's minors."""
    return max((len(rows) for _, rows in _constrained_together(eom)), default=0)


def _group_columns(G: Expr, coordinates: list[int], rows: list[int]) -> list[dict[int, Expr]]:
    if not rows:
        return [{j: sp.S.One} for j in coordinates]
    numbers = _at_random(G.extract(rows, coordinates))
    independent = _independent(numbers, range(len(rows)))
    A = G.extract([rows[k] for k in independent], coordinates)
    r, c = A.shape
    pivots: Pivots = () if c == r + 1 else _pivots(A, numbers.extract(independent, list(range(c))))
    columns = []
    for free in (j for j in range(c) if j not in pivots):
        over = sorted({*pivots, free}) if pivots else list(range(c))
        minors = [
            _determinant(A.extract(list(range(r)), [j for j in over if j != i])) for i in over
        ]
        cross = [(-1) ** k * minor for k, minor in enumerate(minors)]
        cross = _primitive(cross)
        columns.append({coordinates[i]: e for i, e in zip(over, cross, strict=True) if e != 0})
        if not pivots:
            break  # one free coordinate: one column
    return columns


def _determinant(A: Expr) -> Expr:
    d = A.det(method="berkowitz") if A.rows else sp.S.One
    return simplification.simplified(d)


def _primitive(column: list[Expr]) -> list[Expr]:
    """The column without a factor that all its entries share."""
    filled = [e for e in column if e != 0]
    if any(e.has(sp.Float) for e in filled) or not simplification.bounded(sp.Add(*filled)):
        return column
    try:
        factor = sp.gcd_list(filled)
        column = [sp.cancel(e / factor) for e in column]
    except PolynomialError:  # Piecewise and the like: keep the minors
        return column
    return [simplification.simplified(e) for e in column]


def _at_random(A: Expr) -> Expr:
    """A at one random point, to 40 digits: its rank there is the generic one."""
    generator = random.Random(11)
    symbols = sorted(A.free_symbols, key=str)
    point = {s: sp.Float(sp.Rational(generator.randint(200, 1900), 1009), 40) for s in symbols}
    return A.applyfunc(lambda e: sp.N(e.xreplace(point), 40))


def _independent(numbers: Expr, order: Any) -> list[int]:
    """Rows that add to the rank, taken greedily in `order`."""
    rows = list(order)
    columns = numbers.extract(rows, list(range(numbers.cols))).T
    small = 1e-25 * max((abs(x) for x in columns), default=0)
    return [rows[k] for k in columns.rref(iszerofunc=lambda x: abs(x) <= small)[1]]


def _pivots(A: Expr, numbers: Expr) -> Pivots:
    """Columns whose minor is not zero identically; one that cannot vanish anywhere goes first."""
    r, c = A.shape
    columns = list(range(c))
    simple_first = sorted(columns, key=lambda j: (A.col(j).applyfunc(sp.count_ops).norm(1), j))
    if comb(c, r) > TRIALS or r > 4:
        return tuple(sorted(_independent(numbers.T, simple_first)))
    ranked = []
    for chosen in combinations(columns, r):
        if len(_independent(numbers.T, chosen)) == r:
            minor = _determinant(A.extract(list(range(r)), list(chosen)))
            ranked.append((minor.is_zero is not False, sp.count_ops(minor), chosen))
    best: Pivots = min(ranked)[2]
    return best


def _reduced(equation: Expr, eom: EquationsOfMotion) -> Expr:
    """An equation = 0 without denominators' and other common factors, in a short form."""
    if simplification.terms(equation) > simplification.TERMS:
        return equation
    equation = sp.expand(equation)
    if equation.has(sp.Function):
        equation = simplification.expanded(simplification.trigonometric(equation))
    try:
        factors = simplification.factors(equation)
    except PolynomialError:
        factors = [(e, 1) for e in sp.Mul.make_args(sp.factor_terms(equation))]
    for symbols in (set(eom.vdot), {*eom.q, *eom.v, *eom.u}):
        kept = [e**power for e, power in factors if e.free_symbols & symbols]
        if kept:
            return _sign(sp.expand(sp.Mul(*kept)), eom)
    return equation


def _sign(equation: Expr, eom: EquationsOfMotion) -> Expr:
    """The sign for which the first acceleration in the equation has a plus."""
    for symbol in eom.vdot:
        slope = equation.diff(symbol)
        if slope != 0:
            return -equation if slope.could_extract_minus_sign() else equation
    return equation
