"""Quotients of polynomials over the rationals in lowest terms, with an end to every operation.

A field operation may take minutes: the heuristic GCD of n-variate polynomials puts one large number
after the other for the variables, and ends with integers of |f| prod_k (1 + deg_k) digits (Liao and
Fateman, *ISSAC '95*, pp. 240-247).  What an operation will cost is therefore estimated before it is
begun, from terms, degrees and coefficients, so that the answer is the same on every machine; and the
owner of the field is told the effort of each, and may refuse it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import comb, gcd, prod
from typing import Any

from sympy import Symbol
from sympy.polys.domains import QQ
from sympy.polys.orderings import lex
from sympy.polys.rings import PolyRing

from .undecided import Undecided

Polynomial = Any  # SymPy carries no types

PAIRS = 2 * 10**6  # of terms in one product: some seconds
BITS = 10**11  # of integers in one GCD, times the terms: some seconds
BITS_AT_ONCE = 2e4  # of such integers for a unit of effort
LEAST = 80.0  # effort of the least operation
LONG = Symbol("(a long expression)")


class Field:
    """Rational functions of `symbols`; `look` is called with the effort of each operation before it is
    begun, and may raise."""

    def __init__(self, symbols: Sequence[Any], look: Callable[[float], None]) -> None:
        self.symbols = tuple(symbols)
        self.ngens = len(self.symbols)
        self.look = look
        self.ring = PolyRing(self.symbols, QQ, lex)
        self.zero = Fraction(self, self.ring.zero, self.ring.one)
        self.one = Fraction(self, self.ring.one, self.ring.one)
        self._generators = dict(zip(self.symbols, self.ring.gens, strict=True))

    def new(self, numer: Polynomial, denom: Polynomial | None = None) -> Fraction:
        """numer/denom in lowest terms."""
        denom = self.ring.one if denom is None else denom
        if not denom:
            raise ZeroDivisionError("zero denominator")
        self.look(LEAST + admit_gcd(numer, denom))
        return Fraction(self, *numer.cancel(denom))

    def generator(self, symbol: Any) -> Fraction:
        """One of the `symbols`."""
        return Fraction(self, self._generators[symbol], self.ring.one)

    def from_expr(self, expr: Any) -> Fraction:
        """A rational function; ValueError if it is none of these symbols."""
        if expr in self._generators:
            return self.generator(expr)
        if expr.is_Rational:
            return self.number(expr)
        if expr.is_Add:
            total = self.zero
            for term in expr.args:
                total = total + self.from_expr(term)
            return total
        if expr.is_Mul:
            return prod((self.from_expr(factor) for factor in expr.args), start=self.one)
        if expr.is_Pow and expr.exp.is_Integer:
            return self.from_expr(expr.base) ** int(expr.exp)
        raise ValueError(f"{expr} is no rational function of {self.symbols}")

    def number(self, value: Any) -> Fraction:
        """A rational constant."""
        return self.new(self.ring.ground_new(QQ.convert(value)))


class Fraction:
    """numer/denom, coprime, with integer coefficients and a positive leading one below."""

    def __init__(self, field: Field, numer: Polynomial, denom: Polynomial) -> None:
        self.field, self.numer, self.denom = field, numer, denom

    def set_field(self, field: Field) -> Fraction:
        """The same in a field of more symbols, which follow those of its own."""
        ring = field.ring
        return Fraction(field, self.numer.set_ring(ring), self.denom.set_ring(ring))

    def __bool__(self) -> bool:
        return bool(self.numer)

    def __neg__(self) -> Fraction:
        return Fraction(self.field, -self.numer, self.denom)

    def __add__(self, value: Any) -> Fraction:
        other = self._other(value)
        if not other:
            return self
        if not self:
            return other
        if self.denom == other.denom:
            return self.field.new(self.numer + other.numer, self.denom)
        numer = self._times(self.numer, other.denom) + self._times(self.denom, other.numer)
        return self.field.new(numer, self._times(self.denom, other.denom))

    __radd__ = __add__

    def __sub__(self, other: Any) -> Fraction:
        return self + -self._other(other)

    def __rsub__(self, other: Any) -> Fraction:
        return self._other(other) + -self

    def __mul__(self, value: Any) -> Fraction:
        other = self._other(value)
        if not self or not other:
            return self.field.zero
        return self.field.new(
            self._times(self.numer, other.numer), self._times(self.denom, other.denom)
        )

    __rmul__ = __mul__

    def __truediv__(self, value: Any) -> Fraction:
        other = self._other(value)
        if not other:
            raise ZeroDivisionError("zero denominator")
        return self.field.new(
            self._times(self.numer, other.denom), self._times(self.denom, other.numer)
        )

    def __rtruediv__(self, other: Any) -> Fraction:
        return self._other(other) / self

    def __pow__(self, power: int) -> Fraction:
        if power < 0 and not self:
            raise ZeroDivisionError("zero denominator")
        above, below = (self.numer, self.denom) if power >= 0 else (self.denom, self.numer)
        above, below = self._raised(above, abs(power)), self._raised(below, abs(power))
        return self.field.new(above, below) if power < 0 else Fraction(self.field, above, below)

    def diff(self, symbol: Any) -> Fraction:
        """The partial derivative by one of the field's symbols."""
        x = self.field.ring.gens[self.field.symbols.index(symbol)]
        rise = self._times(self.numer.diff(x), self.denom)
        fall = self._times(self.numer, self.denom.diff(x))
        return self.field.new(rise - fall, self._raised(self.denom, 2))

    def _other(self, value: Any) -> Fraction:
        return value if isinstance(value, Fraction) else self.field.number(value)

    def _times(self, f: Polynomial, g: Polynomial) -> Polynomial:
        self.field.look(len(f) * len(g))
        _admit(len(f) * len(g) <= PAIRS)
        return f * g

    def _raised(self, f: Polynomial, power: int) -> Polynomial:
        """f**power, which has one term for each choice of `power` terms of f at most."""
        terms = 1
        if power > 1 and len(f) > 1:
            dense = prod(power * degree + 1 for degree in f.degrees())
            terms = min(dense, comb(len(f) + power - 1, power))
            _admit(terms <= PAIRS)
        self.field.look(terms)
        return f**power


