"""Expressions as rational functions of generators.

A generator is a symbol, t = tan(u/2) for an angle u, exp(u), a root, or anything else (an unknown
function, a logarithm, ...) as it stands:

    sin u = 2 t/(1 + t**2) ,   cos u = (1 - t**2)/(1 + t**2) ,

with addition theorems for multiples of u and sums (Bronstein, *Symbolic Integration I*, ch. 3: a
tower of extensions).  Roots, the imaginary unit and signs satisfy relations g**q = P.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import lcm
from typing import Any

from sympy import (
    Abs,
    Add,
    Dummy,
    E,
    Float,
    I,
    Integer,
    Mul,
    Pow,
    Rational,
    S,
    Symbol,
    cos,
    exp,
    expand,
    expand_log,
    factorint,
    log,
    pi,
    sign,
    sin,
    sympify,
    tan,
)
from sympy.functions.elementary.hyperbolic import HyperbolicFunction
from sympy.functions.elementary.trigonometric import TrigonometricFunction

from .undecided import Undecided


class Generators:
    """The generators met so far, and what they stand for."""

    def __init__(self, variables: Sequence[Any]) -> None:
        self.meaning: dict[Any, Any] = {}
        self.relations: dict[Any, tuple[int, Any]] = {}  # generator -> (q, P):  generator**q = P
        self.angles: dict[Any, Any] = {}  # generator tan(angle/2) -> angle
        self._generator: dict[Any, Any] = {}
        self._fractions: dict[Any, int] = {}
        self._memo: dict[Any, Any] = {}
        for variable in variables:
            self.new(variable, variable)

    def scan(self, expr: Any) -> None:
        """Note the fractions of each angle and exponent, so that one generator serves them all."""
        for node in sympify(expr).atoms(TrigonometricFunction, HyperbolicFunction, exp):
            for coefficient, rest in _terms(node.args[0]):
                self._fractions[rest] = lcm(self._fractions.get(rest, 1), int(coefficient.q))

    def new(self, key: Any, meaning: Any) -> Any:
        """The generator that stands for `meaning`; `key` tells generators apart."""
        if key not in self._generator:
            symbol = meaning if isinstance(meaning, Symbol) else Dummy("g", real=True)
            self._generator[key] = symbol
            self.meaning[symbol] = meaning
        return self._generator[key]

    def rational(self, expr: Any) -> Any:
        """`expr` as a rational function of generators, which are made when they have to be."""
        if expr not in self._memo:
            self._memo[expr] = self._rewrite(expr)
        return self._memo[expr]

    def _rewrite(self, expr: Any) -> Any:
        if isinstance(expr, Rational):
            return expr
        if isinstance(expr, Float):
            return Rational(format(float(expr), ".14g"))
        if expr in (S.NaN, S.Infinity, S.NegativeInfinity, S.ComplexInfinity):
            raise Undecided(expr, "not a finite number")
        if isinstance(expr, Symbol):
            return self.new(expr, expr)
        if expr is I:
            unit = self.new(I, I)
            self.relations[unit] = (2, Integer(-1))
            return unit
        if isinstance(expr, Add | Mul):
            return expr.func(*[self.rational(argument) for argument in expr.args])
        if isinstance(expr, exp) or (isinstance(expr, Pow) and expr.base is E):
            return self._exponential(expr.exp)
        if isinstance(expr, Pow):
            return self._power(expr.base, expr.exp)
        if isinstance(expr, sin | cos):
            return self._circle(expr.args[0])[0 if isinstance(expr, sin) else 1]
        if isinstance(expr, TrigonometricFunction):
            sine, cosine = self._circle(expr.args[0])
            name = type(expr).__name__
            table = {
                "tan": sine / cosine,
                "cot": cosine / sine,
                "sec": 1 / cosine,
                "csc": 1 / sine,
            }
            return table[name] if name in table else self.new(expr, expr)
        if isinstance(expr, HyperbolicFunction):
            return self.rational(expr.rewrite(exp))
        if isinstance(expr, log):
            expanded = expand_log(expr)
            return self.new(expr, expr) if expanded == expr else self.rational(expanded)
        if isinstance(expr, Abs) and expr.args[0].is_extended_real:
            return self.rational(expr.args[0]) * self.rational(sign(expr.args[0]))
        generator = self.new(expr, expr)
        if isinstance(expr, sign) and expr.args[0].is_extended_real:
            self.relations[generator] = (2, Integer(1))
        return generator

    def _exponential(self, exponent: Any) -> Any:
        product = S.One
        for coefficient, rest in _terms(exponent):
            if isinstance(rest, log) and coefficient.is_integer:
                product *= self.rational(rest.args[0]) ** coefficient
                continue
            fraction = lcm(self._fractions.get(rest, 1), int(coefficient.q))
            self._fractions.setdefault(rest, fraction)
            generator = self.new(("exp", rest, fraction), exp(rest / fraction))
            product *= generator ** (coefficient * fraction)
        return product

    def _power(self, base: Any, exponent: Any) -> Any:
        if exponent.is_Integer:
            return self.rational(base) ** exponent
        product = S.One
        for coefficient, rest in _terms(exponent):
            if rest is S.One:
                product *= self._root(base, int(coefficient.q)) ** int(coefficient.p)
                continue
            key = ("power", base, rest, int(coefficient.q))
            generator = self.new(key, base ** (rest / coefficient.q))
            product *= generator ** int(coefficient.p)
        return product

    def _root(self, base: Any, degree: int) -> Any:
        """base**(1/degree); an integer is split into primes, whose roots are independent."""
        if degree == 1:
            return self.rational(base)
        if base.is_Rational and base.is_positive and (base.q != 1 or len(factorint(base.p)) > 1):
            product = S.One
            for prime, power in {**factorint(base.p), **_inverse(factorint(base.q))}.items():
                product *= self._root(Integer(prime), degree) ** power
            return product
        radicand = self.rational(base)
        generator = self.new(("root", base, degree), base ** Rational(1, degree))
        self.relations[generator] = (degree, radicand)
        return generator

    def _circle(self, angle: Any) -> tuple[Any, Any]:
        """(sin, cos) of an angle in terms of t = tan(base/2), base being a part of the angle."""
        sine, cosine = S.Zero, S.One
        for coefficient, rest in _terms(angle):
            value = sin(coefficient * pi)
            if rest is pi and not isinstance(value, sin) and not value.has(sin, cos):
                s, c = self.rational(value), self.rational(cos(coefficient * pi))
            else:
                fraction = lcm(self._fractions.get(rest, 1), int(coefficient.q))
                self._fractions.setdefault(rest, fraction)
                base = rest / fraction
                t = self.new(("tan", base), tan(base / 2))
                self.angles[t] = base
                s1, c1 = 2 * t / (1 + t**2), (1 - t**2) / (1 + t**2)
                s, c = S.Zero, S.One
                for _ in range(abs(int(coefficient * fraction))):
                    s, c = s * c1 + c * s1, c * c1 - s * s1
                s = -s if coefficient < 0 else s
            sine, cosine = sine * c + cosine * s, cosine * c - sine * s
        return sine, cosine


def _terms(argument: Any) -> list[tuple[Any, Any]]:
    """The terms of an angle or an exponent as pairs (rational coefficient, rest)."""
    return [term.as_coeff_Mul(rational=True) for term in Add.make_args(expand(argument))]


def _inverse(factors: dict[int, int]) -> dict[int, int]:
    return {prime: -power for prime, power in factors.items() if prime != 1}
