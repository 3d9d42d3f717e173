"""Integrals by one variable, where a short attempt finds them.

Each term is integrated on its own: products of powers, exponentials, sines and cosines by
int z**n exp(s z) dz with a complex rate s; rational functions and one function of a curved argument by
SymPy (Bronstein, *Symbolic Integration I*, ch. 2).  The integral of an unknown function is left as it stands.
"""

from __future__ import annotations

from functools import lru_cache

from sympy import (
    Add,
    Dummy,
    Function,
    I,
    Integral,
    Mul,
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
    exp,
    expand,
    integrate,
    log,
    sec,
    sin,
    together,
)
from sympy.core.function import AppliedUndef
from sympy.integrals.manualintegrate import manualintegrate
from sympy.simplify.fu import TR8

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
    for method in (_oscillation, _heuristics):
        try:
            found = method(plain, variable)
        except Exception:  # SymPy's heuristics may raise anything
            continue
        if found is None:
            continue
        while found.has(Piecewise):
            piece = next(iter(found.atoms(Piecewise)))
            found = found.xreplace({piece: piece.args[0].expr})
        found = found.replace(erfc, _error_function)
        if not found.has(Integral, S.NaN, S.ComplexInfinity):
            return found.xreplace({new: old for old, new in names.items()})
    return None


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


def _oscillation(term: Expr, x: Expr) -> Expr | None:
    """The integral of a sum of x**n exp(a x) sin(b x + c), products of sines included."""
    if not term.has(sin, cos, exp):
        return None
    total: Expr = S.Zero
    for part in Add.make_args(expand(TR8(term))):
        constant, rest = part.as_independent(x, as_Add=False)
        power, exponent, wave = 0, S.Zero, None
        for factor in Mul.make_args(rest):
            if isinstance(factor, exp):
                exponent += factor.args[0]
            elif isinstance(factor, sin | cos) and wave is None:
                wave = factor
            elif factor != 1:
                base, power = factor.as_base_exp()
                if base != x or not power.is_Integer or not 0 <= power <= 6:
                    return None
        rate = expand(exponent).diff(x)
        angle = wave.args[0] if wave is not None else S.Zero
        turn = angle.diff(x)
        if rate.has(x) or turn.has(x) or rate == turn == 0:
            return None
        # y = (u cos + v sin) exp is stood for by u - i v: to integrate is to divide by a + i b
        u, v = (S.One, S.Zero) if wave is None or isinstance(wave, cos) else (S.Zero, S.One)
        size = rate**2 + turn**2
        for k in range(power, -1, -1):
            u, v = (u * rate - v * turn) / size, (u * turn + v * rate) / size
            total += constant * x**k * (u * cos(angle) + v * sin(angle)) * exp(exponent)
            constant *= -k
    return total
