"""Bead on a wire that a motor turns (rheonomic constraint), through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from runs import simulate_fmu

CASES = {
    "default": {"m": 1.0, "omega": 2.0, "r0": 0.1, "v0": 0.0},
    "thrown inward": {"m": 0.03, "omega": 0.7, "r0": 2.0, "v0": -1.5},
    "backwards": {"m": 20.0, "omega": -3.0, "r0": 1e-3, "v0": 0.0},
}


def spin(path, m, omega, r0, v0, tolerance=1e-12, **start):
    stop = 4 / abs(omega)
    start = {"r": r0, "der(r)": v0, "der(phi)": omega, **start}
    return simulate_fmu(
        str(path),
        stop_time=stop,
        output_interval=stop / 50,
        step_size=stop / 50,
        relative_tolerance=tolerance,
        start_values={"m": m, "omega": omega, **start},
    )


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
@pytest.mark.parametrize(("tolerance", "allowed"), [(None, 1e-7), (1e-12, 1e-11)])
def test_the_bead_runs_away_and_lambda_is_the_motors_torque(native_fmu, case, tolerance, allowed):
    """r = r0 cosh wt + (v0/w) sinh wt, and lambda = 2 m w r r' is the torque [N m] that keeps the wire
    turning: from rest m r0^2 w^2 sinh 2wt."""
    result = spin(native_fmu("RotatingWire"), **case, tolerance=tolerance)
    m, w, r0, v0 = case.values()
    t = result["time"]
    r = r0 * np.cosh(w * t) + v0 / w * np.sinh(w * t)
    rate = r0 * w * np.sinh(w * t) + v0 * np.cosh(w * t)
    size = np.abs(r).max()
    assert np.abs(result["r"] - r).max() < allowed * size
    assert np.abs(result["der(r)"] - rate).max() < allowed * size * abs(w)
    torque = 2 * m * w * r * rate
    top = np.abs(torque).max()
    assert np.abs(result["lambda.drive"] - torque).max() < 2 * allowed * top
    if v0 == 0:
        np.testing.assert_allclose(torque, m * r0**2 * w**2 * np.sinh(2 * w * t), rtol=1e-12)
    np.testing.assert_array_equal(result["Q.phi"], result["lambda.drive"])
    assert (result["Q.r"] == 0).all()


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_the_wire_turns_evenly(native_fmu, case):
    """phi = w t and phi' = w to rounding: the motor does not give way, and what is left of phi'' is
    rounding in the Coriolis acceleration 2 r' w / r that it balances."""
    result = spin(native_fmu("RotatingWire"), **case)
    w = case["omega"]
    np.testing.assert_allclose(result["phi"], w * result["time"], rtol=1e-14, atol=0)
    np.testing.assert_allclose(result["der(phi)"], w, rtol=1e-14)
    coriolis = 2 * np.abs(result["der(r)"] * w / result["r"])
    assert (np.abs(result["der(phi,2)"]) <= 2 * np.finfo(float).eps * coriolis).all()


def test_the_motor_feeds_the_bead(native_fmu):
    """The energy is not constant: it grows by the motor's work, the integral of lambda w, while
    Jacobi's integral m (r'^2 - w^2 r^2)/2 stays."""
    result = spin(native_fmu("RotatingWire"), **CASES["default"])
    m, w, r0, _ = CASES["default"].values()
    energy = result["energy.kinetic"]
    work = m * r0**2 * w**2 * (np.cosh(2 * w * result["time"]) - 1) / 2  # of m r0^2 w^3 sinh 2wt
    assert np.abs(energy - energy[0] - work).max() < 1e-11 * energy[-1]
    assert energy[-1] > 1000 * energy[0]
    jacobi = m * (result["der(r)"] ** 2 - w**2 * result["r"] ** 2) / 2
    assert np.abs(jacobi - jacobi[0]).max() < 1e-11 * energy[-1]


def test_a_start_that_does_not_turn_with_the_wire_is_made_to(native_fmu):
    """omega changed alone leaves phi' = 2 against the motor's 3: the motor wins, r is as for 3."""
    result = spin(native_fmu("RotatingWire"), 1.0, 3.0, 0.1, 0.0, **{"der(phi)": 2.0})
    assert result["der(phi)"][0] == 3.0
    expected = 0.1 * np.cosh(3.0 * result["time"])
    assert np.abs(result["r"] - expected).max() < 1e-11 * expected[-1]
