"""Simple pendulum in x and y with a multiplier, in theta alone, and with lambda eliminated (ME 6590,
eq. 9), through fmpy on the built FMUs, against Jacobi's elliptic functions."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import evenly
from scipy.special import ellipj, ellipk

NAMES = ("PendulumCartesian", "PendulumAngle", "PendulumNullspace")
EVERY = pytest.mark.parametrize("name", NAMES)


def swing(path, theta0, rate=0.0, stop=5.0, tolerance=1e-12, points=100):
    """From theta0 [rad] with theta' = rate [rad/s]; each FMU is started in its own coordinates."""
    if path.stem == "PendulumAngle":
        start = {"theta": theta0, "der(theta)": rate}
    else:
        start = {
            "x": np.sin(theta0),
            "y": -np.cos(theta0),
            "der(x)": rate * np.cos(theta0),
            "der(y)": rate * np.sin(theta0),
        }
    return evenly(path, stop, points, tolerance, start)


def libration(t, theta0, g, L):
    """theta and theta' from rest at theta0: sin(theta/2) = k sn(w t + K, k), k = sin(theta0/2)."""
    w, k = np.sqrt(g / L), np.sin(theta0 / 2)
    sn, cn, _, _ = ellipj(w * t + ellipk(k**2), k**2)
    return 2 * np.arcsin(k * sn), 2 * k * w * cn


def rotation(t, rate, g, L):
    """theta (unwrapped) and theta' from the bottom with rate > 2 sqrt(g/L): theta/2 = am(rate t/2)."""
    m = 4 * g / L / rate**2
    _, _, dn, amplitude = ellipj(rate * t / 2, m)
    return 2 * amplitude, rate * dn


def multiplier(theta, rate):
    """lambda = -T/(2 L) [N/m] with the tension T = m (L theta'^2 + g cos theta), m = 1 kg, L = 1 m."""
    return -(rate**2 + 9.81 * np.cos(theta)) / 2


@EVERY
@pytest.mark.parametrize("theta0", [1e-3, 1.0, 3.0])
def test_motion_and_multiplier_are_elliptic_functions(native_fmu, name, theta0):
    """sin(theta/2) = k sn(w t + K) with k = sin(theta0/2), and
    lambda = -m (L theta'^2 + g cos theta)/(2 L), for small and for nearly upright swings."""
    result = swing(native_fmu(name), theta0, stop=6.0)
    theta, rate = libration(result["time"], theta0, 9.81, 1.0)
    assert np.abs(result["x"] - np.sin(theta)).max() < 1e-10
    assert np.abs(result["y"] + np.cos(theta)).max() < 1e-10
    assert np.abs(result["lambda.rod"] - multiplier(theta, rate)).max() < 1e-10 * 9.81
    if name == "PendulumAngle":
        assert np.abs(result["theta"] - theta).max() < 1e-10


@EVERY
@pytest.mark.parametrize(("start", "pushes"), [(6.4, True), (7.2, False)])
def test_a_fast_pendulum_rotates(native_fmu, name, start, pushes):
    """Pushed at the bottom with theta' > 2 sqrt(g/L) it goes round and round: theta/2 is Jacobi's
    amplitude; over the top the rod pushes if theta'^2 < 5 g/L at the bottom, and else always pulls."""
    result = swing(native_fmu(name), 0.0, start, stop=4.0)
    theta, rate = rotation(result["time"], start, 9.81, 1.0)
    assert theta[-1] > 4 * np.pi
    assert np.abs(result["x"] - np.sin(theta)).max() < 1e-10
    assert np.abs(result["lambda.rod"] - multiplier(theta, rate)).max() < 1e-10 * 49
    assert (result["lambda.rod"] > 0).any() == pushes
    if name == "PendulumAngle":
        assert np.abs(result["theta"] - theta).max() < 1e-10 * theta[-1]


@EVERY
def test_the_defaults_hold_the_default_tolerance(native_fmu, name):
    """Ten seconds of the FMU as it comes, at the tolerance 1e-8 that it states: lambda stays within
    1e-6 of the elliptic function's, in units of the weight."""
    result = swing(native_fmu(name), 1.0, stop=10.0, tolerance=None)
    theta, rate = libration(result["time"], 1.0, 9.81, 1.0)
    assert np.abs(result["lambda.rod"] - multiplier(theta, rate)).max() < 1e-6 * 9.81


def test_theta_determines_x_and_y(native_fmu):
    """With the embedding theta alone is free: x = L sin theta and y = -L cos theta follow, with their
    velocities, and follow a change of L too; to set one of them is an error that says so."""
    with instance(native_fmu("PendulumAngle")) as one:
        kinds = {n: (v.causality, v.initial) for n, v in one.variables.items()}
        assert kinds["theta"] == ("output", "exact")
        for name in ("x", "y", "der(x)", "der(y)", "lambda.rod"):
            assert kinds[name] == ("output", "calculated")
        one.start({"theta": 0.7, "der(theta)": 2.0, "L": 3.0})
        assert one.get("x") == pytest.approx(3 * np.sin(0.7), rel=1e-15)
        assert one.get("y") == pytest.approx(-3 * np.cos(0.7), rel=1e-15)
        assert one.get("der(x)") == pytest.approx(6 * np.cos(0.7), rel=1e-15)
        assert one.get("der(y)") == pytest.approx(6 * np.sin(0.7), rel=1e-15)
        assert one.log == []
    for name in ("x", "y", "der(x)"):
        with instance(native_fmu("PendulumAngle")) as one:
            with pytest.raises(Exception, match="failed with status"):
                one.start({name: 0.5})
            told = [text for _, _, text in one.log]
            assert any(
                f"'{name}' is calculated and cannot be set: set coordinates" in text
                for text in told
            )
