"""Units in coherent SI, and the dimensional analysis of SymPy expressions.

Pint reads the unit strings; a `Unit` keeps its exponents over the SI base and a Modelica name.
The radian is carried apart (FMI has it as a base unit) and counts as dimensionless.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache
from typing import Any

import pint
import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.functions.elementary.hyperbolic import HyperbolicFunction, InverseHyperbolicFunction
from sympy.functions.elementary.trigonometric import (
    InverseTrigonometricFunction,
    TrigonometricFunction,
)

from ..errors import UnitError
from .attitude import Attitude, Carried
from .elements import TIME, Expr

BASE = ("kg", "m", "s", "A", "K", "mol", "cd")
SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_EXAMPLES = "'m', 'rad', 'N.m', 'm/s2', 'kg.m2' or '1'"
_REGISTRY: pint.UnitRegistry[Any] = pint.UnitRegistry()
_REGISTRY.define("@alias ohm = Ohm")
# The symbols a unit name may be made of, in the order in which a name lists them.
_SYMBOLS = (
    *("N", "J", "W", "Pa", "V", "Ohm", "F", "C", "S", "Wb", "T", "H", "Hz", "Gy", "Sv", "kat"),
    *(*BASE, "rad"),
)


def _base_units(symbol: str) -> tuple[float, dict[str, Fraction]]:
    """The factor of a unit symbol to SI, and its exponents over the SI base and rad."""
    factor, base = _REGISTRY.get_base_units(symbol)
    powers = _REGISTRY.parse_units_as_container(str(base))
    short = {_REGISTRY.get_symbol(name): _fraction(power) for name, power in powers.items()}
    return float(str(factor)), {name: p for name, p in short.items() if name in (*BASE, "rad")}


def _fraction(power: Any) -> Fraction:
    return Fraction(power).limit_denominator(1000)


_SI = {symbol: _base_units(symbol)[1] for symbol in _SYMBOLS}
_NAMES = {_REGISTRY.get_name(symbol): symbol for symbol in _SYMBOLS}  # pint's name -> our symbol


@dataclass(frozen=True)
class Unit:
    """A coherent SI unit; units of one dimension may differ in name, as J and N.m do."""

    exponents: tuple[Fraction, ...]  # of kg, m, s, A, K, mol, cd
    rad: int
    name: str

    @property
    def dimensionless(self) -> bool:
        return not any(self.exponents)

    @property
    def base(self) -> dict[str, int]:
        """The attributes of FMI's <BaseUnit> that are not zero."""
        if any(power.denominator != 1 for power in self.exponents):
            raise UnitError(
                f"unit {self.name!r} has fractional exponents, FMI expects integers: "
                "raise the expression to the power that makes them whole"
            )
        powers = zip((*BASE, "rad"), (*self.exponents, Fraction(self.rad)), strict=True)
        return {name: int(power) for name, power in powers if power}

    def same_dimension(self, other: Unit) -> bool:
        return self.exponents == other.exponents

    def per_second(self) -> Unit:
        return self / SECOND

    def __mul__(self, other: Unit) -> Unit:
        return _merged((self.name, Fraction(1)), (other.name, Fraction(1)))

    def __truediv__(self, other: Unit) -> Unit:
        return _merged((self.name, Fraction(1)), (other.name, Fraction(-1)))

    def __pow__(self, power: int | Fraction) -> Unit:
        return _merged((self.name, Fraction(power)))


def _factors(name: str) -> dict[str, Fraction]:
    """The symbols of a name that `_unit` wrote, with their powers."""
    numerator, *denominator = re.split(r"/(?!\d)", name)
    powers: dict[str, Fraction] = {}
    for sign, part in ((1, numerator), *((-1, part) for part in denominator)):
        for symbol, root, whole in re.findall(r"([A-Za-z]+)(?:\^\((\d+/\d+)\)|(\d+))?", part):
            powers[symbol] = sign * Fraction(root or whole or 1)
    return powers


