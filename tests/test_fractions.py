"""The field of rational functions under the classifier: an exact field, whose operations all have an end."""

import pytest
from sympy import exp, simplify, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu.mechanics.integrability import fractions
from lagfmu.mechanics.integrability.classify import Kind, classify
from lagfmu.mechanics.integrability.fractions import Field, Fraction, gcd_bits
from lagfmu.mechanics.integrability.tower import Tower
from lagfmu.mechanics.integrability.undecided import Undecided, spend

a, b = symbols("a b")


def test_a_field():
    """Q(a, b) is a field: sums, products and powers of quotients are quotients, and 1/0 is none."""
    field = Field((a, b), lambda effort: None)
    f, g = (a**2 - b**2) / 3, 1 / (a + b)
    p, q = field.from_expr(f), field.from_expr(g)
    for value, exact in (
        (p + q, f + g),
        (1 - p, 1 - f),
        (p * q, f * g),
        (2 / p, 2 / f),
        (q**-2, g**-2),
        (q.diff(a), g.diff(a)),
        (p.set_field(Field((a, b, *symbols("c:2")), lambda effort: None)), f),
    ):
        assert simplify(value.numer.as_expr() / value.denom.as_expr() - exact) == 0
    assert (p * q).denom == 3  # in lowest terms
    for nothing in (lambda: p / 0, lambda: field.zero**-1, lambda: field.new(p.numer, p.numer * 0)):
        with pytest.raises(ZeroDivisionError):
            nothing()
    with pytest.raises(ValueError, match="no rational function"):
        field.from_expr(exp(a))


def test_what_would_take_minutes_is_not_begun():
    """A GCD of polynomials of degree 6 in 9 variables makes integers of 7^9 digits: it is refused."""
    field = Field(symbols("c:9"), lambda effort: None)
    f = sum(field.ring.gens, field.ring.zero) ** 6
    g = (sum(field.ring.gens, field.ring.zero) + 3) ** 6
    assert gcd_bits(f, g, (1,) * 9) > 7**9
    one = field.ring.one
    for operation in (
        lambda: field.new(f, g),
        lambda: Fraction(field, f, one) * Fraction(field, g, one),
        lambda: Fraction(field, f, one) ** 6,
    ):
        with pytest.raises(Undecided, match="too large to decide"):
            operation()


def test_powers_of_powers_cost_no_more():
    """x^12 - 1 and y^12 - 1 are of degree 2 in x^6 and y^6: what the GCD costs is told after that."""
    p, q = Field((a, b), lambda effort: None).ring.gens
    high, low = (p**12 + q**12 - 1, p**6 + q**6 - 1), (p**2 + q**2 - 1, p + q - 1)
    assert gcd_bits(*high, (6, 6)) == gcd_bits(*low, (1, 1)) < gcd_bits(*high, (1, 1))


def test_effort_is_counted_before_each_operation():
    """A limit of effort holds between any two operations of the field, not only between rows of them."""
    tower = Tower((a, b))
    p, q = tower.element(a), tower.element(b)
    spend(1e9)
    for operation in (
        lambda: p + q,
        lambda: p - q,
        lambda: p * q,
        lambda: p / q,
        lambda: p**2,
        lambda: p.diff(a),
        lambda: tower.K.from_expr(a + b),
    ):
        with pytest.raises(Undecided, match="not decided with the effort allowed"):
            operation()


@pytest.mark.parametrize("limit", ["PAIRS", "BITS"])
def test_the_limits_make_an_answer_undecided(monkeypatch, limit):
    """A form whose arithmetic is refused is undecided: no guess, and no crash."""
    monkeypatch.setattr(fractions, limit, 1)
    x, y, z = dynamicsymbols("x y z")
    dx, dy, dz = (q.diff() for q in (x, y, z))
    answer = classify(
        [(x + y) / (y + z) * dx + (x + z) ** 2 / (z - x) * dy, dz - y * dx], [x, y, z]
    )
    assert answer.kind is Kind.UNDECIDED
    assert "too large to decide" in answer.certificate
