"""Atwood's machine, through fmpy on the built FMU."""

from __future__ import annotations

import numpy as np
import pytest
from runs import simulate_fmu

CASES = {
    "default": (2.0, 1.0, 9.81),
    "the second falls": (0.4, 5.0, 1.62),
    "balanced": (3.0, 3.0, 9.81),
    "a gram and a ton": (1e3, 1e-3, 9.81),
    "a milligram and a megaton": (1e-6, 1e9, 9.81),
}
EVERY = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())


def fall(path, case, **start):
    values = dict(zip(("m1", "m2", "g"), case, strict=True))
    return simulate_fmu(
        str(path), stop_time=1.0, output_interval=0.05, start_values={**values, **start}
    )


@EVERY
def test_the_string_pulls_with_the_harmonic_mean(native_fmu, case):
    """The tension is 2 m1 m2 g/(m1 + m2) and lambda its negative, the string's force on either mass,
    at every moment; the acceleration is (m1 - m2)/(m1 + m2) g."""
    m1, m2, g = case
    result = fall(native_fmu("Atwood"), case)
    tension = 2 * m1 * m2 * g / (m1 + m2)
    for name in ("lambda.string", "Q.x1", "Q.x2"):
        np.testing.assert_allclose(result[name], -tension, rtol=1e-12, err_msg=name)
    a = (m1 - m2) / (m1 + m2) * g
    np.testing.assert_allclose(result["der(x1,2)"], a, rtol=1e-12, atol=1e-15 * g)
    np.testing.assert_allclose(result["der(x2,2)"], -a, rtol=1e-12, atol=1e-15 * g)


@EVERY
def test_one_falls_as_the_other_rises(native_fmu, case):
    """x1 = v0 t + a t^2/2 = -x2, and the energy stays: the string does no work on the two together."""
    m1, m2, g = case
    result = fall(native_fmu("Atwood"), case, **{"der(x1)": -0.5, "der(x2)": 0.5})
    t = result["time"]
    x1 = -0.5 * t + (m1 - m2) / (m1 + m2) * g * t**2 / 2
    np.testing.assert_allclose(result["x1"], x1, rtol=0, atol=1e-12)
    np.testing.assert_allclose(result["x2"], -x1, rtol=0, atol=1e-12)
    rounding = 2 * np.finfo(float).eps * (np.abs(result["x1"]) + np.abs(result["x2"]))
    assert (np.abs(result["residual.string"]) <= rounding).all()
    energy = result["energy.total"]
    assert np.abs(energy - energy[0]).max() <= 1e-12 * result["energy.kinetic"].max()


def test_a_start_off_the_string_moves_the_lighter_mass_more(native_fmu):
    """Start values that would stretch the string, both of which were set, are projected in the metric of the
    masses: what is missing is shared in the inverse ratio of m1 = 2 kg and m2 = 1 kg.  One that was set
    alone stands, and the other follows."""
    result = fall(native_fmu("Atwood"), CASES["default"], x1=0.3)
    assert (result["x1"][0], result["x2"][0]) == pytest.approx((0.3, -0.3), rel=1e-14)
    result = fall(native_fmu("Atwood"), CASES["default"], x1=0.4, x2=-0.1)
    assert result["x1"][0] == pytest.approx(0.4 - 0.1, rel=1e-14)
    assert result["x2"][0] == pytest.approx(-0.1 - 0.2, rel=1e-14)
