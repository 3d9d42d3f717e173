"""Contacts with surfaces that an importer moves: a block on a table whose height u, with der(u) and der(u,2),
is an input."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Input, Model, Parameter

G = 9.81
y, u = dynamicsymbols("y u")
m, g = symbols("m g", positive=True)


@pytest.fixture
def driven(built):
    """The FMU of a block of 2 kg on a table at the height u."""
    model = point_mass(
        "Driven",
        "y",
        [Contact("table", y - u)],
        up=y,
        mass=2.0,
        gravity=G,
        inputs=[Input(u, "m")],
        start={y: 0.0},
    )
    return built(model)


def drive(one, motion):
    for name, value in zip(("u", "der(u)", "der(u,2)"), motion, strict=True):
        one.set(name, value)


def thrown(amplitude, frequency, periods):
    """Times at which a block leaves a table that moves as A sin(w t): where -A w^2 sin(w t) = -g, if it
    has come back by then."""
    phase = np.arcsin(G / (amplitude * frequency**2))
    return (phase + 2 * np.pi * np.arange(periods)) / frequency


@pytest.mark.parametrize("step", [0.002, 0.01])
@pytest.mark.parametrize("order", [1, 2])
def test_a_shaken_block_leaves_the_table_once_a_period(driven, step, order):
    """u = 0.05 sin 20 t has u'' down to -20 m/s^2: the block leaves where u'' = -g in each of seven
    periods, as it does where t stands in the model; whether u'' is given or only u and u'."""
    A, w = 0.05, 20.0
    with instance(driven) as one:
        one.start({"u": 0.0, "der(u)": A * w, "der(y)": A * w}, tolerance=1e-8)
        times = []
        while one.time < 2.2:
            wt = w * one.time
            rate = -A * w**2 * np.sin(wt) if order == 2 else 0.0
            drive(one, (A * np.sin(wt), A * w * np.cos(wt), rate))
            one.step(step)
            if one.get("departure.table.count") > len(times):
                times.append(one.get("departure.table.time"))
        assert one.get("departure.table.count") == len(times) == 7
    np.testing.assert_allclose(times, thrown(A, w, 7), atol=1.5 * step)


def test_a_slowly_shaken_block_never_leaves(driven):
    """u = 0.02 sin 20 t has |u''| <= 8 m/s^2 < g: lambda = m (g + u'') > 0, however the motion is
    sampled, and nothing is counted."""
    A, w = 0.02, 20.0
    with instance(driven) as one:
        one.start({"u": 0.0, "der(u)": A * w, "der(y)": A * w}, tolerance=1e-8)
        while one.time < 0.7:
            wt = w * one.time
            rate = -A * w**2 * np.sin(wt)
            drive(one, (A * np.sin(wt), A * w * np.cos(wt), rate))
            assert one.get("lambda.table") == pytest.approx(2 * (G + rate), rel=1e-6)
            one.step(0.01)
            assert one.get("contact.table")
        assert one.get("departure.table.count") == 0


def test_a_table_that_stops_throws_the_block_up(driven):
    """From a table that goes up at 1 m/s and stops at once the block flies on: up to v^2/2 g, back at
    2 v/g, one departure at the moment of the stop."""
    with instance(driven) as one:
        one.start({"u": 0.0, "der(u)": 1.0, "der(y)": 1.0}, tolerance=1e-10)
        one.step(0.1)
        assert one.get("contact.table")
        drive(one, (0.1, 0.0, 0.0))
        one.step(1.0 / G)
        assert not one.get("contact.table")
        assert one.get("y") == pytest.approx(0.1 + 1 / (2 * G), abs=1e-9)
        assert one.get("departure.table.count") == 1
        assert one.get("departure.table.time") == pytest.approx(0.1, abs=1e-12)
        assert one.get("departure.table.velocity.y") == pytest.approx(1.0, abs=1e-12)
        one.step(1.1 / G)
        assert one.get("contact.table")


def test_a_table_that_just_reaches_the_block_strikes_it(driven):
    """A table that goes up at v and is slowed by v/0.625 s more than the block falls comes nearer by
    0.3125 s v, a millionth more than they are apart: one impact at 0.625 s (1 - 1e-3), in one step of 1 s."""
    with instance(driven) as one:
        start = {"u": 0.0, "der(u)": 1.0, "der(u,2)": -G - 1.6, "y": 0.3125 * (1 - 1e-6)}
        one.start(start, tolerance=1e-10)
        one.step(1.0)
        assert one.get("closing.table.count") == 1
        assert one.get("closing.table.time") == pytest.approx(0.625 * (1 - 1e-3), abs=1e-7)


def test_a_table_that_drops_away_is_left(driven):
    """A table that jumps down by 0.2 m leaves the block in free fall: one departure, lambda = 0."""
    with instance(driven) as one:
        one.start({"u": 0.0}, tolerance=1e-10)
        one.step(0.01)
        drive(one, (-0.2, 0.0, 0.0))
        one.step(0.1)
        assert one.get("departure.table.count") == 1
        assert one.get("lambda.table") == 0
        assert one.get("y") == pytest.approx(-G * 0.1**2 / 2, abs=1e-9)


@pytest.mark.parametrize("told", [1.0, 0.0])
def test_a_stack_comes_to_rest_on_a_table_that_moves(built, told):
    """A ball bounces on one that bounces on a table u = 0.05 sin 5 t.  Where the table has gone on otherwise
    than its derivatives foresaw, the lower ball goes with it and pushes the upper one, though these two are
    apart.  In the end both ride, if the rates of u are `told`: lambda = (m + M) (g + u'') below, M (g + u'')
    between them."""
    v = dynamicsymbols("v")
    e, M = symbols("e M", positive=True)
    model = Model(
        name="Stack",
        lagrangian=(m * y.diff() ** 2 + M * v.diff() ** 2) / 2 - m * g * y - M * g * v,
        coordinates={y: "m", v: "m"},
        constraints=[
            Contact("table", y - u, restitution=e),
            Contact("ball", v - y, restitution=e),
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(M, 0.5, "kg"),
            Parameter(e, 0.4, "1"),
            Parameter(g, G, "m/s^2"),
        ],
        inputs=[Input(u, "m")],
        start={y: 0.3, v: 0.9},
    )
    A, w = 0.05, 5.0

    def moves(one, told):
        u = A * np.sin(w * one.time), told * A * w * np.cos(w * one.time)
        drive(one, (*u, -told * w**2 * u[0]))

    with instance(built(model)) as one:
        one.start(tolerance=1e-8)
        while one.time < 3.0:
            moves(one, told)
            assert one.get("v") > one.get("y") - 1e-12
            one.step(0.01)
        moves(one, told=1.0)
        if told:
            weight = G - A * w**2 * np.sin(w * one.time)
            assert one.get("lambda.table") == pytest.approx(1.5 * weight, rel=1e-6)
            assert one.get("lambda.ball") == pytest.approx(0.5 * weight, rel=1e-6)
