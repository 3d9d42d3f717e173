"""Ladder that slides down a smooth wall, through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from scipy.integrate import quad, solve_ivp

from lagfmu import simulate

G = 9.81


def test_the_times_are_those_of_the_angle_alone(native_fmu):
    """theta'' = -(3/2)(g/l) cos theta at the wall, integrated alone, reaches the departure and (with the
    floor's equation from there) the floor when the FMU says."""
    length, theta0 = 2.0, 1.2  # as the FMU starts
    highest = 2 / 3 * np.sin(theta0)
    square = lambda s: 3 * G / length * (np.sin(theta0) - s)  # noqa: E731
    end = np.sqrt(theta0 - np.arcsin(highest))

    def pace(u):  # theta = theta0 - u^2
        s = np.sin(theta0 - u**2)
        return 2 * u / np.sqrt(square(s))

    time = quad(pace, 0, end, epsabs=1e-12, epsrel=1e-12)[0]

    def fall(_, y):
        theta, rate = y
        s, c = np.sin(theta), np.cos(theta)
        force = (G - length / 2 * s * rate**2) / (1 + 3 * c**2)
        return [rate, -6 * c * force / length]

    def flat(_, y):
        return y[0]

    flat.terminal = True
    y0 = [np.arcsin(highest), -np.sqrt(square(highest))]
    ended = solve_ivp(fall, (0, 2), y0, "DOP853", events=flat, rtol=1e-13, atol=1e-13)
    landing = time + ended.t_events[0][0]
    with instance(native_fmu("Ladder")) as one:
        one.start(tolerance=1e-12)
        one.step(landing - 1e-9)
        assert one.get("departure.wall.time") == pytest.approx(time, abs=1e-10)
        assert not one.get("contact.top")
        one.step(2e-9)
        assert one.get("contact.top")


def test_upright_it_stands(native_fmu):
    """Exactly upright the ladder balances on the floor, which carries it all, and leans on nothing."""
    upright = {"theta": np.pi / 2, "x": 0.0, "y": 1.0}
    result = simulate(native_fmu("Ladder"), 1.0, 0.1, start_values=upright)
    np.testing.assert_allclose(result["lambda.floor"], 10 * G, rtol=1e-12)
    assert np.abs(result["lambda.wall"]).max() < 1e-12
    np.testing.assert_allclose(result["theta"], np.pi / 2, rtol=1e-14)
