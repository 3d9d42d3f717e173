"""Impacts of several contacts at once: solved together, whatever the order in which they are declared."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu
from sympy import cos, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.contacts import G, corner, cradle, e, restitution, rod, table, wedge
from zoo.pendulums import on_hemisphere, r, theta

from lagfmu import Contact, Parameter, simulate
from lagfmu.errors import LagfmuError

pytestmark = pytest.mark.filterwarnings("ignore:.*follows? from the others")


@pytest.fixture
def run(built: Any) -> Callable[..., Any]:
    """run(model, stop, step, values) of its native FMU."""
    return lambda model, *times, **values: simulate(built(model), *times, 1e-10, values)


def top(result: Any) -> Any:
    """Top of the parabola [m] that each communication point lies on."""
    return result["z"] + result["der(z)"] ** 2 / (2 * G)


# --------------------------------------------------------------------------- systems


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_rod_dropped_flat_rebounds_flat(run, order):
    """With J = 2 m l^2 and e = 1/2 both feet strike at sqrt(2 h/g), and the rod rises flat to e^2 h, then
    to e^4 h, ..., until it lies: no foot knows which was declared first."""
    result = run(rod(order), 2.0, 0.02)
    assert np.abs(result["theta"]).max() < 1e-14
    t, first = result["time"], np.sqrt(2 / G)
    for n, ends in enumerate(first * (1 + 2 * np.array([0, 0.5, 0.75]))):
        after = t > ends + 1e-6
        assert top(result)[after].max() == pytest.approx(0.25 ** (n + 1), rel=1e-9)
    assert result["contact.left"][-1]
    assert result["contact.right"][-1]
    assert result["lambda.left"][-1] == pytest.approx(G / 2, rel=1e-12)


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 1, 0, 2)])
def test_a_table_dropped_flat_on_four_legs_stays_level(run, order):
    """Four legs on three degrees of freedom strike together: the table rises level to e^2 h."""
    result = run(table(order), 1.0, 0.02)
    assert np.abs(result["theta"]).max() < 1e-14
    assert np.abs(result["phi"]).max() < 1e-14
    after = result["time"] > np.sqrt(2 / G) + 1e-6
    assert top(result)[after].max() == pytest.approx(0.25, rel=1e-9)


def test_no_leg_of_a_table_pulls_in_an_impact(built):
    """A table that turns lands level, all legs at once, and stays: m v, and J omega about both axes, are the
    legs' impulses, of which the least would pull at one leg where J (omega_1 + omega_2) > m v l."""
    speed, turns, way = 1.0, {"theta": 0.4, "phi": 0.3}, 0.1
    start = {q: -rate * way for q, rate in turns.items()}
    start |= {f"der({q})": rate for q, rate in turns.items()}
    start |= {"z": speed * way + G * way**2 / 2, "der(z)": -speed, "e": 0.0}
    with instance(built(table())) as one:
        one.start(start, tolerance=1e-10)
        one.step(2 * way)
        legs = {(i, j): one.get(f"closing.leg{i}{j}.impulse") for i in (0, 1) for j in (0, 1)}
        assert all(one.get(f"contact.leg{i}{j}") for i, j in legs)
    assert min(legs.values()) >= 0
    assert sum(legs.values()) == pytest.approx(speed + G * way, rel=1e-9)
    for axis, rate in enumerate(turns.values()):
        torque = sum((2 * leg[axis] - 1) * 0.5 * impulse for leg, impulse in legs.items())
        assert torque == pytest.approx(-2.0 * rate, rel=1e-9)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_particle_that_falls_into_a_v_climbs_neither_side(run, order):
    """e = 0: it stays at the bottom of a symmetric V, and each wall then carries m g/(2 sin(angle)); with
    e = 1/2 on both walls it rises on the axis to e^2 h."""
    result = run(wedge(order), 1.0, 0.05)
    assert np.abs(result["x"]).max() < 1e-15
    rests = result["time"] > np.sqrt(2 / G)
    assert np.abs(result["z"][rests]).max() < 1e-15
    for wall in ("left", "right"):
        assert result[f"lambda.{wall}"][-1] == pytest.approx(G / 2 / np.sin(1.0), rel=1e-13)
    result = run(wedge(order), 0.8, 0.05, e=0.5)
    assert np.abs(result["x"]).max() < 1e-14
    assert top(result)[-1] == pytest.approx(0.25, rel=1e-9)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("tilt", [0.0, 0.5])
