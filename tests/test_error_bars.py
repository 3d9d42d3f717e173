"""Error bars: how far a run's values may be off, estimated by a finer run beside the delivered one."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from conftest import scene_of
from fmi2 import EXCHANGE
from fmpy.fmi1 import FMICallException
from instance import instance
from runs import evenly, sources
from scipy.special import ellipj, ellipk
from sympy import sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner
from zoo import point_mass

from lagfmu import Output, Parameter, Scene, simulate, sweep
from lagfmu.errors import SimulationError
from lagfmu.names import bar as bar_of
from lagfmu.testing import LAST, ErrorBarWarning, Plan, Session, app, figure_of, prepare, run_batch

INFINITE = np.finfo(float).max
Barred = Callable[[str], Path]


@pytest.fixture
def barred(built: Any) -> Barred:
    """barred(NAME): an FMU of models/ with error bars."""

    def get(name: str) -> Path:
        file, scene = scene_of(name)
        return built(file.model, replace(scene, error_bars=True), whole=True)

    return get


def run(fmu: Path, stop: float, step: float, tolerance: float | None = None):
    """All outputs at the communication points."""
    return evenly(fmu, stop, round(stop / step), tolerance, {})


def multiplier(t: np.ndarray, angle: float = 1.0) -> np.ndarray:
    """lambda of x^2 + y^2 = L^2 from rest at an angle: -T/(2 L), T = m g (3 cos theta - 2 cos angle)."""
    k = math.sin(angle / 2)
    sn = ellipj(math.sqrt(9.81) * t + ellipk(k**2), k**2)[0]
    return -9.81 * (3 * (1 - 2 * (k * sn) ** 2) - 2 * math.cos(angle)) / 2


@pytest.mark.parametrize("name", ["PendulumCartesian", "PendulumNullspace"])
def test_the_multiplier_of_the_pendulum_lies_within_its_bar(barred, name):
    """Held against Jacobi's elliptic functions over 5 s: at least 99 of 100 points, at two tolerances; by
    multipliers, and on the constraints' null space."""
    for tolerance in (1e-5, 1e-8):
        found = run(barred(name), 5.0, 0.1, tolerance)
        true = np.abs(found["lambda.rod"] - multiplier(found["time"]))
        bar = found["error.lambda.rod"]
        assert np.mean(true <= bar) >= 0.99
        assert (np.diff(bar) >= 0).all()
        assert bar[-1] < 1e4 * tolerance


def test_no_point_of_a_run_misses_its_bar(barred):
    """Runs count, and their first points most: 120 pendulums from rest at angles up to 2.5 rad, tolerances
    from 1e-4 to 1e-11 and three communication steps, held against Jacobi's elliptic functions (rounding of
    these: 1e-13).  In 99 of 100 runs no bar is missed, and half of the bars are less than 100 errors."""
    chance, held, sharp = np.random.default_rng(11), [], []
    keep = tuple((n, LAST) for n in ("lambda.rod", "error.lambda.rod"))
    with Session(barred("PendulumCartesian")) as session:
        for step in (0.02, 0.1, 0.3):
            angle, tolerance = chance.uniform(0.1, 2.5, 40), 10 ** chance.uniform(-11, -4, 40)
            times = step * np.arange(13)
            plan = Plan(("x", "y", "solver.tolerance"), keep, times, whole=True)
            rows = np.stack([np.sin(angle), -np.cos(angle), tolerance], axis=1)
            value, bar = np.moveaxis(run_batch(session, plan, rows).trajectory, 2, 0)
            true = np.array([multiplier(times, a) for a in angle])
            error = np.maximum(np.abs(value - true) - 1e-13, 0)
            held += [*(error <= bar).all(axis=1)]
            sharp += [*(bar[error > 0] / error[error > 0])]
    assert np.mean(held) >= 0.99
    assert np.median(sharp) < 100


