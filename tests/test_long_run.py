"""A pendulum for a very long time: neither its rod nor its energy may drift.

LAGFMU_LONG=1 pytest -n0 tests/test_long_run.py runs the 1e6 s too.
"""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
from fmi2 import Library

M, G, L = 1.0, 9.81, 1.0  # kg, m/s^2, m
SPAN = 1e5  # s
LONG = os.environ.get("LAGFMU_LONG") == "1"


@pytest.fixture
def pendulum(library) -> Library:
    return library("PendulumCartesian")


def run(pendulum: Library, span: float, interval: float, values: dict, tolerance: float):
    """|f| and the energy's error, at every communication point."""
    one = pendulum(logging=False).start(values, tolerance)
    names = ["residual.rod", "energy.total", "x", "y"]
    seen = np.empty((round(span / interval) + 1, len(names)))
    seen[0] = one.reals(names)
    for k in range(1, len(seen)):
        one.step(interval)
        seen[k] = one.reals(names)
    one.free()
    return abs(seen[:, 0]), abs(seen[:, 1] - seen[0, 1]), seen


def check_rattle(pendulum: Library, span: float, interval: float) -> None:
    f, energy, seen = run(pendulum, span, interval, {"solver.method": "rattle"}, 1e-8)
    assert f.max() <= 1e-12 * L**2
    assert energy.max() <= 1e-7 * M * G * L
    angle = np.arctan2(seen[:, 2], -seen[:, 3])
    assert abs(angle).max() == pytest.approx(1.0, abs=1e-3)  # it swings as high as ever


@pytest.mark.thorough
def test_rattle_keeps_rod_and_energy(pendulum):
    """1e5 s, 48,000 swings: |f| <= 1e-12 L^2 and the energy within 1e-7 m g L, at instants that come at
    every phase of the swing."""
    check_rattle(pendulum, SPAN, 9.7)


def test_rattle_does_not_gain_or_lose_on_the_way(pendulum):
    """The energy's error swings and does not grow: as large in the first tenth as in the last."""
    _, energy, _ = run(pendulum, SPAN / 5, 3.1, {"solver.method": "rattle"}, 1e-8)
    tenth = len(energy) // 10
    assert energy[-tenth:].max() < 2 * energy[:tenth].max() + 1e-12 * M * G * L


@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_the_rod_keeps_its_length_with_every_method(pendulum, method):
    """1e4 s with projection: f stays at rounding, whatever the energy's drift, which is linear in time."""
    f, energy, _ = run(pendulum, 1e4, 9.7, {"solver.method": method}, 1e-8)
    assert f.max() <= 1e-14 * L**2
    half = energy[len(energy) // 2]
    assert energy[-1] < 3 * half + 1e-9
    assert energy[-1] < 1e-4 * M * G * L


@pytest.mark.skipif(not LONG, reason="LAGFMU_LONG=1 for the 1e6 s")
@pytest.mark.parametrize("interval", [math.e, 97.0])
def test_a_million_seconds(pendulum, interval):
    """The same bounds over 1e6 s, 480,000 swings."""
    check_rattle(pendulum, 1e6, interval)