def test_a_ball_flies_out_of_a_corner_the_way_it_came(run, order, tilt):
    """In a right-angled corner struck at its vertex both components of the velocity turn to -e v."""
    model = corner(order, 0.8, tilt)
    values = {"x": np.cos(np.pi / 4 + tilt), "z": np.sin(np.pi / 4 + tilt)}
    values |= {f"der({q})": -x for q, x in values.items()}
    result = run(model, 2.0, 0.5, **values)
    for q in ("x", "z"):
        assert result[f"der({q})"][-1] == pytest.approx(-0.8 * values[f"der({q})"], rel=1e-12)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 2, 0)])
def test_a_cradle_whose_balls_touch_is_the_same_from_both_sides(run, order, mirrored):
    """n equal balls: by Newton's law and complementarity those at rest move on together with
    (1 + e)/n, whatever their order and whether the first or the last is struck."""
    count = 4
    for value in (0.0, 0.5, 1.0):
        last = run(cradle(count, order, 0.5, mirrored), 1.0, 0.25, e=value)[-1]
        v = np.array([last[f"der(x{k})"] for k in range(count)])
        if mirrored:
            v = -v[::-1]
        expected = [(1 + value) / count - value, *[(1 + value) / count] * (count - 1)]
        np.testing.assert_allclose(v, expected, atol=1e-14)


def test_a_cradle_with_gaps_passes_the_motion_on(run):
    """Balls a micrometre apart strike one after another: with e = 1 the last flies off alone."""
    model = cradle(4)
    gaps = {f"x{k}": 0.1 * k + 1e-6 * k for k in range(1, 4)}
    last = run(model, 1.0, 0.25, **gaps)[-1]
    v = [last[f"der(x{k})"] for k in range(4)]
    np.testing.assert_allclose(v, [0, 0, 0, 1], atol=1e-12)


def test_a_ball_rebounds_from_a_block_that_lies(run):
    """A ball falls on a block that rests on the floor: the block stays, the impulse passes through it,
    the ball rises to e^2 h."""
    low, z = dynamicsymbols("low z")
    d = symbols("d", positive=True)
    model = point_mass(
        "Anvil",
        "low z",
        [
            Contact("between", z - low - d, restitution=e),
            Contact("floor", low, restitution=e),
        ],
        up=low + z,
        gravity=G,
        parameters=[Parameter(d, 0.1, "m"), restitution(0.6)],
        start={low: 0.0, z: 1.1},
    )
    result = run(model, 0.8, 0.05)
    assert np.abs(result["low"]).max() < 1e-15
    assert result["contact.floor"].all()
    assert top(result)[-1] == pytest.approx(0.1 + 0.36, rel=1e-9)


def test_a_ball_bounces_from_a_table_that_rises(run):
    """Relative to a table that rises with V = 2 m/s a ball falls with w and rebounds with e w; seen from the
    ground it gains speed: v+ = V + e (V - v-)."""
    z = dynamicsymbols("z")
    V = symbols("V", positive=True)
    model = point_mass(
        "Riser",
        "z",
        [Contact("table", z - V * dynamicsymbols._t, restitution=e)],
        parameters=[Parameter(V, 2.0, "m/s"), restitution(0.5)],
        start={z: 1.0, z.diff(): -3.0},
    )
    result = run(model, 1.0, 0.1)
    after = result["time"] > 0.2
    np.testing.assert_allclose(result["der(z)"][after], 2 + 0.5 * 5, rtol=1e-13)
    tau = result["time"][after] - 0.2
    np.testing.assert_allclose(result["z"][after], 0.4 + 4.5 * tau, rtol=1e-12)


# --------------------------------------------------------------------------- what is refused


@pytest.mark.parametrize("value", [1.5, -0.1, 1 + 1e-9])
def test_a_restitution_outside_0_to_1_is_refused(run, value):
    """e = 1.5 would make energy, e < 0 pass through the floor: refused by name and value, also where
    the parameter has no bounds of its own."""
    free = symbols("e_free")
    x = dynamicsymbols("x")
    model = point_mass(
        "Free",
        "x",
        [Contact("floor", x, restitution=free)],
        parameters=[Parameter(free, 0.5, "1")],
        start={x: 1.0},
    )
    with pytest.raises(LagfmuError, match=r"restitution of 'floor' is .*expected 0 .* to 1"):
        run(model, 1.0, 0.5, e_free=value)


# --------------------------------------------------------------------------- model exchange

TOLERANCES = (1e-3, 1e-4, 1e-6, 1e-8)


def exchanged(path: Path, stop: float, interval: float = 0.02, **more: Any) -> Any:
    """A run of fmpy's integrator on the FMU's model exchange."""
    return simulate_fmu(
        str(path), stop_time=stop, output_interval=interval, fmi_type="ModelExchange", **more
    )