def test_the_first_point_of_a_run_lies_within_its_bar(barred):
    """A pendulum from 98 degrees after one communication step of 0.1 s, where one or two steps decide."""
    angle = 1.7041670222167058
    with instance(barred("PendulumCartesian")) as one:
        one.start({"x": math.sin(angle), "y": -math.cos(angle)}, tolerance=2.334e-7)
        one.step(0.1)
        off = abs(one.get("lambda.rod") - multiplier(np.array([0.1]), angle)[0])
        assert 1e-10 < off <= one.get("error.lambda.rod") < 100 * off


def test_an_event_in_the_middle_of_a_long_step_lies_within_its_bar(barred):
    """A particle that slides down with friction leaves; both runs take the same step to where it does, whose
    error the finer run must not share: the time, and the flight that follows from it."""
    names = ("departure.surface.time", "r", "theta")
    tolerances = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
    for step in (0.25, 0.5):
        exact = run(barred("RoughHemisphere"), 1.5, step, 1e-13)
        for tolerance in tolerances:
            found = run(barred("RoughHemisphere"), 1.5, step, tolerance)
            for name in names:
                bar = found[bar_of(name)][-1]
                assert abs(found[name][-1] - exact[name][-1]) <= bar, (name, step, tolerance)
            assert found[bar_of(names[0])][-1] < 10 * tolerance


def test_the_time_at_which_slipping_starts_lies_within_its_bar(barred):
    """A block on a belt sticks, and slips when the spring pulls as hard as friction can: again and again."""
    name = "slipping.grip.time"
    exact = run(barred("Belt"), 4.0, 0.1, 1e-13)
    for tolerance in (1e-5, 1e-8):
        found = run(barred("Belt"), 4.0, 0.1, tolerance)
        count = found["slipping.grip.count"]
        assert (count == exact["slipping.grip.count"]).all()
        assert count[-1] >= 2
        assert (np.abs(found[name] - exact[name]) <= found[bar_of(name)]).all()
        assert found[bar_of(name)][-1] < 1e3 * tolerance


@pytest.mark.parametrize(
    ("method", "step", "steps"), [("rattle", 0.05, 40), ("rk4", 0.02, 100)], ids=["rattle", "rk4"]
)
def test_a_fixed_step_has_bars_by_the_step_halved(barred, method, step, steps):
    """The finer run of half the step is off by a 64th of the delivered run's error with rattle, which is of
    order 6, by a sixteenth with rk4."""
    with instance(barred("PendulumCartesian")) as one:
        one.start({"solver.method": method, "solver.step": step}, tolerance=1e-6)
        for _ in range(20):
            one.step(0.1)
        off = abs(one.get("lambda.rod") - multiplier(np.array([one.time]))[0])
        assert 0 < off <= one.get("error.lambda.rod") < 200 * off
        assert one.get("solver.steps") == steps


def test_a_run_is_the_same_with_error_bars_and_without(barred, native_fmu):
    """The finer run goes beside it and touches nothing: every value of every output, bit for bit.  Without
    there is none in the sources, and nobody is shown an error of zero that was not measured."""
    with_bars = run(barred("Hemisphere"), 2.0, 0.05)
    without = run(native_fmu("Hemisphere"), 2.0, 0.05)
    for name in without.dtype.names:
        assert np.array_equal(with_bars[name], without[name]), name
    assert not any(n.startswith("error.") for n in without.dtype.names)
    assert "error_bars.c" in sources(barred("Hemisphere"))
    assert "error_bars.c" not in sources(native_fmu("Hemisphere"))
    with pytest.raises(SimulationError, match="--error-bars"):
        simulate(native_fmu("Hemisphere"), error_bars=True)


def test_going_back_and_on_again_gives_the_same_bars(barred):
    """The finer run is part of a saved state, as a pointer and as bytes, across the departure."""
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


