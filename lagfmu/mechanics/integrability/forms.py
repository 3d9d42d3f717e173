"""The one-form of a constraint: sum_j a_j(q, t) q_j' + a_0(q, t) is sum_j a_j dq_j + a_0 dt.

It lives on the space of (q, t), whose coordinates are independent real symbols there, or on the surfaces
f(q, t) = 0 of holonomic constraints in it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sympy import Dummy, Eq, S, expand, simplify, sympify

from ...errors import DerivationError
from ...model.elements import TIME, Expr
from .zero import plain

_SHORT = 60  # operations of a coordinate's value that is put in


def pfaffian(form: Expr, coordinates: Sequence[Expr]) -> tuple[list[Expr], Expr]:
    """The coefficients (a_1, ..., a_n) and a_0 of sum_j a_j q_j' + a_0.

    Raises `DerivationError`, which names the term, if the form is not linear in the velocities.
    """
    form = form.lhs - form.rhs if isinstance(form, Eq) else sympify(form)
    if any(form.has(q.diff(TIME, 2)) for q in coordinates):
        raise DerivationError(
            f"constraint {form} has accelerations: a Pfaffian constraint is linear in the "
            "velocities; integrate it once, or leave it to the dynamics"
        )
    speeds = {q.diff(TIME): Dummy(f"v{j}") for j, q in enumerate(coordinates)}
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
        self._there = dict(zip([*coordinates, TIME], self.variables, strict=True))
        for symbol in sorted(used - set(self._there), key=str):
            if symbol.is_extended_real is None:
                self._there[symbol] = Dummy(symbol.name, real=True)
        self._back = {value: key for key, value in self._there.items()}

    def there(self, expr: Expr) -> Expr:
        return plain(expr.xreplace(self._there))

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
    left, kept, free = list(forms), [], list(coordinates)
    surfaces = sorted(map(sympify, holonomic), key=lambda f: f.count_ops())
    while surfaces:
        f = surfaces.pop(0)
        solved = ((q, expand(q - f / f.diff(q))) for q in free if _is_constant(f.diff(q)))
        q, value = next(solved, (None, S.NaN))
        if q is None or value.count_ops() > _SHORT:
            kept.append(f)
            continue
        free.remove(q)
        put = {q.diff(TIME): value.diff(TIME)}
        left, surfaces, kept = (
            [e.xreplace(put).xreplace({q: value}) for e in group]
            for group in (left, surfaces, kept)
        )
    return tuple(left), tuple(f for f in kept if f != 0), tuple(free)


def _is_constant(factor: Expr) -> bool:
    """It depends on parameters alone, and is not zero whatever they are."""
    if factor.has(TIME):
        return False
    return bool(factor.is_Symbol or factor.is_nonzero)
