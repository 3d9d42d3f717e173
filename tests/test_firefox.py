"""The live page in Firefox, opened from disk: the same numbers as in any other browser."""

from __future__ import annotations

import json
import time
from pathlib import Path

import pytest
from firefox import firefox

from lagfmu import simulate

MOVE = """(() => {
    const slider = document.querySelector('input[data-name="theta"]');
    slider.value = 0.3;
    slider.dispatchEvent(new Event("input"));
})()"""


def test_the_particle_leaves_in_firefox(page_file, native_fmu):
    """The native FMU's lambda to rounding, the departure marked at its time, and again after a slider has
    moved; nothing is complained of."""
    fmu: Path = native_fmu("Hemisphere")
    expected, moved = simulate(fmu), simulate(fmu, start_values={"theta": 0.3})
    with firefox() as tab:
        tab.open(page_file("Hemisphere"))
        run = tab.value("lagfmu.run({})")
        assert run["time"] == list(expected["time"])
        weight = expected["lambda.surface"].max()
        assert run["values"]["lambda.surface"] == pytest.approx(
            list(expected["lambda.surface"]), rel=0, abs=1e-11 * weight
        )
        mark = "document.querySelector('#events button')?.innerText ?? ''"
        for result, action in ((expected, None), (moved, MOVE)):
            if action:
                tab.value(action + " ?? 0")
            departure = result["departure.surface.time"][-1]
            for _ in range(200):
                told = tab.value(mark).removesuffix(" s")
                if told and float(told) == pytest.approx(departure, rel=1e-9):
                    break
                time.sleep(0.05)
            else:
                raise AssertionError(f"marked at {json.dumps(told)}, expected {departure}")
        assert tab.problems == []
