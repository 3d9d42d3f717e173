"""That an expression is not zero: its value with 60 digits at random points.

A polynomial in the generators is taken for not zero at a point if it exceeds 30 digits of the sum of
its terms' magnitudes, so that cancellation is told from rounding.  An unknown function is stood for
by one of its kind, a x + exp(b x) + sin(c (x + 1)), the same everywhere.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

import mpmath
from sympy import Abs, Dummy, Float, Integer, Integral, Rational, exp, sign, sin
from sympy.core.function import AppliedUndef

from .undecided import spend

DIGITS = 60
_POINTS = 3
_EVALUATING = 500.0  # effort of one value


class Samples:
    """Values of the generators, whose `meaning` is known, at a few points that are kept."""

    def __init__(self, meaning: Mapping[Any, Any]) -> None:
        self.meaning = meaning
        self._points: list[dict[Any, Any]] = []
        self._values: list[dict[Any, Any]] = []
        self._functions: dict[Any, Any] = {}
        self._random = random.Random(20)

    def nonzero(self, polynomial: Any) -> list[bool]:
        """Whether the polynomial in generators is not zero, at each of the points."""
        symbols = polynomial.ring.symbols
        used = [symbol for place, symbol in enumerate(symbols) if polynomial.degree(place) > 0]
        return [_nonzero(polynomial, values) for values in self._numbers(used)]

    def _numbers(self, used: list[Any]) -> list[dict[Any, Any]]:
        """The generators' values at the sample points, real ones if there are any."""
        if not self._values or not self._extend(used):
            drawn = []
            for _ in range(40):
                point: dict[Any, Any] = {}
                values = self._evaluate(used, point, {})
                if values is not None:
                    drawn.append((all(isinstance(v, mpmath.mpf) for v in values.values()), point))
                if sum(real for real, _ in drawn) == _POINTS:
                    break
            analytic = not any(m.has(Abs, sign) for m in self.meaning.values())
            chosen = [point for real, point in drawn if real]
            if not chosen and analytic:
                chosen = [point for _, point in drawn[:_POINTS]]
            self._points = chosen
            self._values = [{} for _ in chosen]
            self._functions = {}
            self._extend(used)
        return self._values

    def _extend(self, used: list[Any]) -> bool:
        """Evaluate the generators that are used; False if one cannot be."""
        for point, values in zip(self._points, self._values, strict=True):
            if self._evaluate(used, point, values) is None:
                return False
        return True

    def _evaluate(
        self, used: list[Any], point: dict[Any, Any], values: dict[Any, Any]
    ) -> dict[Any, Any] | None:
        for symbol in used:
            if symbol in values:
                continue
            spend(_EVALUATING)
            meaning = self.meaning[symbol]
            concrete = self._concrete(meaning)
            for free in sorted(concrete.free_symbols, key=str):
                if free not in point:
                    point[free] = Float(self._draw(free), DIGITS + 15)
            try:
                number = concrete.xreplace(point).evalf(DIGITS)
                value = number._to_mpmath(int(DIGITS * 3.33))
            except (TypeError, ValueError, AttributeError, ArithmeticError):
                return None
            if not mpmath.isfinite(value):
                return None
            values[symbol] = value
        return values

    def _draw(self, symbol: Any) -> Any:
        if symbol.is_integer:
            return Integer(self._random.randint(2, 7))
        value = Rational(self._random.randint(10**5, 2 * 10**6), 10**6 + 3)
        if symbol.is_negative or (not symbol.is_positive and self._random.random() < 0.4):
            value = -value
        return value

    def _concrete(self, expr: Any) -> Any:
        """`expr` with each unknown function replaced by one of its kind, the same everywhere."""
        if not expr.has(AppliedUndef):
            return expr
        # a quadrature of an unknown function, which only `quadrature.py` makes: any number
        for node in expr.atoms(Integral):
            if node not in self._functions:
                self._functions[node] = self._draw(Dummy(positive=True))
        known = {n: value for n, value in self._functions.items() if isinstance(n, Integral)}
        expr = expr.xreplace(known)

        def example(applied: Any) -> Any:
            key = applied.func
            if key not in self._functions:
                self._functions[key] = [
                    [Rational(self._random.randint(1, 99), 101) for _ in applied.args]
                    for _ in range(3)
                ]
            a, b, c = self._functions[key]
            linear = sum(x * u for x, u in zip(a, applied.args, strict=True))
            return (
                linear
                + exp(sum(x * u for x, u in zip(b, applied.args, strict=True)))
                + sin(sum(x * (u + 1) for x, u in zip(c, applied.args, strict=True)))
            )

        expr = expr.replace(lambda e: isinstance(e, AppliedUndef), example)
        return expr.doit()


def _nonzero(polynomial: Any, values: dict[Any, Any]) -> bool:
    with mpmath.workdps(DIGITS):
        total = size = mpmath.mpf(0)
        for monomial, coefficient in polynomial.terms():
            term = mpmath.mpf(int(coefficient.numerator)) / int(coefficient.denominator)
            for symbol, power in zip(polynomial.ring.symbols, monomial, strict=True):
                if power:
                    term *= values[symbol] ** power
            total += term
            size += abs(term)
        return bool(abs(total) > size * mpmath.mpf(10) ** (-DIGITS // 2))
