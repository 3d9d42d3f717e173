"""Solid sphere rolling down a fixed sphere, through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu
from scipy.integrate import quad

WORLDS = {  # m [kg], g [m/s^2], a, R [m]
    "earth": {"m": 1.0, "g": 9.81, "a": 1.0, "R": 0.2},
    "moon": {"m": 3e-3, "g": 1.62, "a": 2.0, "R": 25.0},
    "tiny": {"m": 1e3, "g": 9.81, "a": 1e-6, "R": 1e-7},
    "marble": {"m": 1.0, "g": 9.81, "a": 1.0, "R": 1e-3},
}
EVERY = pytest.mark.parametrize("world", WORLDS.values(), ids=WORLDS.keys())


def roll(path, world, theta0, share=0.0, tolerance=1e-12, stop=12.0, points=1):
    """The motion from theta0 with v0^2 = share * g b cos(theta0), b = a + R; `stop` in sqrt(b/g)."""
    g, b, R = world["g"], world["a"] + world["R"], world["R"]
    rate = np.sqrt(share * g / b * np.cos(theta0))
    stop *= np.sqrt(b / g)
    start = {"r": b, "theta": theta0, "der(theta)": rate, "der(phi)": b / R * rate}
    return simulate_fmu(
        str(path),
        stop_time=stop,
        output_interval=stop / points,
        step_size=stop / points,
        relative_tolerance=tolerance,
        start_values={**world, **start},
    )


@EVERY
@pytest.mark.parametrize(("tolerance", "allowed"), [(None, 1e-7), (1e-12, 1e-11)])
def test_it_leaves_where_ten_seventeenths_of_the_height_and_the_speed_say(
    native_fmu, world, tolerance, allowed
):
    """The sphere leaves at cos theta = (10 cos theta0 + 7 v0^2/(g b))/17, b = a + R, whatever its mass
    and size: 7 v0^2/(g b) from the fraction of its energy that does not turn it."""
    for theta0, share in ((0.01, 0.0), (0.3, 0.5), (0.9, 0.99)):
        result = roll(native_fmu("RollingSphere"), world, theta0, share, tolerance)
        assert result["departure.surface.count"][-1] == 1
        expected = (10 + 7 * share) / 17 * np.cos(theta0)
        assert abs(np.cos(result["departure.surface.theta"][-1]) - expected) < allowed


def test_started_ever_nearer_to_the_top_it_leaves_at_ten_seventeenths(native_fmu):
    """As theta0 -> 0 from rest it leaves at cos theta = 10/17, later than the sliding particle's 2/3,
    and what is missing falls as (5/17) theta0^2."""
    for theta0 in (1e-1, 1e-2, 1e-3, 1e-4):
        result = roll(native_fmu("RollingSphere"), WORLDS["earth"], theta0, stop=25.0)
        short = 10 / 17 - np.cos(result["departure.surface.theta"][-1])
        assert short == pytest.approx(5 / 17 * theta0**2, rel=theta0**2, abs=1e-11)


def test_rolling_takes_longer_than_sliding_by_the_root_of_seven_fifths(native_fmu):
    """theta'' = (5/7)(g/b) sin theta: the time to the departure is the integral of d theta/theta' with
    theta'^2 = (10/7)(g/b)(cos theta0 - cos theta)."""
    g, b, theta0 = 9.81, 1.2, 0.2

    def pace(u):  # theta = theta0 + u^2
        fall = np.cos(theta0) - np.cos(theta0 + u**2)
        return 2 * u / np.sqrt(10 / 7 * g / b * fall)

    end = np.sqrt(np.arccos(10 / 17 * np.cos(theta0)) - theta0)
    time = quad(pace, 0, end, epsabs=1e-12, epsrel=1e-12)[0]
    for points in (1, 37, 800):
        result = roll(native_fmu("RollingSphere"), WORLDS["earth"], theta0, stop=6.0, points=points)
        assert result["departure.surface.time"][-1] == pytest.approx(time, abs=1e-10)


@EVERY
def test_the_forces_on_it_until_it_leaves(native_fmu, world):
    """On the surface the normal force is m g (17 cos theta - (10 + 7 share) cos theta0)/7 and the
    friction -(2/7) m g sin theta; the torque on the sphere is -R times that; f and the slip are zero.
    In flight there are no forces but the weight."""
    theta0, share = 0.2, 0.3
    result = roll(native_fmu("RollingSphere"), world, theta0, share, stop=6.0, points=300)
    weight, R, b = world["m"] * world["g"], world["R"], world["a"] + world["R"]
    closed = result["contact.surface"]
    assert 20 < closed.sum() < 280
    theta = result["theta"]
    normal = weight * (17 * np.cos(theta) - (10 + 7 * share) * np.cos(theta0)) / 7
    friction = -2 / 7 * weight * np.sin(theta)
    for name, expected, unit in (
        ("lambda.surface", normal, weight),
        ("Q.r", normal, weight),
        ("lambda.rolling", friction, weight),
        ("Q.theta", b * friction, b * weight),
        ("Q.phi", -R * friction, R * weight),
    ):
        assert np.abs(result[name] - expected)[closed].max() < 1e-11 * unit, name
        assert (result[name][~closed] == 0).all(), name
    assert (result["lambda.surface"][closed] > 0).all()
    assert np.abs(result["residual.surface"])[closed].max() <= 1e-15 * b
    speed = b * np.abs(result["der(theta)"]).max()
    assert np.abs(result["residual.rolling"])[closed].max() <= 1e-14 * speed


@EVERY
def test_in_flight_the_centre_falls_freely_and_the_spin_stays(native_fmu, world):
    """After the departure the centre flies a parabola, the sphere turns evenly, and the energy of both
    is still what it was at rest."""
    result = roll(native_fmu("RollingSphere"), world, 0.2, stop=6.0, points=300)
    g, b = world["g"], world["a"] + world["R"]
    flying, last = ~result["contact.surface"], result[-1]
    angle, spin = last["departure.surface.theta"], last["departure.surface.velocity.theta"]
    tau = (result["time"] - last["departure.surface.time"])[flying]
    x = b * np.sin(angle) + b * spin * np.cos(angle) * tau
    z = b * np.cos(angle) - b * spin * np.sin(angle) * tau - g * tau**2 / 2
    r, theta = result["r"][flying], result["theta"][flying]
    size = np.hypot(x, z)
    assert np.abs((r * np.sin(theta) - x) / size).max() < 1e-11
    assert np.abs((r * np.cos(theta) - z) / size).max() < 1e-11
    turning = last["departure.surface.velocity.phi"]
    assert turning == pytest.approx(b / world["R"] * spin, rel=1e-13)
    np.testing.assert_allclose(result["der(phi)"][flying], turning, rtol=1e-14)
    energy = world["m"] * g * b * np.cos(0.2)
    assert np.abs(result["energy.total"] - energy).max() < 1e-11 * energy


def test_a_start_that_slips_is_made_to_roll(native_fmu):
    """Set sliding at theta' without a word on its spin, the sphere keeps the speed that was set and is given
    the spin that rolls; the log tells it."""
    with instance(native_fmu("RollingSphere")) as one:
        one.start({"theta": 0.1, "der(theta)": 0.7})
        assert one.get("der(theta)") == pytest.approx(0.7, rel=1e-14)
        assert one.get("der(phi)") == pytest.approx(0.7 * 1.2 / 0.2, rel=1e-14)
        assert any("der(phi)" in message for _, _, message in one.log)
