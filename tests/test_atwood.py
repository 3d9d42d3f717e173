"""Atwood's machine, through fmpy on the built FMU."""

from __future__ import annotations

import pytest

from lagfmu import simulate


def test_a_start_off_the_string_moves_the_lighter_mass_more(native_fmu):
    """Start values that would stretch the string, both of which were set, are projected in the metric of the
    masses: what is missing is shared in the inverse ratio of m1 = 2 kg and m2 = 1 kg.  One that was set
    alone stands, and the other follows."""
    result = simulate(native_fmu("Atwood"), 0.1, start_values={"x1": 0.3})
    assert (result["x1"][0], result["x2"][0]) == pytest.approx((0.3, -0.3), rel=1e-14)
    result = simulate(native_fmu("Atwood"), 0.1, start_values={"x1": 0.4, "x2": -0.1})
    assert result["x1"][0] == pytest.approx(0.4 - 0.1, rel=1e-14)
    assert result["x2"][0] == pytest.approx(-0.1 - 0.2, rel=1e-14)