def _unit(factors: Mapping[str, Fraction]) -> Unit:
    """The unit of a product of powers of `_SYMBOLS`; the exponents follow from the name's parts."""
    total = dict.fromkeys((*BASE, "rad"), Fraction(0))
    above: list[str] = []
    below: list[str] = []
    for symbol in _SYMBOLS:
        power = factors.get(symbol, Fraction(0))
        if not power or (symbol == "rad" and power.denominator != 1):
            continue  # a root of an angle is a plain number
        for base, exponent in _SI[symbol].items():
            total[base] += exponent * power
        size = abs(power)
        text = "" if size == 1 else f"{size}" if size.denominator == 1 else f"^({size})"
        (above if power > 0 else below).append(symbol + text)
    name = ".".join(above) or "1"
    if below:
        name += "/" + (below[0] if len(below) == 1 else f"({'.'.join(below)})")
    rad = int(total.pop("rad"))
    return Unit(tuple(total.values()), rad, name)


@lru_cache(maxsize=4096)
def _merged(*parts: tuple[str, Fraction]) -> Unit:
    total: dict[str, Fraction] = {}
    for name, power in parts:
        for symbol, exponent in _factors(name).items():
            total[symbol] = total.get(symbol, Fraction(0)) + power * exponent
    return _unit(total)


ONE = _unit({})
SECOND, METRE, ENERGY, POWER, FORCE = (
    _unit({name: Fraction(1)}) for name in ("s", "m", "J", "W", "N")
)


def for_reading(name: str | None) -> str:
    """An FMU's name of a unit as people write it: kg·m² for kg.m2; nothing for a plain number."""
    if name is None or name == "1":
        return ""
    name = re.sub(r"(?<=[A-Za-z])(-?\d+)", lambda m: m[1].translate(SUPERSCRIPT), name)
    return name.replace(".", "·")


@dataclass(frozen=True)
class DisplayUnit:
    """A unit in which values are given or shown, of `size` in the coherent SI unit `unit`: 1 g = 0.001 kg.

    `coherent`: it is but another spelling of `unit`.
    """

    name: str
    unit: Unit
    size: float
    coherent: bool = False

    def to_si(self, value: float) -> float:
        """A value given in this unit, in coherent SI: 200 g is 0.2 kg, to the last digit."""
        parts = 1 / self.size
        return value / parts if parts > 1 and parts.is_integer() else value * self.size

    def from_si(self, value: float) -> float:
        """A value in coherent SI as it is shown."""
        parts = 1 / self.size
        return value * parts if parts > 1 and parts.is_integer() else value / self.size

    def per_second(self) -> DisplayUnit | None:
        """Of a rate; None where the name would have two fractions."""
        if "/" in self.name:
            return None
        return DisplayUnit(f"{self.name}/s", self.unit.per_second(), self.size)


def parse_unit(text: str, what: str) -> Unit:
    """Read a coherent SI unit such as 'm/s2', 'm/s^2', 'N m' or '1'; `what` names its owner in messages.

    Raises UnitError for what is no unit, and for one that is not coherent (g, mm, deg, rpm).
    """
    read = parse_scaled(text, what)
    if not read.coherent:
        size = "1" if math.isclose(read.size, 1.0) else f"{read.size:.6g}"
        amount = size if read.unit == ONE else f"{size} {read.unit.name}"
        raise UnitError(
            f"{what} is given in {text!r} (1 {read.name} = {amount}); equations are evaluated in coherent "
            f"SI units: give the value in {read.unit.name!r}"
        )
    return read.unit


def declared_unit(text: object, what: str, problems: list[str]) -> Unit | None:
    """The unit that something was given; what is wrong with it joins `problems`."""
    if not isinstance(text, str) or not text.strip():
        problems.append(f"{what} has no unit: give one, e.g. 'm', 'rad', or '1' for a number")
        return None
    try:
        return parse_unit(text, what)
    except UnitError as error:
        problems.append(str(error))
        return None


