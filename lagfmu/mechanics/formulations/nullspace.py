"""The `nullspace` formulation in symbols: lambda eliminated from Lagrange's equations.

    G S = 0 ,   S^T (M vdot - F) = 0 ,   G vdot = gamma              (ME 6590, eq. 9)

because S^T multiplies G^T lambda away.  A column of S is the generalized cross product of the rows
of G over r + 1 columns, S_i = (-1)^i det(G without column i): no division, so that S is a null vector
wherever G is defined.  With one free coordinate it vanishes nowhere but where G loses rank.
"""

from __future__ import annotations

import random
from itertools import combinations
from math import comb
from typing import Any

import sympy as sp
from sympy.polys.polyerrors import PolynomialError

from ...model.elements import Expr
from .. import simplification
from ..coupling import constrained_together
from ..equations import EquationsOfMotion

Pivots = tuple[int, ...]
TRIALS = 100  # choices of pivot columns that are compared


def null_space(eom: EquationsOfMotion) -> Expr:
    """S (n, N) with G S = 0, all constraints acting; N = n - r, r being the generic rank of G.

    Coordinates that constraints tie together are taken group by group; a coordinate without a
    constraint has a unit vector.  Redundant rows are left out.
    """
    columns: list[dict[int, Expr]] = []
    for coordinates, rows in constrained_together(eom):
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
    return max((len(rows) for _, rows in constrained_together(eom)), default=0)


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
