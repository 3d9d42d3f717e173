"""Shorter forms of an expression, for the eye: each is tried only where it cannot take long.

SymPy's `factor`, `trigsimp` and `simplify` may take minutes on forty sines and cosines, and hours on the next
run of the same program: factors are sought with random numbers and in the order in which a process hashes its
symbols.  What a step will cost is therefore estimated before it is begun, from operations, from the number
of independent symbols and functions, and from the terms that a product has when it is multiplied out; never
by a clock.  Beyond the bounds the expression stays as it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from functools import lru_cache
from math import comb
from typing import Any

import sympy as sp
from sympy.core.random import rng
from sympy.functions.elementary.trigonometric import TrigonometricFunction
from sympy.simplify.fu import TR8

from ..model.elements import Expr

OPERATIONS = 100  # of what SymPy's heuristics are asked for
SIMPLE = 40  # of what all of them are
GENERATORS = 12  # symbols and functions, each of which is a variable of a polynomial to SymPy
TERMS = 80  # of a sum that is multiplied out
WAVES = 24  # terms that products of sines may become


@lru_cache(maxsize=4096)
def terms(e: Expr) -> int:
    """The terms that the expression has at most when it is multiplied out."""
    if e.is_Add:
        return sum(terms(a) for a in e.args)
    if e.is_Mul:
        count = 1
        for a in e.args:
            count *= terms(a)
        return count
    if e.is_Pow and e.exp.is_Integer and e.exp > 1:
        count = terms(e.base)
        return comb(count + int(e.exp) - 1, int(e.exp)) if count > 1 else 1
    return 1


def bounded(e: Expr, operations: int = OPERATIONS) -> bool:
    """A step of SymPy's on it cannot take long."""
    if e.count_ops() > operations:
        return False
    roots = (p for p in e.atoms(sp.Pow) if not p.exp.is_Integer)
    generators = {*e.free_symbols, *e.atoms(sp.Function), *roots}
    return len(generators) <= GENERATORS and terms(e) <= TERMS


def expanded(e: Expr) -> Expr:
    """Multiplied out."""
    return sp.expand(e) if terms(e) <= TERMS else e


def gathered(e: Expr, symbols: Collection[Expr], places: Collection[Expr]) -> Expr:
    """The force of a spring under its stiffness, k (x - y) for k x - k y: terms of the symbols and places
    alone that share a symbol, if one of them holds a place."""
    known = {*symbols, *places}
    straight = [
        term
        for term in sp.Add.make_args(e)
        if term.free_symbols <= known and not term.has(sp.Function)
    ]
    left, found = list(straight), []
    while len(left) > 1:
        shared = Counter(s for term in left for s in sp.Mul.make_args(term) if s in symbols)
        most = max(shared, key=lambda s: (shared[s], str(s)), default=None)
        if most is None or shared[most] < 2:
            break
        group = [term for term in left if most in sp.Mul.make_args(term)]
        left = [term for term in left if term not in group]
        whole = sp.Add(*group)
        found.append(sp.factor_terms(whole) if whole.has(*places) else whole)
    others = [term for term in sp.Add.make_args(e) if term not in straight]
    return sp.Add(*found, *left, *others)


def sums_of_angles(e: Expr) -> Expr:
    """Products of sines and cosines as sums, where they may cancel."""
    if not e.has(TrigonometricFunction):
        return e
    waves = max(
        sum(_power(f) for f in sp.Mul.make_args(term) if f.has(TrigonometricFunction))
        for term in sp.Add.make_args(e)
    )
    if waves < 2 or len(sp.Add.make_args(e)) * 2 ** (waves - 1) > WAVES:
        return e
    return sp.expand(TR8(e))


def _power(factor: Expr) -> int:
    power = factor.as_base_exp()[1]
    return abs(int(power)) if power.is_Integer else 1


def trigonometric(e: Expr) -> Expr:
    """With sin^2 + cos^2 = 1 and its like."""
    return _steadily(sp.trigsimp, e) if bounded(e) else e


def simplified(e: Expr) -> Expr:
    """By everything that SymPy has."""
    return _steadily(sp.simplify, e) if bounded(e, SIMPLE) else e


def product(e: Expr) -> Expr:
    """As a product."""
    return _steadily(sp.factor, e) if bounded(e) else e


def factors(e: Expr) -> list[tuple[Expr, int]]:
    """Factors and powers of the numerator; of what all its terms share where that would take long.

    Raises sympy.PolynomialError where it is no quotient of polynomials.
    """
    if e.has(sp.Float) or not bounded(e):
        return [(f, 1) for f in sp.Mul.make_args(sp.factor_terms(e))]
    above = sp.fraction(sp.together(e))[0]
    found: list[tuple[Expr, int]] = _steadily(sp.factor_list, above)[1]
    return found


def _steadily(step: Any, e: Expr) -> Any:
    """The step, with the same random numbers each time; the caller's are as before."""
    state = rng.getstate()
    rng.seed(7)
    try:
        return step(e)
    finally:
        rng.setstate(state)
