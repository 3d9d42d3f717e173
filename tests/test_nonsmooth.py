"""Contacts of FMUs of both targets: several that open within one communication step, one that is lost and
made again, again and again."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from scipy.integrate import quad
from scipy.optimize import brentq
from sympy import cos, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Model, Parameter

G = 9.81
COUNT = 3
AMPLITUDE, SHAKEN = 0.03, 20.0  # A w^2 = 12 m/s^2
y = dynamicsymbols("y")
m, g, a = symbols("m g a", positive=True)
CONSTANTS = [Parameter(m, 2.0, "kg"), Parameter(g, G, "m/s^2")]


def spheres():
    """Three particles, each on a hemisphere of its own."""
    r = [dynamicsymbols(f"r{k}") for k in range(COUNT)]
    theta = [dynamicsymbols(f"theta{k}") for k in range(COUNT)]
    T = sum(m * (p.diff() ** 2 + p**2 * q.diff() ** 2) / 2 for p, q in zip(r, theta, strict=True))
    V = sum(m * g * p * cos(q) for p, q in zip(r, theta, strict=True))
    return Model(
        name="Spheres",
        lagrangian=T - V,
        coordinates={**dict.fromkeys(r, "m"), **dict.fromkeys(theta, "rad")},
        constraints=[Contact(f"surface{k}", r[k] - a) for k in range(COUNT)],
        parameters=[*CONSTANTS, Parameter(a, 1.0, "m")],
        start=dict.fromkeys(r, 1.0) | dict.fromkeys(theta, 0.3),
    )


def table():
    """A block on a table that goes up and down as A (1 - cos w t)."""
    A, w, t = *symbols("A w", positive=True), dynamicsymbols._t
    return point_mass(
        "Table",
        "y",
        [Contact("table", y - A * (1 - cos(w * t)))],
        up=y,
        parameters=[*CONSTANTS, Parameter(A, AMPLITUDE, "m"), Parameter(w, SHAKEN, "rad/s")],
        start={y: 0.0},
    )


def time_to_leave(theta0):
    """From theta'^2 = 2 (g/a)(cos theta0 - cos theta) and cos theta = (2/3) cos theta0 at the end; with
    theta = theta0 + w^2 nothing is singular."""
    end = np.arccos(2 / 3 * np.cos(theta0))

    def integrand(w):
        theta = theta0 + w**2
        fall = 2 * np.sin(theta0 + w**2 / 2) * np.sin(w**2 / 2)  # cos theta0 - cos theta
        return 2 * w / np.sqrt(2 * G * fall) if fall > 0 else 2 / np.sqrt(2 * G * np.sin(theta))

    return quad(integrand, 0, np.sqrt(end - theta0), epsabs=1e-13)[0]


@pytest.mark.parametrize("points", [1, 7, 100])
@pytest.mark.parametrize(
    "starts", [(0.3, 0.2, 0.1), (0.1, 0.3, 0.2), (0.2, 0.2, 0.3), (0.2, 0.2 + 1e-9, 0.2)]
)
def test_contacts_open_in_the_order_of_their_times(built, starts, points):
    """Each particle leaves its sphere when it would alone, the one that started further from the top
    first, whether all that happens within one communication step or in a hundred."""
    with instance(built(spheres())) as one:
        one.start({f"theta{k}": theta for k, theta in enumerate(starts)}, tolerance=1e-11)
        for n in range(points):
            one.step(1.2 * (n + 1) / points - one.time)
        times = [one.get(f"departure.surface{k}.time") for k in range(COUNT)]
        for k, theta in enumerate(starts):
            assert one.get(f"departure.surface{k}.count") == 1
            assert not one.get(f"contact.surface{k}")
            assert times[k] == pytest.approx(time_to_leave(theta), rel=1e-8)
            left = one.get(f"departure.surface{k}.theta{k}")
            assert np.cos(left) == pytest.approx(2 / 3 * np.cos(theta), abs=1e-9)
        texts = [text for _, category, text in one.log if category == "logEvents"]
        assert len(texts) == COUNT
    if len({*starts}) == COUNT:
        assert np.argsort(times).tolist() == np.argsort(starts)[::-1].tolist()


@pytest.mark.parametrize("method", ["auto", "dop853", "radau"])
def test_a_block_is_thrown_off_and_caught_again(built, method):
    """A table u = A (1 - cos w t) with A w^2 > g throws the block off where u'' = -g and meets it again
    where the block's parabola meets u: at each of these times in each of three periods, lambda =
    m (g + u'') between."""
    A, w = AMPLITUDE, SHAKEN
    leave = np.arccos(-G / (A * w**2)) / w
    rise, speed = A * (1 - np.cos(w * leave)), A * w * np.sin(w * leave)

    def gap(t):
        s = t - leave
        return rise + speed * s - G * s**2 / 2 - A * (1 - np.cos(w * t))

    caught = brentq(gap, leave + 0.02, leave + 0.4, xtol=1e-13)
    period = 2 * np.pi / w
    assert caught < period
    assert G + A * w**2 * np.cos(w * caught) > 0  # from there on the table carries it
    with instance(built(table())) as one:
        one.start({"solver.method": method}, tolerance=1e-10)
        while one.time < 3 * period:
            one.step(0.01)
            turn, part = divmod(one.time, period)
            flying = leave < part < caught
            assert one.get("contact.table") == (not flying)
            assert one.get("departure.table.count") == turn + (part > leave)
            push = 2 * (G + A * w**2 * np.cos(w * one.time))
            assert one.get("lambda.table") == pytest.approx(0 if flying else push, abs=1e-6)
        assert one.get("departure.table.time") == pytest.approx(2 * period + leave, abs=1e-9)
