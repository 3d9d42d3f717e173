"""The one-form of a constraint: sum_j a_j(q, t) q_j' + a_0(q, t) is sum_j a_j dq_j + a_0 dt.

It lives on the space of (q, t), whose coordinates are independent real symbols there.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from sympy import Dummy, Eq, S, expand, simplify, sympify
from sympy.physics.mechanics import dynamicsymbols

from ...errors import DerivationError
from ...model.elements import Expr


def pfaffian(form: Expr, coordinates: Sequence[Expr]) -> tuple[list[Expr], Expr]:
    """The coefficients (a_1, ..., a_n) and a_0 of sum_j a_j q_j' + a_0.

    Raises `DerivationError`, which names the term, if the form is not linear in the velocities.
    """
    time = dynamicsymbols._t
    if isinstance(form, Eq):
        form = form.lhs - form.rhs
    form = sympify(form)
    speeds = [Dummy(f"v{j}") for j in range(len(coordinates))]
    plain = form.subs(
        {q.diff(time, 2): Dummy("acceleration") for q in coordinates if form.has(q.diff(time, 2))}
    )
    if plain != form:
        raise DerivationError(
            f"constraint {form} has accelerations: a Pfaffian constraint is linear in the "
            "velocities; integrate it once, or leave it to the dynamics"
        )
    names = dict(zip([q.diff(time) for q in coordinates], speeds, strict=True))
    plain = form.xreplace(names)
    coefficients = [_coefficient(plain, v) for v in speeds]
    if any(coefficient.has(*speeds) for coefficient in coefficients if speeds):
        back = {v: q for q, v in names.items()}
        terms = [
            term
            for term in expand(plain).as_ordered_terms()
            if any(term.diff(v, w) != 0 for v in speeds for w in speeds)
        ]
        listed = ", ".join(str(term.xreplace(back)) for term in terms) or str(form)
        raise DerivationError(
            f"constraint {form} is not linear in the velocities: {listed}; a Pfaffian constraint "
            "is sum_j a_j(q, t)*q_j' + a_0(q, t) = 0"
        )
    rest = plain.xreplace(dict.fromkeys(speeds, S.Zero))
    return coefficients, rest


def _coefficient(plain: Expr, speed: Expr) -> Expr:
    slope = plain.diff(speed)
    if any(isinstance(v, Dummy) and v.name.startswith("v") for v in slope.free_symbols):
        slope = simplify(expand(slope))
    return slope


class Chart:
    """Coordinates q_j(t) and t as independent real symbols, and back."""

    def __init__(self, coordinates: Sequence[Expr], used: set[Any]) -> None:
        time = dynamicsymbols._t
        names = [str(getattr(q, "func", q)) for q in coordinates]
        self.variables = [Dummy(name, real=True) for name in [*names, "t"]]
        self._there = dict(zip([*coordinates, time], self.variables, strict=True))
        for symbol in sorted(used - set(self._there), key=str):
            if symbol.is_extended_real is None:
                self._there[symbol] = Dummy(symbol.name, real=True)
        self._back = {value: key for key, value in self._there.items()}

    def there(self, expr: Expr) -> Expr:
        return expr.xreplace(self._there)

    def back(self, expr: Expr) -> Expr:
        return sympify(expr).xreplace(self._back)
