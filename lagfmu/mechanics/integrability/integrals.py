"""First integrals in closed form, where an integrating factor is simple.

One form omega: a factor mu with d(mu omega) = 0 is looked for as a product of powers of the variables, of
the factors of omega's coefficients and of omega's value on the field of all scalings, and of exponentials
exp(c x) (Darboux; for separable, homogeneous, Bernoulli and autonomous equations it is of that kind), or
as that of a linear equation (Ince, *Ordinary Differential Equations*, ch. II).  Several forms: those that
are integrable alone, one after the other, and sums of monomials with constant coefficients.
A candidate counts only where df = 0 along the system is proven.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

from sympy import (
    Add,
    Mul,
    PolynomialError,
    Rational,
    S,
    exp,
    expand,
    ilcm,
    log,
)
from sympy.polys.domains import QQ
from sympy.polys.matrices import DomainMatrix

from ...model.elements import Expr
from .frobenius import Row, along, closed, curvature, rref
from .functions import Functions
from .generators import Undecided
from .quadratures import potential

FAILURES = (Undecided, ArithmeticError, NotImplementedError, PolynomialError, TypeError, ValueError)
_UNKNOWNS = 90  # constants of a sum
_FACTORABLE = 40  # terms of a polynomial that is factored


def first_integrals(
    forms: Sequence[Sequence[Expr]],
    rows: Sequence[Sequence[Expr]],
    variables: Sequence[Expr],
    known: Sequence[Expr],
) -> list[Expr]:
    """Independent first integrals of the integrable system that the reduced `rows` span.

    `forms` are the one-forms as they were given, and `known` candidates for integrals.
    """
    found: list[Expr] = []
    for f in _candidates(forms, rows, variables, known):
        with suppress(*FAILURES):
            if _independent_integral(f, found, rows, variables):
                found.append(f)
        if len(found) == len(rows):
            break
    return found


def _candidates(
    forms: Sequence[Sequence[Expr]],
    rows: Sequence[Sequence[Expr]],
    variables: Sequence[Expr],
    known: Sequence[Expr],
) -> Iterator[Expr]:
    yield from known
    for row in forms if len(forms) == 1 else rows:
        yield from _integrals_of(row, variables)
    if len(rows) > 1:
        for degree in (1, 2):
            yield from _sums(rows, variables, degree)


def _independent_integral(
    f: Expr, found: Sequence[Expr], rows: Sequence[Sequence[Expr]], variables: Sequence[Expr]
) -> bool:
    """df = 0 along the system, and the derivatives by the pivots are independent of those found."""
    field = Functions(variables, [f, *found, *itertools.chain(*rows)])
    basis = [[field.element(entry) for entry in row] for row in rows]
    pivots = pivots_of(rows)
    value = field.element(f)
    if not all(
        field.is_zero(along(field, basis, pivots, j, value))
        for j in range(len(variables))
        if j not in pivots
    ):
        return False
    matrix = [[field.diff(field.element(g), variables[p]) for p in pivots] for g in (*found, f)]
    return len(rref(field, matrix, len(pivots))[1]) > len(found)


def pivots_of(rows: Sequence[Sequence[Expr]]) -> list[int]:
    """Where the reduced rows have their first entry."""
    return [next(j for j, entry in enumerate(row) if entry != 0) for row in rows]


# --- one form ------------------------------------------------------------------------------


def _integrals_of(row: Sequence[Expr], variables: Sequence[Expr]) -> Iterator[Expr]:
    """Candidates f with df = mu omega."""
    with suppress(*FAILURES):
        field = Functions(variables, row)
        given = [field.element(entry) for entry in row]
        if sum(map(bool, given)) > 1 and closed(field, given):  # then no factor makes it easier
            f = potential(row, variables)
            if f is not None:
                yield f
            return
        form = _primitive(field, given)
        place = next(i for i, a in enumerate(form) if a)
        alone = [field.over(a, form[place]) for a in form]
        if any(any(column) for column in curvature(field, [alone], [place]).values()):
            return
        for mu in _integrating_factors(field, form):
            f = potential([mu * field.expr(a) for a in form], variables)
            if f is not None:
                yield _without_logarithms(f)


def _primitive(field: Functions, row: Row) -> Row:
    """The row times its common denominator, divided by the common factor of the rest."""
    row = [field.lift(entry) for entry in row]
    below, above = field.K.ring.one, field.K.ring.zero
    for entry in row:
        field.admit(entry, field.K.raw_new(above, below))
        below, above = below.lcm(entry.denom), above.gcd(entry.numer)
    factor = field.K.new(below, above)
    return [field.times(entry, factor) for entry in row]


def _integrating_factors(field: Functions, form: Row) -> Iterator[Expr]:
    """mu with d(mu omega) = 0, for an integrable form."""
    if closed(field, form):
        yield S.One
        return
    yield from _darboux(field, form)
    places = [i for i, a in enumerate(form) if a]
    for p in places:  # linear in y: d(log mu) = sum_i (db_i/dy) dx_i for dy + sum_i b_i dx_i
        y = field.variables[p]
        slopes = [field.diff(field.over(a, form[p]), y) for a in form]
        if all(field.is_zero(field.diff(slope, y)) for slope in slopes):
            inner = potential([field.expr(slope) for slope in slopes], field.variables)
            if inner is not None:
                yield exp(expand(inner)) / field.expr(form[p])


def _darboux(field: Functions, form: Row) -> Iterator[Expr]:
    """mu = prod_m h_m**c_m with d(mu omega) = 0: linear in the constants c_m."""
    x = field.variables
    places = [i for i, a in enumerate(form) if a]
    scaled = field.plus(*[field.times(field.element(x[i]), form[i]) for i in places])
    bases: dict[Expr, None] = {x[i]: None for i in places}
    for a in (*(form[i] for i in places), scaled):
        if len(a.numer) <= _FACTORABLE:
            for factor, _ in a.numer.factor_list()[1]:
                h = factor.as_expr().xreplace(field.generators.meaning)
                if h.has(*x):
                    bases[h] = None
    bases |= {exp(x[i]): None for i in places}
    logarithms = [
        [field.over(field.diff(field.element(h), v), field.element(h)) for v in x] for h in bases
    ]
    pairs = list(itertools.combinations(range(len(x)), 2))
    columns = [
        [field.minus(field.diff(form[j], x[i]), field.diff(form[i], x[j])) for i, j in pairs]
    ]
    for slope in logarithms:
        columns.append(
            [
                field.minus(field.times(slope[i], form[j]), field.times(slope[j], form[i]))
                for i, j in pairs
            ]
        )
    for vector in relations(field, columns):
        if vector[0] != 0:
            yield Mul(*[h ** (c / vector[0]) for h, c in zip(bases, vector[1:], strict=True)])


def relations(field: Functions, columns: Sequence[Row]) -> list[list[Expr]]:
    """Vectors c of constants with sum_m c_m columns_m = 0 identically: every coefficient of it as a
    polynomial in the generators that are not constant has to vanish."""
    constants = field.constants()
    moving = [k for k, symbol in enumerate(field.K.symbols) if symbol not in constants]
    table: dict[Any, dict[int, Any]] = {}
    ring = field.K.ring
    for equation, entries in enumerate(zip(*columns, strict=True)):
        lifted = [field.lift(entry) for entry in entries]
        below = ring.one
        for entry in lifted:
            field.admit(entry, field.K.raw_new(ring.one, below))
            below = below.lcm(entry.denom)
        for m, entry in enumerate(lifted):
            entry = field.times(entry, field.K.raw_new(below))
            for monomial, coefficient in entry.numer.terms():
                outer = tuple(monomial[k] for k in moving)
                inner = tuple(0 if k in moving else e for k, e in enumerate(monomial))
                cells = table.setdefault((equation, outer), {})
                cells[m] = cells.get(m, ring.zero) + ring.term_new(
                    inner, coefficient / entry.denom.LC
                )
    width = len(columns)
    chance = random.Random(3)
    point = [(g, QQ(chance.randint(2, 99), chance.randint(2, 99))) for g in ring.gens]
    tried = [
        [QQ.convert(cells[m].evaluate(point)) if m in cells else QQ.zero for m in range(width)]
        for cells in table.values()
    ]
    if DomainMatrix(tried, (len(tried), width), QQ).rank() == width:
        return []
    domain = QQ.frac_field(*constants) if constants else QQ
    lines = [
        [domain.from_sympy(cells.get(m, ring.zero).as_expr()) for m in range(width)]
        for cells in table.values()
    ]
    kernel = DomainMatrix(lines, (len(lines), width), domain).nullspace().to_dense().to_list()
    meaning = field.generators.meaning
    return [[domain.to_sympy(c).xreplace(meaning) for c in vector] for vector in kernel]


def _sums(rows: Sequence[Sequence[Expr]], variables: Sequence[Expr], degree: int) -> Iterator[Expr]:
    """f = sum of monomials in variables and functions, with constant coefficients."""
    with suppress(*FAILURES):
        field = Functions(variables, itertools.chain(*rows))
        basis = [[field.element(entry) for entry in row] for row in rows]
        pivots = pivots_of(rows)
        fixed = field.constants()
        atoms = [s for s in field.K.symbols if s not in fixed]
        atoms = [field.generators.meaning[s] for s in atoms]
        monomials = [
            Mul(*factors)
            for count in range(1, degree + 1)
            for factors in itertools.combinations_with_replacement(atoms, count)
        ]
        if len(monomials) > _UNKNOWNS:
            return
        free = [j for j in range(len(variables)) if j not in pivots]
        columns = [
            [along(field, basis, pivots, j, field.element(monomial)) for j in free]
            for monomial in monomials
        ]
        for vector in relations(field, columns):
            first = next(c for c in vector if c != 0)
            yield Add(*[(c / first).cancel() * g for c, g in zip(vector, monomials, strict=True)])


def _without_logarithms(f: Expr) -> Expr:
    """A sum of logarithms with rational ratios is exponentiated: log(x) - w*t to x*exp(-w*t)."""
    logs = [
        term.as_independent(log, as_Add=False) for term in Add.make_args(expand(f)) if term.has(log)
    ]
    if not logs:
        return f
    ratios = [(factor / logs[0][0]).cancel() for factor, node in logs]
    if not all(isinstance(node, log) for _, node in logs) or not all(
        isinstance(ratio, Rational) for ratio in ratios
    ):
        return f
    scale = ilcm(1, *[ratio.q for ratio in ratios])
    return exp(expand(scale * f / logs[0][0]))
