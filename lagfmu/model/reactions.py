"""Multipliers and generalized forces of constraint as symbols, for expressions of a model's own.

    multiplier("rod")        lambda of the constraint, with the sign and unit of the FMU's lambda.rod
    force_of_constraint(x)   Q_x = sum_k lambda_k a_kx of all constraints, as the FMU's Q.x

They are the symbols that the FMU's variables are named by, so that an output, the normal force of a
friction and a closed form mean the same by them.  They have no place in the energy or in a force: what
is solved for cannot stand among what it is solved from.

Norms of multipliers, the normal forces of joints: a pin rubs by N = sqrt(Fx^2 + Fy^2).
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp
from sympy.core.function import AppliedUndef

from ..errors import UnitError
from ..names import FORCE, MULTIPLIER, REACTIONS, name, read
from .dimensions import dimension_of
from .elements import Expr, ModelFields, Nonholonomic, name_of
from .units import ONE, SECOND, Unit, generalized_force_unit, multiplier_unit


def multiplier(constraint: str) -> Expr:
    """lambda of the constraint of that name; its unit is J/[f], W/[expression] if nonholonomic."""
    return sp.Symbol(name(MULTIPLIER, constraint), real=True)


def force_of_constraint(coordinate: Expr) -> Expr:
    """Q of all constraints on a coordinate, in J/[coordinate], or on a speed, in W/[speed]."""
    return sp.Symbol(name(FORCE, "", name_of(coordinate)), real=True)


def _is_reaction(symbol: Expr) -> bool:
    """True for what `multiplier` and `force_of_constraint` make."""
    return bool(symbol.is_Symbol) and read(str(symbol)).quantity in REACTIONS


def reactions_in(expression: Expr) -> list[Expr]:
    """The multipliers and forces of constraint in an expression, by name."""
    return sorted(filter(_is_reaction, sp.sympify(expression).free_symbols), key=str)


def reaction_units(model: ModelFields, units: Mapping[Expr, Unit]) -> dict[Expr, Unit]:
    """The unit of each multiplier and each force of constraint of the model.

    A constraint whose own terms disagree in dimension has none; that is told where it is checked.
    """
    found = {}
    for c in model.constraints:
        if not hasattr(c, "expression"):
            continue
        try:
            unit = dimension_of(sp.sympify(c.expression), units, c.name) or ONE
        except UnitError:
            continue
        found[multiplier(c.name)] = multiplier_unit(unit, isinstance(c, Nonholonomic))
    for q in model.directions:
        if q in units and isinstance(q, AppliedUndef):
            moved = units[q] * SECOND if q in model.speeds else units[q]
            found[force_of_constraint(q)] = generalized_force_unit(moved)
    return found


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
    rest, reacting = term.as_independent(*filter(_is_reaction, term.free_symbols), as_Add=False)
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