def parse_scaled(text: str, what: str) -> DisplayUnit:
    """Read any unit that is a multiple of a coherent one: 'g', 'mm', 'deg', 'rpm', 'kN/mm'.

    Raises UnitError for what is no unit, an offset scale (degC) and a logarithmic one (dB).
    """
    given = f"{what} is given in {text!r}"
    expected = f"a unit such as {_EXAMPLES} was expected"
    if not isinstance(text, str):
        raise UnitError(f"{given}; {expected}: write the unit as text")
    marked = re.sub(r"(?<!\d)\.|\.(?!\d)|[·⋅]", "*", text.strip().replace("**", "^"))
    marked = re.sub(r"(?<=[^\W\d_])(-?\d)", r"^\1", marked)  # Modelica's m/s2
    factor = r"(?:\([^()]*\)|[^\s*/()^]+)(?:\s*\^\s*(?:-?[\d.]+|\([^()]*\)))?"
    if re.search(rf"/\s*{factor}\s*[*\s]\s*[\w(]", marked):
        raise UnitError(
            f"{given}, whose product after '/' is ambiguous; {expected}: "
            "put the denominator in parentheses, as in 'J/(kg.K)'"
        )
    try:
        container = _REGISTRY.parse_units_as_container(marked.replace("^", "**"), as_delta=False)
        powers = {name: _fraction(power) for name, power in container.items()}
    except Exception as error:  # pint lets the errors of its tokenizer and evaluator through
        raise UnitError(f"{given}, which is not a unit; {expected}: correct the unit") from error
    if "number_meter" in powers:  # pint's textile unit
        raise UnitError(f"{given}, which is not a unit; {expected}: write the product as 'N.m'")
    if any(power.denominator != 1 for power in powers.values()):
        raise UnitError(f"{given}, with a fractional exponent; {expected}: use whole exponents")
    scale, coherent, multiple, offset = 1.0, ONE, False, False
    for name, power in powers.items():
        if name in _NAMES:
            coherent *= _unit({_NAMES[name]: power})
            continue
        multiple = True
        size, base = _base_units(name)
        offset = offset or _REGISTRY.Quantity(0.0, name).to_base_units().magnitude != 0
        scale *= size**power
        coherent *= _named(_unit(base)) ** power
    if offset:
        raise UnitError(
            f"{given}, an offset or logarithmic scale; equations are evaluated in coherent SI units: "
            f"give the value in {coherent.name!r}"
        )
    return DisplayUnit(" ".join(text.split()), coherent, scale, not multiple)


QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s\d.].*)?\Z")


def parse_quantity(text: str, unit: Unit, what: str) -> float:
    """'0.2' in coherent SI, or '200 g' with a unit of its own, as a number in SI.

    Raises UnitError for what is neither, and for a unit of another dimension than `unit`.
    """
    found = QUANTITY.match(text)
    if found is None:
        raise UnitError(
            f"{what} = {text!r} is no number, expected one in {unit.name}, or with a unit"
        )
    if found[2] is None:
        return float(found[1])
    read = parse_scaled(found[2], what)
    if not read.unit.same_dimension(unit):
        raise UnitError(
            f"{what} = {text!r} has unit {_shown(read.unit)}, expected {_shown(unit)}: correct the unit"
        )
    return read.to_si(float(found[1]))


def _named(unit: Unit) -> Unit:
    """The SI unit with a name of its own for this dimension, if there is one."""
    known = (_unit({symbol: Fraction(1)}) for symbol in _SYMBOLS[: _SYMBOLS.index("Hz")])
    return next((u for u in known if (u.exponents, u.rad) == (unit.exponents, unit.rad)), unit)


def multiplier_unit(constraint_unit: Unit, nonholonomic: bool) -> Unit:
    """[lambda] = J/[f] of a holonomic f(q, t), W/[expr] = J/([expr].s) of a Pfaffian form."""
    unit = constraint_unit * SECOND if nonholonomic else constraint_unit
    for known, force in ((ONE, FORCE * METRE), (METRE, FORCE), (METRE**2, FORCE / METRE)):
        if unit.same_dimension(known):
            return force
    return ENERGY / _without_rad(unit)


def generalized_force_unit(coordinate_unit: Unit) -> Unit:
    """[Q_j] = J/[q_j]: N for a length, N.m for an angle or a number."""
    return multiplier_unit(coordinate_unit, False)


def _without_rad(unit: Unit) -> Unit:
    return _merged((unit.name, Fraction(1)), ("rad", Fraction(-unit.rad)))


