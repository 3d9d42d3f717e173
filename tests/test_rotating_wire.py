"""Bead on a wire that a motor turns (rheonomic constraint), through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
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
