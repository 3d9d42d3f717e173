"""Zero tests that do not guess: exact arithmetic in a differential field, with a numerical proof.

An expression is a rational function of generators (`generators.py`).  If its numerator vanishes, the
expression is zero: that is exact.  That it is *not* zero is decided by its values with 60 digits at
random points (`samples.py`); a rational function of symbols needs none.  Otherwise, `Undecided` is
raised.  The derivations follow from t' = u' (1 + t**2)/2 for t = tan(u/2), g' = u' g for g = exp(u)
and g' = P' g/(q P) for g**q = P (Bronstein, *Symbolic Integration I*, ch. 3).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from sympy import Dummy, Poly, S, Symbol, cos, exp, expand, sign, simplify, sin, sympify

from .fractions import LONG, Field
from .generators import Generators
from .samples import DIGITS, Samples
from .undecided import Undecided, deadline, late, spend, spent_beyond

_EFFORT = 8e6  # of all that one tower decides
_LARGEST = 3000  # terms of a numerator and a denominator; beyond that, the answer is "undecided"
_SIMPLIFIABLE = 150  # operations up to which SymPy's simplify is asked, ...
_SIMPLIFYING = 2e4  # ... and the effort for each
_LOOK = 20.0  # effort of an operation on elements besides its polynomials


class Tower:
    """The differential field that given expressions live in, with derivations by `variables`."""

    def __init__(self, variables: Sequence[Any], scan: Iterable[Any] = ()) -> None:
        self.variables = tuple(variables)
        self._deadline = deadline(_EFFORT)
        self._generators = Generators(self.variables)
        self._samples = Samples(self._generators.meaning)
        self._derivatives: dict[tuple[Any, Any], Any] = {}
        self._field()
        for expr in scan:
            self._generators.scan(expr)

    def _field(self) -> None:
        self.K = Field(list(self._generators.meaning), self._look)

    def _look(self, effort: float = _LOOK) -> None:
        spend(effort)
        if spent_beyond(self._deadline):
            raise Undecided(LONG, "not decided with the effort allowed")

    def element(self, expr: Any) -> Any:
        """`expr` as an element of the field, which grows when it has to."""
        rational = self._generators.rational(sympify(expr))
        if len(self._generators.meaning) != self.K.ngens:
            self._field()
        try:
            return self.reduce(self.K.from_expr(rational))
        except (ValueError, ZeroDivisionError) as error:
            raise Undecided(expr, "not a rational function of known generators") from error

    # --- arithmetic -------------------------------------------------------------------------

    def lift(self, element: Any) -> Any:
        """`element` in the field as it is now."""
        return element if element.field is self.K else element.set_field(self.K)

    def reduce(self, element: Any) -> Any:
        """`element` with the roots' relations applied, and no square root in the denominator."""
        element = self.lift(element)
        if len(element.numer) + len(element.denom) > _LARGEST:
            raise Undecided(LONG, "too large to decide")
        self._look()
        for generator, (degree, radicand) in reversed(self._generators.relations.items()):
            power = self.K.from_expr(radicand)
            root = self.K.generator(generator)
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
                result += element.diff(symbol) * rate
        return self.reduce(result)

    def _derivative(self, generator: Any, variable: Any) -> Any:
        key = (generator, variable)
        if key not in self._derivatives:
            meaning = self._generators.meaning[generator]
            if generator in self._generators.angles:
                rate = self.element(self._generators.angles[generator].diff(variable))
                t = self.K.generator(generator)
                rate = rate * (1 + t**2) / 2
            elif isinstance(meaning, exp):
                rate = self.element(meaning.args[0].diff(variable)) * self.K.generator(generator)
            elif generator in self._generators.relations:
                degree, radicand = self._generators.relations[generator]
                inner = self.diff(self.K.from_expr(radicand), variable)
                below = degree * self.K.from_expr(radicand)
                rate = inner * self.K.generator(generator) / below
            elif isinstance(meaning, sign):
                rate = self.K.zero
            else:
                rate = self.element(meaning.diff(variable))
            self._derivatives[key] = rate
        return self._derivatives[key]

    # --- decisions --------------------------------------------------------------------------

    def is_zero(self, element: Any) -> bool:
        """True if proven, False by numerics of high precision; raises `Undecided` otherwise."""
        element = self.reduce(element)
        if not element:
            return True
        if all(isinstance(meaning, Symbol) for meaning in self._generators.meaning.values()):
            return False  # a rational function of independent symbols
        signs = self._samples.nonzero(element.numer)
        if signs and all(signs):
            return False
        expr = self.back(element)
        if not signs:
            raise Undecided(expr, "no point was found at which it can be evaluated")
        if any(signs):
            raise Undecided(expr, "zero in one region and not in another")
        if expr.count_ops() <= _SIMPLIFIABLE and not late():
            spend(_SIMPLIFYING * expr.count_ops())
            if simplify(expr) == 0:
                return True
        raise Undecided(expr, f"zero to {DIGITS // 2} digits, which is no proof")

    def zero(self, expr: Any) -> bool:
        """`is_zero` of an expression."""
        return self.is_zero(self.element(expr))

    # --- back to expressions ----------------------------------------------------------------

    def back(self, element: Any) -> Any:
        """`element` as an expression again, in sines and cosines."""
        element = self.lift(element)
        numer, denom = element.numer.as_expr(), element.denom.as_expr()
        for t, angle in self._generators.angles.items():
            if numer.has(t) or denom.has(t):
                above, below = Poly(numer, t), Poly(denom, t)
                half = (max(above.degree(), below.degree()) + 1) // 2
                numer, denom = _unfold(above, half, angle), _unfold(below, half, angle)
        content, rest = (numer / denom).as_content_primitive()
        return (content * rest).xreplace(self._generators.meaning)

    def name(self, expr: Any) -> Any:
        """An expression in generators, with what they stand for."""
        return expr.xreplace(self._generators.meaning)

    def constants(self) -> list[Any]:
        """Generators whose derivative by every variable is zero."""
        found = []
        for symbol in list(self._generators.meaning):
            if not any(
                self._generators.meaning[symbol].has(variable) for variable in self.variables
            ):
                found.append(symbol)
        return found

    def functions(self) -> list[Any]:
        """What the generators other than symbols stand for; sine and cosine for an angle."""
        found = []
        fixed = self.constants()
        for symbol, meaning in self._generators.meaning.items():
            if symbol in self._generators.angles and symbol not in fixed:
                found += [
                    sin(self._generators.angles[symbol]),
                    cos(self._generators.angles[symbol]),
                ]
            elif symbol not in fixed and not isinstance(meaning, Symbol):
                found.append(meaning)
                if isinstance(meaning, exp):
                    found.append(1 / meaning)
        return found


def _unfold(polynomial: Any, half: int, angle: Any) -> Any:
    """A polynomial in tan(angle/2), times cos(angle/2)**(2 half), in sin(angle), cos(angle)."""
    c, s = Dummy("c"), Dummy("s")
    total = S.Zero
    for (k,), coefficient in polynomial.terms():
        odd = k % 2
        term = (s / 2) ** odd * ((1 - c) / 2) ** (k // 2)
        total += coefficient * term * ((1 + c) / 2) ** (half - odd - k // 2)
    return expand(total).xreplace({c: cos(angle), s: sin(angle)})
