"""The dimensional analysis of SymPy expressions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.functions.elementary.hyperbolic import HyperbolicFunction, InverseHyperbolicFunction
from sympy.functions.elementary.trigonometric import (
    InverseTrigonometricFunction,
    TrigonometricFunction,
)

from ..errors import UnitError
from .attitude import Attitude, Carried
from .elements import TIME, Expr, plain
from .units import ONE, SECOND, Unit, fraction, in_words, without_rad

# Functions of a dimensionless argument, and those that keep the dimension of their arguments.
_PURE = (
    *(TrigonometricFunction, InverseTrigonometricFunction, HyperbolicFunction),
    *(InverseHyperbolicFunction, sp.exp, sp.log, sp.floor, sp.ceiling, sp.erf),
)
_KEEPING = (sp.Abs, sp.Max, sp.Min, sp.Mod, sp.re, sp.conjugate)


def check_dimension(
    expr: Expr, expected: Unit | None, units: Mapping[Expr, Unit], what: str
) -> list[str]:
    """The dimensional problems of `expr`, [] if there are none.  With `expected` None only the terms must
    agree.  A symbol without a unit is a problem."""
    walker = _Walker(units, what)
    unit = walker.walk(sp.sympify(expr), expected)
    if unit is not None and expected is not None and not unit.same_dimension(expected):
        walker.report(
            f"{_short(expr)!r} has unit {in_words(unit)}, expected {in_words(expected)}: "
            + _remedy([sp.sympify(expr)], [unit])
        )
    return list(walker.problems)


def dimension_of(expr: Expr, units: Mapping[Expr, Unit], what: str) -> Unit | None:
    """The unit of `expr`, None if it is identically zero; UnitError if its dimensions disagree."""
    walker = _Walker(units, what)
    unit = walker.walk(sp.sympify(expr), None)
    if walker.problems:
        raise UnitError("\n".join(walker.problems))
    return unit


class _Walker:
    """Walks an expression and collects its dimensional problems; None stands for any dimension."""

    def __init__(self, units: Mapping[Expr, Unit], what: str) -> None:
        self.units, self.what = units, what
        self.problems: dict[str, None] = {}  # ordered, each once

    def report(self, problem: str) -> None:
        self.problems.setdefault(f"{self.what}: {problem}")

    def walk(self, expr: Expr, expected: Unit | None = None) -> Unit | None:
        if expr in self.units:
            return self.units[expr]
        if expr.is_number:
            return None if expr.is_zero or expr.is_infinite else ONE
        if expr == TIME:
            return SECOND
        if expr.is_Symbol or (isinstance(expr, AppliedUndef) and expr.args == (TIME,)):
            self.report(
                f"{plain(expr)!r} is neither coordinate, parameter nor input: declare it with its unit"
            )
            return None
        if expr.is_Add or isinstance(expr, _KEEPING):
            return self._agree(expr.args, expected, expr)
        if expr.is_Mul:
            return self._product(expr.args, expected)
        if expr.is_Pow:
            return self._power(expr)
        if isinstance(expr, sp.Derivative):
            unit = self.walk(expr.expr)
            for variable, count in expr.variable_count:
                below = self.walk(variable)
                unit = None if unit is None or below is None else unit / below ** int(count)
            return unit
        if isinstance(expr, sp.Piecewise):
            for _, condition in expr.args:
                self._condition(condition)
            return self._agree([value for value, _ in expr.args], expected, expr)
        if hasattr(expr, "spline"):
            return self._spline(expr)
        if isinstance(expr, sp.atan2):
            self._agree(expr.args, None, expr)
        elif isinstance(expr, Attitude):
            self._pure(expr.quaternion, "quaternion", expr)
        elif isinstance(expr, Carried):
            return self._carried(expr)
        elif isinstance(expr, (sp.sign, sp.Heaviside)):
            self.walk(expr.args[0])
        elif isinstance(expr, _PURE):
            self._pure(expr.args, "argument", expr)
        else:
            self.report(
                f"unknown function {expr.func.__name__!r} in {plain(expr)!r}, whose dimension "
                "cannot be told: write it in elementary functions"
            )
            return None
        return ONE

    def _carried(self, expr: Carried) -> Unit | None:
        """The unit of the vector, times that of w in each order."""
        order, _, e, s, w = expr.parts
        self._pure(e, "quaternion", expr)
        unit, rate = self._agree(s, None, expr), self._agree(w, None, expr) if order else ONE
        return None if unit is None or rate is None else unit * rate**order

    def _spline(self, expr: Expr) -> Unit:
        """A table's value, or [y]/[x]^k of its derivative; its argument has the unit of its x."""
        spline, order = expr.spline, expr.order
        unit = self.walk(expr.args[0], spline.x_unit)
        if unit is not None and not unit.same_dimension(spline.x_unit):
            self.report(
                f"the argument of {plain(expr)!r} has unit {in_words(unit)}, expected "
                f"{in_words(spline.x_unit)} as the table {spline.name!r} has: correct one of them"
            )
        found: Unit = spline.y_unit / spline.x_unit**order if order else spline.y_unit
        return found

    def _pure(self, args: Iterable[Expr], role: str, whole: Expr) -> None:
        for arg in args:
            unit = self.walk(arg, ONE)
            if unit is not None and not unit.dimensionless:
                self.report(
                    f"the {role} of {plain(whole)!r} has unit {in_words(unit)}, "
                    "expected a dimensionless one: divide it by a Parameter of that unit"
                )

    def _condition(self, condition: Expr) -> None:
        if condition.is_Relational:
            self._agree(condition.args, None, condition)
        else:
            for arg in condition.args:
                self._condition(arg)

    def _product(self, args: Sequence[Expr], expected: Unit | None) -> Unit | None:
        """The product; what is expected of it tells what a sum among the factors must be."""
        product: Unit | None = ONE
        sums = [arg for arg in args if arg.is_Add]
        for arg in (*(arg for arg in args if not arg.is_Add), *sums):
            hint = None
            if [arg] == sums and expected is not None and product is not None:
                hint = expected / product
            unit = self.walk(arg, hint)
            product = None if unit is None or product is None else product * unit
        return product

    def _power(self, expr: Expr) -> Unit | None:
        base, exponent = self.walk(expr.base), expr.exp
        if not exponent.is_number:
            self._pure([exponent], "exponent", expr)
        if base is None:
            return None
        if exponent.is_Rational or (exponent.is_Float and not base.dimensionless):
            return base ** fraction(str(exponent))
        if not base.dimensionless:
            self.report(
                f"the base of {plain(expr)!r} has unit {in_words(base)}, expected a dimensionless "
                "one under an exponent that is no plain number: divide it by a Parameter of that "
                "unit"
            )
        return ONE if base.dimensionless else None

    def _agree(self, terms: Sequence[Expr], expected: Unit | None, whole: Expr) -> Unit | None:
        """The common unit of `terms`; the offenders differ from `expected` or the majority."""
        groups: dict[tuple[Fraction, ...], list[tuple[Expr, Unit]]] = {}
        for term in terms:
            unit = self.walk(term, expected)
            if unit is not None:
                groups.setdefault(unit.exponents, []).append((term, unit))
        if not groups:
            return None
        if len(groups) == 1:
            units = [unit for _, unit in next(iter(groups.values()))]
            # y - R*theta is a length, whichever of its terms comes first
            return without_rad(units[0]) if len({u.rad for u in units}) > 1 else units[0]

        def rank(key: tuple[Fraction, ...]) -> tuple[bool, bool, int]:
            numbers = all(term.is_number for term, _ in groups[key])
            return expected is not None and key == expected.exponents, not numbers, len(groups[key])

        first, second, *_ = sorted(groups, key=rank, reverse=True)
        right = groups.pop(first) if rank(first) > rank(second) else []
        offenders = [pair for group in groups.values() for pair in group]
        named = " and ".join(f"{plain(term)!r} (unit {in_words(unit)})" for term, unit in offenders)
        remedy = _remedy([term for term, _ in offenders], [unit for _, unit in offenders])
        if right:
            agreed = expected if expected and first == expected.exponents else right[0][1]
            noun = "term" if len(offenders) == 1 else "terms"
            problem = f"{noun} {named} must have unit {in_words(agreed)} like the rest"
        else:
            problem = f"the terms {named} differ in dimension"
        self.report(f"{problem} in {_short(whole)!r}: {remedy}")
        return None


def _short(expr: Expr) -> str:
    text = plain(expr)
    return text if len(text) <= 120 else f"{text[:117]}..."


def _remedy(terms: Sequence[Expr], found: Sequence[Unit]) -> str:
    if any(term.is_number for term in terms):
        return "write the number as a Parameter with a unit"
    if any(unit.dimensionless for unit in found):
        return "add the missing factor; a number with a dimension must be a Parameter with a unit"
    return "add the missing factor, or correct the unit of one of its symbols"
