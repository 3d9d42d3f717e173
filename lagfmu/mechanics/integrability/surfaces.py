"""Pfaffian forms on the surfaces f(q, t) = 0 of holonomic constraints.

An f that is linear in a coordinate, with a factor that is constant, is solved for it, and the coordinate
and its velocity are put into the forms and into the other f: exact, and f is gone.  An f that is not
stays, and its differential has to join the forms.
"""

from __future__ import annotations

from collections.abc import Sequence

from sympy import Expr, Symbol, expand, sympify
from sympy.physics.mechanics import dynamicsymbols

_SHORT = 60  # operations of a coordinate's value that is put in


def on_surfaces(
    forms: Sequence[Expr], coordinates: Sequence[Expr], holonomic: Sequence[Expr]
) -> tuple[tuple[Expr, ...], tuple[Expr, ...], tuple[Expr, ...]]:
    """The forms, the f that are left, and the coordinates that are left."""
    forms, left = list(forms), [sympify(f) for f in holonomic]
    free, kept = list(coordinates), []
    while left:
        left.sort(key=lambda f: f.count_ops())
        f = left.pop(0)
        solved = _solved(f, free)
        if solved is None:
            kept.append(f)
            continue
        q, value = solved
        free.remove(q)
        forms = [_put(form, q, value) for form in forms]
        left = [g for g in (_put(g, q, value) for g in (*left, *kept)) if g != 0]
        kept = []
    return tuple(forms), tuple(kept), tuple(free)


def _solved(f: Expr, coordinates: Sequence[Expr]) -> tuple[Expr, Expr] | None:
    """A coordinate that f = 0 gives, and its value."""
    for q in coordinates:
        factor = f.diff(q)
        if factor == 0 or not all(isinstance(s, Symbol) for s in factor.free_symbols):
            continue
        moving = factor.has(dynamicsymbols._t, *coordinates)
        if not moving and (factor.is_number or factor.is_Symbol or factor.is_nonzero):
            value = expand(q - f / factor)
            if not value.has(q) and value.count_ops() <= _SHORT:
                return q, value
    return None


def _put(expr: Expr, q: Expr, value: Expr) -> Expr:
    time = dynamicsymbols._t
    if not expr.has(q):
        return expr
    rate = value.diff(time)
    return expr.xreplace({q.diff(time): rate}).xreplace({q: value})
