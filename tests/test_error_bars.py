"""Error bars: how far a run's values may be off, estimated by a companion run at a coarser tolerance."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from conftest import FILES, MODELS
from instance import instance
from scipy.special import ellipj, ellipk

from lagfmu.fmu.compiler import find_compiler
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare

INFINITE = np.finfo(float).max
Barred = Callable[[str], Path]


@pytest.fixture(scope="module")
def barred(target: str, prepared, tmp_path_factory: pytest.TempPathFactory) -> Barred:
    """barred(NAME): an FMU of models/ with error bars, built once a target."""
    if target == "native" and find_compiler() is None:
        pytest.skip("no C compiler on this machine")
    folder, made = tmp_path_factory.mktemp("barred"), {}

    def get(name: str) -> Path:
        if name not in made:
            file = load(MODELS / f"{FILES[name]}.py")
            scene = replace(prepared(name).asked, error_bars=True)
            made[name] = write(prepare(file.model, scene), folder, target=target)
        return made[name]

    return get


def run(fmu: Path, stop: float, step: float, **options):
    """All outputs at the communication points."""
    return fmpy.simulate_fmu(
        str(fmu), stop_time=stop, step_size=step, output_interval=step, **options
    )


def multiplier(t: np.ndarray) -> np.ndarray:
    """lambda of x^2 + y^2 = L^2 from rest at 1 rad: -T/(2 L), T = m g (3 cos theta - 2 cos theta0)."""
    k = math.sin(0.5)
    sn = ellipj(math.sqrt(9.81) * t + ellipk(k**2), k**2)[0]
    return -9.81 * (3 * (1 - 2 * (k * sn) ** 2) - 2 * math.cos(1.0)) / 2


def test_the_multiplier_of_the_pendulum_lies_within_its_bar(barred):
    """Held against Jacobi's elliptic functions over 10 s: at least 99 of 100 points, at three tolerances."""
    for tolerance in (1e-5, 1e-7, 1e-9):
        found = run(barred("PendulumCartesian"), 10.0, 0.05, relative_tolerance=tolerance)
        true = np.abs(found["lambda.rod"] - multiplier(found["time"]))
        bar = found["error.lambda.rod"]
        assert np.mean(true <= bar) >= 0.99
        assert (np.diff(bar) >= 0).all()
        assert bar[-1] < 1e4 * tolerance


def test_the_time_of_departure_lies_within_its_bar(barred):
    """The particle leaves the hemisphere; before it does there is no error to know."""
    exact = run(barred("Hemisphere"), 2.0, 0.1, relative_tolerance=1e-13)
    name = "departure.surface.time"
    for tolerance in (1e-5, 1e-8):
        found = run(barred("Hemisphere"), 2.0, 0.1, relative_tolerance=tolerance)
        assert found[f"error.{name}"][0] == 0
        bar = found[f"error.{name}"][-1]
        assert abs(found[name][-1] - exact[name][-1]) <= bar < 1e3 * tolerance


def test_a_run_is_the_same_with_error_bars_and_without(barred, fmu):
    """The companion runs beside it and touches nothing: every value of every output, bit for bit."""
    with_bars = run(barred("Hemisphere"), 2.0, 0.05)
    without = run(fmu("Hemisphere"), 2.0, 0.05)
    for name in without.dtype.names:
        assert np.array_equal(with_bars[name], without[name]), name
    assert not any(n.startswith("error.") for n in without.dtype.names)


def test_going_back_and_on_again_gives_the_same_bars(barred):
    """The companion is part of a saved state, as a pointer and as bytes, across the departure."""
    with instance(barred("Hemisphere")) as one, instance(barred("Hemisphere"), "b") as other:
        for x in (one, other):
            x.start(tolerance=1e-6)
        for _ in range(15):
            one.step(0.1)
        state = one.fmu.getFMUState()
        data, now = one.fmu.serializeFMUState(state), one.time
        for _ in range(5):
            one.step(0.1)
        expected = one.outputs()
        one.fmu.setFMUState(state)
        other.fmu.setFMUState(other.fmu.deSerializeFMUstate(data))
        for x in (one, other):
            x.time = now
            for _ in range(5):
                x.step(0.1)
            assert x.outputs() == expected
        one.fmu.freeFMUState(state)
        one.fmu.reset()
        one.start(tolerance=1e-6)
        for _ in range(20):
            one.step(0.1)
        assert one.outputs() == expected


def test_reading_bars_does_not_change_them(barred):
    """The bars belong to the communication points, whoever looks at them."""
    with instance(barred("CartPendulum")) as one, instance(barred("CartPendulum"), "b") as other:
        for x in (one, other):
            x.start(tolerance=1e-6)
        for k in range(20):
            for x in (one, other):
                x.set("F", math.sin(k))
                if x is one:
                    x.outputs()
                x.step(0.1)
        assert one.outputs() == other.outputs()


def test_a_fixed_step_is_halved_and_that_is_said(barred):
    """rk4 of order 4: the run of half the step is off by a fifteenth of the difference, and says so."""
    with instance(barred("PendulumCartesian")) as one:
        one.start({"solver.method": "rk4", "solver.step": 0.02}, tolerance=1e-6)
        for _ in range(20):
            one.step(0.1)
        off = abs(one.get("lambda.rod") - multiplier(np.array([one.time]))[0])
        assert off <= one.get("error.lambda.rod") < 100 * off
        assert one.get("solver.steps") == 200
        told = [text for status, _, text in one.log if status == 1]
        assert any("0.01 s in place of 0.02 s" in text for text in told), one.log


def test_only_what_has_a_bar_has_one_and_bars_go_with_their_outputs(prepared):
    """Q, lambda, coordinates, velocities, the model's own outputs and times of events; not energies."""
    file = load(MODELS / "hemisphere.py")
    scene = replace(prepared("Hemisphere").asked, error_bars=True)
    names = {v.name for v in prepare(file.model, scene).table.variables}
    wanted = {"r", "der(theta)", "lambda.surface", "Q.r", "Q.surface.r", "departure.surface.time"}
    assert {f"error.{n}" for n in wanted} <= names
    assert not {"error.energy.total", "error.der(r,2)", "error.a", "error.time"} & names
    for outputs in (["lambda.surface"], ["error.lambda.surface"]):
        few = prepare(file.model, replace(scene, outputs=outputs)).table.outputs
        assert {v.name for v in few} == {"lambda.surface", "error.lambda.surface"}
    assert not any("error." in v.name for v in prepared("Hemisphere").table.variables)
