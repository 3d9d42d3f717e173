"""Zero tests that do not guess: exact arithmetic in a differential field, with a numerical proof.

An expression is rewritten as a rational function of *generators*: symbols, tan(angle/2), exp(u),
roots, and anything else (unknown functions, logarithms, ...) as it stands.  If its numerator
vanishes, the expression is zero: that is exact.  That it is *not* zero is decided by numerics of
high precision: if at each of a few random points, its value with 60 digits is not zero to 30
digits, relative to its terms.  (Rational functions of symbols need no numerics.)  Otherwise,
`Undecided` is raised.
"""

from __future__ import annotations

import itertools
import math
import random
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from math import lcm
from typing import Any

import mpmath
from sympy import (
    Abs,
    Add,
    Dummy,
    E,
    Float,
    I,
    Integer,
    Integral,
    Mul,
    Poly,
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
    simplify,
    sin,
    sympify,
    tan,
)
from sympy.core.function import AppliedUndef
from sympy.functions.elementary.hyperbolic import HyperbolicFunction
from sympy.functions.elementary.trigonometric import TrigonometricFunction
from sympy.polys.domains import QQ
from sympy.polys.fields import FracField
from sympy.polys.orderings import lex

_DIGITS = 60
_POINTS = 3
_LARGEST = 3000  # terms of a numerator and a denominator; beyond that, the answer is "undecided"
_SIMPLIFIABLE = 150  # operations up to which SymPy's simplify is asked
_UNTIL: ContextVar[float] = ContextVar("until", default=math.inf)


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Towers made within this block decide nothing after so many seconds."""
    token = _UNTIL.set(min(time.monotonic() + seconds, _UNTIL.get()))
    try:
        yield
    finally:
        _UNTIL.reset(token)


def late() -> bool:
    """The time of the innermost `within` is over."""
    return time.monotonic() > _UNTIL.get()


class Undecided(Exception):  # noqa: N818 (an answer rather than an error)
    """It cannot be decided whether `expr` is zero."""

    def __init__(self, expr: Any, reason: str) -> None:
        self.expr = expr
        self.reason = reason
        super().__init__(f"{reason}: {expr}")


def _terms(argument: Any) -> list[tuple[Any, Any]]:
    """The terms of an angle or an exponent as pairs (rational coefficient, rest)."""
    return [term.as_coeff_Mul(rational=True) for term in Add.make_args(expand(argument))]


class Tower:
    """The differential field that given expressions live in, with derivations by `variables`."""

    def __init__(
        self, variables: Sequence[Any], scan: Iterable[Any] = (), seconds: float = 20.0
    ) -> None:
        self.variables = tuple(variables)
        self.relations: dict[Any, tuple[int, Any]] = {}  # generator -> (q, P):  generator**q = P
        self.angles: dict[Any, Any] = {}  # generator tan(angle/2) -> angle
        self._meaning: dict[Any, Any] = {}
        self._generator: dict[Any, Any] = {}
        self._fractions: dict[Any, int] = {}
        self._memo: dict[Any, Any] = {}
        self._derivatives: dict[tuple[Any, Any], Any] = {}
        self._points: list[dict[Any, Any]] = []
        self._values: list[dict[Any, Any]] = []
        self._random = random.Random(20)
        self._functions: dict[Any, Any] = {}
        self._deadline = min(time.monotonic() + seconds, _UNTIL.get())
        for variable in self.variables:
            self._new(variable, variable)
        self._field()
        for expr in scan:
            self._scan(expr)

    # --- from expressions to elements of the field -----------------------------------------

    def _scan(self, expr: Any) -> None:
        """Note the fractions of each angle and exponent, so that one generator serves them all."""
        for node in sympify(expr).atoms(TrigonometricFunction, HyperbolicFunction, exp):
            for coefficient, rest in _terms(node.args[0]):
                self._fractions[rest] = lcm(self._fractions.get(rest, 1), int(coefficient.q))

    def _field(self) -> None:
        self.K = FracField(list(self._meaning), QQ, lex)

    def _new(self, key: Any, meaning: Any) -> Any:
        """The generator that stands for `meaning`; `key` tells generators apart."""
        if key not in self._generator:
            symbol = meaning if isinstance(meaning, Symbol) else Dummy("g", real=True)
            self._generator[key] = symbol
            self._meaning[symbol] = meaning
        return self._generator[key]

    def element(self, expr: Any) -> Any:
        """`expr` as an element of the field, which grows when it has to."""
        rational = self._rational(sympify(expr))
        if len(self._meaning) != self.K.ngens:
            self._field()
        try:
            return self.reduce(self.K.from_expr(rational))
        except (ValueError, ZeroDivisionError) as error:
            raise Undecided(expr, "not a rational function of known generators") from error

    def _rational(self, expr: Any) -> Any:
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
            return self._new(expr, expr)
        if expr is I:
            unit = self._new(I, I)
            self.relations[unit] = (2, Integer(-1))
            return unit
        if isinstance(expr, Add | Mul):
            return expr.func(*[self._rational(argument) for argument in expr.args])
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
            return table[name] if name in table else self._new(expr, expr)
        if isinstance(expr, HyperbolicFunction):
            return self._rational(expr.rewrite(exp))
        if isinstance(expr, log):
            expanded = expand_log(expr)
            return self._new(expr, expr) if expanded == expr else self._rational(expanded)
        if isinstance(expr, Abs) and expr.args[0].is_extended_real:
            return self._rational(expr.args[0]) * self._rational(sign(expr.args[0]))
        generator = self._new(expr, expr)
        if isinstance(expr, sign) and expr.args[0].is_extended_real:
            self.relations[generator] = (2, Integer(1))
        return generator

    def _exponential(self, exponent: Any) -> Any:
        product = S.One
        for coefficient, rest in _terms(exponent):
            if isinstance(rest, log) and coefficient.is_integer:
                product *= self._rational(rest.args[0]) ** coefficient
                continue
            fraction = lcm(self._fractions.get(rest, 1), int(coefficient.q))
            self._fractions.setdefault(rest, fraction)
            generator = self._new(("exp", rest, fraction), exp(rest / fraction))
            product *= generator ** (coefficient * fraction)
        return product

    def _power(self, base: Any, exponent: Any) -> Any:
        if exponent.is_Integer:
            return self._rational(base) ** exponent
        product = S.One
        for coefficient, rest in _terms(exponent):
            if rest is S.One:
                product *= self._root(base, int(coefficient.q)) ** int(coefficient.p)
                continue
            key = ("power", base, rest, int(coefficient.q))
            generator = self._new(key, base ** (rest / coefficient.q))
            product *= generator ** int(coefficient.p)
        return product

    def _root(self, base: Any, degree: int) -> Any:
        """base**(1/degree); an integer is split into primes, whose roots are independent."""
        if degree == 1:
            return self._rational(base)
        if base.is_Rational and base.is_positive and (base.q != 1 or len(factorint(base.p)) > 1):
            product = S.One
            for prime, power in {**factorint(base.p), **_inverse(factorint(base.q))}.items():
                product *= self._root(Integer(prime), degree) ** power
            return product
        radicand = self._rational(base)
        generator = self._new(("root", base, degree), base ** Rational(1, degree))
        self.relations[generator] = (degree, radicand)
        return generator

    def _circle(self, angle: Any) -> tuple[Any, Any]:
        """(sin, cos) of an angle in terms of t = tan(base/2), base being a part of the angle."""
        sine, cosine = S.Zero, S.One
        for coefficient, rest in _terms(angle):
            value = sin(coefficient * pi)
            if rest is pi and not isinstance(value, sin) and not value.has(sin, cos):
                s, c = self._rational(value), self._rational(cos(coefficient * pi))
            else:
                fraction = lcm(self._fractions.get(rest, 1), int(coefficient.q))
                self._fractions.setdefault(rest, fraction)
                base = rest / fraction
                t = self._new(("tan", base), tan(base / 2))
                self.angles[t] = base
                s1, c1 = 2 * t / (1 + t**2), (1 - t**2) / (1 + t**2)
                s, c = S.Zero, S.One
                for _ in range(abs(int(coefficient * fraction))):
                    s, c = s * c1 + c * s1, c * c1 - s * s1
                s = -s if coefficient < 0 else s
            sine, cosine = sine * c + cosine * s, cosine * c - sine * s
        return sine, cosine

    # --- arithmetic -------------------------------------------------------------------------

    def lift(self, element: Any) -> Any:
        """`element` in the field as it is now."""
        return element if element.field == self.K else element.set_field(self.K)

    def reduce(self, element: Any) -> Any:
        """`element` with the roots' relations applied, and no square root in the denominator."""
        element = self.lift(element)
        if len(element.numer) + len(element.denom) > _LARGEST:
            raise Undecided("(a long expression)", "too large to decide")
        if time.monotonic() > self._deadline:
            raise Undecided("(a long expression)", "not decided in the time allowed")
        for generator, (degree, radicand) in reversed(self.relations.items()):
            power = self.K.from_expr(radicand)
            root = self.K.from_expr(generator)
            place = self.K.symbols.index(generator)
            numer = self._fold(element.numer, place, degree, root, power)
            denom = self._fold(element.denom, place, degree, root, power)
            if degree == 2:
                low, high = denom
                if high:
                    a, b = numer
                    numer = [a * low - b * high * power, b * low - a * high]
                    denom = [low**2 - high**2 * power, self.K.zero]
            below = sum((c * root**k for k, c in enumerate(denom)), self.K.zero)
            if not below:
                raise Undecided(self.back(element), "a denominator may vanish")
            element = sum((c * root**k for k, c in enumerate(numer)), self.K.zero) / below
        return element

    def _fold(self, polynomial: Any, place: int, degree: int, root: Any, power: Any) -> list[Any]:
        """Coefficients of 1, r, ..., r**(degree - 1) after r**degree -> power."""
        ring = polynomial.ring
        parts: dict[int, Any] = {}
        for monomial, coefficient in polynomial.terms():
            k = monomial[place]
            rest = (*monomial[:place], 0, *monomial[place + 1 :])
            parts.setdefault(k, ring.zero)
            parts[k] += ring.term_new(rest, coefficient)
        folded = [self.K.zero] * degree
        for k, part in parts.items():
            folded[k % degree] += self.K.new(part) * power ** (k // degree)
        return folded

    def diff(self, element: Any, variable: Any) -> Any:
        """The derivative of an element by a variable."""
        element = self.lift(element)
        used = [
            symbol
            for place, symbol in enumerate(self.K.symbols)
            if element.numer.degree(place) > 0 or element.denom.degree(place) > 0
        ]
        inner = {symbol: self._derivative(symbol, variable) for symbol in used}
        element = self.lift(element)
        result = self.K.zero
        for symbol in used:
            rate = self.lift(inner[symbol])
            if rate:
                result += element.diff(self.K.from_expr(symbol)) * rate
        return self.reduce(result)

    def _derivative(self, generator: Any, variable: Any) -> Any:
        key = (generator, variable)
        if key not in self._derivatives:
            meaning = self._meaning[generator]
            if generator in self.angles:
                rate = self.element(self.angles[generator].diff(variable))
                t = self.K.from_expr(generator)
                rate = rate * (1 + t**2) / 2
            elif isinstance(meaning, exp):
                rate = self.element(meaning.args[0].diff(variable)) * self.K.from_expr(generator)
            elif generator in self.relations:
                degree, radicand = self.relations[generator]
                inner = self.diff(self.K.from_expr(radicand), variable)
                below = degree * self.K.from_expr(radicand)
                rate = inner * self.K.from_expr(generator) / below
            elif isinstance(meaning, sign):
                rate = self.K.zero
            else:
                rate = self.element(meaning.diff(variable))
            self._derivatives[key] = rate
        return self._derivatives[key]

    def constants(self) -> list[Any]:
        """Generators whose derivative by every variable is zero."""
        found = []
        for symbol in list(self._meaning):
            if not any(self._meaning[symbol].has(variable) for variable in self.variables):
                found.append(symbol)
        return found

    def functions(self) -> list[Any]:
        """What the generators other than symbols stand for; sine and cosine for an angle."""
        found = []
        fixed = self.constants()
        for symbol, meaning in self._meaning.items():
            if symbol in self.angles and symbol not in fixed:
                found += [sin(self.angles[symbol]), cos(self.angles[symbol])]
            elif symbol not in fixed and not isinstance(meaning, Symbol):
                found.append(meaning)
                if isinstance(meaning, exp):
                    found.append(1 / meaning)
        return found

    def name(self, expr: Any) -> Any:
        """An expression in generators, with what they stand for."""
        return expr.xreplace(self._meaning)

    # --- back to expressions ----------------------------------------------------------------

    def back(self, element: Any) -> Any:
        """`element` as an expression again, in sines and cosines."""
        element = self.lift(element)
        numer, denom = element.numer.as_expr(), element.denom.as_expr()
        for t, angle in self.angles.items():
            if numer.has(t) or denom.has(t):
                above, below = Poly(numer, t), Poly(denom, t)
                half = (max(above.degree(), below.degree()) + 1) // 2
                numer, denom = _unfold(above, half, angle), _unfold(below, half, angle)
        content, rest = (numer / denom).as_content_primitive()
        return (content * rest).xreplace(self._meaning)

    # --- decisions --------------------------------------------------------------------------

    def is_zero(self, element: Any) -> bool:
        """True if proven, False by numerics of high precision; raises `Undecided` otherwise."""
        element = self.reduce(element)
        if not element:
            return True
        if all(isinstance(meaning, Symbol) for meaning in self._meaning.values()):
            return False  # a rational function of independent symbols
        signs = [self._nonzero(element.numer, values) for values in self._numbers(element)]
        if signs and all(signs):
            return False
        expr = self.back(element)
        if not signs:
            raise Undecided(expr, "no point was found at which it can be evaluated")
        if any(signs):
            raise Undecided(expr, "zero in one region and not in another")
        if expr.count_ops() <= _SIMPLIFIABLE and not late() and simplify(expr) == 0:
            return True
        raise Undecided(expr, f"zero to {_DIGITS // 2} digits, which is no proof")

    def zero(self, expr: Any) -> bool:
        """`is_zero` of an expression."""
        return self.is_zero(self.element(expr))

    def _nonzero(self, polynomial: Any, values: dict[Any, Any]) -> bool:
        with mpmath.workdps(_DIGITS):
            total = size = mpmath.mpf(0)
            for monomial, coefficient in polynomial.terms():
                term = mpmath.mpf(int(coefficient.numerator)) / int(coefficient.denominator)
                for symbol, power in zip(self.K.symbols, monomial, strict=True):
                    if power:
                        term *= values[symbol] ** power
                total += term
                size += abs(term)
            return bool(abs(total) > size * mpmath.mpf(10) ** (-_DIGITS // 2))

    def _numbers(self, element: Any) -> list[dict[Any, Any]]:
        """The generators' values at the sample points, real ones if there are any."""
        used = [
            symbol for place, symbol in enumerate(self.K.symbols) if element.numer.degree(place) > 0
        ]
        if not self._values or not self._extend(used):
            drawn = []
            for _ in range(40):
                point: dict[Any, Any] = {}
                values = self._evaluate(used, point, {})
                if values is not None:
                    drawn.append((all(isinstance(v, mpmath.mpf) for v in values.values()), point))
                if sum(real for real, _ in drawn) == _POINTS:
                    break
            analytic = not any(m.has(Abs, sign) for m in self._meaning.values())
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
            meaning = self._meaning[symbol]
            concrete = self._concrete(meaning)
            for free in sorted(concrete.free_symbols, key=str):
                if free not in point:
                    point[free] = Float(self._draw(free), _DIGITS + 15)
            try:
                number = concrete.xreplace(point).evalf(_DIGITS)
                value = number._to_mpmath(int(_DIGITS * 3.33))
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
        # a quadrature of an unknown function, which only lagfmu.integrals makes: any number
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

    # --- linear algebra ---------------------------------------------------------------------

    def rref(self, rows: Sequence[Sequence[Any]], width: int) -> tuple[list[list[Any]], list[int]]:
        """Reduced row echelon form with pivots in the first `width` columns; zero rows last."""
        matrix = [[self.lift(entry) for entry in row] for row in rows]
        pivots: list[int] = []
        for column in range(width):
            top = len(pivots)
            chosen = self._pivot(matrix, top, column)
            if chosen is None:
                continue
            matrix[top], matrix[chosen] = matrix[chosen], matrix[top]
            head = matrix[top][column]
            matrix[top] = [self.reduce(entry / head) if entry else entry for entry in matrix[top]]
            for k, row in enumerate(matrix):
                factor = row[column]
                if k != top and factor:
                    matrix[k] = [
                        self.reduce(a - factor * b) if b else a
                        for a, b in zip(row, matrix[top], strict=True)
                    ]
                    matrix[k][column] = self.K.zero
            pivots.append(column)
        return matrix, pivots

    def _pivot(self, matrix: list[list[Any]], top: int, column: int) -> int | None:
        doubt: Undecided | None = None
        order = sorted(
            range(top, len(matrix)),
            key=lambda k: len(matrix[k][column].numer) + len(matrix[k][column].denom),
        )
        for k in order:
            try:
                if not self.is_zero(matrix[k][column]):
                    return k
                matrix[k][column] = self.K.zero
            except Undecided as undecided:
                doubt = undecided
        if doubt is not None:
            raise doubt
        return None

    def nullspace(self, rows: Sequence[Sequence[Any]], width: int) -> list[list[Any]]:
        """A basis of the vectors v with rows v = 0."""
        matrix, pivots = self.rref(rows, width)
        basis = []
        for free in (column for column in range(width) if column not in pivots):
            vector = [self.K.zero] * width
            vector[free] = self.K.one
            for k, pivot in enumerate(pivots):
                vector[pivot] = -matrix[k][free]
            basis.append(vector)
        return basis


def _inverse(factors: dict[int, int]) -> dict[int, int]:
    return {prime: -power for prime, power in factors.items() if prime != 1}


def _unfold(polynomial: Any, half: int, angle: Any) -> Any:
    """A polynomial in tan(angle/2), times cos(angle/2)**(2 half), in sin(angle), cos(angle)."""
    c, s = Dummy("c"), Dummy("s")
    total = S.Zero
    for (k,), coefficient in polynomial.terms():
        odd = k % 2
        term = (s / 2) ** odd * ((1 - c) / 2) ** (k // 2)
        total += coefficient * term * ((1 + c) / 2) ** (half - odd - k // 2)
    return expand(total).xreplace({c: cos(angle), s: sin(angle)})


def pairs(count: int) -> Iterable[tuple[int, int]]:
    """All (i, j) with i < j < count."""
    return itertools.combinations(range(count), 2)
