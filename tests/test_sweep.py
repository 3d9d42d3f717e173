"""lagfmu sweep: many runs of one FMU, each as if it were the only one."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MODELS
from typer.testing import CliRunner

import lagfmu
from lagfmu.errors import LagfmuError, SettingError, SimulationError
from lagfmu.testing import (
    LAST,
    MAX,
    MEAN,
    TIME_OF_MAX,
    Plan,
    Session,
    SessionProcess,
    app,
    axis,
    design,
    distribution,
    engine,
    in_session,
    load,
    run_batch,
    sampled,
)
from lagfmu.testing import archive_version as version

THETA = np.linspace(0.05, 1.0, 12)
KEEP = ("lambda.surface:max", "departure.surface.time:last", "lambda.surface:time-of-max")


@pytest.fixture(scope="module")
def hemisphere(native_fmu) -> Path:
    return native_fmu("Hemisphere")


@pytest.fixture(scope="module")
def unpacked(hemisphere, tmp_path_factory):
    import fmpy

    return fmpy.extract(str(hemisphere), str(tmp_path_factory.mktemp("unpacked")))


def test_the_particle_leaves_where_the_energy_says_in_every_run(hemisphere):
    """cos(theta) = (2/3) cos(theta0) at the departure, whatever the mass; the largest normal force of a start
    from rest is that at the start, m g cos(theta0)."""
    found = lagfmu.sweep(
        hemisphere,
        {"theta": THETA, "m": [0.5, 2.0]},
        keep=[*KEEP, "departure.surface.theta:last"],
        stop_time=2.0,
        tolerance=1e-10,
    )
    assert found["departure.surface.theta:last"].dims == ("theta", "m")
    cosine = np.cos(found["departure.surface.theta:last"])
    assert np.abs(cosine - 2 / 3 * np.cos(found.theta)).max() < 1e-9
    weight = found.m * 9.81 * np.cos(found.theta)
    assert np.abs(found["lambda.surface:max"] / weight - 1).max() < 1e-9
    assert (found["lambda.surface:time-of-max"] == 0).all()
    assert (found.status == "ok").all()
    assert found["lambda.surface:max"].attrs["units"] == "N"
    assert found.theta.attrs["units"] == "rad"


def test_a_run_in_a_sweep_is_the_run_alone(hemisphere):
    """Bit for bit what fmpy's simulate_fmu gives: an instance that is reset remembers nothing."""
    import fmpy

    found = lagfmu.sweep(
        hemisphere,
        {"theta": THETA},
        keep=["lambda.surface:trajectory"],
        stop_time=1.0,
        step_size=0.05,
    )
    for k in (0, 5, 11):
        alone = fmpy.simulate_fmu(
            str(hemisphere), stop_time=1.0, step_size=0.05, output_interval=0.05,
            start_values={"theta": THETA[k]}, output=["lambda.surface"],
        )  # fmt: skip
        assert (found["lambda.surface"].values[k] == alone["lambda.surface"]).all()


def test_the_loop_in_c_and_the_one_in_python_give_the_same_bits(unpacked):
    """An FMU of another tool, which has no lagfmu_batch, is run by the same steps."""
    keep = (("lambda.surface", MAX), ("lambda.surface", MEAN), ("theta", TIME_OF_MAX), ("r", LAST))
    plan = Plan(("theta",), keep, np.linspace(0, 1.5, 31), 1e-9, whole=True)
    session = Session(unpacked)
    rows = np.array([[0.1], [0.9], [-5e300], [0.3]])
    fast = run_batch(session, plan, rows)
    slow = replace(fast, result=np.full_like(fast.result, np.nan), reasons={})
    slow = replace(slow, trajectory=np.full_like(fast.trajectory, np.nan))
    slow = replace(slow, status=np.zeros(4, np.int32), reached=np.zeros(4))
    in_session(session, plan, rows, slow)
    session.close()
    good = [0, 1, 3]
    assert (fast.result[good] == slow.result[good]).all()
    assert (fast.trajectory[good] == slow.trajectory[good]).all()
    assert fast.status.tolist() == slow.status.tolist()
    assert fast.status[2] > 1
    assert fast.reasons.keys() == slow.reasons.keys() == {2}
    assert "theta" in fast.reasons[2]


