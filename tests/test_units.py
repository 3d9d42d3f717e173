"""Units: what is read and refused, and the dimensional analysis of mechanical expressions."""

from __future__ import annotations

from fractions import Fraction

import pint
import pytest
import sympy as sp
from hypothesis import given
from hypothesis import strategies as st
from sympy.physics.mechanics import dynamicsymbols

from lagfmu.errors import UnitError
from lagfmu.testing import (
    ENERGY,
    ONE,
    POWER,
    SECOND,
    Unit,
    check_dimension,
    dimension_of,
    generalized_force_unit,
    multiplier_unit,
    parse_unit,
)

t = dynamicsymbols._t
r, theta, x, y = dynamicsymbols("r theta x y")
m, g, R, k, F, n = sp.symbols("m g R k F n")


def unit(text: str) -> Unit:
    return parse_unit(text, "parameter 'p'")


UNITS = {
    **{q: unit("m") for q in (r, x, y, R)},
    **{theta: unit("rad"), m: unit("kg"), g: unit("m/s2"), k: unit("N/m"), F: unit("N"), n: ONE},
}
KINETIC = m * (r.diff(t) ** 2 + r**2 * theta.diff(t) ** 2) / 2


@pytest.mark.parametrize(
    "symbol",
    [
        "N",
        "J",
        "W",
        "Pa",
        "V",
        "Ohm",
        "F",
        "C",
        "S",
        "Wb",
        "T",
        "H",
        "Hz",
        "Gy",
        "Sv",
        "kat",
        "kg",
        "m",
        "s",
        "A",
        "K",
        "mol",
        "cd",
        "rad",
    ],
)
def test_each_symbol_has_the_dimension_that_pint_knows(symbol):
    """lagfmu reads the symbols of coherent SI by itself: their size is 1, their exponents are Pint's."""
    registry = pint.UnitRegistry()
    factor, base = registry.get_base_units("ohm" if symbol == "Ohm" else symbol)
    powers = registry.parse_units_as_container(str(base))
    assert unit(symbol).base == {registry.get_symbol(n): p for n, p in powers.items()}
    assert factor == 1


def problems(expr: object, expected: Unit | None = None) -> list[str]:
    return check_dimension(expr, expected, UNITS, "Lagrangian")


@pytest.mark.parametrize(
    ("text", "name", "base"),
    [
        ("m/s^2", "m/s2", {"m": 1, "s": -2}),
        ("m/s**2", "m/s2", {"m": 1, "s": -2}),
        ("m/s2", "m/s2", {"m": 1, "s": -2}),
        ("m.s-2", "m/s2", {"m": 1, "s": -2}),
        ("m/s/s", "m/s2", {"m": 1, "s": -2}),
        ("N*m", "N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N.m", "N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N m", "N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N·m", "N.m", {"kg": 1, "m": 2, "s": -2}),
        ("J", "J", {"kg": 1, "m": 2, "s": -2}),
        ("kg", "kg", {"kg": 1}),
        ("kg.m²", "kg.m2", {"kg": 1, "m": 2}),
        ("1", "1", {}),
        ("", "1", {}),
        (" ", "1", {}),
        ("1/s", "1/s", {"s": -1}),
        ("rad", "rad", {"rad": 1}),
        ("rad/s", "rad/s", {"rad": 1, "s": -1}),
        ("N.m.s/rad", "N.m.s/rad", {"kg": 1, "m": 2, "s": -1, "rad": -1}),
        ("N / m", "N/m", {"kg": 1, "s": -2}),
        ("J/(kg.K)", "J/(kg.K)", {"m": 2, "s": -2, "K": -1}),
        ("metre/second", "m/s", {"m": 1, "s": -1}),
        ("Ohm", "Ohm", {"kg": 1, "m": 2, "s": -3, "A": -2}),
    ],
)
def test_coherent_units_are_read(text: str, name: str, base: dict[str, int]) -> None:
    """Every spelling of one coherent SI unit has one name and one set of base exponents."""
    read = unit(text)
    assert (read.name, read.base) == (name, base)
    assert unit(read.name) == read


