"""Disk rolling down an incline (Marion & Thornton, example 7.9), both with y and theta and with theta
alone, through fmpy on the built FMUs."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu

BOTH = pytest.mark.parametrize("name", ["InclineDisk", "InclineDiskMinimal"])
DISKS = {
    "default": {"M": 1.0, "R": 0.1, "g": 9.81, "alpha": np.pi / 6},
    "millstone": {"M": 1.3e3, "R": 0.7, "g": 9.81, "alpha": 0.02},
    "on the Moon": {"M": 2e-3, "R": 4e-3, "g": 1.62, "alpha": 1.5},
    "upright": {"M": 3.0, "R": 0.25, "g": 9.81, "alpha": np.pi / 2},
    "huge and light": {"M": 1e-6, "R": 1e4, "g": 9.81, "alpha": 0.7},
}
EVERY = pytest.mark.parametrize("disk", DISKS.values(), ids=DISKS.keys())


def roll(path, disk, **start):
    return simulate_fmu(
        str(path), stop_time=1.0, output_interval=0.05, start_values={**disk, **start}
    )


@BOTH
@EVERY
def test_friction_and_acceleration_are_those_of_the_lecture(native_fmu, name, disk):
    """y'' = (2/3) g sin alpha, lambda = -M g sin(alpha)/3 = Q_y [N], up the incline, and
    Q_theta = -R lambda [N m], to 1e-12 at every moment, with the y coordinate or without."""
    result = roll(native_fmu(name), disk)
    pull = disk["g"] * np.sin(disk["alpha"])
    friction = -disk["M"] * pull / 3
    for variable, expected in (
        ("der(y,2)", 2 / 3 * pull),
        ("der(theta,2)", 2 / 3 * pull / disk["R"]),
        ("lambda.rolling", friction),
        ("Q.y", friction),
        ("Q.theta", -disk["R"] * friction),
        ("Q.rolling.y", friction),
        ("Q.rolling.theta", -disk["R"] * friction),
    ):
        np.testing.assert_allclose(result[variable], expected, rtol=1e-12, err_msg=variable)
    assert result["unique.rolling"].all()


@BOTH
@EVERY
def test_it_rolls_as_an_evenly_accelerated_body(native_fmu, name, disk):
    """y = y0 + v0 t + (1/3) g sin(alpha) t^2 and y = R theta, also when it is first rolled uphill."""
    R, turn = disk["R"], -2.0
    start = {"theta": 3.0, "der(theta)": turn}
    if name == "InclineDisk":
        start |= {"y": 3.0 * R, "der(y)": turn * R}
    result = roll(native_fmu(name), disk, **start)
    t = result["time"]
    theta = 3.0 + turn * t + disk["g"] * np.sin(disk["alpha"]) / R * t**2 / 3
    size = np.abs(theta).max()
    np.testing.assert_allclose(result["theta"], theta, rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(result["y"], R * theta, rtol=0, atol=1e-12 * R * size)
    rounding = 2 * np.finfo(float).eps * (np.abs(result["y"]) + R * np.abs(result["theta"]))
    assert (np.abs(result["residual.rolling"]) <= rounding).all()


@BOTH
def test_friction_does_no_work(native_fmu, name):
    """The point of contact does not move: the energy is constant though a force acts there, and
    its power on y is what it takes from theta."""
    result = roll(native_fmu(name), DISKS["default"])
    energy = result["energy.total"]
    assert np.ptp(energy) <= 1e-13 * result["energy.kinetic"].max()
    power = result["Q.y"] * result["der(y)"] + result["Q.theta"] * result["der(theta)"]
    assert np.abs(power).max() <= 1e-14 * np.abs(result["Q.y"] * result["der(y)"]).max()


def test_an_incline_of_hardly_any_angle(native_fmu):
    """At 1e-300 rad the disk's own time is 1e150 s, and the integrator stands as far ahead: at 1 s
    y = g alpha t^2/3 all the same, to ten digits."""
    with instance(native_fmu("InclineDisk")) as one:
        one.fmu.setupExperiment()
        one.set("alpha", 1e-300)
        one.fmu.enterInitializationMode()
        one.fmu.exitInitializationMode()
        for t in (0.5, 1.0):
            one.step(0.5)
            assert one.get("y") == pytest.approx(9.81 * 1e-300 * t**2 / 3, rel=1e-10, abs=0)
            assert one.get("theta") == pytest.approx(9.81 * 1e-299 * t**2 / 3, rel=1e-10, abs=0)