def test_a_worker_needs_no_model():
    """It runs an FMU: without SymPy and units it is there in a fifth of the time."""
    code = f"import {SessionProcess.__module__}, sys; print({{'sympy', 'pint'}} & {{*sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


def test_results_do_not_depend_on_the_number_of_workers(hemisphere):
    """Chunks go to whoever is free: the same bytes of numbers."""
    runs = [
        lagfmu.sweep(hemisphere, {"theta": np.linspace(0.1, 1, 150)}, keep=KEEP, workers=n)
        for n in (1, 3)
    ]
    for name in KEEP:
        assert runs[0][name].values.tobytes() == runs[1][name].values.tobytes()


def test_a_refused_run_is_a_row_with_its_reason(hemisphere):
    """A radius below zero is no hemisphere: NaN, the status and the FMU's own words; the others are there."""
    found = lagfmu.sweep(hemisphere, {"a": [1.0, -1.0, 0.5]}, keep=["energy.total:last"])
    assert found.status.values.tolist() == ["ok", "error", "ok"]
    assert np.isnan(found["energy.total:last"].values[1])
    assert "'a' = -1.0 is outside its bounds" in str(found.reason.values[1])
    assert found.attrs["refused"] == 1


class Deadly(SessionProcess):
    """A host whose process dies in one run of a chunk: that with theta = 0.5."""

    def _ask(self, plan, values):
        if self.process is None:
            super()._ask(plan, values[:0])
        if (values[:, 0] == 0.5).any():
            os.kill(self.process.pid, signal.SIGKILL)
        return super()._ask(plan, values)


def test_a_crash_loses_one_row_and_not_its_chunk(unpacked):
    """The process of the FMU is killed whenever one run of five is tried: that run is told, the rest done."""
    plan = Plan(("theta",), (("theta", LAST),), np.array([0.0, 0.1]))
    host = Deadly(unpacked)
    found = host.run(plan, np.array([[0.1], [0.2], [0.5], [0.7], [0.9]]))
    host.close()
    assert found.status.tolist() == [0, 0, 6, 0, 0]
    assert "signal 9" in found.reasons[2]
    assert np.isfinite(found.result[:, 0]).tolist() == [True, True, False, True, True]


def test_an_interrupted_sweep_goes_on_where_it_stopped(hemisphere, tmp_path):
    """The client dies after some chunks: with `resume` the rest is done, every run is there once, and the
    file has the bytes of numbers of a sweep that was never interrupted."""
    import pyarrow.parquet as pq

    values = {"theta": np.linspace(0.1, 1, 120)}
    whole, broken = tmp_path / "whole.parquet", tmp_path / "broken.parquet"
    lagfmu.sweep(hemisphere, values, keep=KEEP, out=whole)

    def stop(done, total, refused):
        if done >= 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lagfmu.sweep(hemisphere, values, keep=KEEP, out=broken, progress=stop)
    parts = broken.with_name("broken.parquet.parts")
    assert 0 < len(list(parts.glob("part_*"))) < 60
    with pytest.raises(SimulationError, match="--resume"):
        lagfmu.sweep(hemisphere, values, keep=KEEP, out=broken)
    with pytest.raises(SimulationError, match="another sweep"):
        lagfmu.sweep(hemisphere, {"theta": [1.0]}, keep=KEEP, out=broken, resume=True)
    lagfmu.sweep(hemisphere, values, keep=KEEP, out=broken, resume=True)
    assert not parts.exists()
    a, b = pq.read_table(whole), pq.read_table(broken)
    assert a["run"].to_pylist() == list(range(120))
    assert a.equals(b)
    assert a.schema.field("lambda.surface:max").metadata[b"unit"] == b"N"
    facts = json.loads(a.schema.metadata[b"lagfmu"])
    assert len(facts["fmu_sha256"]) == 64


