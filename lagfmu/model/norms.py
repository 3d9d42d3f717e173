"""Norms of multipliers, the normal forces of joints: a pin rubs by N = sqrt(Fx^2 + Fy^2)."""

from __future__ import annotations

import sympy as sp

from .elements import Expr
from .reactions import is_reaction, reactions_in

Norm = tuple[Expr, ...]  # components, each linear in the multipliers


def norm(*components: Expr) -> Expr:
    """sqrt(a^2 + b^2 + ...) of multipliers, in their unit: the normal force of a joint.

    `norm(multiplier("A.x"), multiplier("A.y"))` [N] is that of a pin; times its radius it limits a torque.
    """
    return sp.sqrt(sp.Add(*(sp.sympify(c) ** 2 for c in components)))


def norms_of(normal: Expr) -> tuple[Norm, ...] | None:
    """The norms that a normal force is the sum of; None if it is no such sum.

    What is linear in the multipliers, and what has none, is a norm of one component.
    """
    normal = sp.sympify(normal)
    if reactions_in(normal):
        terms = sp.Add.make_args(sp.expand_mul(normal, deep=False))
        found = tuple(n for n in map(_norm, terms) if n is not None)
        if len(found) == len(terms) and all(map(_is_linear, sum(found, ()))):
            return found
    return ((normal,),) if _is_linear(normal) else None


def _is_linear(e: Expr) -> bool:
    symbols = reactions_in(e)
    return all(sp.simplify(e.diff(a, b)) == 0 for a in symbols for b in symbols)


def _norm(term: Expr) -> Norm | None:
    """The components of c |a| or of c sqrt(a^2 + b^2 + ...); None for anything else, c < 0 included."""
    rest, reacting = term.as_independent(*filter(is_reaction, term.free_symbols), as_Add=False)
    if reacting == 1:
        return (term,)
    if rest.could_extract_minus_sign():
        return None
    if isinstance(reacting, sp.Abs):
        return (rest * reacting.args[0],)
    base, power = reacting.as_base_exp()
    if power != sp.S.Half:
        return None
    return tuple(rest * _root(square) for square in sp.Add.make_args(base))


def _root(square: Expr) -> Expr:
    """a of a^2, a product of even powers."""
    factors = [f.as_base_exp() for f in sp.Mul.make_args(square)]
    return sp.Mul(*(base ** (power / 2) for base, power in factors))