@pytest.mark.parametrize("value", [0.0, 0.3, 0.7, 0.9])
def test_an_importers_integrator_leaves_the_ball_above_the_floor(native_fmu, value):
    """Under CVODE at every tolerance the ball bounces, comes to rest on the floor and stays there:
    y >= -1e-5 m, and after sqrt(2 h/g) (1 + e)/(1 - e) lambda = m g."""
    rest = np.sqrt(2 / G) * (1 + value) / (1 - value)
    for tolerance in TOLERANCES:
        result = exchanged(
            native_fmu("BouncingBall"),
            max(6.0, 1.1 * rest),
            relative_tolerance=tolerance,
            start_values={"e": value},
        )
        assert result["y"].min() >= -1e-8
        assert result["contact.floor"][-1]
        assert abs(result["y"][-1]) < 1e-15
        assert result["lambda.floor"][-1] == pytest.approx(G, rel=1e-12)
        assert (result["departure.floor.count"] == 0).all()


@pytest.mark.parametrize("step", [0.05, 0.01])
def test_a_fixed_step_carries_no_ball_through_the_floor(native_fmu, step):
    """Euler's method sees a landing up to a step late, so that the ball is inside by v h at most; it is
    brought back each time, and does not sink."""
    for value in (0.0, 0.3, 0.7):
        result = exchanged(
            native_fmu("BouncingBall"),
            8.0,
            step,
            solver="Euler",
            step_size=step,
            start_values={"e": value},
        )
        assert result["y"].min() >= -5 * step
        assert result["y"][-1] >= 0


@pytest.mark.parametrize("value", [0.0, 0.5, 0.9])
def test_a_particle_that_left_a_hemisphere_lands_in_model_exchange(built, value):
    """It leaves at cos theta = (2/3) cos theta0, lands on the floor and stays above it for 6 s, whatever
    tolerance CVODE has; x'' = 0 and energy only falls after the departure, within the tolerance."""
    floor = Contact("floor", r * cos(theta), restitution=e)
    lander = built(on_hemisphere("Lander", 0.1, [floor], parameters=[restitution(0.5)]))
    for tolerance in TOLERANCES:
        values = {"e": value}
        result = exchanged(
            lander,
            6.0,
            relative_tolerance=tolerance,
            start_values=values,
        )
        height = result["r"] * np.cos(result["theta"])
        assert height.min() >= -1e-5
        assert result["r"].min() >= 1 - 1e-3
        assert result["departure.surface.count"][-1] == 1
        assert result["departure.floor.count"][-1] == 0
        if value < 0.9:
            assert result["contact.floor"][-1]
        angle = result["departure.surface.theta"][-1]
        assert np.cos(angle) == pytest.approx(2 / 3 * np.cos(0.1), abs=100 * tolerance)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_rod_dropped_flat_lies_flat_in_model_exchange(built, order):
    """Both feet are struck together under an importer's integrator too."""
    path = built(rod(order, 0.7))
    for tolerance in TOLERANCES:
        result = exchanged(path, 6.0, relative_tolerance=tolerance)
        assert np.abs(result["theta"]).max() < 1e-8
        assert result["contact.left"][-1]
        assert result["contact.right"][-1]
        assert min(result["residual.left"].min(), result["residual.right"].min()) > -1e-8


def test_a_bounce_is_told_with_its_time_and_impulse(native_fmu):
    """A ball of 1 kg falls 1 m: it strikes the floor at sqrt(2 h/g) with m sqrt(2 g h) (1 + e), and again
    after its flight of 2 e sqrt(2 h/g) with e times that, though no communication point sees it; bounces
    within one step are told as the latest of them."""
    with instance(native_fmu("BouncingBall")) as one:
        one.start(stop_time=3.0)
        for _ in range(6):
            one.step(0.5)
        told = [m for _, c, m in one.log if c == "logEvents" and "was struck" in m]
    g, e = 9.81, 0.7
    fall, blow = np.sqrt(2 / g), np.sqrt(2 * g) * (1 + e)
    found = [[float(x) for x in re.findall(r"(?:t =|impulse) (\S+)", m)] for m in told]
    assert found[0] == pytest.approx([fall, blow], rel=1e-9)
    assert found[1] == pytest.approx([fall * (1 + 2 * e), blow * e], rel=1e-9)
    assert found[2] == pytest.approx(
        [fall * (1 + 2 * e + 2 * e**2 + 2 * e**3), blow * e**3], rel=1e-9
    )
    assert [m.partition("latest of ")[2] for m in told[:3]] == ["", "", "2"]