def plain(expr: Expr) -> str:
    """The expression as text: r for r(t), der(r) and der(r,2) for its derivatives."""
    expr = sp.sympify(expr)
    names: dict[Expr, Expr] = {}
    for node in expr.atoms(sp.Derivative):
        order = sum(int(count) for _, count in node.variable_count)
        wrt = [plain(v) for v, _ in node.variable_count if v != TIME]
        tail = [plain(node.expr), *wrt, *([str(order)] if order > 1 else [])]
        names[node] = sp.Symbol(f"der({','.join(tail)})")
    for node in expr.atoms(AppliedUndef):
        if len(node.args) == 1 and node.args[0].is_Symbol:
            names[node] = sp.Symbol(node.func.__name__)
    return str(expr.xreplace(names))


def check_dimension(
    expr: Expr, expected: Unit | None, units: Mapping[Expr, Unit], what: str
) -> list[str]:
    """The dimensional problems of `expr`, [] if there are none.  With `expected` None only the terms must
    agree.  A symbol without a unit is a problem."""
    walker = _Walker(units, what)
    unit = walker.walk(sp.sympify(expr), expected)
    if unit is not None and expected is not None and not unit.same_dimension(expected):
        walker.report(
            f"{_short(expr)!r} has unit {_shown(unit)}, expected {_shown(expected)}: "
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


def _short(expr: Expr) -> str:
    text = plain(expr)
    return text if len(text) <= 120 else f"{text[:117]}..."


def _shown(unit: Unit) -> str:
    """The name for a message: no rad beside kg or m, and the base units behind a derived name."""
    if unit.exponents[0] or unit.exponents[1]:
        unit = _without_rad(unit)
    base = _unit(dict(zip((*BASE, "rad"), (*unit.exponents, Fraction(unit.rad)), strict=True)))
    return unit.name if unit.name == base.name else f"{unit.name} = {base.name}"


def _remedy(terms: Sequence[Expr], found: Sequence[Unit]) -> str:
    if any(term.is_number for term in terms):
        return "write the number as a Parameter with a unit"
    if any(unit.dimensionless for unit in found):
        return "add the missing factor; a number with a dimension must be a Parameter with a unit"
    return "add the missing factor, or correct the unit of one of its symbols"


# Functions of a dimensionless argument, and those that keep the dimension of their arguments.
_PURE = (
    *(TrigonometricFunction, InverseTrigonometricFunction, HyperbolicFunction),
    *(InverseHyperbolicFunction, sp.exp, sp.log, sp.floor, sp.ceiling, sp.erf),
)
_KEEPING = (sp.Abs, sp.Max, sp.Min, sp.Mod, sp.re, sp.conjugate)


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
                f"the argument of {plain(expr)!r} has unit {_shown(unit)}, expected "
                f"{_shown(spline.x_unit)} as the table {spline.name!r} has: correct one of them"
            )
        found: Unit = spline.y_unit / spline.x_unit**order if order else spline.y_unit
        return found

    def _pure(self, args: Iterable[Expr], role: str, whole: Expr) -> None:
        for arg in args:
            unit = self.walk(arg, ONE)
            if unit is not None and not unit.dimensionless:
                self.report(
                    f"the {role} of {plain(whole)!r} has unit {_shown(unit)}, "
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
            return base ** _fraction(str(exponent))
        if not base.dimensionless:
            self.report(
                f"the base of {plain(expr)!r} has unit {_shown(base)}, expected a dimensionless "
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
            return _without_rad(units[0]) if len({u.rad for u in units}) > 1 else units[0]

        def rank(key: tuple[Fraction, ...]) -> tuple[bool, bool, int]:
            numbers = all(term.is_number for term, _ in groups[key])
            return expected is not None and key == expected.exponents, not numbers, len(groups[key])

        first, second, *_ = sorted(groups, key=rank, reverse=True)
        right = groups.pop(first) if rank(first) > rank(second) else []
        offenders = [pair for group in groups.values() for pair in group]
        named = " and ".join(f"{plain(term)!r} (unit {_shown(unit)})" for term, unit in offenders)
        remedy = _remedy([term for term, _ in offenders], [unit for _, unit in offenders])
        if right:
            agreed = expected if expected and first == expected.exponents else right[0][1]
            noun = "term" if len(offenders) == 1 else "terms"
            problem = f"{noun} {named} must have unit {_shown(agreed)} like the rest"
        else:
            problem = f"the terms {named} differ in dimension"
        self.report(f"{problem} in {_short(whole)!r}: {remedy}")
        return None
