"""Solving f(x) = value for x: one branch of the inverse function."""

from __future__ import annotations

from sympy import (
    Add,
    Mul,
    Poly,
    PolynomialError,
    Pow,
    acos,
    asin,
    atan,
    cos,
    exp,
    log,
    sin,
    sqrt,
    tan,
    together,
)

from ...model.elements import Expr


def invert(f: Expr, value: Expr, x: Expr) -> Expr | None:
    """x with f(x) = value, by undoing one operation after the other; one branch of it."""
    undo = {exp: log, log: exp, sin: asin, asin: sin, cos: acos, acos: cos, tan: atan, atan: tan}
    for _ in range(20):
        if f == x:
            return value
        if isinstance(f, Add | Mul):
            rest, part = f.as_independent(x)
            if not isinstance(part, type(f)):
                value = value - rest if isinstance(f, Add) else value / rest
                f = part
                continue
        elif isinstance(f, Pow) and not f.exp.has(x):
            f, value = f.base, value ** (1 / f.exp)
            continue
        elif type(f) in undo:
            f, value = f.args[0], undo[type(f)](value)
            continue
        break
    try:
        polynomial = Poly(together(f - value).as_numer_denom()[0], x)
    except PolynomialError:
        return None
    if any(c.has(x) for c in polynomial.all_coeffs()) or polynomial.degree() not in (1, 2):
        return None
    if polynomial.degree() == 1:
        a, b = polynomial.all_coeffs()
        return -b / a
    a, b, c = polynomial.all_coeffs()
    return (-b + sqrt(b**2 - 4 * a * c)) / (2 * a)
