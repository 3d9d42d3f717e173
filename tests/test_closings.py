"""When a contact closes and when a slide ends: times, counts, impulses, and the state just before."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import scene_of
from instance import instance
from runs import simulate_fmu
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.contacts import rod

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, Scene, multiplier, sweep
from lagfmu.errors import ModelError
from lagfmu.testing import happened

Fmu = Callable[[str], Path]
G = 9.81
# of a ball that falls 1 m and keeps E of its speed
FALL, SPEED, E = np.sqrt(2 / G), np.sqrt(2 * G), 0.7

x, z = dynamicsymbols("x z")
m, g = symbols("m g", positive=True)
CONSTANTS = (Parameter(m, 2.0, "kg"), Parameter(g, G, "m/s^2"))


def bounce(k: int) -> tuple[float, float, float]:
    """Time, velocity before and impulse of the bounce k = 0, 1, ... of 1 kg."""
    flights = sum(2 * E**i * FALL for i in range(1, k + 1))
    return FALL + flights, -SPEED * E**k, (1 + E) * SPEED * E**k


@pytest.mark.parametrize("step", [0.05, 1.5])
def test_every_bounce_is_a_closing(native_fmu: Fmu, step: float) -> None:
    """A ball that falls h strikes the floor at sqrt(2 h/g) with -sqrt(2 g h), takes m (1 + e) v, and again
    after 2 e v/g with e times that, whether a communication step sees one or several; at last it stays."""
    seen = set()
    with instance(native_fmu("BouncingBall")) as one:
        one.start(stop_time=3.0)
        assert [one.get(f"closing.floor.{s}") for s in ("count", "time", "impulse")] == [0, 0, 0]
        for _ in range(round(3 / step)):
            one.step(step)
            count = one.get("closing.floor.count")
            if not 0 < count <= 8:
                continue
            seen.add(count)
            found = [one.get(f"closing.floor.{s}") for s in ("time", "velocity.y", "impulse")]
            assert found == pytest.approx(bounce(count - 1), rel=1e-9)
            assert abs(one.get("closing.floor.y")) < 1e-12
            assert not one.get("contact.floor")
        assert one.get("contact.floor")
        assert one.get("departure.floor.count") == 0
    assert len(seen) >= (8 if step < 0.1 else 1)


def test_bounces_count_alike_in_model_exchange(native_fmu: Fmu) -> None:
    """An importer's solver meets the same bounces at the same times, with the same impulses."""
    run = simulate_fmu(
        str(native_fmu("BouncingBall")),
        fmi_type="ModelExchange",
        stop_time=2.0,
        output_interval=0.01,
        relative_tolerance=1e-10,
        output=[f"closing.floor.{s}" for s in ("count", "time", "velocity.y", "impulse")],
    )
    for k in range(4):
        (row,) = run[run["closing.floor.count"] == k + 1][-1:]
        found = [row[f"closing.floor.{s}"] for s in ("time", "velocity.y", "impulse")]
        assert found == pytest.approx(bounce(k), rel=1e-6)


def test_what_is_closed_at_the_start_has_not_closed(native_fmu: Fmu) -> None:
    """The particle rests on the hemisphere from the start: it leaves, and closes nothing; the block rides on
    its belt, which has not stuck before it has slipped."""
    with instance(native_fmu("Hemisphere")) as one:
        one.start(stop_time=2.0)
        one.step(2.0)
        assert one.get("departure.surface.count") == 1
        assert one.get("closing.surface.count") == 0
    with instance(native_fmu("Belt")) as one:
        one.start()
        one.step(0.24)
        assert [one.get(f"{s}.grip.count") for s in ("slipping", "sticking")] == [0, 0]
        assert one.get("sticks.grip")


def test_the_block_sticks_after_each_slide_in_model_exchange(native_fmu: Fmu) -> None:
    """With d = (mu_s - mu_k) m g/k the block slips for (2/w)(pi - atan(d w/v)) and sticks for 2 d/v: the
    first slide begins where k v t = mu_s m g; when it sticks it moves with the belt."""
    names = ("count", "time", "velocity.x")
    run = simulate_fmu(
        str(native_fmu("Belt")),
        fmi_type="ModelExchange",
        stop_time=1.5,
        output_interval=0.05,
        relative_tolerance=1e-10,
        output=[f"sticking.grip.{s}" for s in names],
    )
    w, v = 10.0, 0.2
    d = 0.2 * G / 100
    slide, ride = 2 / w * (np.pi - np.arctan(d * w / v)), 2 * d / v
    first = 0.5 * G / (100 * v) + slide
    for k, at in enumerate((first, first + ride + slide)):
        (row,) = run[run["sticking.grip.count"] == k + 1][-1:]
        assert row["sticking.grip.time"] == pytest.approx(at, abs=1e-6)
        assert row["sticking.grip.velocity.x"] == pytest.approx(v, abs=1e-9)
    assert run["sticking.grip.count"][-1] == 2