def test_what_was_refused_before_an_interruption_counts(hemisphere, tmp_path):
    """The first run has no radius; the client stops after it and goes on."""
    values, out = {"a": [-1.0, *np.linspace(0.5, 1, 9)]}, tmp_path / "runs.nc"

    def stop(done, total, refused):
        if done >= 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lagfmu.sweep(hemisphere, values, out=out, progress=stop, workers=1)
    found = lagfmu.sweep(hemisphere, values, out=out, resume=True)
    assert found.attrs["refused"] == 1


def test_inputs_come_from_a_table(native_fmu):
    """A cart that is pushed harder and harder goes where it goes when it is simulated alone."""
    inputs = np.zeros(3, dtype=[("time", float), ("F", float)])
    inputs["time"], inputs["F"] = [0.0, 0.5, 1.0], [0.0, 1.0, 5.0]
    path, span = native_fmu("CartPendulum"), {"stop_time": 1.0, "step_size": 0.05}
    found = lagfmu.sweep(path, {"m": [0.1, 0.2]}, keep=["s:last"], inputs=inputs, **span)
    for k, m in enumerate((0.1, 0.2)):
        alone = lagfmu.simulate(path, start_values={"m": m}, inputs=inputs, **span)
        assert found["s:last"].values[k] == pytest.approx(alone["s"][-1], rel=1e-12)


@pytest.mark.parametrize("method", ["latin-hypercube", "sobol"])
def test_samples_follow_their_distributions(method):
    """Means and standard deviations of 4,096 points; the same seed gives the same points."""
    laws = dict(
        map(distribution, ["m ~ normal(1, 0.05)", "a ~ uniform(2, 4)", "k ~ loguniform(1, 100)"])
    )
    points = sampled(laws, 4096, 7, method)
    assert points[:, 0].mean() == pytest.approx(1, abs=1e-3)
    assert points[:, 0].std() == pytest.approx(0.05, rel=1e-2)
    assert points[:, 1].mean() == pytest.approx(3, abs=1e-2)
    assert np.log10(points[:, 2]).mean() == pytest.approx(1, abs=1e-2)
    assert (points == sampled(laws, 4096, 7, method)).all()


def test_axes_are_crossed_in_the_order_in_which_they_are_given():
    """The last axis runs fastest."""
    found = design(dict(map(axis, ["x=0:1:2", "y=1,2,3", "z=1:100:3:log"])))
    assert found.table[:4].tolist() == [[0, 1, 1], [0, 1, 10], [0, 1, 100], [0, 2, 1]]
    assert len(found) == 18


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--vary", "thta=1,2"], "'thta' cannot be set; did you mean 'theta'?"),
        (["--vary", "theta=1:1:5"], "the step is zero"),
        (["--vary", "theta=0:1:10:log"], "both ends above zero"),
        (["--vary", "theta=1:2"], "FROM:TO:COUNT"),
        (["--vary", "theta=one"], "'one' is no finite number"),
        (["--vary", "solver.method=foo"], "method 'foo' is unknown, expected one of auto, dop853"),
        (["--vary", "theta=1:x:5"], "--vary 'theta=1:x:5'"),  # :x: is no picture of a cross
        (["--vary", "theta=0:1:1000000000"], "8 GB"),
        (["--vary", "theta=0:1:100000", "--vary", "m=1:2:100000"], "1e+10 runs"),
        (["--sample", "m ~ normal(1, 0.1)"], "runs = None"),
        (["--sample", "m ~ normal(1, 0.1)", "--runs", "0"], "runs = 0"),
        (["--sample", "m ~ normal(1, 0.1)", "--runs", "1000000000"], "8 GB"),
        (["--sample", "m ~ cauchy(1, 0.1)", "--runs", "5"], "loguniform(low, high)"),
        (["--sample", "m ~ uniform(2, 1)", "--runs", "5"], "low = 2.0"),
        (["--vary", "theta=1,2", "--keep", "lambda.surfce:max"], "did you mean 'lambda.surface'?"),
        (["--vary", "theta=1,2", "--keep", "lambda.surface:peak"], "time-of-max"),
        (["--vary", "theta=1,2", "--out", "runs.xls"], ".parquet, .csv, .nc, .zarr"),
        (["--vary", "xyz=1"], "expected one of m, g, a, r, der(r), theta, der(theta), solver."),
        (["--vary", "theta=1,2", "--vary", "theta=3"], "theta is given twice"),
        ([], "nothing varies"),
        (["--vary", "theta=1,2", "--step-size", "0"], "step_size = 0.0"),
        (["--vary", "theta=1,2", "--workers", "0"], "workers = 0, expected a whole number from 1"),
        (["--vary", "theta=1,2", "--seed", "-1"], "seed = -1, expected a whole number from 0"),
        (["--vary", "theta=1,2", "--sampling", "grid"], "latin-hypercube, sobol"),
        (["--vary", "theta=1,2", "--scene", "Other"], "is for a model file"),
        (["--vary", "theta=1,2", "--tolerance", "0"], "tolerance = 0.0"),
        (["--vary", "theta=1,2", "--tolerance", "1000"], "at most 0.1"),
        (["--vary", "theta=1,2", "--resume"], "the out of the sweep"),
        (["--vary", "theta=1,2", "--plot", "runs.xyz"], ".svg, .png, .pdf"),
        (["--vary", "solver.method=1.5"], "expected one of auto, dop853"),
    ],
)  # fmt: skip
def test_bad_input_is_told_with_the_remedy(hemisphere, options, message):
    """Before anything is run: the name, what was given, what was expected."""
    done = CliRunner().invoke(app, ["sweep", str(hemisphere), *options])
    assert done.exit_code == 2
    assert message in " ".join(done.output.split())


