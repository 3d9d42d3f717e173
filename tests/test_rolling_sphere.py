"""Solid sphere rolling down a fixed sphere, through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu
from scipy.integrate import quad

EARTH = {"m": 1.0, "g": 9.81, "a": 1.0, "R": 0.2}  # kg, m/s^2, m, m


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


def test_started_ever_nearer_to_the_top_it_leaves_at_ten_seventeenths(native_fmu):
    """As theta0 -> 0 from rest it leaves at cos theta = 10/17, later than the sliding particle's 2/3,
    and what is missing falls as (5/17) theta0^2."""
    for theta0 in (1e-1, 1e-2, 1e-3, 1e-4):
        result = roll(native_fmu("RollingSphere"), EARTH, theta0, stop=25.0)
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
        result = roll(native_fmu("RollingSphere"), EARTH, theta0, stop=6.0, points=points)
        assert result["departure.surface.time"][-1] == pytest.approx(time, abs=1e-10)


def test_a_start_that_slips_is_made_to_roll(native_fmu):
    """Set sliding at theta' without a word on its spin, the sphere keeps the speed that was set and is given
    the spin that rolls; the log tells it."""
    with instance(native_fmu("RollingSphere")) as one:
        one.start({"theta": 0.1, "der(theta)": 0.7})
        assert one.get("der(theta)") == pytest.approx(0.7, rel=1e-14)
        assert one.get("der(phi)") == pytest.approx(0.7 * 1.2 / 0.2, rel=1e-14)
        assert any("der(phi)" in message for _, _, message in one.log)
