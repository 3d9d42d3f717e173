"""lagfmu fit: parameters and starts from what was measured."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from conftest import MODELS
from typer.testing import CliRunner

import lagfmu
from lagfmu.errors import SettingError, SimulationError
from lagfmu.testing import app, fit_solve

TRUE = {"L": 0.8, "m": 2.5}


@pytest.fixture(scope="module")
def pendulum(native_fmu) -> Path:
    return native_fmu("PendulumAngle")


@pytest.fixture(scope="module")
def swing(pendulum):
    """A pendulum of 0.8 m and 2.5 kg for 1.5 s, without noise."""
    run = lagfmu.simulate(pendulum, stop_time=1.5, step_size=0.1, start_values=TRUE)
    return {n: np.array(run[n]) for n in ("time", "theta", "lambda.rod")}


def noisy(table, seed, **deviations):
    """The table with normal noise of these standard deviations."""
    draw = np.random.default_rng(seed)
    noise = {n: s * draw.standard_normal(len(table["time"])) for n, s in deviations.items()}
    return {n: column + noise.get(n.replace(".", "_"), 0.0) for n, column in table.items()}


def test_data_without_noise_give_the_parameters_back(pendulum, swing):
    """Length and mass of a pendulum from its angle and from lambda, as exactly as the runs are;
    lambda = -m (g cos theta + L theta'^2)/(2 L) knows the mass, which the angle does not."""
    found = lagfmu.fit(pendulum, swing, {"L": (0.3, 3.0), "m": None})
    assert found.converged
    assert found.values == pytest.approx(TRUE, rel=1e-8)


def test_an_fmu_with_derivatives_takes_no_differences(swing, tmp_path):
    """The model file with the outputs named is built with derivatives: the same values from a third of the
    runs, and a clock that is set right besides by differences."""
    free, measure = {"L": (0.3, 3.0), "m": None}, ["theta", "lambda.rod"]
    found = lagfmu.fit(MODELS / "pendulum.py", swing, free, measure, scene="PendulumAngle")
    assert found.own == {"L", "m"}
    assert found.values == pytest.approx(TRUE, rel=1e-8)
    assert "derivatives of the FMU" in found.summary()
    assert "differences" not in found.summary()
    late = swing | {"time": swing["time"] + 0.01}
    found = lagfmu.fit(
        MODELS / "pendulum.py", late, free, measure, offset=0.02, scene="PendulumAngle"
    )
    assert found.values == pytest.approx(TRUE | {"offset.experiment 1": 0.01}, rel=1e-6)
    assert "else differences" in found.summary()


def test_what_the_angle_does_not_know_is_said(pendulum, swing):
    """The angle depends on g/L alone: a change of both by the same part moves nothing, and the mass moves
    nothing.  Both stay where the search began, as far as the data leave them."""
    data = noisy(swing, 1, theta=1e-3)
    found = lagfmu.fit(pendulum, data, ["L", "m", "g"], {"theta": 1e-3})
    first, second = (c.changes for c in found.undetermined)
    assert sorted([sorted(first), sorted(second)]) == [["L", "g"], ["m"]]
    both = first if "L" in first else second
    assert both["L"] == pytest.approx(both["g"], rel=1e-3)
    assert found.values["m"] == 1.0
    assert found.values["g"] / found.values["L"] == pytest.approx(9.81 / 0.8, rel=1e-2)
    assert all(np.isinf(e) for e in found.errors.values())
    assert "not determined by the data: a change of m by +1 %" in repr(found)
    assert any("not used: lambda.rod" in text for text in found.remarks())


def test_what_alone_is_free_and_moves_nothing_stays(pendulum, swing):
    """The mass is no matter to the angle: its derivative is what runs scatter by, and the search ends where
    it began."""
    found = lagfmu.fit(pendulum, noisy(swing, 1, theta=1e-3), ["m"], ["theta"])
    assert found.values["m"] == 1.0
    assert np.isinf(found.errors["m"])
    assert "not determined by the data: a change of m by +1 %" in repr(found)


def test_an_error_is_what_noise_does(pendulum, swing, tmp_path):
    """The standard error of each value is the spread of the values over 60 draws of the noise, within what 60
    draws tell of a spread (30 % is more than three of its standard deviations)."""
    zipfile.ZipFile(pendulum).extractall(tmp_path)
    drawn = [
        lagfmu.fit(tmp_path, noisy(swing, k, theta=0.01, lambda_rod=0.2), ["L", "m"])
        for k in range(60)
    ]
    for name in TRUE:
        spread = np.std([f.values[name] for f in drawn])
        assert np.median([f.errors[name] for f in drawn]) == pytest.approx(spread, rel=0.3)


def test_few_measurements_tell_little_of_their_scatter(pendulum, swing):
    """Four angles and one unknown length leave three degrees of freedom: the deviation is that of the
    residuals over three, and the interval is Student's, 3.182446 standard errors wide to each side (table of
    the t distribution, 97.5 %, 3).  With a deviation that is given it is the normal distribution's 1.959964,
    and scales with it."""
    rows = slice(4, 16, 3)
    data = {n: column[rows] for n, column in noisy(swing, 3, theta=0.01).items()}
    others = {"m": 2.5}

    def half(found):
        low, high = found.intervals["L"]
        assert (low + high) / 2 == pytest.approx(found.values["L"], rel=1e-12)
        return (high - low) / 2 / found.errors["L"]

    found = lagfmu.fit(pendulum, data, ["L"], ["theta"], start_values=others)
    run = lagfmu.simulate(
        pendulum, stop_time=1.5, step_size=0.1, start_values=others | {"L": found.values["L"]}
    )
    off = run["theta"][rows] - data["theta"]
    (deviation,) = found.deviations.values()
    assert deviation == pytest.approx(np.sqrt(off @ off / 3), rel=1e-3)
    assert half(found) == pytest.approx(3.182446, rel=1e-6)
    for given in (0.01, 0.02):
        known = lagfmu.fit(pendulum, data, ["L"], {"theta": given}, start_values=others)
        assert half(known) == pytest.approx(1.959964, rel=1e-6)
        assert known.errors["L"] / given == pytest.approx(found.errors["L"] / deviation, rel=1e-2)


@pytest.mark.thorough
@pytest.mark.parametrize("known", [True, False], ids=["known", "estimated"])
def test_the_interval_holds_the_truth_in_95_of_100(pendulum, swing, known, tmp_path):
    """1,000 draws of the noise, with standard deviations that are given and that are estimated: the true
    value lies in its interval of 95 % in 93 to 97 of 100."""
    zipfile.ZipFile(pendulum).extractall(tmp_path)
    sizes = {"theta": 0.01, "lambda.rod": 0.2}
    held = dict.fromkeys(TRUE, 0)
    for k in range(1000):
        data = noisy(swing, 1000 + k, theta=0.01, lambda_rod=0.2)
        found = lagfmu.fit(tmp_path, data, ["L", "m"], sizes if known else list(sizes))
        for name, (low, high) in found.intervals.items():
            held[name] += low <= TRUE[name] <= high
    assert all(930 <= count <= 970 for count in held.values()), held


def test_gaps_units_and_columns_that_set_something(pendulum, swing, tmp_path):
    """An empty cell is no measurement, mN/m are thousandths, and a column m that keeps one value is the mass
    of the experiment."""
    rows = ["time [ms],theta,lambda.rod [mN/m],m"]
    for k, (t, theta, force) in enumerate(zip(*swing.values(), strict=True)):
        rows.append(f"{1e3 * t},{'' if k % 3 == 0 else theta},{1e3 * force},2.5")
    file = tmp_path / "swing.csv"
    file.write_text("\n".join(rows))
    found = lagfmu.fit(pendulum, file, {"L": None})
    assert found.values["L"] == pytest.approx(0.8, rel=1e-8)
    assert len(found.measured) == 16 + 10


def test_several_experiments_share_what_is_free(pendulum):
    """Two swings from starts of their own, one of them by a clock that is 0.02 s late: one length."""
    tables = []
    for begin in (0.4, 1.2):
        run = lagfmu.simulate(
            pendulum, stop_time=2, step_size=0.1, start_values={"theta": begin, "L": 0.8}
        )
        late = 0.02 if begin == 0.4 else 0.0
        table = {"time": run["time"] + late, "theta": np.array(run["theta"])}
        tables.append(lagfmu.Experiment(table, {"theta": begin}, f"from {begin}"))
    found = lagfmu.fit(pendulum, tables, ["L"], {"theta": 1e-4}, offset=0.05)
    assert found.values == pytest.approx(
        {"L": 0.8, "offset.from 0.4": 0.02, "offset.from 1.2": 0.0}, rel=1e-6, abs=1e-8
    )
    assert {e: list(t) for e, t in found.residuals().items()} == {
        "from 0.4": ["theta"],
        "from 1.2": ["theta"],
    }


def test_outliers_weigh_less_under_a_robust_loss(pendulum, swing):
    """Three readings of 16 are off by 0.5 rad: least squares is off by more than ten times what Cauchy's loss
    is off."""
    data = noisy(swing, 3, theta=1e-3)
    data["theta"][[3, 7, 12]] += 0.5
    off = [
        abs(lagfmu.fit(pendulum, data, ["L"], {"theta": 1e-3}, loss=loss).values["L"] - 0.8)
        for loss in ("linear", "cauchy")
    ]
    assert off[1] < 0.1 * off[0]


def test_a_robust_loss_estimates_the_deviation_of_the_undisturbed(pendulum):
    """400 readings with a normal error of 1 mrad, every tenth of which is off by 0.5 rad besides: half of the
    magnitudes are below 0.674 standard deviations, and the tenth that is far away shifts that to 0.764."""
    run = lagfmu.simulate(pendulum, stop_time=2, step_size=0.005, start_values=TRUE)
    data = noisy({n: np.array(run[n]) for n in ("time", "theta")}, 4, theta=1e-3)
    data["theta"][::10] += 0.5
    found = lagfmu.fit(pendulum, data, ["L"], loss="cauchy", step_size=0.005)
    assert found.values["L"] == pytest.approx(0.8, rel=1e-3)
    assert found.deviations["theta"] == pytest.approx(1e-3 * 0.764 / 0.674, rel=0.1)


def test_galileos_ball_was_solid(monkeypatch):
    """The distances of f. 107v, at eight beats of 0.55 s on an incline of 1.70 degrees, as Drake read them:
    kappa = I/(M R^2) of a solid ball is 2/5.  By the line of the documentation, with the FMU's derivative."""
    page = (MODELS.parent / "docs" / "fit.md").read_text(encoding="utf-8")
    line = re.search(r"^    lagfmu (fit models/.*)$", page, re.MULTILINE)[1]
    monkeypatch.chdir(MODELS.parent)
    done = CliRunner().invoke(app, shlex.split(line))
    assert done.exit_code == 0, done.output
    found = re.search(r"kappa +([\d.]+) +([\d.]+) +([\d.]+) \.\.\. ([\d.]+)", done.output)
    kappa, error, low, high = map(float, found.groups())
    assert low < 0.4 < high
    assert abs(kappa - 0.4) < 0.005
    assert error < 0.005
    assert "derivatives of the FMU" in done.output


def test_friction_from_the_motion_of_what_slides(native_fmu):
    """A cylinder that slips on an incline of 30 degrees (mu_s below tan(alpha)/3): its coefficient of kinetic
    friction from where it is."""
    fmu, sticky = native_fmu("InclineFriction"), {"mu_s": 0.18}
    run = lagfmu.simulate(fmu, stop_time=1, step_size=0.05, start_values=sticky | {"mu_k": 0.1})
    measured = {n: np.array(run[n]) for n in ("time", "y")}
    found = lagfmu.fit(fmu, measured, {"mu_k": (0.05, 0.18, 0.15)}, start_values=sticky)
    assert found.values["mu_k"] == pytest.approx(0.1, rel=1e-7)


def test_an_input_drives_the_run(native_fmu):
    """The mass of a cart from how it answers a force that the table holds."""
    fmu = native_fmu("CartPendulum")
    time = np.linspace(0, 2, 41)
    signal = np.zeros(41, dtype=[("time", float), ("F", float)])
    signal["time"], signal["F"] = time, 3 * np.sin(3 * time)
    described = {"M": 1.7}
    run = lagfmu.simulate(fmu, stop_time=2, step_size=0.05, inputs=signal, start_values=described)
    table = {"time": time, "F": signal["F"], "x": np.array(run["x"])}
    found = lagfmu.fit(fmu, table, {"M": (0.5, 5.0)}, step_size=0.05)
    assert found.values["M"] == pytest.approx(1.7, rel=1e-6)


def test_a_force_that_jumps_is_read_by_the_clock_of_its_table(native_fmu):
    """A force of 3 N that 40 times is switched on or off, in a table whose clock is 0.02 s late: the cart's
    mass and the clock, from how it answers.  Whatever offset a search tries, no jump is put off by a step."""
    fmu = native_fmu("CartPendulum")
    jumps = np.sort(np.random.default_rng(5).uniform(0.01, 1.99, 40))
    time = np.sort(np.concatenate([np.linspace(0, 2, 41), jumps, jumps]))
    signal = np.zeros(len(time), dtype=[("time", float), ("F", float)])
    signal["time"] = time
    switched = np.concatenate([[False], np.diff(time) == 0])
    signal["F"] = 3.0 * (np.cumsum(switched) % 2)
    run = lagfmu.simulate(fmu, stop_time=2, step_size=0.05, inputs=signal, start_values={"M": 1.7})
    answer = np.full(len(time), np.nan)
    answer[np.searchsorted(time, run["time"])] = run["x"]
    table = {"time": time + 0.02, "F": signal["F"], "x": answer}
    found = lagfmu.fit(fmu, table, {"M": (0.5, 5.0)}, step_size=0.05, offset=0.05)
    expected = {"M": 1.7, "offset.experiment 1": 0.02}
    assert found.values == pytest.approx(expected, rel=1e-6)


def test_a_value_at_its_bound_is_said(pendulum, swing):
    """The data ask for 0.8 m where 0.7 m is allowed."""
    found = lagfmu.fit(pendulum, swing, {"L": (0.1, 0.7, 0.5)}, {"theta": 1e-3})
    assert found.values["L"] == pytest.approx(0.7)
    assert np.isnan(found.errors["L"])
    text = repr(found)
    assert "L stands at its bound 0.7: the data ask for more" in text
    assert "the residuals are larger than the standard deviations that were given" in text


def test_a_search_that_does_not_end_is_said(pendulum, swing, monkeypatch, tmp_path):
    """Two evaluations are too few: the exit code is 1, and what to do is said."""
    monkeypatch.setattr(fit_solve, "EVALUATIONS", 2)
    file = tmp_path / "swing.csv"
    file.write_text(
        "time,theta\n"
        + "\n".join(f"{t},{x}" for t, x in zip(swing["time"], swing["theta"], strict=True))
    )
    done = CliRunner().invoke(app, ["fit", str(pendulum), str(file), "--free", "L=0.1:9:5"])
    assert done.exit_code == 1
    assert "did not converge: start nearer" in " ".join(done.output.split())


def test_the_command_writes_figures_and_numbers(pendulum, swing, tmp_path):
    """A table for eyes, JSON with residuals, and a picture."""
    file, out, picture = tmp_path / "swing.csv", tmp_path / "fit.json", tmp_path / "fit.svg"
    file.write_text(
        "time,theta,lambda.rod\n"
        + "\n".join(f"{a},{b},{c}" for a, b, c in zip(*swing.values(), strict=True))
    )
    words = ["fit", pendulum, file, "--free", "L=10 cm:3", "--free", "m", "--measure", "theta:0.01"]
    words += ["--measure", "lambda.rod", "--json", out, "--plot", picture]
    done = CliRunner().invoke(app, [str(w) for w in words])
    assert done.exit_code == 0, done.output
    found = json.loads(out.read_text())
    assert found["converged"]
    assert {v["name"]: v["value"] for v in found["values"]} == pytest.approx(TRUE, rel=1e-6)
    assert found["values"][0]["low"] == 0.1
    assert len(found["residuals"]["swing"]["theta"]["time"]) == 16
    assert picture.read_text().startswith("<?xml")


def test_every_mistake_is_named_at_once(pendulum):
    """Names with suggestions, bounds, a start outside of them, times, columns, a deviation."""
    table = {
        "time": [0, 2, 1],
        "thta": [0, 0, 0],
        "theta": [1, 2, 3],
        "m": [1, 1, 2],
        "lambda.rod [kg]": [1, 2, 3],
        "x": [np.inf, 0, 0],
    }
    free = {"l": None, "m": (2, 1), "g": (1, 5, 9), "energy.total": None, "solver.method": None}
    with pytest.raises(SettingError) as refused:
        lagfmu.fit(pendulum, table, free, {"tensoin": None, "theta": -1.0})
    text = str(refused.value)
    for part in (
        "'l' cannot be set",
        "'m': bounds 2.0 and 1.0",
        "'g': the start 9.0 lies outside the bounds 1.0 and 5.0",
        "'energy.total' cannot be set",
        "'solver.method' is a Enumeration",
        "'tensoin' is no output; did you mean 'tension'?",
        "a standard deviation of -1.0",
        "the times are not sorted",
        "'thta' is not in the FMU; did you mean 'theta'?",
        "'m' is a parameter, and its column does not keep one value",
        "is given in 'kg', expected a multiple of N/m",
        "'x' holds what is no finite number",
    ):
        assert part in text, (part, text)


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ("theta\n1\n", "there is no column 'time'"),
        ("time,theta\n0,nan\n", "theta in row 1 is 'nan': expected finite numbers, or empty cells"),
        ("time,theta\n0,\n1,\n", "'theta' has gaps alone"),
        ("time,m\n0,1\n1,1\n", "nothing was measured"),
        ("time,theta\n0,x\n", "no table of numbers: row 1 is '0,x'"),
        ("time,theta\n", "has no rows"),
        ("", "is no table"),
        ("time,theta\n0,1\n", "1 measured numbers for 2 unknowns"),
    ],
)
def test_a_table_that_cannot_serve_is_refused(pendulum, tmp_path, content, told):
    """Without time or numbers, with NaN, with gaps alone, or with fewer numbers than unknowns."""
    (tmp_path / "x.csv").write_text(content)
    done = CliRunner().invoke(
        app, ["fit", str(pendulum), str(tmp_path / "x.csv"), "--free", "L", "--free", "theta"]
    )
    assert done.exit_code == 2
    assert told in " ".join(done.output.split())