@pytest.mark.parametrize(
    ("suffix", "engine_"),
    [("nc", "h5netcdf"), pytest.param("zarr", "zarr", marks=pytest.mark.thorough)],
)
def test_trajectories_come_back_from_the_file_with_what_they_are(
    hemisphere, tmp_path, suffix, engine_
):
    """netCDF and Zarr: the same numbers, bit for bit, with units, and in the file which FMU, which versions
    and which command they come from; a run that was refused has its reason and NaN."""
    xr, pd = pytest.importorskip("xarray"), pytest.importorskip("pandas")
    out = tmp_path / f"runs.{suffix}"
    done = CliRunner().invoke(
        app,
        ["sweep", str(hemisphere), "--vary", "a=-1,0.5,1", "--vary", "m=1,2", "--out", str(out),
         "--keep", "energy.total:max", "--keep", "theta:trajectory"],
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    alone = lagfmu.sweep(
        hemisphere, {"a": [-1, 0.5, 1], "m": [1, 2]}, keep=["energy.total:max", "theta:trajectory"]
    )
    with xr.open_dataset(out, engine=engine_) as found:
        assert found.equals(alone)
        units = {
            n: found[n].attrs["units"] for n in ("a", "m", "time", "theta", "energy.total:max")
        }
        assert units == {"a": "m", "m": "kg", "time": "s", "theta": "rad", "energy.total:max": "J"}
        digest = hashlib.sha256(hemisphere.read_bytes()).hexdigest()
        assert found.attrs["fmu_sha256"] == digest
        assert found.attrs["lagfmu"] == version()
        assert found.attrs["fmpy"]
        assert found.attrs["command"].startswith("lagfmu")
        assert pd.isna(found["theta"].values[0]).all()
        assert "outside its bounds" in str(found["reason"].values[0, 0])


def test_the_command_draws_what_was_refused(hemisphere, tmp_path):
    """Half of these starts stand off the sphere by less than nothing: refused, and marked; drawn anew the
    figure has the same bytes."""
    figures = [tmp_path / "runs.svg", tmp_path / "again.svg"]
    for figure in figures:
        done = CliRunner().invoke(
            app,
            ["sweep", str(hemisphere), "--vary", "a=-1:1:6", "--keep", "energy.total:max",
             "--plot", str(figure)],
        )  # fmt: skip
        assert done.exit_code == 0, done.output
        assert "6 runs, 3 refused" in done.output
        assert "and 2 like it" in done.output
        assert "refused" in figure.read_text()
    assert figures[0].read_bytes() == figures[1].read_bytes()


def swept(*words: object) -> str:
    """What the command prints, by words."""
    done = CliRunner().invoke(app, ["sweep", *map(str, words)])
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split())