@pytest.mark.parametrize(
    ("text", "factor", "instead"),
    [
        ("mm", "1 mm = 0.001 m", "m"),
        ("g", "1 g = 0.001 kg", "kg"),
        ("deg", "1 deg = 0.0174533 rad", "rad"),
        ("km/h", "1 km/h = 0.277778 m/s", "m/s"),
        ("rpm", "1 rpm = 0.10472 rad/s", "rad/s"),
        ("lbf", "1 lbf = 4.44822 N", "N"),
        ("lbf.ft", "1 lbf.ft = 1.35582 N.m", "N.m"),
        ("kWh", "1 kWh = 3.6e+06 J", "J"),
        ("hour", "1 hour = 3600 s", "s"),
        ("percent", "1 percent = 0.01", "1"),
        ("%", "1 % = 0.01", "1"),
        ("mm/m", "1 mm/m = 0.001", "1"),
        ("litre", "1 litre = 0.001 m3", "m3"),
        ("stere", "1 stere = 1 m3", "m3"),
        ("delta_degC", "1 delta_degC = 1 K", "K"),
        ("sr", "1 sr = 1 rad2", "rad2"),
        ("Bq", "1 Bq = 1 1/s", "1/s"),
    ],
)
def test_incoherent_units_are_refused(text: str, factor: str, instead: str) -> None:
    """A unit with a factor to SI is refused with that factor and with the unit to write."""
    with pytest.raises(UnitError) as caught:
        parse_unit(text, "parameter 'L'")
    assert str(caught.value).startswith(f"parameter 'L' is given in {text!r} ({factor});")
    assert str(caught.value).endswith(f"give the value in {instead!r}")
    unit(instead)


@pytest.mark.parametrize("text", ["degC", "degF", "degC/m", "dB", "dBm"])
def test_offset_and_logarithmic_scales_are_refused(text: str) -> None:
    """0 degC is not 0 K and 0 dB is not 0: no factor converts such a scale."""
    with pytest.raises(UnitError, match=r"parameter 'p'.*offset or logarithmic.*give the value in"):
        unit(text)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("foo", "correct the unit"),
        ("m/", "correct the unit"),
        ("m)", "correct the unit"),
        ("m**m", "correct the unit"),
        ("2 m", "correct the unit"),
        ("Nm", "write the product as 'N.m'"),
        ("m^0.5", "use whole exponents"),
        ("m^(1/2)", "use whole exponents"),
        ("J/kg K", "put the denominator in parentheses"),
        ("J/kg.K", "put the denominator in parentheses"),
        (3, "write the unit as text"),
        (None, "write the unit as text"),
    ],
)
def test_unreadable_units_are_refused(text: str, remedy: str) -> None:
    """What is no unit, or has two readings, names its owner, its value and a remedy."""
    with pytest.raises(UnitError) as caught:
        unit(text)
    assert str(caught.value).startswith(f"parameter 'p' is given in {text!r}")
    assert "a unit such as 'm'" in str(caught.value)
    assert remedy in str(caught.value)


SYMBOLS = ["N", "J", "W", "Pa", "V", "Ohm", "C", "T", "Hz", "kg", "m", "s", "A", "K", "rad"]
PRODUCTS = st.lists(st.tuples(st.sampled_from(SYMBOLS), st.integers(-3, 3)), max_size=5)


@given(PRODUCTS)
def test_every_produced_name_is_read_back(parts: list[tuple[str, int]]) -> None:
    """The name of a product of powers denotes that very unit."""
    product = ONE
    for symbol, power in parts:
        product *= unit(symbol) ** power
    assert unit(product.name) == product
    assert unit(product.per_second().name) == product / SECOND
    for nonholonomic in (False, True):
        force = multiplier_unit(product, nonholonomic)
        assert unit(force.name) == force


@given(PRODUCTS, PRODUCTS)
def test_exponents_form_a_group(one: list[tuple[str, int]], two: list[tuple[str, int]]) -> None:
    """Exponents add under multiplication, and a quotient undoes a product."""
    a, b = ONE, ONE
    for symbol, power in one:
        a *= unit(symbol) ** power
    for symbol, power in two:
        b *= unit(symbol) ** power
    sums = tuple(p + q for p, q in zip(a.exponents, b.exponents, strict=True))
    assert (a * b).exponents == sums
    assert (a * b).rad == a.rad + b.rad
    assert a * b / b == a
    assert (a ** Fraction(1, 3)).exponents == tuple(p / 3 for p in a.exponents)
    assert ((a**2) ** Fraction(1, 2)).exponents == a.exponents