def test_a_first_run_that_fails_is_told_with_its_values(native_fmu):
    """A start that no run survives: the cause, and with which values."""
    fmu = native_fmu("PendulumAngle")
    table = {"time": [0.0, 1.0], "theta": [1.0, 0.5]}
    with pytest.raises(SimulationError, match=r"the first run \(L = 1\.0\) fails"):
        lagfmu.fit(fmu, table, ["L"], start_values={"der(theta)": 1e200})


def test_the_lines_of_the_documentation_run(pendulum, swing, tmp_path, monkeypatch):
    """docs/fit.md in a folder with the FMU and measured.csv; its table is that of a fit."""
    page = (Path(__file__).parent.parent / "docs" / "fit.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "dist" / "native").mkdir(parents=True)
    shutil.copy(pendulum, "dist/native/PendulumAngle.fmu")
    data = noisy(swing, 5, theta=0.01, lambda_rod=0.2)
    rows = (",".join(map(str, row)) for row in zip(*data.values(), strict=True))
    (tmp_path / "measured.csv").write_text("\n".join([",".join(data), *rows]))
    words = re.search(r"^    lagfmu (fit .*)$", page, re.MULTILINE)[1].split()
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "95 % interval" in done.output
    exec(page.split("```python\n")[1].split("```")[0])  # what it prints is what is tested above
    assert (tmp_path / "fit.png").is_file()
