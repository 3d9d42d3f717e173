"""Potentials of exact forms, by quadratures that a short attempt of SymPy's finds."""

from __future__ import annotations

from collections.abc import Sequence

from sympy import Add, Dummy, Function, Integral, Pow, S, apart, erfc, erfi, expand, log, together
from sympy.core.function import AppliedUndef
from sympy.integrals.heurisch import heurisch
from sympy.integrals.manualintegrate import manualintegrate
from sympy.integrals.rationaltools import ratint

from ...model.elements import Expr
from .functions import Functions

_TERM = 40  # operations of a term that is integrated
_SHORT = 10  # operations of a term whose integral is searched for


def potential(row: Sequence[Expr], variables: Sequence[Expr]) -> Expr | None:
    """f with df/dx_i = row_i, for an exact row, by one quadrature for each variable."""
    for order in (1, -1):
        f = S.Zero
        for a, x in list(zip(row, variables, strict=True))[::order]:
            field = Functions(variables, [*row, f])
            rest = field.element(a - f.diff(x)) if f != 0 else field.element(a)
            if not field.is_zero(rest):
                term = quadrature(a if f == 0 else field.expr(rest), x)
                if term is None:
                    break
                f += term
        else:
            return f.as_independent(*variables, as_Add=True)[1]
    return None


def quadrature(expr: Expr, x: Expr) -> Expr | None:
    """The integral of `expr` by x, term by term, if a short attempt finds it."""
    attempts = [expand(expr), expr]
    if expr.is_rational_function(x):
        attempts.insert(0, apart(together(expr), x))
    for attempt in attempts:
        terms = [_primitive_of(term, x) for term in Add.make_args(attempt)]
        if None not in terms:
            return Add(*terms)
    return None


def _primitive_of(term: Expr, x: Expr) -> Expr | None:
    """By SymPy's rules, where all symbols are positive: what comes of it is verified afterwards."""
    constant, term = term.as_independent(x, as_Add=False)
    if term.has(Integral) or term.count_ops() > _TERM:
        return None
    if any(
        u.has(x) for u in term.atoms(AppliedUndef)
    ):  # of an unknown function, it is left as it stands
        s = Dummy("s", real=True)
        return constant * Integral(term.xreplace({x: s}), (s, S.Zero, x))
    names = {v: Dummy(v.name, positive=True) for v in sorted(term.free_symbols | {x}, key=str)}
    plain, variable = term.xreplace(names), names[x]
    if plain.is_rational_function(variable):
        found = ratint(plain, variable)
    elif len(_curved(plain, variable)) > 1:  # SymPy may search for minutes
        return None
    else:
        found = manualintegrate(plain, variable)
        if found.has(Integral) and plain.count_ops() <= _SHORT:
            found = heurisch(plain, variable) or found
    if found.has(Integral, S.NaN, S.ComplexInfinity):
        return None
    if found.has(erfc):  # of an imaginary argument
        found = expand(found.rewrite([erfc], erfi))
    return constant * found.xreplace({new: old for old, new in names.items()})


def _curved(term: Expr, x: Expr) -> set[Expr]:
    """Arguments of functions and roots that are not linear in x."""
    arguments = {
        node.exp * log(node.base) if isinstance(node, Pow) else node.args[0]
        for node in term.atoms(Function, Pow)
        if node.has(x) and not (isinstance(node, Pow) and node.exp.is_Integer)
    }
    return {u for u in arguments if u.diff(x).has(x)}