def test_few_runs_are_printed_each_by_itself(hemisphere):
    """Where no particle leaves there is no time of it, though the FMU's variable is 0 s; a run that is
    refused has a status in place of numbers."""
    said = swept(hemisphere, "--vary", "theta=0.01,0.5", "--vary", "a=-1,1", "--stop-time", 1)
    assert "4 runs, 2 refused" in said
    assert "0.01 1 9.80951 0 never ok" in said
    assert "0.5 1 8.60908 1 0.411351 ok" in said
    assert "0.5 -1 error" in said


@pytest.mark.parametrize("kept", [[], ["--keep", "departure.surface.time:last"]])
def test_of_many_runs_the_ranges_are_printed_without_what_never_happened(
    hemisphere, kept, tmp_path
):
    """From rest at 0.01 rad the particle stays for 1.64 s: within 1 s it leaves from 0.07 rad on, and the
    zeros that stand for no departure are no times; the data are as the FMU gives them."""
    out = tmp_path / "runs.parquet"
    said = swept(hemisphere, "--vary", "theta=0.01:1:30", "--stop-time", 1, "--out", out, *kept)
    assert "departure.surface.time:last: 0.219213 ... 0.984895 s" in said
    assert "never in 2 runs" in said
    import pyarrow.parquet as pq

    times = pq.read_table(out)["departure.surface.time:last"].to_numpy()
    assert (times[:2] == 0).all()
    assert times[2:].max() < 1


def test_a_table_as_csv_has_every_bit_and_its_units_beside_it(hemisphere, tmp_path):
    """What spreadsheets and pandas read without a word of explanation; units and the FMU's hash by the W3C's
    vocabulary for tabular data; a reason holds commas and quotes."""
    import pandas as pd

    out = tmp_path / "runs.csv"
    swept(hemisphere, "--vary", "theta=0.05:1:7", "--vary", "a=1,-1", "--out", out)
    found = pd.read_csv(out)
    alone = lagfmu.sweep(hemisphere, {"theta": np.linspace(0.05, 1, 7), "a": [1, -1]})
    for name in ("lambda.surface:max", "departure.surface.time:last", "reached"):
        assert found[name].to_numpy(float).tobytes() == alone[name].values.tobytes(), name
    assert found["reason"][1] == alone["reason"].values[0, 1]
    about = json.loads((tmp_path / "runs.csv-metadata.json").read_text())
    assert about["url"] == "runs.csv"
    columns = {c["titles"]: c for c in about["tableSchema"]["columns"]}
    assert list(columns) == list(found.columns)
    assert columns["theta"]["schema:unitText"] == "rad"
    assert columns["lambda.surface:max"]["schema:unitText"] == "N"
    assert columns["run"]["datatype"] == "integer"
    digest = hashlib.sha256(hemisphere.read_bytes()).hexdigest()
    assert about["notes"][0]["fmu_sha256"] == digest
    again = lagfmu.sweep(hemisphere, rows={"theta": found["theta"], "a": found["a"]})
    assert (again["lambda.surface:max"].values[::2] == found["lambda.surface:max"][::2]).all()