def test_contacts_that_close_together_have_each_their_own_impulse(built: Any) -> None:
    """A rod that falls flat on two feet gives half of m (1 + e) v to each."""
    with instance(built(rod())) as one:
        one.start(stop_time=0.5)
        one.step(0.5)
        for foot in ("left", "right"):
            assert one.get(f"closing.{foot}.count") == 1
            assert one.get(f"closing.{foot}.time") == pytest.approx(FALL, rel=1e-12)
            assert one.get(f"closing.{foot}.impulse") == pytest.approx(0.75 * SPEED, rel=1e-9)


def test_an_impact_goes_through_what_is_closed(built: Any) -> None:
    """A ball falls onto a block that lies on the floor: both contacts take m (1 + e) v at one instant, and
    the block, which stays, has been struck too; that its contact was closed at the start does not count."""
    a, b = dynamicsymbols("a b")
    model = point_mass(
        "Stack",
        "a b",
        [Contact("floor", b), Contact("meeting", a - b, restitution=0.5)],
        up=a + b,
        parameters=CONSTANTS,
        start={a: 1.0},
    )
    with instance(built(model)) as one:
        one.start(stop_time=0.6)
        one.step(0.4)
        assert one.get("closing.floor.count") == 0
        one.step(0.2)
        for contact in ("floor", "meeting"):
            assert one.get(f"closing.{contact}.count") == 1
            assert one.get(f"closing.{contact}.impulse") == pytest.approx(3 * SPEED, rel=1e-9)
        assert one.get("closing.floor.velocity.a") == pytest.approx(-SPEED, rel=1e-9)
        assert one.get("closing.floor.velocity.b") == pytest.approx(0, abs=1e-12)
        assert one.get("contact.floor")


def test_a_landing_may_stick_at_once(built: Any) -> None:
    """A block that falls straight down onto rough ground sticks when it lands, at the same instant."""
    model = point_mass(
        "Drop",
        "x z",
        [
            Contact("ground", z),
            Nonholonomic("hold", x.diff()),
            Friction("grip", of=["hold"], normal=multiplier("ground"), static=0.5),
        ],
        up=z,
        parameters=CONSTANTS,
        start={z: 1.0},
    )
    with instance(built(model)) as one:
        one.start(stop_time=1.0)
        one.step(1.0)
        assert one.get("closing.ground.count") == one.get("sticking.grip.count") == 1
        assert one.get("closing.ground.time") == one.get("sticking.grip.time")
        assert one.get("closing.ground.time") == pytest.approx(FALL, rel=1e-12)
        told = [text for _, category, text in one.log if category == "logEvents"]
        assert any(t.startswith("contact ground was struck at t = ") for t in told)
        assert f"friction grip began to stick at t = {one.get('sticking.grip.time')!r} s" in told


def test_a_sweep_says_never_where_nothing_landed(native_fmu: Fmu) -> None:
    """Runs that end before the ball lands have no time of a landing, and none of an impulse."""
    found = sweep(
        native_fmu("BouncingBall"),
        vary={"y": [0.5, 50.0]},
        keep=["closing.floor.time:last", "closing.floor.impulse:last", "closing.floor.count:last"],
        stop_time=0.5,
        workers=1,
    )
    assert found["closing.floor.count:last"].values.tolist() == [1, 0]
    for column, value in (
        ("closing.floor.time:last", np.sqrt(1 / G)),
        ("closing.floor.impulse:last", (1 + E) * np.sqrt(G)),
    ):
        first, second = happened(found, column)
        assert first == pytest.approx(value, rel=1e-9)
        assert np.isnan(second)


def test_the_times_of_closings_have_error_bars(built: Any) -> None:
    """error.closing.floor.time covers what the landing's time is off, and is 0 before the first."""
    model = scene_of("BouncingBall")[0].model
    with instance(built(model, Scene("Barred", error_bars=True))) as one:
        one.start()
        one.step(0.4)
        assert one.get("error.closing.floor.time") == 0
        one.step(0.4)
        bar = one.get("error.closing.floor.time")
        assert abs(one.get("closing.floor.time") - FALL) <= bar < 1e-6
        assert "error.closing.floor.impulse" not in one.variables


def test_a_coordinate_called_impulse_needs_a_model_without_contacts() -> None:
    """closing.floor.impulse must stay one thing; where nothing closes the name is free."""
    impulse = dynamicsymbols("impulse")
    said = {
        "name": "P",
        "lagrangian": m * impulse.diff() ** 2 / 2,
        "coordinates": {impulse: "m"},
        "parameters": [CONSTANTS[0]],
    }
    assert Model(**said)
    with pytest.raises(ModelError, match=r"closing\.floor\.impulse.*choose another"):
        Model(**said, constraints=[Contact("floor", impulse)])