def test_joule_and_newton_metre_share_a_dimension() -> None:
    """A torque and an energy have one dimension under two names; the radian does not count."""
    assert ENERGY.exponents == unit("N.m").exponents == (POWER * SECOND).exponents
    assert unit("N.m") != ENERGY
    assert ENERGY.same_dimension(unit("N.m/rad"))
    assert not ENERGY.same_dimension(POWER)
    assert unit("rad").dimensionless
    assert not unit("rad/s").dimensionless


@pytest.mark.parametrize(
    ("constraint", "nonholonomic", "name"),
    [
        ("m", False, "N"),
        ("m2", False, "N/m"),
        ("rad", False, "N.m"),
        ("1", False, "N.m"),
        ("m.rad", False, "N"),
        ("kg", False, "J/kg"),
        ("m/s", False, "J.s/m"),
        ("m/s", True, "N"),
        ("rad/s", True, "N.m"),
        ("1/s", True, "N.m"),
        ("m2/s", True, "N/m"),
        ("kg/s", True, "J/kg"),
    ],
)
def test_multiplier_times_constraint_is_energy(
    constraint: str, nonholonomic: bool, name: str
) -> None:
    """lambda.f is an energy, and lambda times a Pfaffian form in the velocities a power."""
    force = multiplier_unit(unit(constraint), nonholonomic)
    assert force.name == name
    assert force.rad == 0
    assert (force * unit(constraint)).same_dimension(POWER if nonholonomic else ENERGY)
    assert unit(force.name) == force


@pytest.mark.parametrize(
    ("coordinate", "name"), [("m", "N"), ("rad", "N.m"), ("1", "N.m"), ("kg", "J/kg")]
)
def test_generalized_force_times_coordinate_is_energy(coordinate: str, name: str) -> None:
    """Q_j dq_j is a work."""
    force = generalized_force_unit(unit(coordinate))
    assert force.name == name
    assert (force * unit(coordinate)).same_dimension(ENERGY)


@pytest.mark.parametrize(
    ("expr", "expected"),
    [
        (KINETIC - m * g * r * sp.cos(theta), "J"),
        (y - R * theta, "m"),
        (x.diff(t) - R * theta.diff(t), "m/s"),
        (r.diff(t, 2) - r * theta.diff(t) ** 2 + g * sp.cos(theta), "m/s2"),
        (sp.sqrt(x**2 + y**2) - R, "m"),
        (sp.sqrt(x) ** 3 * sp.sqrt(y), "m2"),
        (x**0.5 * y ** sp.Rational(1, 2), "m"),
        (g * t**2 / 2 - x, "m"),
        (sp.atan2(x, y) + theta, "rad"),
        (sp.Abs(x) + sp.Max(0, y) - sp.Min(x, y), "m"),
        (sp.sign(x) * F * x + sp.Heaviside(y) * k * y**2, "J"),
        (sp.Piecewise((0, x < R), (k * (x - R) ** 2 / 2, True)), "J"),
        (sp.Piecewise((F, sp.And(x > 0, y < R)), (-F, True)), "N"),
        (sp.exp(-x / R) + sp.log(m / m + n) + sp.tanh(n) + sp.asin(x / R), "1"),
        (2**n + theta**sp.pi + sp.pi + sp.E, "1"),
        (sp.Derivative(sp.cos(theta), t) + theta.diff(t), "1/s"),
        (sp.Derivative(k * x**2, x), "N"),
        (0, "J"),
        (sp.Float(0.0), "J"),
        (3, "1"),
    ],
)
def test_consistent_expressions_pass(expr: object, expected: str) -> None:
    """A physically meaningful expression has the dimension it must have, and no problem."""
    assert problems(expr, unit(expected)) == []
    assert problems(expr) == []
    found = dimension_of(expr, UNITS, "expression")
    if sp.sympify(expr).is_zero:
        assert found is None
    else:
        assert found is not None
        assert found.same_dimension(unit(expected))


