"""The cost of a simulation does not depend on the axes in which the mechanism is written."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from zoo.linkages import straight_line

from lagfmu import Scene, simulate
from lagfmu.testing import StartMovedWarning

TURNED = 0.5  # rad


@pytest.fixture
def frames(built: Callable[..., Path]) -> list[Path]:
    """Peaucellier's linkage along its own axes, and in axes that are turned."""
    scene = Scene("StraightLine", stop_time=0.5, step_size=0.05)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StartMovedWarning)
        return [built(straight_line(turned), scene) for turned in (0.0, TURNED)]


def run(fmu: Path, tolerance: float, method: str) -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", StartMovedWarning)
        return simulate(fmu, tolerance=tolerance, start_values={"solver.method": method})


@pytest.mark.parametrize(("method", "tolerance"), [("dop853", 1e-8), ("radau", 1e-5)])
def test_a_guided_point_costs_what_it_costs_in_turned_axes(frames, method, tolerance):
    """Q of Peaucellier's linkage moves along y: its x' is 0 only because the rods hold it, and is no
    motion to be resolved.  Turned by 0.5 rad it is a component like any other: the steps are the same within
    a quarter, and so is the motion."""
    own, turned = (run(fmu, tolerance, method) for fmu in frames)
    steps = sorted((int(own["solver.steps"][-1]), int(turned["solver.steps"][-1])))
    assert steps[1] <= 1.25 * steps[0]
    x = turned["xq"] * np.cos(TURNED) - turned["yq"] * np.sin(TURNED)
    y = turned["xq"] * np.sin(TURNED) + turned["yq"] * np.cos(TURNED)
    np.testing.assert_allclose(own["xq"], 6.75 / 2, rtol=1e-14)
    np.testing.assert_allclose(x, 6.75 / 2, rtol=1e-13)
    np.testing.assert_allclose(y, own["yq"], atol=100 * tolerance)
