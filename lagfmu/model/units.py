"""Units in coherent SI.

A `Unit` keeps its exponents over the SI base and a Modelica name.  Products of the symbols of coherent SI are
read here, all other units by Pint, which is loaded for the first of them: 0.4 s.
The radian is carried apart (FMI has it as a base unit) and counts as dimensionless.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any

from ..errors import UnitError

if TYPE_CHECKING:
    import pint

BASE = ("kg", "m", "s", "A", "K", "mol", "cd")
SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
_EXAMPLES = "'m', 'rad', 'N.m', 'm/s2', 'kg.m2' or '1'"
# What a unit name may be made of, in the order in which a name lists them, as powers of BASE and rad.
_DERIVED = {
    "N": (1, 1, -2),
    "J": (1, 2, -2),
    "W": (1, 2, -3),
    "Pa": (1, -1, -2),
    "V": (1, 2, -3, -1),
    "Ohm": (1, 2, -3, -2),
    "F": (-1, -2, 4, 2),
    "C": (0, 0, 1, 1),
    "S": (-1, -2, 3, 2),
    "Wb": (1, 2, -2, -1),
    "T": (1, 0, -2, -1),
    "H": (1, 2, -2, -2),
    "Hz": (0, 0, -1),
    "Gy": (0, 2, -2),
    "Sv": (0, 2, -2),
    "kat": (0, 0, -1, 0, 0, 1),
}
_SI = {s: dict(zip(BASE, powers, strict=False)) for s, powers in _DERIVED.items()}
_SI |= {s: {s: 1} for s in (*BASE, "rad")}
_SYMBOLS = tuple(_SI)


@cache
def _registry() -> tuple[pint.UnitRegistry[Any], dict[str, str]]:
    """Pint, and our symbol for each of its names that has one."""
    import pint

    registry: pint.UnitRegistry[Any] = pint.UnitRegistry()
    registry.define("@alias ohm = Ohm")
    return registry, {registry.get_name(symbol): symbol for symbol in _SYMBOLS}


def _base_units(symbol: str) -> tuple[float, dict[str, Fraction]]:
    """The factor of a unit symbol to SI, and its exponents over the SI base and rad."""
    registry, _ = _registry()
    factor, base = registry.get_base_units(symbol)
    powers = registry.parse_units_as_container(str(base))
    short = {registry.get_symbol(name): fraction(power) for name, power in powers.items()}
    return float(str(factor)), {name: p for name, p in short.items() if name in (*BASE, "rad")}


def fraction(power: Any) -> Fraction:
    """An exponent as the fraction that was meant."""
    return Fraction(power).limit_denominator(1000)


LONGEST, MOST = 200, 99  # characters of a unit, and its largest exponent
# one exponent; pint evaluates what it is handed, a power of a power too
_EXPONENT = re.compile(
    r"\s*\^\s*(?:-?\d{1,2}(?:\.\d{1,2})?|\(\s*-?\d{1,2}(?:\.\d{1,2}|\s*/\s*\d{1,2})?\s*\))(?!\w|\s*[\d.^])"
)


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
    if len(text) > LONGEST:
        raise UnitError(
            f"{what} is given in a unit of {len(text)} characters ({text[:20]!r}...); {expected}: shorten it"
        )
    marked = re.sub(r"(?<!\d)\.|\.(?!\d)|[·⋅]", "*", text.strip().replace("**", "^"))
    marked = re.sub(r"(?<=[^\W\d_])(-?\d)", r"^\1", marked)  # Modelica's m/s2
    factor = r"(?:\([^()]*\)|[^\s*/()^]+)(?:\s*\^\s*(?:-?[\d.]+|\([^()]*\)))?"
    if re.search(rf"/\s*{factor}\s*[*\s]\s*[\w(]", marked):
        raise UnitError(
            f"{given}, whose product after '/' is ambiguous; {expected}: "
            "put the denominator in parentheses, as in 'J/(kg.K)'"
        )
    if not _is_product(marked):
        raise UnitError(
            f"{given}, which is not a unit; {expected}: correct the unit (exponents to {MOST})"
        )
    if (factors := _coherent(marked)) is not None:
        return DisplayUnit(" ".join(text.split()), _unit(factors), 1.0, True)
    registry, names = _registry()
    try:
        container = registry.parse_units_as_container(marked.replace("^", "**"), as_delta=False)
        powers = {name: fraction(power) for name, power in container.items()}
    except Exception as error:  # pint lets the errors of its tokenizer and evaluator through
        raise UnitError(f"{given}, which is not a unit; {expected}: correct the unit") from error
    if "number_meter" in powers:  # pint's textile unit
        raise UnitError(f"{given}, which is not a unit; {expected}: write the product as 'N.m'")
    if any(power.denominator != 1 for power in powers.values()):
        raise UnitError(f"{given}, with a fractional exponent; {expected}: use whole exponents")
    if any(abs(power) > MOST for power in powers.values()):
        raise UnitError(f"{given}; {expected}: use exponents to {MOST}")
    scale, coherent, multiple, offset = 1.0, ONE, False, False
    for name, power in powers.items():
        if name in names:
            coherent *= _unit({names[name]: power})
            continue
        multiple = True
        size, base = _base_units(name)
        offset = offset or registry.Quantity(0.0, name).to_base_units().magnitude != 0
        scale *= _power(size, int(power))
        coherent *= _named(_unit(base)) ** power
    if offset:
        raise UnitError(
            f"{given}, an offset or logarithmic scale; equations are evaluated in coherent SI units: "
            f"give the value in {coherent.name!r}"
        )
    if not 0 < scale < math.inf:
        raise UnitError(
            f"{given}, whose size is no number of double precision: use {coherent.name!r}"
        )
    return DisplayUnit(" ".join(text.split()), coherent, scale, not multiple)


def _coherent(marked: str) -> dict[str, Fraction] | None:
    """The powers of `_SYMBOLS` in "kg*m^2/s^2" or "J/(kg*K)"; None for what is not made of these alone."""
    factor = r"(?:[A-Za-z]+(?:\^-?\d{1,2})?|1)"
    product = rf"{factor}(?:\s*[*\s]\s*{factor})*"
    if not re.fullmatch(rf"{product}(?:\s*/\s*(?:{factor}|\(\s*{product}\s*\)))*", marked):
        return None
    total: dict[str, Fraction] = {}
    for slash, part in re.findall(r"(/?)\s*([^/]+)", marked):
        for symbol, power in re.findall(r"([A-Za-z]+)(?:\^(-?\d+))?", part):
            total[symbol] = total.get(symbol, Fraction(0)) + int(power or 1) * (-1 if slash else 1)
    return (
        total
        if total.keys() <= _SI.keys() and max(map(abs, total.values()), default=0) <= MOST
        else None
    )


def _is_product(marked: str) -> bool:
    """True if exponents are short numbers, none of them raised again, and no other numbers stand there."""
    plain = _EXPONENT.sub(" ", marked)
    return not re.search(r"\^|(?<!\w)(?!1(?![\w.]))\d", plain)


def _power(size: float, power: int) -> float:
    try:
        return float(size**power)
    except OverflowError:
        return math.inf


QUANTITY = re.compile(r"\s*([-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?)\s*([^\s\d.].*)?\Z")


def parse_quantity(text: str, unit: Unit, what: str) -> float:
    """'0.2' in coherent SI, or '200 g' with a unit of its own, as a number in SI.

    Raises UnitError for what is neither, and for a unit of another dimension than `unit`.
    """
    found = QUANTITY.match(text) if len(text) <= LONGEST else None
    if found is None:
        raise UnitError(
            f"{what} = {text[:LONGEST]!r} is no number, expected one in {unit.name}, or with a unit"
        )
    if found[2] is None:
        return float(found[1])
    read = parse_scaled(found[2], what)
    if not read.unit.same_dimension(unit):
        raise UnitError(
            f"{what} = {text!r} has unit {in_words(read.unit)}, expected {in_words(unit)}: correct the unit"
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
    return ENERGY / without_rad(unit)


def generalized_force_unit(coordinate_unit: Unit) -> Unit:
    """[Q_j] = J/[q_j]: N for a length, N.m for an angle or a number."""
    return multiplier_unit(coordinate_unit, False)


def without_rad(unit: Unit) -> Unit:
    """The same of lengths along an arc: m for m.rad."""
    return _merged((unit.name, Fraction(1)), ("rad", Fraction(-unit.rad)))


def in_words(unit: Unit) -> str:
    """The name for a message: no rad beside kg or m, and the base units behind a derived name."""
    if unit.exponents[0] or unit.exponents[1]:
        unit = without_rad(unit)
    base = _unit(dict(zip((*BASE, "rad"), (*unit.exponents, Fraction(unit.rad)), strict=True)))
    return unit.name if unit.name == base.name else f"{unit.name} = {base.name}"
