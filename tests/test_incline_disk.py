"""Disk rolling down an incline (Marion & Thornton, example 7.9), both with y and theta and with theta
alone, through fmpy on the built FMUs."""

from __future__ import annotations

import numpy as np
import pytest
from instance import instance
from runs import simulate_fmu

BOTH = pytest.mark.parametrize("name", ["InclineDisk", "InclineDiskMinimal"])


def roll(path):
    return simulate_fmu(str(path), stop_time=1.0, output_interval=0.05)


@BOTH
def test_friction_does_no_work(native_fmu, name):
    """The point of contact does not move: the energy is constant though a force acts there, and
    its power on y is what it takes from theta."""
    result = roll(native_fmu(name))
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
