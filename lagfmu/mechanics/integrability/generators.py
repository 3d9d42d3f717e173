"""Expressions as rational functions of generators.

A generator is a symbol, sin(u) or cos(u) of an angle u, exp(u), a root, or anything else (an unknown
function, a logarithm, ...) as it stands.  Some satisfy a relation g**q = P: cos(u)**2 = 1 - sin(u)**2,
roots, the imaginary unit, signs.  Multiples and sums of angles are unfolded by the addition theorems.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import lcm
from typing import Any

from sympy import (
    Abs,
    Add,
    Dummy,
    I,
    Mul,
    Pow,
    Rational,
    Symbol,
    cos,
    exp,
    expand,
    expand_log,
    expand_trig,
    log,
    pi,
    sign,
    sin,
    sympify,
)
from sympy.functions.elementary.hyperbolic import HyperbolicFunction
from sympy.functions.elementary.trigonometric import TrigonometricFunction
from sympy.simplify.fu import TR1, TR2


class Undecided(Exception):  # noqa: N818 (an answer rather than an error)
    """It cannot be decided whether `expr` is zero (Richardson, *Journal of Symbolic Logic* 33, 1968)."""

    def __init__(self, expr: Any, reason: str) -> None:
        self.expr, self.reason = expr, reason
        super().__init__(f"{reason}: {expr}")


class Generators:
    """The generators met so far, and what they stand for."""

    def __init__(self, expressions: Iterable[Any]) -> None:
        self.meaning: dict[Any, Any] = {}  # generator -> expression
        self.relations: dict[Any, tuple[int, Any]] = {}  # generator -> (q, P):  generator**q = P
        self._symbols: dict[Any, Any] = {}  # expression -> generator
        self._shares: dict[
            Any, int
        ] = {}  # part of an angle or exponent -> denominator of its fractions
        for expr in expressions:
            for node in sympify(expr).atoms(TrigonometricFunction, HyperbolicFunction, exp):
                for coefficient, rest in _terms(node.args[0]):
                    self._shares[rest] = lcm(self._shares.get(rest, 1), int(coefficient.q))

    def rational(self, expr: Any) -> Any:
        """`expr` as a rational function of generators, which are made when they have to be."""
        if expr.is_Rational:
            return expr
        if expr.is_Float:
            return Rational(format(float(expr), ".14g"))
        if expr.is_finite is False:
            raise Undecided(expr, "not a finite number")
        if isinstance(expr, Symbol):
            return self._generator(expr)
        if isinstance(expr, Add | Mul) or (isinstance(expr, Pow) and expr.exp.is_Integer):
            return expr.func(*map(self.rational, expr.args))
        if isinstance(expr, sin | cos):
            return self._circular(expr)
        if isinstance(expr, TrigonometricFunction) and TR2(TR1(expr)) != expr:
            return self.rational(TR2(TR1(expr)))
        if isinstance(expr, HyperbolicFunction):
            return self.rational(expr.rewrite(exp))
        if isinstance(expr, exp | Pow):
            return Mul(*[self._power(expr, c, rest) for c, rest in _terms(expr.exp)])
        if isinstance(expr, log) and expand_log(expr) != expr:
            return self.rational(expand_log(expr))
        if isinstance(expr, Abs) and expr.args[0].is_extended_real:
            return self.rational(expr.args[0]) * self.rational(sign(expr.args[0]))
        if expr is I or (isinstance(expr, sign) and expr.args[0].is_extended_real):
            return self._generator(expr, 2, expr**2 if expr is I else Rational(1))
        return self._generator(expr)

    def _generator(self, meaning: Any, degree: int = 0, power: Any = None) -> Any:
        """The generator that stands for `meaning`, with generator**degree = power."""
        if meaning in self.meaning:  # a generator already
            return meaning
        if meaning not in self._symbols:
            symbol = meaning if isinstance(meaning, Symbol) else Dummy("g", real=True)
            self._symbols[meaning] = symbol
            self.meaning[symbol] = meaning
            if degree:
                self.relations[symbol] = (degree, power)
        return self._symbols[meaning]

    def _power(self, expr: Any, coefficient: Any, rest: Any) -> Any:
        """base**(coefficient*rest), for `expr` = base**exponent or exp(exponent)."""
        if isinstance(expr, exp):
            share = lcm(self._shares.setdefault(rest, 1), int(coefficient.q))
            self._shares[rest] = share
            return self._generator(exp(rest / share)) ** (coefficient * share)
        degree = int(coefficient.q)
        root = Pow(expr.base, rest / degree)
        if rest != 1:
            return self._generator(root) ** int(coefficient.p)
        power = self.rational(expr.base)
        return self._generator(root, degree, power) ** int(coefficient.p)

    def _circular(self, expr: Any) -> Any:
        """sin or cos of a sum of angles, in the sine and cosine of a common part of each of them."""
        angle = fixed = Rational(0)
        parts = {}
        for coefficient, rest in _terms(expr.args[0]):
            if rest is pi:
                fixed += coefficient * pi
                continue
            share = lcm(self._shares.setdefault(rest, 1), int(coefficient.q))
            self._shares[rest] = share
            part = Dummy("u")
            parts[part] = rest / share
            angle += coefficient * share * part
        if not parts:
            return self._generator(expr)
        unfolded = expand_trig(expr.func(angle + fixed))
        for part, meaning in parts.items():
            sine = self._generator(sin(meaning))
            cosine = self._generator(cos(meaning), 2, 1 - sine**2)
            unfolded = unfolded.xreplace({sin(part): sine, cos(part): cosine})
        return self.rational(unfolded)


def _terms(argument: Any) -> list[tuple[Any, Any]]:
    """The terms of an angle or an exponent as pairs (rational coefficient, rest)."""
    return [term.as_coeff_Mul(rational=True) for term in Add.make_args(expand(argument))]