def test_the_rows_of_a_file_are_run_as_they_stand(hemisphere, tmp_path):
    """A column a quantity, the method by its name, a line a run; of rows that are no grid the figure has a
    panel for each cause of each number.  What is no number is named with its line."""
    pd = pytest.importorskip("pandas")
    file, figure, out = (tmp_path / n for n in ("rows.csv", "runs.svg", "runs.csv"))
    file.write_text("theta, solver.method, a\n0.3, dop853, 1\n0.6, radau, 2\n0.9, rk4, -1\n")
    words = "--keep", "energy.total:last", "--plot", figure, "--out", out
    done = CliRunner().invoke(app, ["sweep", *map(str, (hemisphere, "--from", file, *words))])
    assert done.exit_code == 0, done.output
    assert "3 runs, 1 refused" in done.output
    found = pd.read_csv(out)["energy.total:last"]
    alone = lagfmu.sweep(
        hemisphere,
        rows={"theta": [0.3, 0.6], "solver.method": ["dop853", "radau"], "a": [1, 2]},
        keep=["energy.total:last"],
    )
    assert (found[:2] == alone["energy.total:last"].values).all()
    assert "1 refused (x)" in figure.read_text()
    with pytest.raises(SettingError, match="rows: a: 'x' is no finite number"):
        lagfmu.sweep(hemisphere, rows={"a": ["1", "x"]})
    for text, told in (("theta\n0.3\nx\n", "theta in row 2 is 'x'"), ("theta\n", "no rows")):
        file.write_text(text)
        done = CliRunner().invoke(app, ["sweep", str(hemisphere), "--from", str(file)])
        assert done.exit_code == 2
        assert told in " ".join(done.output.split())


def test_a_model_file_is_built_first(tmp_path):
    """One command from a model to a table."""
    path = MODELS / "atwood.py"
    done = CliRunner().invoke(app, ["sweep", str(path), "--vary", "m1=1,2", "--stop-time", "0.1"])
    assert done.exit_code == 0, done.output
    assert "2 runs, 0 refused" in done.output


def example(word: str) -> str:
    """The block of docs/sweeps.md that holds a word."""
    text = (MODELS.parent / "docs" / "sweeps.md").read_text(encoding="utf-8")
    return next(b for b in re.findall(r"```python\n(.*?)```", text, re.DOTALL) if word in b)


@pytest.fixture
def dist(native_fmu, tmp_path, monkeypatch) -> None:
    """A folder with dist/native/, as build_fmus.py makes it."""
    (tmp_path / "dist" / "native").mkdir(parents=True)
    for name in ("Hemisphere", "HalfCar"):
        (tmp_path / "dist" / "native" / f"{name}.fmu").symlink_to(native_fmu(name))
    monkeypatch.chdir(tmp_path)


@pytest.mark.thorough
def test_an_optimizer_finds_the_damping_at_which_the_spring_just_holds(dist):
    """Optuna, as docs/sweeps.md has it: softer rides better and travels farther, so that the best damping is
    where the travel is the 60 mm that are allowed."""
    pytest.importorskip("optuna")
    names: dict[str, Any] = {}
    exec(example("optuna"), names)
    damping = {"c": np.geomspace(6e3, 9e3, 12)}
    found = lagfmu.sweep(
        "dist/native/HalfCar.fmu", damping, keep=["front.travel:max", "body.acceleration:max"]
    )
    travel = found["front.travel:max"].values
    assert (np.diff(travel) < 0).all()
    assert (np.diff(found["body.acceleration:max"]) > 0).all()
    allowed = np.interp(-0.06, -travel, found.c)
    assert names["study"].best_params["c"] == pytest.approx(allowed, rel=0.1)


OTHER = """
import math
from pythonfmu import Fmi2Causality, Fmi2Initial, Fmi2Slave, Fmi2Variability, Real

class Decay(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.k, self.u, self.x = 1.0, 0.0, 1.0
        fixed = Fmi2Variability.fixed
        self.register_variable(Real("k", causality=Fmi2Causality.parameter, variability=fixed))
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("x", causality=Fmi2Causality.output, initial=Fmi2Initial.exact))

    def do_step(self, t, h):
        self.x = self.x * math.exp(-self.k * h) + self.u * h
        return self.k > 0
"""


@pytest.fixture(scope="module")
def decay(tmp_path_factory) -> Path:
    """An FMU that pythonfmu built, without lagfmu: x' = -k x + u."""
    from pythonfmu import FmuBuilder

    folder = tmp_path_factory.mktemp("other")
    (folder / "decay.py").write_text(OTHER)
    return Path(FmuBuilder.build_FMU(folder / "decay.py", dest=folder))


