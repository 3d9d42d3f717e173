"""lagfmu sensitivity: what outputs at the end of a run depend on, at a point and over ranges."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import MODELS, model_file
from typer.testing import CliRunner

import lagfmu
from lagfmu import Scene
from lagfmu.errors import SettingError, SimulationError
from lagfmu.testing import app, happened, over_ranges, sensitivity

LEAVES = "departure.surface.time"


def run(*words, code: int = 0) -> str:
    done = CliRunner().invoke(app, [str(w) for w in words])
    assert done.exit_code == code, done.output
    return " ".join(done.output.split())


def test_when_the_particle_leaves_goes_with_the_root_of_the_radius(native_fmu):
    """T is proportional to sqrt(a/g), and knows no mass: 1/2, -1/2 and 0 parts in 100; dT/dtheta_0 at
    theta_0 = 0.3 is -1.01696078397883.  By differences of runs, since the FMU has no derivatives."""
    fmu, start = native_fmu("Hemisphere"), {"theta": 0.3, "a": 1.0}
    found = sensitivity(fmu, [LEAVES], ["a", "g", "m", "theta"], start_values=start)
    assert not found.own.any()
    assert found.relative[0, :3] == pytest.approx([0.5, -0.5, 0.0], abs=1e-7)
    assert found.derivatives[0, 3] == pytest.approx(-1.01696078397883, rel=1e-7)
    assert list(found.points)[found.order(0)[0]] == "theta"


@pytest.mark.skipif("not __import__('shutil').which('cc')", reason="no C compiler")
def test_a_model_file_gets_derivatives_of_its_own(tmp_path):
    """The same through the command, from the FMU's variational equations: to 1e-9, and no difference is
    taken."""
    out = tmp_path / "s.json"
    words = ["sensitivity", MODELS / "hemisphere.py", "--of", LEAVES, "--to", "theta,a"]
    text = run(*words, "--set", "theta=0.3", "--json", out, "--plot", tmp_path / "s.svg")
    (found,) = json.loads(out.read_text())["outputs"]
    by = {row["name"]: row for row in found["by"]}
    assert all(row["of_the_fmu"] for row in by.values())
    assert by["theta"]["derivative"] == pytest.approx(-1.01696078397883, rel=1e-9)
    assert by["a"]["derivative"] == pytest.approx(found["value"] / 2, rel=1e-9)
    assert "differences" not in text
    assert (tmp_path / "s.svg").is_file()


@pytest.mark.skipif("not __import__('shutil').which('cc')", reason="no C compiler")
def test_a_body_on_a_floor_keeps_its_derivatives_by_parameters():
    """A disk that rolls from rest, y = g sin(alpha) t^2/(2 (1 + kappa)): 1, -kappa/(1 + kappa) and
    alpha/tan(alpha) parts in 100, from the FMU, though by the start of z, at which it lies on the incline,
    there is none."""
    found = sensitivity(MODELS / "incline_friction.py", ["y"], "all")
    by = {name: k for k, name in enumerate(found.points)}
    angle = math.pi / 6
    for name, part in {
        "g": 1,
        "kappa": -1 / 3,
        "alpha": angle / math.tan(angle),
        "M": 0,
        "mu_s": 0,
    }.items():
        assert found.own[0, by[name]], name
        assert found.relative[0, by[name]] == pytest.approx(part, abs=1e-9), name
    assert not found.own[0, by["z"]]
    assert np.isnan(found.derivatives[0, by["z"]])


@pytest.mark.skipif("not __import__('shutil').which('cc')", reason="no C compiler")
def test_the_best_friction_of_the_documentation_is_the_best(tmp_path, monkeypatch):
    """As printed in docs/sensitivities.md: between no friction and a cart that stands still there is one at
    which least energy is left after 10 s; on both sides of it there is more."""
    page = (MODELS.parent / "docs" / "sensitivities.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "models").symlink_to(MODELS)
    command = re.search(r"^    lagfmu (build \S+cart_pendulum.*)$", page, re.MULTILINE)[1]
    run(*command.split(), "--no-check")
    (block,) = (
        b for b in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "scipy.optimize" in b
    )
    told: dict = {}
    exec(block, told)
    best = told["found"].x[0]
    assert told["found"].success
    assert best == pytest.approx(8.35, rel=1e-3)
    least = told["remaining"]([best])[0]
    assert all(told["remaining"]([factor * best])[0] > least for factor in (0.9, 1.1))


@pytest.mark.skipif("not __import__('shutil').which('cc')", reason="no C compiler")
def test_pymoo_finds_the_dampers_that_are_worth_it(tmp_path, monkeypatch):
    """As printed there: of those that pymoo keeps none is stronger than the best friction, each stronger one
    leaves less energy, and each fulfils the conditions of an optimum by the FMU's own derivatives."""
    page = (MODELS.parent / "docs" / "sensitivities.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    run("build", MODELS / "cart_pendulum.py", "--sensitivities", "energy.total:c", "--no-check")
    (block,) = (b for b in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "pymoo" in b)
    told: dict = {}
    exec(block, told)
    energy, friction = told["found"].F[np.argsort(told["found"].X[:, 0])].T
    assert len(friction) > 5
    assert 7 < friction[-1] < 8.5
    assert (np.diff(energy) < 0).all()
    cart = told["ConstraintsFromBounds"](told["cart"])
    off = told["KKTPM"]().calc(friction[:, None], cart, ideal=np.array([-10.0, 0.0]))
    assert (off < 1e-3).all()


def test_beside_other_events_there_is_no_difference(native_fmu):
    """With a plain start r = 1 a larger radius lets the particle start inside of the sphere, a smaller one in
    the air: a change of r meets other events, and gets no number."""
    found = sensitivity(native_fmu("Hemisphere"), [LEAVES], stop_time=3.0)
    assert np.isnan(found.derivatives[0, list(found.points).index("r")])
    assert found.why[LEAVES, "r"] == "runs beside this one meet other events"
    told = f"{LEAVES}: no derivative by r, der(r): runs beside this one meet other events"
    assert told in found.remarks()


def test_where_there_is_no_derivative_nobody_takes_its_zero(built, tmp_path):
    """With r as a plain number the start of the particle may go either way: the FMU gives no derivative by a,
    and 0 in its place.  A result does not know it, a plot leaves it out, a sweep has NaN, and `sensitivity`
    takes differences, which find none either."""
    file = model_file("hemisphere")
    start = {q: v for q, v in file.model.start.items() if str(q) != "r(t)"}
    (r,) = (q for q in file.model.start if str(q) == "r(t)")
    model = replace(file.model, start={**start, r: 1.0})
    fmu = built(model, Scene("Either", sensitivities=["lambda.surface:a"]), ())
    name = "sensitivity.lambda.surface.by.a"
    found = lagfmu.simulate(fmu, stop_time=0.5)
    assert not found.known(name).any()
    line = found.plot(name).axes[0].lines[0]
    assert np.isnan(line.get_ydata()).all()
    runs = lagfmu.sweep(fmu, {"theta": [0.1, 0.2]}, keep=[f"{name}:last"], stop_time=0.5, workers=1)
    assert np.isnan(happened(runs, f"{name}:last")).all()
    told = sensitivity(fmu, ["lambda.surface"], ["a"], stop_time=0.5)
    assert not told.own.any()
    assert told.why["lambda.surface", "a"] == "runs beside this one meet other events"


def test_a_parameter_at_its_bound_is_changed_to_one_side(native_fmu):
    """Without damping the cart's friction can only grow: the slope is that of one side."""
    fmu = native_fmu("CartPendulum")
    found = sensitivity(fmu, ["x"], ["c"], start_values={"c": 0.0}, stop_time=0.5, tolerance=1e-10)
    above = sensitivity(fmu, ["x"], ["c"], start_values={"c": 1e-6}, stop_time=0.5, tolerance=1e-10)
    assert found.derivatives[0, 0] == pytest.approx(above.derivatives[0, 0], rel=1e-2)
    assert math.isnan(found.relative[0, 0])


@pytest.mark.parametrize(
    ("of", "to", "told"),
    [
        (["departure.surface.tim"], ["a"], "did you mean 'departure.surface.time'"),
        (["departure.surface.count"], ["a"], "is no Real output"),
        ([LEAVES], ["mm"], "'mm' cannot be set; did you mean 'm'?"),
        ([LEAVES], ["solver.method"], "is a Enumeration"),
        ([], ["a"], "nothing is asked for"),
    ],
)
def test_what_is_no_name_is_refused(native_fmu, of, to, told):
    """Outputs and parameters that there are not, and numbers that do not change continuously."""
    with pytest.raises(SettingError) as refused:
        sensitivity(native_fmu("Hemisphere"), of, to)
    assert told in str(refused.value)


def test_over_ranges_the_variance_is_shared(native_fmu):
    """log T = log(a/g)/2 + a function of theta_0: mass takes no part of the variance, the others all of it;
    by Morris's elementary effects the mass has none."""
    fmu = native_fmu("Hemisphere")
    ranges = {"theta": (0.2, 0.4), "g": (5.0, 10.0), "m": (1.0, 2.0)}
    found = over_ranges(fmu, [LEAVES], ranges, samples=128, seed=3, stop_time=4, workers=2)
    parts = found.indices[LEAVES]
    assert abs(parts["m"]["ST"]) < 1e-6
    assert parts["theta"]["S1"] + parts["g"]["S1"] == pytest.approx(1.0, abs=0.1)
    assert found.order(LEAVES)[-1] == "m"
    morris = over_ranges(fmu, [LEAVES], ranges, "morris", 10, stop_time=4, workers=2)
    assert morris.order(LEAVES)[-1] == "m"
    assert morris.indices[LEAVES]["m"]["mu_star"] < 1e-6


def test_the_command_prints_indices(native_fmu, tmp_path):
    """A table by Sobol's plan; an output that did not happen everywhere has none, and says so."""
    words = ["sensitivity", native_fmu("Hemisphere"), "--of", f"{LEAVES},lambda.surface"]
    words += ["--over", "theta=0.01:1", "--over", "a=1:2", "--samples", 16, "--stop-time", 1]
    text = run(*words, "--plot", tmp_path / "s.svg")
    assert "departure.surface.time: no indices: it did not happen in" in text
    assert "lambda.surface: sobol, 64 runs" in text


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--over", "theta=0.5"], "expected NAME=LOW:HIGH"),
        (["--over", "theta=1:0.5"], "expected the smaller end first"),
        (["--over", "theta=0.1:0.5", "--method", "fast"], "expected one of morris, sobol"),
        (["--over", "theta=0.1:0.5", "--to", "a"], "--to and --set are for derivatives"),
        (["--on", "tcp://127.0.0.1:1"], "--on is for --over"),
    ],
)
def test_options_that_do_not_go_together_are_named(native_fmu, options, told):
    """Ranges that are none, methods that there are not."""
    assert told in run("sensitivity", native_fmu("Hemisphere"), "--of", LEAVES, *options, code=2)


def test_refused_runs_give_no_indices(native_fmu):
    """A range in which spheres have no radius: an index over the rest would be of another range."""
    with pytest.raises(SimulationError, match="were refused"):
        over_ranges(
            native_fmu("Hemisphere"),
            [LEAVES],
            {"a": (-1.0, 1.0)},
            samples=4,
            workers=1,
        )
