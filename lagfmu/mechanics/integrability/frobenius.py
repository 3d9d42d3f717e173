"""Frobenius' theorem and the derived flag of a codistribution, by linear algebra over its functions.

Reduced rows omega_i = dx_p + sum_f b_f dx_f, p being the pivots, span it; X_f = d/dx_f - sum_i b_if
d/dx_(p_i) are the fields they annul.  The codistribution is integrable where every d(omega_i)(X_f,
X_g) = X_f(b_g) - X_g(b_f) vanishes; else I(k+1) = {omega in I(k): d(omega) = 0 mod I(k)} ends in the
largest part that is (Bryant et al., *Exterior Differential Systems*, ch. II).  All ranks are generic:
they hold where no pivot vanishes.

First integrals in closed form, where an integrating factor is simple.

A factor mu with d(mu omega) = 0 is looked for as a product of powers of the variables, of the factors of
omega's coefficients and of omega's value on the field of all scalings, and of exponentials exp(c x)
(Darboux; for separable, homogeneous, Bernoulli and autonomous equations it is of that kind: Ince,
*Ordinary Differential Equations*, ch. II).  Of a set, each row by itself.  What is found counts only where
df = 0 along the system is proven.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import NamedTuple

import sympy as sp
from sympy.integrals.heurisch import heurisch
from sympy.integrals.rationaltools import ratint

from ...model.elements import Expr
from .zero import Undecided, is_zero, plain, short, slope

Row = Sequence[Expr]  # the coefficients of a one-form
Curvature = dict[tuple[int, int], list[Expr]]  # (f, g) -> d(omega_i)(X_f, X_g) of each reduced row


class Reduced(NamedTuple):
    """Rows in reduced echelon form, zero rows last, and the columns of their pivots."""

    rows: list[list[Expr]]
    pivots: list[int]


def rref(rows: Sequence[Row], width: int) -> Reduced:
    """Reduced row echelon form, with the pivots in the first `width` columns; raises Undecided."""
    matrix, pivots = sp.Matrix(rows).rref(iszerofunc=is_zero, simplify=short, normalize_last=False)
    return Reduced(matrix.applyfunc(short).tolist(), [p for p in pivots if p < width])


def closed(row: Row, variables: Row) -> bool:
    """d(omega) = 0 as it stands."""
    pairs = itertools.combinations(zip(row, variables, strict=True), 2)
    return all(is_zero(slope(b, x) - slope(a, y)) for (a, x), (b, y) in pairs)


def _along(f: int, value: Expr, basis: Reduced, variables: Row) -> Expr:
    """X_f(value), with X_f = d/dx_f - sum_i b_if d/dx_(p_i)."""
    pairs = zip(basis.rows, basis.pivots, strict=False)
    return slope(value, variables[f]) - sum(row[f] * slope(value, variables[p]) for row, p in pairs)


def curvature(basis: Reduced, variables: Row) -> Curvature:
    """d(omega_i)(X_f, X_g) = X_f(b_g) - X_g(b_f), omega_i being the reduced rows."""
    free = [j for j in range(len(variables)) if j not in basis.pivots]
    table = {}
    for f, g in itertools.combinations(free, 2):
        column = []
        for row in basis.rows:
            value = _along(f, row[g], basis, variables) - _along(g, row[f], basis, variables)
            column.append(sp.S.Zero if is_zero(value) else short(value))
        table[f, g] = column
    return table


def obstruction(
    matrix: Sequence[Row], bend: Curvature, pivots: Sequence[int]
) -> tuple[int | None, Expr, tuple[int, ...]]:
    """k, a coefficient of d(omega_k) wedge omega_1 ... that is not zero, and its place.

    The coefficient at dx_f, dx_g and the pivots is det(a_P) d(omega_k)(X_f, X_g), a_P being the pivot
    columns of independent forms, and omega_k = sum_i a_(k, p_i) (reduced row i).
    """
    found = []
    for (f, g), column in bend.items():
        for k, row in enumerate(matrix):
            value = sp.Add(*(row[p] * b for p, b in zip(pivots, column, strict=True)))
            if not is_zero(value):
                found.append((k, value, (f, g, *pivots)))
    if not found:
        return None, sp.S.Zero, ()
    k, value, where = min(found, key=lambda one: one[1].count_ops())
    independent = rref([[row[p] for row in matrix] for p in pivots], len(matrix)).pivots
    minor = sp.Matrix([[matrix[i][p] for p in pivots] for i in independent]).det(method="berkowitz")
    return k, short(value * minor), where


def derived_flag(
    basis: Reduced, bend: Curvature, variables: Row
) -> tuple[tuple[int, ...], Reduced]:
    """The ranks of the derived flag down to where it is stable, and the reduced rows there."""
    flag = [len(basis.rows)]
    while any(any(column) for column in bend.values()):
        kernel = sp.Matrix(list(bend.values())).nullspace(simplify=short, iszerofunc=is_zero)
        flag.append(len(kernel))
        rows = sp.Matrix(basis.rows)
        derived = [list(vector.T * rows) for vector in kernel]
        basis = rref(derived, len(variables)) if derived else Reduced([], [])
        bend = curvature(basis, variables)
    return tuple(flag), basis


FAILURES = (
    Undecided,
    ArithmeticError,
    NotImplementedError,
    sp.PolynomialError,
    TypeError,
    ValueError,
)
_FACTORABLE = 200  # operations of a coefficient that is factored
_SEARCHED = 20  # operations of a term whose integral is searched for


def first_integrals(
    forms: Sequence[Row], bottom: Reduced, variables: Row, known: Sequence[Expr]
) -> list[Expr]:
    """Independent first integrals of the integrable system of the reduced rows at the `bottom`.

    `forms` are the one-forms as they were given, and `known` candidates for integrals.
    """
    found: list[Expr] = []
    rows = forms if len(forms) == 1 else bottom.rows
    searched = itertools.chain.from_iterable(_integrals_of(row, variables) for row in rows)
    for f in itertools.chain(known, searched):
        with suppress(*FAILURES):
            if _independent(f, found, bottom, variables):
                found.append(f)
        if len(found) == len(bottom.rows):
            break
    return found


def _independent(f: Expr, found: Sequence[Expr], bottom: Reduced, variables: Row) -> bool:
    """df = 0 along the system, and the derivatives by the pivots are independent of those found."""
    free = (j for j in range(len(variables)) if j not in bottom.pivots)
    if not all(is_zero(_along(j, f, bottom, variables)) for j in free):
        return False
    matrix = [[slope(g, variables[p]) for p in bottom.pivots] for g in (*found, f)]
    return len(rref(matrix, len(bottom.pivots)).pivots) > len(found)


def _integrals_of(row: Row, variables: Row) -> Iterator[Expr]:
    """Candidates f with df = mu omega, for a form that is integrable by itself."""
    with suppress(*FAILURES):
        alone = rref([row], len(variables))
        if closed(row, variables):
            yield from _potential(row, variables)
        elif not any(any(column) for column in curvature(alone, variables).values()):
            form = _primitive(row)
            factors = (
                [sp.S.One] if closed(form, variables) else _integrating_factors(form, variables)
            )
            for mu in factors:
                for f in _potential([short(mu * a) for a in form], variables):
                    yield sp.exp(sp.expand(f)) if f.has(sp.log) else f  # x exp(-w t)


def _primitive(row: Row) -> Row:
    """The row times its common denominator, divided by the common factor of the rest."""
    quotients = [short(a) for a in row]
    below = sp.lcm_list([sp.fraction(a)[1] for a in quotients])
    above = [short(a * below) for a in quotients]
    factor = sp.gcd_list(above)
    return [short(a / factor) for a in above]


def _integrating_factors(form: Row, variables: Row) -> Iterator[Expr]:
    """mu = prod_m h_m**c_m with d(mu omega) = 0: linear in the constants c_m."""
    pairs = [(a, x) for a, x in zip(form, variables, strict=True) if a != 0]
    bases = {x: None for _, x in pairs} | {sp.exp(x): None for _, x in pairs}
    for a in (*(a for a, _ in pairs), short(sp.Add(*(a * x for a, x in pairs)))):
        if a.count_ops() <= _FACTORABLE:
            factors = (h for h, _ in sp.factor_list(a)[1])
            bases |= {h: None for h in factors if h.has(*variables)}
    powers = sp.symbols(f"c:{len(bases)}", cls=sp.Dummy)
    logarithm = sum(c * sp.log(h) for c, h in zip(powers, bases, strict=True))
    equations = []
    for (a, x), (b, y) in itertools.combinations(zip(form, variables, strict=True), 2):
        bend = slope(b, x) - slope(a, y)
        turned = slope(logarithm, x) * b - slope(logarithm, y) * a
        equations += _coefficients(bend + turned, variables)
    for solution in sp.linsolve(equations, *powers):
        chosen = (c.xreplace(dict.fromkeys(powers, sp.S.Zero)) for c in solution)
        yield sp.Mul(*[h**c for h, c in zip(bases, chosen, strict=True)])


def _coefficients(quotient: Expr, variables: Row) -> list[Expr]:
    """What has to vanish for the quotient to be zero for all values of the variables."""
    numerator = sp.fraction(short(quotient))[0]
    if not numerator.has(*variables):
        return [numerator]
    polynomial = sp.Poly(numerator)
    moving = [g for g in polynomial.gens if g.has(*variables)]
    return list(polynomial.as_poly(*moving).coeffs())


def _potential(row: Row, variables: Row) -> Iterator[Expr]:
    """f with df/dx_i = row_i, for an exact row, by one quadrature for each variable."""
    for order in (1, -1):
        f = sp.S.Zero
        for a, x in list(zip(row, variables, strict=True))[::order]:
            rest = a if f == 0 else short(a - plain(slope(f, x)))
            if not is_zero(rest):
                term = _quadrature(rest, x)
                if term is None:
                    break
                f += term
        else:
            yield f.as_independent(*variables, as_Add=True)[1]
            return


def _quadrature(expr: Expr, x: Expr) -> Expr | None:
    """The integral of `expr` by x where SymPy finds it soon; symbols count as positive, and what comes of
    it is verified afterwards."""
    names = {v: sp.Dummy(v.name, positive=True) for v in sorted(expr.free_symbols | {x}, key=str)}
    attempts = [sp.expand(expr), sp.factor_terms(expr)]
    if expr.is_rational_function(x):
        attempts = [sp.apart(expr, x)]
    for attempt in attempts:
        terms = [
            _primitive_of(term.xreplace(names), names[x]) for term in sp.Add.make_args(attempt)
        ]
        if None not in terms:
            return sp.Add(*terms).xreplace({new: old for old, new in names.items()})
    return None


def _primitive_of(term: Expr, x: Expr) -> Expr | None:
    constant, term = term.as_independent(x, as_Add=False)
    if term.is_rational_function(x):
        found = ratint(term, x)
    elif term.count_ops() > _SEARCHED or len(_curved(term, x)) > 1:
        return None
    else:
        found = heurisch(term, x)
    if found is None or found.has(sp.Integral, sp.nan, sp.zoo):
        return None
    return constant * found


def _curved(term: Expr, x: Expr) -> set[Expr]:
    """Arguments that are not linear in x: of several, SymPy may search for minutes."""
    nodes = [p for p in term.atoms(sp.Pow) if not p.exp.is_Integer] + [*term.atoms(sp.Function)]
    return {a for node in nodes for a in node.args if a.diff(x).has(x)}