def test_an_fmu_of_another_tool_is_swept_as_well(decay, tmp_path):
    """x = exp(-k t), kept without being asked for, since there is no multiplier; what it refuses is a row;
    the input of a table drives it."""
    found = lagfmu.sweep(decay, {"k": [0.5, -1.0, 2.0]}, stop_time=1.0, step_size=0.1)
    assert found["x:last"].values[[0, 2]] == pytest.approx(np.exp([-0.5, -2.0]), rel=1e-12)
    assert found.status.values.tolist() == ["ok", "discard", "ok"]
    inputs = np.zeros(2, dtype=[("time", float), ("u", float)])
    inputs["time"], inputs["u"] = [0, 1], 1.0
    driven = lagfmu.sweep(decay, {"k": [1e-9]}, stop_time=1.0, step_size=0.1, inputs=inputs)
    assert driven["x:last"].values == pytest.approx(2.0)


ONE = b"""<fmiModelDescription fmiVersion="1.0" modelName="One" modelIdentifier="One" guid="1"
numberOfContinuousStates="0" numberOfEventIndicators="0"><ModelVariables/></fmiModelDescription>"""


@pytest.mark.parametrize(
    ("change", "gone", "message"),
    [
        (lambda text: ONE, "", "is an FMU of FMI 1.0, expected FMI 2.0 or 3.0"),
        (lambda text: text.replace(b"CoSimulation", b"Other"), "", "has no co-simulation"),
        (lambda text: text, "binaries/", "has no binary for this machine"),
    ],
)
def test_an_fmu_that_cannot_be_swept_is_refused_by_name(decay, tmp_path, change, gone, message):
    """Another version of FMI, model exchange alone, no binary: said before anything is run."""
    path = tmp_path / "odd.fmu"
    with zipfile.ZipFile(decay) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name == "modelDescription.xml":
                content = change(content)
            if not (gone and name.startswith(gone)):
                new.writestr(name, content)
    with pytest.raises(LagfmuError, match=message) as told:
        lagfmu.sweep(path, {"k": [1.0]})
    assert "odd.fmu" in str(told.value)


@pytest.mark.parametrize("command", [["sweep", "--vary", "k=1,2"], ["simulate"], ["verify"]])
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,u\n0,1\n1,2\n", "there is no column 'time', found t, u"),
        ("time,u\n0,1\n2,1\n1,1\n", "the times are not sorted, expected rising seconds"),
        ("time,u\n0,1\n1,one\n", "row 2 is '1,one'"),
        ("time,u,u\n0,1,2\n1,1,2\n", "u stands in two columns"),
        ("time,v\n0,1\n1,2\n", "'v' is no input, expected one of u"),
        ("", "is no table"),
        (None, "cannot be read: No such file"),
    ],
)
def test_a_bad_table_of_inputs_is_told_by_every_command(decay, tmp_path, command, text, message):
    """As wrong usage, with what was found and what was expected."""
    table = tmp_path / "in.csv"
    if text is not None:
        table.write_text(text)
    name, *options = command
    words = [name, str(decay), *options, "--input", str(table), "--stop-time", "1"]
    if name == "verify":  # an FMU of another tool is held against a reference
        (tmp_path / "ref.csv").write_text("time,x\n0,1\n")
        words += ["--reference", str(tmp_path / "ref.csv")]
    done = CliRunner().invoke(app, words)
    assert message in " ".join(done.output.split())
    assert done.exit_code == 2


def test_a_folder_of_something_else_is_left_alone(decay, tmp_path):
    """What lies where the finished chunks would go is no sweep's: nothing is touched."""
    parts = tmp_path / "runs.parquet.parts"
    parts.mkdir()
    (parts / "letter.txt").write_text("dear")
    for options in ({}, {"resume": True}):
        with pytest.raises(SimulationError, match="is not the folder of a sweep"):
            lagfmu.sweep(decay, {"k": [1.0]}, out=tmp_path / "runs.parquet", **options)
    assert (parts / "letter.txt").read_text() == "dear"


