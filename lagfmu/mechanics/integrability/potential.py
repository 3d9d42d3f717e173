"""Potentials of exact forms: f with df/dx_i = a_i, by one quadrature for each variable.

What is left of a_i after the quadratures by the other variables does not depend on these (Ince,
*Ordinary Differential Equations*, ch. II).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sympy import Add, Mul, Pow, S, exp, expand, factor_terms, ilcm, log

from ...model.elements import Expr
from .quadrature import quadrature
from .tower import Tower
from .undecided import FAILURES


def potential(row: Sequence[Expr], variables: Sequence[Expr]) -> Expr | None:
    """f with df/dx_i = row_i, for an exact row."""
    count = len(variables)
    for order in (list(range(count)), list(range(count))[::-1]):
        f: Any = S.Zero
        done: list[Expr] = []
        for i in order:
            try:
                tower = Tower(variables, [*row, f])
                element = tower.element(row[i] - f.diff(variables[i]))
                part = S.Zero if tower.is_zero(element) else row[i]
                if part != 0 and f != 0:
                    part = tower.back(element)
                term = quadrature(without(part, done), variables[i])
            except FAILURES:
                term = None
            if term is None:
                f = None
                break
            f += term
            done.append(variables[i])
        if f is not None:
            return f
    return None


def without(expr: Expr, gone: Sequence[Expr]) -> Expr:
    """`expr`, which does not depend on the variables `gone`, written without them."""
    for x in gone:
        for value in (S.Zero, S.One, S(2), S.Half):
            if expr.has(x):
                plain = expr.subs(x, value)
                if plain.is_finite is not False and not plain.has(S.NaN, S.ComplexInfinity):
                    expr = plain
    return expr


def tidy(f: Expr | None) -> Expr | None:
    """A sum of logarithms with rational ratios is exponentiated: log(x) - w*t to x*exp(-w*t).

    A product with roots is raised to the power that removes them.
    """
    if f is None:
        return None
    powers = [factor.as_base_exp()[1] for factor in Mul.make_args(f)]
    if all(power.is_Rational for power in powers):
        return f ** ilcm(1, *[power.q for power in powers])
    terms = Add.make_args(expand(f))
    logs = [(term / node, node) for term in terms for node in term.args if isinstance(node, log)]
    logs += [(S.One, term) for term in terms if isinstance(term, log)]
    logs = [(c, node) for c, node in logs if not c.has(log) and node.args[0].free_symbols]
    if not logs:
        return f
    ratios = [((c / logs[0][0]).cancel(), node) for c, node in logs]
    inner = set().union(*(node.free_symbols for _, node in logs))
    if logs[0][0].free_symbols & inner or not all(r.is_Rational for r, _ in ratios):
        return f
    scale = ilcm(1, *[ratio.q for ratio, _ in ratios])
    rest = expand(f - Add(*[c * node for c, node in logs]))
    product = Mul(*[Pow(node.args[0], scale * ratio) for ratio, node in ratios])
    return factor_terms(product) * exp(expand(scale * rest / logs[0][0]))
