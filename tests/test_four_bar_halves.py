"""docs/four_bar_halves.py: two FMUs that IDA joins at a pin, against the four-bar as one model."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from lagfmu import simulate
from lagfmu.testing import find_compiler

PROGRAM = Path(__file__).parent.parent / "docs" / "four_bar_halves.py"

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


@pytest.fixture(scope="module")
def halves():
    """The program's names."""
    pytest.importorskip("sksundae", reason="pip install -e '.[test]'")
    spec = importlib.util.spec_from_file_location("four_bar_halves", PROGRAM)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_force_of_the_pin_is_the_multiplier_of_the_whole(halves, built, tmp_path):
    """Over 2 s, in which the crank turns twice, at a tolerance of 1e-11: to 1e-7 of its size; the pin's ends
    stay together, and a coarser tolerance finds it less exactly."""
    times = np.linspace(0, 2, 21)
    joined = halves.joined(str(tmp_path))
    one = simulate(built(halves.whole), stop_time=2.0, step_size=0.1, tolerance=1e-12)
    force = np.array([one["lambda.pin.x"], one["lambda.pin.y"]]).T
    assert np.ptp(one["crank"]) > 4 * np.pi
    fine, coarse = (joined.run(times, tolerance) for tolerance in (1e-11, 1e-7))
    errors = [np.abs(found[:, -2:] - force).max() / np.abs(force).max() for found in (fine, coarse)]
    assert errors[0] < 1e-7
    assert errors[1] > 10 * errors[0]
    for kind in "pva":
        assert np.abs(joined.apart(kind)).max() < 1e-11
    angles = np.array([one[name] for name in ("crank", "coupler", "rocker")]).T
    np.testing.assert_allclose(fine[:, [0, 2, 4]], angles, atol=1e-7)
