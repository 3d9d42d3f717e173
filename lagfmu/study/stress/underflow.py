"""How far underflow may move the value of an expression, whatever the order of its operations.

A product may lose what is below the smallest normal double eta, times its other factors, and each operation
passes on what its terms lost (running error analysis: Higham, Accuracy and Stability of Numerical
Algorithms, sect. 3.3, with eq. 2.8 for underflow). sqrt(x^2 + y^2) of 1e-300 m/s is 0: the root of eta.
"""

from __future__ import annotations

import sys

import sympy as sp

from ...model.elements import Expr

ETA = sp.Float(sys.float_info.min)


def underflow(e: Expr) -> Expr:
    """The largest error that underflow makes, as an expression of the same symbols; 0 of a symbol."""
    if e.is_Atom:
        return sp.S.Zero
    lost = [underflow(a) for a in e.args]
    if isinstance(e, sp.Add | sp.Max | sp.Min | sp.Abs):
        return sp.Add(*lost)
    if e.is_Mul:
        return _of_product(e.args, lost)
    if e.is_Pow and e.exp.is_number:
        return _of_power(sp.Abs(e.base), e.exp, lost[0])
    arguments = [sp.Dummy(real=True) for _ in e.args]
    slopes = [e.func(*arguments).diff(x) for x in arguments]
    values = dict(zip(arguments, e.args, strict=True))
    return ETA + sp.Add(
        *(
            sp.Abs(slope.xreplace(values)) * u
            for slope, u in zip(slopes, lost, strict=True)
            if u != 0 and not slope.has(sp.Derivative, sp.Subs, sp.DiracDelta)
        )
    )


def _of_product(factors: tuple[Expr, ...], lost: list[Expr]) -> Expr:
    """Any product of some of the factors may be lost, then multiplied by the others, or divide them."""
    sizes = [sp.Abs(f) + u for f, u in zip(factors, lost, strict=True)]
    passed = [sp.Mul(u, *sizes[:k], *sizes[k + 1 :]) for k, u in enumerate(lost)]
    own = ETA * sp.Mul(*(sp.Max(1, s) for s in sizes))
    divided = any(f.is_Pow and f.exp.is_negative for f in factors)
    return sp.Add(*passed) + own * (1 + sp.Mul(*sizes) if divided else 1)


def _of_power(size: Expr, exponent: Expr, lost: Expr) -> Expr:
    """|(x + u)^p - x^p| <= max(1, |p|) u y^(p - 1) with y = x + u, or x - u where p < 0; products of x."""
    if exponent.is_negative:
        return ETA - exponent * lost * sp.Max(0, size - lost) ** (exponent - 1)
    passed = sp.Max(1, exponent) * lost * (size + lost) ** (exponent - 1)
    return passed if exponent < 1 else passed + ETA * sp.Max(1, size + lost) ** exponent