@contextlib.contextmanager
def cluster(folder: Path, workers: int):
    """A scheduler and workers as a user starts them; the address and the workers' processes."""
    dask, file = [sys.executable, "-m", "dask"], folder / "scheduler.json"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    command = ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    scheduler = subprocess.Popen([*dask, *command, "--scheduler-file", str(file)], **quiet)
    started = [scheduler]

    def worker() -> subprocess.Popen[bytes]:
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--scheduler-file", str(file)]
        place = ["--local-directory", str(folder), "--death-timeout", "60"]
        process = subprocess.Popen([*dask, "worker", *options, *place], **quiet)
        started.append(process)
        return process

    try:
        for _ in range(600):
            if file.exists() and file.read_text().strip():
                break
            time.sleep(0.1)
        address = json.loads(file.read_text())["address"]
        yield address, [worker() for _ in range(workers)], worker
    finally:
        for process in started:
            process.kill()
            process.wait()


@pytest.mark.thorough
def test_a_cluster_gives_the_same_numbers_even_if_its_workers_die(hemisphere, tmp_path):
    """Two Dask workers, one of which is killed again and again while it works: every run is there exactly
    once, with the bytes of the run on this machine."""
    pytest.importorskip("distributed")
    values = {"theta": np.linspace(0.05, 1.0, 300)}
    here = lagfmu.sweep(hemisphere, values, keep=KEEP)
    with cluster(tmp_path, 2) as (address, workers, another):
        done = threading.Event()
        killed = []

        def murder() -> None:
            while not done.wait(2.0) and len(killed) < 3:
                workers[-1].kill()
                killed.append(workers[-1])
                workers.append(another())

        killer = threading.Thread(target=murder)
        killer.start()
        try:
            there = lagfmu.sweep(hemisphere, values, keep=KEEP, on=address)
        finally:
            done.set()
            killer.join()
    for name in KEEP:
        assert here[name].values.tobytes() == there[name].values.tobytes()


def test_a_scheduler_that_does_not_answer_is_told(hemisphere, monkeypatch):
    """Nobody listens there."""
    pytest.importorskip("distributed")
    monkeypatch.setattr(engine, "PATIENCE", 1)
    with pytest.raises(
        SimulationError, match=r"no Dask scheduler answers at 'tcp://127\.0\.0\.1:9'"
    ):
        lagfmu.sweep(hemisphere, {"theta": [0.1]}, on="tcp://127.0.0.1:9")


def test_a_scene_by_name_is_of_a_model_file() -> None:
    """A Model has no named scenes: the name is refused, it was left aside without a word."""
    with pytest.raises(
        LagfmuError, match=r"scene 'Other': .* of the model 'Pendulum\w*' give a Scene"
    ):
        lagfmu.sweep(load(MODELS / "pendulum.py").model, {"m": [1.0]}, scene="Other")


def test_extremes_do_not_depend_on_the_communication_step(native_fmu: Any) -> None:
    """Of a model file the largest tension m g (3 - 2 cos(theta0)) is found between the points, which the
    column says; of an FMU without peaks it is that of the points, which the column says too."""
    file = MODELS / "pendulum.py"
    start, keep = {"x": [np.sin(1.0)], "y": [-np.cos(1.0)]}, ["tension:max", "tension:time-of-max"]
    options = {"keep": keep, "stop_time": 1.4, "step_size": 0.35, "tolerance": 1e-9}
    ours = lagfmu.sweep(file, start, scene="PendulumCartesian", **options)
    most, quarter = 9.81 * (3 - 2 * np.cos(1.0)), 0.53478439992
    assert ours["tension:max"].item() == pytest.approx(most, rel=1e-8)
    assert ours["tension:time-of-max"].item() == pytest.approx(quarter, abs=1e-4)
    assert "continuous motion" in ours["tension:max"].attrs["description"]
    points = lagfmu.sweep(native_fmu("PendulumCartesian"), start, **options)
    assert points["tension:max"].item() < 0.99 * most
    assert "communication points" in points["tension:max"].attrs["description"]
