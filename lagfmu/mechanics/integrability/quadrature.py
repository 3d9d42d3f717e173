"""Integrals by one variable, where a short attempt finds them.

Each term is integrated on its own by SymPy: rational functions (Bronstein, *Symbolic Integration I*, ch. 2),
and what its rules for people find.  The integral of an unknown function is left as it stands.
"""

from __future__ import annotations

from functools import lru_cache

from sympy import (
    Add,
    Dummy,
    Function,
    I,
    Integral,
    Piecewise,
    Poly,
    Pow,
    S,
    apart,
    cos,
    csc,
    erf,
    erfc,
    erfi,
    expand,
    integrate,
    log,
    sec,
    sin,
    together,
)
from sympy.core.function import AppliedUndef
from sympy.integrals.manualintegrate import manualintegrate

from ...model.elements import Expr
from .undecided import late, spend

_LONG = 600  # operations of an integrand beyond which no integration is tried
_TERM = 40  # operations of one term of it
_SEARCHING = 2e4  # effort of the search for its integral, an operation


def quadrature(expr: Expr, x: Expr) -> Expr | None:
    """The integral of `expr` by x, if a short attempt finds it."""
    if not expr.has(x):
        return expr * x
    if expr.count_ops() > _LONG:
        return None
    attempts = [expand(expr), expr]
    if expr.is_rational_function(x):
        attempts.insert(0, apart(together(expr), x))
    for attempt in attempts:
        total: Expr = S.Zero
        for term in Add.make_args(attempt):
            constant, rest = term.as_independent(x, as_Add=False)
            inner = _primitive_of(rest, x)
            if inner is None:
                break
            total += constant * inner
        else:
            return total
    return None


def _primitive_of(term: Expr, x: Expr) -> Expr | None:
    if term.count_ops() > _TERM or term.has(Integral) or late():
        return None
    if any(u.has(x) for u in term.atoms(AppliedUndef)):
        s = Dummy("s", real=True)
        for low in (S.Zero, S.One):
            if not term.subs(x, low).has(S.NaN, S.ComplexInfinity, S.Infinity):
                return Integral(term.xreplace({x: s}), (s, low, x))
        return None
    spend(_SEARCHING * term.count_ops())
    return _search(term, x)


@lru_cache(maxsize=500)
def _search(term: Expr, x: Expr) -> Expr | None:
    # where all symbols are positive: the primitive is verified for what they are, afterwards
    names = {v: Dummy(v.name, positive=True) for v in sorted(term.free_symbols | {x}, key=str)}
    plain, variable = term.xreplace(names), names[x]
    try:
        found = _heuristics(plain, variable)
    except Exception:  # SymPy's heuristics may raise anything
        return None
    if found is None:
        return None
    while found.has(Piecewise):
        piece = next(iter(found.atoms(Piecewise)))
        found = found.xreplace({piece: piece.args[0].expr})
    found = found.replace(erfc, _error_function)
    if found.has(Integral, S.NaN, S.ComplexInfinity):
        return None
    return found.xreplace({new: old for old, new in names.items()})


def _error_function(u: Expr) -> Expr:
    """erfc(u) less a constant, and real for an imaginary u: erf(i u) = i erfi(u)."""
    return -I * erfi(u / I) if u.as_coefficient(I) is not None else -erf(u)


def _heuristics(term: Expr, x: Expr) -> Expr | None:
    """SymPy's, which may take minutes: not for terms with several functions of curved arguments."""
    if term.is_rational_function(x):
        above, below = (Poly(part, x).degree() for part in together(term).as_numer_denom())
        if above + below > 12:
            return None
        return integrate(term, x, risch=False, meijerg=False, heurisch=False, manual=False)
    curved = {
        node.exp * log(node.base) if isinstance(node, Pow) else node.args[0]
        for node in term.atoms(Function, Pow)
        if node.has(x) and not (isinstance(node, Pow) and node.exp.is_Integer)
    }
    curved = {u for u in curved if u.diff(x).has(x)}
    if len(curved) > 1:
        return None
    if curved:
        (u,), v = curved, Dummy("v", positive=True)
        plain = (term / u.diff(x)).subs(u, v)
        if not plain.has(x):
            found = _heuristics(plain, v)
            return found if found is None else found.xreplace({v: u})
        if term.count_ops() > 10:
            return None
    found = manualintegrate(term, x)
    if not found.has(Integral):
        return found
    inverse = {cos: sec, sin: csc}
    other = term.replace(
        lambda e: isinstance(e, Pow) and e.exp.is_negative and type(e.base) in inverse,
        lambda e: inverse[type(e.base)](*e.base.args) ** -e.exp,
    )
    return None if other == term else manualintegrate(other, x)
