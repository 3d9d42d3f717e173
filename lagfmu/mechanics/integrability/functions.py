"""A differential field of functions, in which "is it zero?" is answered without a guess.

An element is a quotient of polynomials in generators, in lowest terms and with the relations of roots,
sines and cosines applied.  If its numerator vanishes, it is zero: that is exact.  That it is *not* zero
is decided by its values with 60 digits at random points; a rational function of symbols needs none.
Otherwise, `Undecided` is raised, as it is where the arithmetic would take too long: what an operation
costs is estimated from the sizes of its operands, so that the answer is the same on every machine.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from math import prod
from typing import Any

import mpmath
from sympy import (
    Abs,
    Float,
    Integral,
    Rational,
    S,
    Symbol,
    exp,
    sign,
    simplify,
    sin,
    sympify,
)
from sympy.core.function import AppliedUndef
from sympy.polys.domains import QQ
from sympy.polys.fields import FracField
from sympy.polys.orderings import lex

from .generators import Generators, Undecided

DIGITS = 60
_POINTS = 3
_OPERATION = 1e8  # largest cost of one operation: some seconds
_BUDGET = 2e9  # of all operations in one field
_SIMPLIFIABLE = 150  # operations up to which SymPy's simplify is asked
_LONG = Symbol("(a long expression)")


class Functions:
    """The differential field that the given expressions live in, with derivations by `variables`."""

    def __init__(self, variables: Sequence[Any], expressions: Iterable[Any] = ()) -> None:
        self.variables = tuple(variables)
        self.generators = Generators(expressions)
        self._budget = _BUDGET
        self._random = random.Random(20)
        self._rates: dict[tuple[Any, Any], Any] = {}  # (generator, variable) -> derivative
        for variable in self.variables:
            self.generators.rational(variable)
        self._grow()

    def _grow(self) -> None:
        self.K = FracField(list(self.generators.meaning), QQ, lex)
        self.zero, self.one = self.K.zero, self.K.one

    # --- arithmetic -------------------------------------------------------------------------

    def element(self, expr: Any) -> Any:
        """`expr` as an element of the field, which grows when it has to."""
        rational = self.generators.rational(sympify(expr))
        if len(self.generators.meaning) != len(self.K.symbols):
            self._grow()
        return self._value(rational)

    def _value(self, rational: Any) -> Any:
        if rational.is_Add:
            return self.plus(*map(self._value, rational.args))
        if rational.is_Mul:
            return self.times(*map(self._value, rational.args))
        if rational.is_Pow:
            power = self.times(*[self._value(rational.base)] * abs(int(rational.exp)))
            return power if rational.exp > 0 else self.over(self.one, power)
        return self.K(rational) if rational.is_Rational else self.K.from_expr(rational)

    def lift(self, element: Any) -> Any:
        """`element` in the field as it is now."""
        return element if element.field is self.K else element.set_field(self.K)

    def plus(self, *elements: Any) -> Any:
        """The sum."""
        total = self.K.zero
        for a in map(self.lift, elements):
            self.admit(a, total)
            total = total + a
        return self._reduced(total)

    def times(self, *elements: Any) -> Any:
        """The product."""
        total = self.K.one
        for a in map(self.lift, elements):
            self.admit(a, total)
            total = self._reduced(total * a)
        return total

    def minus(self, a: Any, b: Any) -> Any:
        """a - b."""
        return self.plus(a, -b)

    def over(self, a: Any, b: Any) -> Any:
        """a/b."""
        a, b = self.lift(a), self.lift(b)
        if not b:
            raise Undecided(self.expr(a), "divided by zero")
        self.admit(a, b)
        return self._reduced(a / b)

    def admit(self, a: Any, b: Any) -> None:
        """The GCD of n-variate polynomials works with integers of prod_k (1 + deg_k) digits (Liao and
        Fateman, *ISSAC '95*), for each of the terms."""
        terms = len(a.numer) * len(b.denom) + len(a.denom) * len(b.numer)
        degrees = [part.degrees() for part in (a.numer, a.denom, b.numer, b.denom) if part]
        plain = len(a.denom) == len(b.denom) == 1  # the GCD with a monomial
        cost = terms * (
            1 if plain else prod(1 + max(0, *powers) for powers in zip(*degrees, strict=True))
        )
        self._budget -= cost
        if cost > _OPERATION:
            raise Undecided(_LONG, "too large to decide")
        if self._budget < 0:
            raise Undecided(_LONG, "not decided with the effort allowed")

    def _reduced(self, element: Any) -> Any:
        """`element` with the relations applied above and below."""
        for generator, (degree, power) in reversed(self.generators.relations.items()):
            place = self.K.symbols.index(generator)
            if max(element.numer.degree(place), element.denom.degree(place)) >= degree:
                above, below = (
                    self._folded(part, place, degree, power)
                    for part in (element.numer, element.denom)
                )
                if not below:
                    raise Undecided(self.expr(element), "a denominator may vanish")
                self.admit(above, below)
                element = above / below
        return element

    def _folded(self, polynomial: Any, place: int, degree: int, power: Any) -> Any:
        """The polynomial in g after g**degree -> power."""
        parts: dict[int, Any] = {}
        for monomial, coefficient in polynomial.terms():
            whole, left = divmod(monomial[place], degree)
            rest = (*monomial[:place], left, *monomial[place + 1 :])
            parts.setdefault(whole, self.K.ring.zero)[rest] = coefficient
        square = self._value(power)
        return self.plus(
            *[self.times(self.K.raw_new(part), *[square] * k) for k, part in parts.items()]
        )

    def diff(self, element: Any, variable: Any) -> Any:
        """The derivative of an element by a variable."""
        element = self.lift(element)
        rates = {}
        for place, symbol in enumerate(self.K.symbols):
            if element.numer.degree(place) > 0 or element.denom.degree(place) > 0:
                meaning = self.generators.meaning[symbol]
                if isinstance(meaning, sign):  # constant on either side of zero
                    continue
                if (symbol, variable) not in self._rates:
                    self._rates[symbol, variable] = self.element(meaning.diff(variable))
                rates[symbol] = self._rates[symbol, variable]
        element = self.lift(element)
        parts = []
        for symbol, rate in rates.items():
            if rate:
                self.admit(element, element)
                parts.append(self.times(element.diff(self.K.from_expr(symbol)), rate))
        return self.plus(*parts)

    def expr(self, element: Any) -> Any:
        """`element` as an expression again."""
        content, rest = self.lift(element).as_expr().as_content_primitive()
        return (content * rest).xreplace(self.generators.meaning)

    def constants(self) -> list[Any]:
        """Generators whose derivative by every variable is zero."""
        meaning = self.generators.meaning
        return [s for s in self.K.symbols if not meaning[s].has(*self.variables)]

    # --- is it zero? ------------------------------------------------------------------------

    def is_zero(self, element: Any) -> bool:
        """True if proven, False by numerics of high precision; raises `Undecided` otherwise."""
        element = self._reduced(self.lift(element))
        if not element:
            return True
        if all(isinstance(meaning, Symbol) for meaning in self.generators.meaning.values()):
            return False  # a rational function of independent symbols
        signs = self._nonzero(element.numer)
        if signs and all(signs):
            return False
        expr = self.expr(element)
        if not signs:
            raise Undecided(expr, "no point was found at which it can be evaluated")
        if any(signs):
            raise Undecided(expr, "zero in one region and not in another")
        if expr.count_ops() <= _SIMPLIFIABLE and simplify(expr) == 0:
            return True
        raise Undecided(expr, f"zero to {DIGITS // 2} digits, which is no proof")

    def _nonzero(self, polynomial: Any) -> list[bool]:
        """Whether the polynomial is not zero, at each of some random points: whether its value exceeds
        30 digits of the sum of its terms' magnitudes."""
        symbols = self.K.symbols
        used = [symbol for k, symbol in enumerate(symbols) if polynomial.degree(k) > 0]
        real: list[dict[Any, Any]] = []
        other: list[dict[Any, Any]] = []
        for _ in range(40):
            values = self._values(used)
            if values is not None:
                plain = all(isinstance(value, mpmath.mpf) for value in values.values())
                (real if plain else other).append(values)
            if len(real) == _POINTS:
                break
        if not real and not any(m.has(Abs, sign) for m in self.generators.meaning.values()):
            real = other[:_POINTS]  # analytic, so that complex points will do
        answers = []
        for values in real:
            with mpmath.workdps(DIGITS):
                terms = []
                for monomial, c in polynomial.terms():
                    term = mpmath.mpf(int(c.numerator)) / int(c.denominator)
                    for symbol, power in zip(symbols, monomial, strict=True):
                        term *= values[symbol] ** power if power else 1
                    terms.append(term)
                size = mpmath.fsum(map(abs, terms))
                answers.append(abs(mpmath.fsum(terms)) > size * mpmath.mpf(10) ** (-DIGITS // 2))
        return answers

    def _values(self, used: Sequence[Any]) -> dict[Any, Any] | None:
        """The generators' values at a random point, or None where one of them has none."""
        point: dict[Any, Any] = {}
        values = {}
        for symbol in used:
            meaning = _concrete(self.generators.meaning[symbol])
            for free in sorted(meaning.free_symbols, key=str):
                point.setdefault(free, self._draw(free))
            try:
                value = meaning.xreplace(point).evalf(DIGITS)._to_mpmath(int(DIGITS * 3.33))
            except (TypeError, ValueError, AttributeError, ArithmeticError):
                return None
            if not mpmath.isfinite(value):
                return None
            values[symbol] = value
        return values

    def _draw(self, symbol: Any) -> Any:
        """A random number of the symbol's kind."""
        if symbol.is_integer:
            return S(self._random.randint(2, 7))
        value = Rational(self._random.randint(10**5, 2 * 10**6), 10**6 + 3)
        flip = symbol.is_negative or (not symbol.is_positive and self._random.random() < 0.4)
        return Float(-value if flip else value, DIGITS + 15)


def _concrete(expr: Any) -> Any:
    """`expr` with a smooth function for each unknown one, and a number for an integral of such."""
    expr = expr.xreplace({node: _number(str(node)) for node in expr.atoms(Integral)})
    if not expr.has(AppliedUndef):
        return expr

    def example(applied: Any) -> Any:
        u = sum(_number(f"{applied.func} {k}") * x for k, x in enumerate(applied.args))
        return u + exp(u / 3) + sin(2 * u + 1)

    return expr.replace(lambda e: isinstance(e, AppliedUndef), example).doit()


def _number(name: str) -> Rational:
    """A number between 0 and 1 that belongs to a name."""
    return Rational(random.Random(name).randint(10**5, 10**6), 10**6 + 3)
