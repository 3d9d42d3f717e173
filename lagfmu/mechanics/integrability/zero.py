"""Is an expression zero?  Proven, refuted by numbers of high precision, or undecided; never guessed.

An expression is a quotient of polynomials in its symbols, functions and roots.  What division by the
relations cos(u)^2 + sin(u)^2 - 1 and r^q - P of each root r leaves of it in lowest terms is zero if the
expression is zero by these relations.  That it is *not* zero is decided by its values at random points, to
digits that SymPy's evalf vouches for.
"""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from math import comb, prod

import sympy as sp
from sympy.core.evalf import PrecisionExhausted
from sympy.core.function import AppliedUndef
from sympy.functions.elementary.hyperbolic import HyperbolicFunction
from sympy.functions.elementary.trigonometric import TrigonometricFunction
from sympy.simplify.fu import TR1, TR2

from ...model.elements import Expr
from ..simplification import simplified

POINTS = 8  # enough to see either side of zero
DIGITS = 20  # of a value that is not zero, at least
_LARGEST = 10**6  # terms of a numerator or denominator that is multiplied out
_LONG = sp.Symbol("(a long expression)")


class Undecided(Exception):  # noqa: N818 (an answer rather than an error)
    """It cannot be decided whether `expr` is zero (Richardson, *Journal of Symbolic Logic* 33, 1968)."""

    def __init__(self, expr: Expr, reason: str) -> None:
        self.expr, self.reason = expr, reason
        super().__init__(f"{reason}: {expr}")


def plain(expr: Expr) -> Expr:
    """`expr` in sines and cosines of single angles, exponentials, roots and signs; decimals as 14 digits."""
    expr = expr.xreplace({x: sp.Rational(format(float(x), ".14g")) for x in expr.atoms(sp.Float)})
    expr = expr.replace(lambda e: isinstance(e, HyperbolicFunction), lambda e: e.rewrite(sp.exp))
    expr = expr.replace(
        lambda e: isinstance(e, sp.Abs) and e.args[0].is_extended_real,
        lambda e: e.args[0] * sp.sign(e.args[0]),
    )
    if expr.has(TrigonometricFunction):
        expr = sp.expand_trig(TR2(TR1(expr)))
    return sp.expand_log(expr)


def slope(expr: Expr, x: Expr) -> Expr:
    """The derivative by x; a sign is constant on either side of zero."""
    return expr.diff(x).replace(sp.DiracDelta, lambda *_: sp.S.Zero)


def short(expr: Expr) -> Expr:
    """`expr` as a quotient in lowest terms, with the relations of roots, sines and cosines applied.

    Raises Undecided where that would take long, by the size of the expression.
    """
    generators = _Generators()
    rational = generators.of(sp.sympify(expr))
    if _size(rational) > _LARGEST:
        raise Undecided(_LONG, "too large to decide")
    if rational.is_Rational:
        return rational
    field = sp.polys.fields.FracField([*generators.meaning][::-1], sp.QQ, sp.lex)
    quotient = field.from_expr(rational)
    relations = [field.ring.from_expr(relation) for relation in generators.relations]
    if relations:
        above, below = quotient.numer.rem(relations), quotient.denom.rem(relations)
        if not below:
            raise Undecided(expr, "a denominator may vanish")
        quotient = field.from_expr(above.as_expr()) / field.from_expr(below.as_expr())
    return quotient.as_expr().xreplace(generators.meaning)


class _Generators:
    """What an expression is a rational function of: symbols, and functions and roots under a name."""

    def __init__(self) -> None:
        self.meaning: dict[Expr, Expr] = {}  # generator -> expression
        self.relations: list[
            Expr
        ] = []  # polynomials that are zero, each led by a generator of its own
        self._names: dict[Expr, Expr] = {}

    def of(self, expr: Expr) -> Expr:
        """`expr` in the generators, which are named as they are met."""
        if expr.is_Rational:
            return expr
        if expr.is_Add or expr.is_Mul or (expr.is_Pow and expr.exp.is_Integer):
            return expr.func(*map(self.of, expr.args))
        if isinstance(expr, sp.exp | sp.Pow):
            base, exponent = expr.as_base_exp()
            return sp.Mul(
                *(self._power(base, term) for term in sp.Add.make_args(sp.expand(exponent)))
            )
        if isinstance(expr, sp.cos):
            return self._name(expr, 2, 1 - self.of(sp.sin(expr.args[0])) ** 2)
        if expr is sp.I or isinstance(expr, sp.sign):
            return self._name(expr, 2, sp.S.NegativeOne if expr is sp.I else sp.S.One)
        return self._name(expr)

    def _power(self, base: Expr, exponent: Expr) -> Expr:
        share, rest = exponent.as_coeff_Mul(rational=True)
        root = sp.Pow(base, rest / share.q)
        if rest != 1 or root == base:
            return self._name(root) ** share.p
        return self._name(root, share.q, self.of(base)) ** share.p

    def _name(self, expr: Expr, degree: int = 0, power: Expr = sp.S.Zero) -> Expr:
        """The generator g that stands for `expr`, with g**degree = power."""
        if expr not in self._names:
            name = expr if expr.is_Symbol else sp.Dummy("g", real=True)
            self._names[expr], self.meaning[name] = name, expr
            if degree:
                self.relations.append(name**degree - power)
        return self._names[expr]


def _size(expr: Expr) -> int:
    """At most so many terms, above and below, when it is multiplied out."""
    if expr.is_Add:
        return sum(map(_size, expr.args))
    if expr.is_Mul:
        return prod(map(_size, expr.args))
    if expr.is_Pow:
        count, power = _size(expr.base), abs(int(expr.exp))
        return comb(count + power - 1, power)
    return 1


def is_zero(expr: Expr) -> bool:
    """True if proven, False by certified digits at random points; raises `Undecided` otherwise."""
    expr = short(expr)
    if expr == 0:
        return True
    if expr.is_rational_function():
        return False  # of independent symbols
    answers = list(itertools.islice(_tried(expr), POINTS))
    if not answers:
        raise Undecided(expr, "no point was found at which it can be evaluated")
    if all(answers):
        return False
    if any(answers):
        raise Undecided(expr, "zero in one region and not in another")
    if simplified(expr) == 0:
        return True
    raise Undecided(expr, f"zero to {DIGITS} digits, which is no proof")


def _tried(expr: Expr) -> Iterator[bool]:
    """Whether it is not zero, at random points; an unknown function and its derivatives are unknowns."""
    chance = random.Random(20)
    unknown = expr.atoms(AppliedUndef, sp.Derivative, sp.Subs)
    expr = expr.xreplace({f: sp.Dummy(str(f), real=True) for f in unknown})
    for _ in range(40):
        point = {s: _drawn(s, chance) for s in sorted(expr.free_symbols, key=str)}
        try:
            value = expr.evalf(DIGITS, subs=point, strict=True, maxn=5 * DIGITS)
        except PrecisionExhausted:
            yield False
        except (TypeError, ValueError, ArithmeticError):
            continue
        else:
            if value.is_finite and value.is_real:
                yield value != 0


def _drawn(symbol: Expr, chance: random.Random) -> Expr:
    """A random number of the symbol's kind."""
    if symbol.is_integer:
        return sp.Integer(chance.randint(2, 7))
    value = sp.Rational(chance.randint(10**5, 2 * 10**6), 10**6 + 3)
    flip = symbol.is_negative or (not symbol.is_positive and chance.random() < 0.4)
    return -value if flip else value