def test_only_what_has_a_bar_has_one_and_bars_go_with_their_outputs(prepared):
    """Q, lambda, coordinates, velocities, the model's own outputs and times of events; not energies."""
    file, plain = scene_of("Hemisphere")
    scene = replace(plain, error_bars=True)
    names = {v.name for v in prepare(file.model, scene).table.variables}
    wanted = {"r", "der(theta)", "lambda.surface", "Q.r", "Q.surface.r", "departure.surface.time"}
    assert {bar_of(n) for n in wanted} <= names
    assert not {"error.energy.total", "error.der(r,2)", "error.a", "error.time"} & names
    for outputs in (["lambda.surface"], ["error.lambda.surface"]):
        few = prepare(file.model, replace(scene, outputs=outputs)).table.outputs
        assert {v.name for v in few} == {"lambda.surface", "error.lambda.surface"}
    assert not any("error." in v.name for v in prepared("Hemisphere").table.variables)


def test_between_the_two_departures_the_bars_are_infinite(barred):
    """One run has left the hemisphere and the other has not: the largest double, until both have."""
    name = "departure.surface.time"
    with instance(barred("Hemisphere")) as one:
        one.start(tolerance=1e-5)
        for _ in range(16):
            one.step(0.1)
        before, now = one.fmu.getFMUState(), one.time
        one.step(0.2)
        left, bar = one.get(name), one.get(bar_of(name))
        seen, between = [], np.outer((-1, 1), bar * np.geomspace(1e-3, 0.5, 6)).ravel()
        for moment in (*(left + between), left + 100 * bar):
            one.fmu.setFMUState(before)
            one.time = now
            one.step(moment - now)
            seen.append([one.get(bar_of(n)) for n in ("theta", "lambda.surface", name)])
        one.fmu.freeFMUState(before)
    assert (np.array(seen[:-1]) == INFINITE).any(axis=0).all()
    assert max(seen[-1]) < 1


@pytest.fixture
def root(built: Any) -> Path:
    """A mass on a spring by rk4, and an output that is not defined beyond x = d: two steps from x = 1 to the
    middle end 5 mm short of it, the four of the finer run 0.3 mm."""
    x, (k, d) = dynamicsymbols("x"), symbols("k d", positive=True)
    model = point_mass(
        "Root",
        "x",
        energy=-k * x**2 / 2,
        parameters=[Parameter(k, 1.0, "N/m"), Parameter(d, 2e-3, "m")],
        outputs=[Output("root", sqrt((x - d) / d), "1")],
        start={x: 1.0},
    )
    half = math.pi / 2
    options = {"stop_time": half, "step_size": half, "method": "rk4", "step": half / 2}
    return built(model, Scene("Root", error_bars=True, **options))


def test_a_finer_run_that_cannot_follow_is_told_and_the_run_goes_on(root):
    """Where the finer run cannot be read and the delivered run can all bars are infinite, and the log says so
    once."""
    with instance(root) as one:
        one.start(tolerance=1e-6)
        one.step(math.pi / 2)
        assert 0 < one.get("x") < 1e-2
        assert one.get("error.x") == one.get("error.root") == INFINITE
        one.step(1e-3)
        told = [text for status, _, text in one.log if status == 1 and "error bars" in text]
        assert len(told) == 1
        assert "cannot follow" in told[0]
        assert "root" in told[0]
    with pytest.warns(ErrorBarWarning, match=r"cannot follow to t = 1\.57\d* s"):
        assert simulate(root)["error.x"][-1] == INFINITE


def test_an_fmu_with_error_bars_is_for_co_simulation(barred, library):
    """In Model Exchange the importer integrates: no interface is offered, and none is given silently."""
    path = barred("PendulumCartesian")
    description = fmpy.read_model_description(str(path))
    assert description.modelExchange is None
    assert description.numberOfEventIndicators == 0
    assert not [v.name for v in description.modelVariables if v.reinit]
    refused = library(path)(kind=EXCHANGE)
    assert refused.handle.value is None
    assert "take co-simulation" in refused.log[-1][2]


