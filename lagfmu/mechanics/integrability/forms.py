"""The one-form of a constraint: sum_j a_j(q, t) q_j' + a_0(q, t) is sum_j a_j dq_j + a_0 dt.

It lives on the space of (q, t), whose coordinates are independent real symbols there, or on the surfaces
f(q, t) = 0 of holonomic constraints in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sympy import Dummy, Eq, S, Symbol, expand, simplify, sympify
from sympy.physics.mechanics import dynamicsymbols

from ...errors import DerivationError
from ...model.elements import Expr

_SHORT = 60  # operations of a coordinate's value that is put in


def pfaffian(form: Expr, coordinates: Sequence[Expr]) -> tuple[list[Expr], Expr]:
    """The coefficients (a_1, ..., a_n) and a_0 of sum_j a_j q_j' + a_0.

    Raises `DerivationError`, which names the term, if the form is not linear in the velocities.
    """
    time = dynamicsymbols._t
    form = form.lhs - form.rhs if isinstance(form, Eq) else sympify(form)
    if any(form.has(q.diff(time, 2)) for q in coordinates):
        raise DerivationError(
            f"constraint {form} has accelerations: a Pfaffian constraint is linear in the "
            "velocities; integrate it once, or leave it to the dynamics"
        )
    speeds = {q.diff(time): Dummy(f"v{j}") for j, q in enumerate(coordinates)}
    plain = form.xreplace(speeds)
    v = list(speeds.values())
    coefficients = [plain.diff(speed) for speed in v]
    coefficients = [simplify(expand(a)) if a.has(*v) else a for a in coefficients]
    if any(a.has(*v) for a in coefficients):
        back = {speed: rate for rate, speed in speeds.items()}
        terms = [
            str(term.xreplace(back))
            for term in expand(plain).as_ordered_terms()
            if any(term.diff(one, two) != 0 for one in v for two in v)
        ]
        raise DerivationError(
            f"constraint {form} is not linear in the velocities: {', '.join(terms) or form}; "
            "a Pfaffian constraint is sum_j a_j(q, t)*q_j' + a_0(q, t) = 0"
        )
    return coefficients, plain.xreplace(dict.fromkeys(v, S.Zero))


class Chart:
    """Coordinates q_j(t) and t as independent real symbols, and back."""

    def __init__(self, coordinates: Sequence[Expr], entries: Sequence[Expr]) -> None:
        used: set[Any] = set().union(*(entry.free_symbols for entry in entries))
        names = [str(getattr(q, "func", q)) for q in coordinates]
        self.variables = [Dummy(name, real=True) for name in [*names, "t"]]
        self._there = dict(zip([*coordinates, dynamicsymbols._t], self.variables, strict=True))
        for symbol in sorted(used - set(self._there), key=str):
            if symbol.is_extended_real is None:
                self._there[symbol] = Dummy(symbol.name, real=True)
        self._back = {value: key for key, value in self._there.items()}

    def there(self, expr: Expr) -> Expr:
        return expr.xreplace(self._there)

    def back(self, expr: Expr) -> Expr:
        return sympify(expr).xreplace(self._back)


def on_surfaces(
    forms: Sequence[Expr], coordinates: Sequence[Expr], holonomic: Sequence[Expr]
) -> tuple[tuple[Expr, ...], tuple[Expr, ...], tuple[Expr, ...]]:
    """The forms, the f and the coordinates that are left.

    An f that is linear in a coordinate, with a factor that is constant, is solved for it, and the
    coordinate and its velocity are put into the forms and into the other f: exact, and f is gone.  An f
    that is not stays, and its differential has to join the forms.
    """
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
    return expr.xreplace({q.diff(time): value.diff(time)}).xreplace({q: value})