@pytest.mark.parametrize(
    ("expr", "expected", "parts"),
    [
        # the missing g: the term named is the potential, not the kinetic energy
        (KINETIC - m * r * sp.cos(theta), "J", ["term '-m*r*cos(theta)' (unit kg.m)", "unit J"]),
        (x + y + m, None, ["term 'm' (unit kg)", "must have unit m"]),
        (x + m, None, ["'m' (unit kg)", "'x' (unit m)", "differ in dimension"]),
        (x + 1, None, ["term '1' (unit 1)", "write the number as a Parameter with a unit"]),
        (x + y + sp.sin(theta), None, ["term 'sin(theta)'", "must be a Parameter"]),
        (m * g, "J", ["'g*m' has unit kg.m/s2, expected J = kg.m2/s2"]),
        (sp.Integer(1), "J", ["'1' has unit 1", "write the number as a Parameter"]),
        # what the whole must be tells which term of an inner sum is wrong
        (m * (r.diff(t) ** 2 + r * theta.diff(t) ** 2), "J", ["term 'der(theta)**2*r' (unit m/s2"]),
        (sp.sin(x), None, ["the argument of 'sin(x)' has unit m", "divide it by a Parameter"]),
        (sp.sin(theta + x), None, ["term 'x' (unit m) must have unit 1"]),
        (sp.exp(m), None, ["the argument of 'exp(m)' has unit kg"]),
        (2**x, None, ["the exponent of '2**x' has unit m"]),
        (x**n, None, ["the base of 'x**n' has unit m"]),
        (x**sp.pi, None, ["the base of 'x**pi' has unit m"]),
        (sp.atan2(x, m), None, ["differ in dimension in 'atan2(x, m)'"]),
        (sp.Max(x, 1), None, ["term '1'", "'Max(1, x)'"]),
        (sp.Piecewise((x, y > 0), (m, True)), None, ["'x' (unit m) and 'm' (unit kg)"]),
        (sp.Piecewise((x, y > m), (R, True)), None, ["differ in dimension in"]),
        (sp.Function("f")(x), None, ["unknown function 'f' in 'f(x)'"]),
        (sp.gamma(n), None, ["unknown function 'gamma'"]),
    ],
)
def test_one_problem_names_the_offender(
    expr: object, expected: str | None, parts: list[str]
) -> None:
    """Quantities of different dimensions cannot be added, nor enter a transcendental function."""
    found = problems(expr, None if expected is None else unit(expected))
    assert len(found) == 1
    assert found[0].startswith("Lagrangian: ")
    for part in parts:
        assert part in found[0]


def test_several_offenders_are_all_listed() -> None:
    """Independent mistakes of one expression are reported together."""
    found = problems(sp.sin(x) * F * x + sp.exp(m) * k * x**2 + m, ENERGY)
    assert len(found) == 3


def test_undeclared_symbols_are_named_once() -> None:
    """A symbol without a unit is a problem of its own, and fits any dimension when skipped."""
    c, z = sp.Symbol("c"), dynamicsymbols("z")
    found = problems(c * x + c * z.diff(t) + k * x)
    assert len(found) == 2
    assert any("'c' is neither coordinate, parameter nor input" in problem for problem in found)
    assert any("'z' is neither coordinate" in problem for problem in found)


@pytest.mark.parametrize(
    ("expr", "name"),
    [
        (y - R * theta, "m"),
        (R * theta - y, "m"),
        (theta.diff(t), "rad/s"),
        (theta - n, "1"),
        (k * x, "N"),
        (F * x.diff(t), "N.m/s"),
        (sp.sqrt(x), "m^(1/2)"),
    ],
)
def test_names_of_derived_dimensions(expr: object, name: str) -> None:
    """A rolled length R.theta is a length, whichever side of the equation it stands on."""
    assert dimension_of(expr, UNITS, "expression").name == name


def test_fractional_exponents_have_no_fmi_base_unit() -> None:
    """FMI's base unit exponents are integers, so that the root of a length has none."""
    with pytest.raises(UnitError, match=r"'m\^\(1/2\)' has fractional exponents"):
        _ = dimension_of(sp.sqrt(x), UNITS, "f").base