def test_a_bar_has_no_derivative(barred):
    """The difference of two runs is no function of the state."""
    with instance(barred("PendulumCartesian")) as one:
        one.start()
        one.step(0.1)
        of = [one.variables["x"].valueReference]
        one.fmu.getDirectionalDerivative([one.variables["lambda.rod"].valueReference], of, [1.0])
        bar = one.variables["error.x"].valueReference
        with pytest.raises(FMICallException):
            one.fmu.getDirectionalDerivative([bar], of, [1.0])
        assert "'error.x' is not defined" in one.log[-1][2]


@pytest.mark.thorough
def test_a_forged_finer_run_is_refused_or_harmless(barred, tmp_path):
    """Modes, times and differences that no finer run has, with the right checksum: refused in words, or
    finite to read."""
    attack = str(Path(__file__).with_name("test_forged_states.py"))
    done = subprocess.run(
        [sys.executable, attack, str(barred("Hemisphere")), str(tmp_path), "steps", "1", "200"],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, (done.returncode, done.stderr[-2000:])


def test_simulate_gives_the_bars_of_the_fmu_and_plots_them_as_bands(barred):
    """A band stands about each curve."""
    options = {"stop_time": 2.0, "step_size": 0.05, "tolerance": 1e-6}
    found = simulate(barred("Hemisphere"), error_bars=True, **options)
    drawn = ["lambda.surface", "theta", "der(theta)", "der(theta,2)"]
    figure = figure_of(found, found.units, drawn)
    bands = dict(zip(drawn, (len(axis.collections) for axis in figure.axes), strict=True))
    assert bands == {n: int(n != "der(theta,2)") for n in drawn}  # an acceleration has no bar
    said = [axis.get_legend().get_texts()[0].get_text() for axis in figure.axes]
    assert said[1] == f"theta\n± {found['error.theta'].max():.1g}"
    assert said[3] == "der(theta,2)"


def test_bars_of_many_runs_are_kept_as_any_output(barred):
    """A sweep keeps the largest bar of each run, and the true errors lie within."""
    of, angle = "lambda.rod", np.array([0.5, 1.0, 1.5])
    rows = {"x": np.sin(angle), "y": -np.cos(angle)}
    keep = [f"{of}:trajectory", f"{bar_of(of)}:trajectory", f"{bar_of(of)}:max"]
    options = {"stop_time": 3.0, "step_size": 0.1, "workers": 1}
    found = sweep(barred("PendulumCartesian"), rows=rows, keep=keep, tolerance=1e-6, **options)
    exact = np.array([multiplier(np.linspace(0, 3, 31), a) for a in angle])
    bars = found[bar_of(of)].values
    assert (np.abs(found[of].values - exact) <= bars + 1e-13).mean() >= 0.99
    assert (found[f"{bar_of(of)}:max"].values == bars.max(axis=1)).all()
    assert found[bar_of(of)].attrs["units"] == found[of].attrs["units"]


def test_an_infinite_bar_is_printed_so(root, tmp_path):
    """In the table of a sweep, where the finer run is lost."""
    said = CliRunner().invoke(
        app,
        ["sweep", str(root), "--vary", "d=0.002,0.0001", "--keep", "error.x:max", "--plot",
         str(tmp_path / "bars.svg")],
    ).output  # fmt: skip
    assert "0.002 infinite" in " ".join(said.split()), said


def test_an_output_called_a_time_is_no_event(built: Any) -> None:
    """A bob that swings through and a clock of its own: lap.time beside a lap.count that moves all the while
    is off by rounding."""
    model = scene_of("PendulumCartesian")[0].model
    t, x = dynamicsymbols._t, next(iter(model.coordinates))
    own = (Output("lap.time", t, "s"), Output("lap.count", x**2, "m^2"))
    fmu = built(replace(model, outputs=own), Scene("Lap", error_bars=True))
    bars = run(fmu, 1.0, 0.25)[bar_of("lap.time")]
    assert (bars < 1e-13).all()
