"""Expressions that can be written down but not used: they have no value somewhere, no derivative, or more
than one component.  Each is named with what to write instead.
"""

from __future__ import annotations

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.vector.dyadic import Dyadic
from sympy.physics.vector.vector import Vector

from .elements import TIME, Contact, Expr, Holonomic, ModelFields
from .symbols import plain

KINKED = (sp.Abs, sp.sign, sp.Heaviside, sp.Max, sp.Min, sp.floor, sp.ceiling, sp.Mod)
MOST = 400  # operations of an f that is looked at as a product


def of_several_components(what: str, thing: object) -> list[str]:
    """A vector or a matrix where one expression belongs."""
    if isinstance(thing, (sp.MatrixBase, sp.MatrixExpr, Vector, Dyadic)):
        kind = "vector" if isinstance(thing, (Vector, Dyadic)) else "matrix"
        how = "r.dot(N.x)" if kind == "vector" else "r[0]"
        return [
            f"{what} is a {kind}, {thing}: write one for each of its components, for example "
            f"Holonomic('close_x', {how})"
        ]
    return []


def unusable(what: str, expression: Expr) -> list[str]:
    """Cases that leave a gap."""
    problems = []
    for piece in expression.atoms(sp.Piecewise):
        if piece.args[-1].cond != sp.true:
            problems.append(
                f"{what}: {plain(piece)} has no value where none of its conditions holds: end it with a "
                "case (value, True)"
            )
    return problems


def unusable_surfaces(model: ModelFields) -> list[str]:
    """Functions f of constraints that lack a second derivative, or whose gradient vanishes with them."""
    problems = []
    changing = (*model.coordinates, *(i.symbol for i in model.inputs))
    moving = {TIME}.union(*(s.free_symbols for s in changing))
    for c in model.constraints:
        if not isinstance(c, (Holonomic, Contact)):
            continue
        f = sp.sympify(c.expression)
        kinks = [k for k in f.atoms(*KINKED) if k.free_symbols & moving]
        if kinks:
            problems.append(
                f"constraint {c.name!r}: {', '.join(sorted(map(plain, kinks)))} has a kink or a jump, but f "
                "is differentiated twice: write a smooth f (x**2 - L**2 for |x| - L), or a constraint or "
                "Contact for each side"
            )
        elif f.count_ops() <= MOST and _is_squared(f, moving):
            problems.append(
                f"constraint {c.name!r}: the gradient of {plain(f)} vanishes wherever it is 0 itself, so "
                "that no multiplier can hold it: give what is squared there"
            )
    return problems


def _is_squared(f: Expr, moving: set[Expr]) -> bool:
    """A product, of the factors of which that vanish each is a square or a higher power."""
    terms = sp.Add.make_args(f)
    if len(terms) > 1 and not set.intersection(*(e.atoms(AppliedUndef) for e in terms)):
        return False  # it is none, and factor_terms() takes long to find that
    factors = [a for a in sp.Mul.make_args(sp.factor_terms(f)) if a.free_symbols & moving]
    powers = [a.as_base_exp()[1] for a in factors]
    return bool(powers) and all(p.is_number and p.is_positive and p > 1 for p in powers)
