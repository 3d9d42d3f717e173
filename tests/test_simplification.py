"""Shorter forms for the eye: equal to what they are made of, and never at the cost of a build."""

from __future__ import annotations

import random

import pytest
import sympy as sp
from sympy.core.random import rng

from lagfmu.testing import simplification

a, b, c = sp.symbols("a b c", real=True)
ANGLES = sp.symbols("q0:20", real=True)
WAYS = (
    simplification.expanded,
    simplification.sums_of_angles,
    simplification.trigonometric,
    simplification.simplified,
    simplification.product,
)


def body(count: int) -> sp.Expr:
    """A sum of products of the sines and cosines of many angles, as a spatial mechanism's minors are."""
    chance = random.Random(3)
    waves = [f(q) for q in ANGLES for f in (sp.sin, sp.cos)]
    return sp.Add(
        *(chance.choice((-1, 1)) * sp.Mul(*chance.sample(waves, 5)) for _ in range(count))
    )


@pytest.mark.parametrize("way", WAYS)
def test_a_spatial_mechanism_is_shown_as_it_stands(way):
    """Sixty products of forty sines and cosines, and their square: SymPy's factor and trigsimp take
    minutes on them, now and then; nothing of that is begun, and the same expression comes back."""
    for e in (body(60), body(12) ** 6, (1 + a) ** 40 * (b + sp.sin(c)) ** 40):
        assert way(e) is e


def test_what_a_product_becomes_is_counted_before_it_is_multiplied_out():
    """(a + b)^2 (a + c) has at most 3 * 2 terms; a power of a sum, the combinations with repetition."""
    assert simplification.terms((a + b) ** 2 * (a + c)) == 6
    assert simplification.terms((a + b + c) ** 4) == 15 == len(sp.expand((a + b + c) ** 4).args)
    assert simplification.terms(sp.sin(a + b) / (a + b)) == 1


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(
    "e",
    [
        a * sp.sin(b) ** 2 + a * sp.cos(b) ** 2,
        sp.cos(a) * sp.cos(b) + sp.sin(a) * sp.sin(b),
        a**2 - b**2 + a - b,
        (a + b) ** 3 * sp.sin(c) * sp.cos(c) / sp.sqrt(a**2 + 1),
    ],
)
def test_the_form_changes_and_the_value_does_not(way, e):
    """At a point with irrational coordinates both have the same value to 40 digits."""
    point = {a: sp.sqrt(2), b: sp.pi / 5, c: sp.E / 3}
    assert abs(sp.N((way(e) - e).subs(point), 40)) < 1e-38


def test_sines_and_cosines_cancel_where_that_is_cheap():
    """sin^2 + cos^2 = 1, and cos a cos b + sin a sin b = cos(a - b)."""
    assert simplification.trigonometric(a * sp.sin(b) ** 2 + a * sp.cos(b) ** 2) == a
    product = sp.cos(a) * sp.cos(b) + sp.sin(a) * sp.sin(b)
    assert simplification.sums_of_angles(product) == sp.cos(a - b)
    assert dict(simplification.factors(sp.expand((a + b) ** 2 * (a - c)))) == {a + b: 2, a - c: 1}


def test_a_users_random_numbers_are_left_alone():
    """SymPy draws random numbers while it factors: always the same ones here, and none of the user's."""
    before = rng.getstate()
    simplification.product(sp.expand((a + b * c + 1) * (a - b + c**2 + 3)))
    assert rng.getstate() == before


def test_terms_that_share_a_parameter_are_gathered() -> None:
    """The force of a spring reads k (x - y), however it was multiplied out, and whatever else acts."""
    k, m, g, x, y, w = sp.symbols("k m g x y w")
    known = (k, m, g), (x, y)
    assert simplification.gathered(k * x - k * y + m * g, *known) == k * (x - y) + m * g
    assert simplification.gathered(k * x + m * y, *known) == k * x + m * y
    fall = m * g * sp.cos(x) - m * y * w**2  # as textbooks have it
    assert simplification.gathered(fall, *known) == fall