def admit_gcd(f: Polynomial, g: Polynomial) -> float:
    """The effort of the GCD of two polynomials.  Raises `Undecided` where it would take too long."""
    terms = len(f) + len(g)
    if len(f) < 2 or len(g) < 2:
        return float(terms)  # the GCD with a monomial
    size = gcd_bits(f, g, (1,) * f.ring.ngens) * terms
    if size <= BITS:
        return terms + size / BITS_AT_ONCE
    steps = tuple(
        gcd(*powers) or 1 for powers in zip(*f.itermonoms(), *g.itermonoms(), strict=True)
    )
    size = gcd_bits(f, g, steps) * terms
    _admit(size <= BITS)
    return terms + size / BITS_AT_ONCE


def gcd_bits(f: Polynomial, g: Polynomial, steps: Sequence[int]) -> int:
    """Bits of the integers that a heuristic GCD makes of polynomials in powers x_k**steps_k."""
    above, below = (
        max(abs(c.numerator) for c in h.values()).bit_length()
        + max(c.denominator for c in h.values()).bit_length()
        - 1
        for h in (f, g)
    )
    for high, low, step in zip(f.degrees(), g.degrees(), steps, strict=True):
        point = max(min(above, below) + 1, 5)  # bits of what is put for this variable
        above, below = above + high // step * point, below + low // step * point
    return int(max(above, below))


def _admit(short: bool) -> None:
    if not short:
        raise Undecided(LONG, "too large to decide")
