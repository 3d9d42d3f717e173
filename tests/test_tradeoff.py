"""Speed against accuracy: what is measured is right, and what is chosen from it holds."""

from __future__ import annotations

import csv
import io
import json
import random
import re
import zipfile
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from rich.console import Console
from scipy.special import ellipj, ellipk
from test_cli import SMALL, lagfmu

from lagfmu import Scene, simulate
from lagfmu.errors import BuildError, SimulationError
from lagfmu.fmu.write import write
from lagfmu.methods import EVALUATIONS, NUMBERS
from lagfmu.model.file import load
from lagfmu.model.goal import Goal, parse
from lagfmu.page.table import print_whole
from lagfmu.prepare.prepare import prepare
from lagfmu.study.tradeoff import choose as choosing
from lagfmu.study.tradeoff.choose import choose, pick
from lagfmu.study.tradeoff.front import front
from lagfmu.study.tradeoff.held_out import Case, other_values
from lagfmu.study.tradeoff.importer import Importer
from lagfmu.study.tradeoff.measure import (
    Plan,
    Tradeoff,
    default_plan,
    measure,
    quick_plan,
    take_turns,
)
from lagfmu.study.tradeoff.quantities import residual
from lagfmu.study.tradeoff.reference import refer
from lagfmu.study.tradeoff.report import table
from lagfmu.study.tradeoff.search import Clock, Walk, coarsest
from lagfmu.study.tradeoff.setting import Setting, dials, tolerances
from lagfmu.study.tradeoff.survey import formulations, survey
from lagfmu.verification.verify import closed_forms_in, verify

MODELS = Path(__file__).parent.parent / "models"
PENDULUM = load(MODELS / "pendulum.py")
SWING = Scene("Swing", stop_time=2.0, step_size=0.1)


def built(name: str, scene: Scene, folder: Path) -> Path:
    """The FMU of models/NAME.py in a scene of its own, with those closed forms that fit it."""
    file = load(MODELS / f"{name}.py")
    return write(prepare(file.model, scene), folder, file.closed_forms)


@pytest.fixture(scope="module")
def wire(tmp_path_factory) -> Tradeoff:
    """The rotating wire at two tolerances and two fixed steps."""
    folder = tmp_path_factory.mktemp("wire")
    fmu = built("rotating_wire", Scene("Wire", stop_time=1.5, step_size=0.05), folder)
    methods = ("dop853", "rattle", "rk4")
    plan = Plan((0.05, 0.15), (1e-3, 1e-6), methods, halvings=3, limit=1e9, budget=1e9)
    return measure(fmu, plan, repeats=2)


@pytest.fixture(scope="module")
def swing(tmp_path_factory) -> tuple[Path, Tradeoff]:
    """The Cartesian pendulum, whose motion in time stands in no closed form of its file."""
    fmu = built("pendulum", SWING, tmp_path_factory.mktemp("swing"))
    return fmu, measure(fmu, Plan((0.1,), (1e-4, 1e-7, 1e-10), ("dop853", "radau5")), repeats=1)


def jacobi(t, theta0=1.0, m=1.0, g=9.81, L=1.0):
    """lambda = -T/(2L), T = m g (3 cos theta - 2 cos theta0), sin(theta/2) = k sn(w t + K)."""
    k = np.sin(theta0 / 2)
    sn = ellipj(np.sqrt(g / L) * t + ellipk(k**2), k**2)[0]
    return -m * g * (3 * (1 - 2 * (k * sn) ** 2) - 2 * np.cos(theta0)) / (2 * L)


# ------------------------------------------------------------------ the front


def test_the_front_is_what_nothing_dominates():
    """p is on the front if and only if no q is as good in both and better in one."""
    chance = random.Random(1)
    for _ in range(50):
        points = [(chance.randrange(8) / 7, chance.randrange(8) / 7) for _ in range(20)]
        kept = front(points)
        for k, (e, c) in enumerate(points):
            beaten = any(x <= e and y <= c and (x, y) != (e, c) for x, y in points)
            assert ((e, c) in [points[i] for i in kept]) == (not beaten)
            assert k not in kept or not beaten
        assert len({points[i] for i in kept}) == len(kept)


def test_the_front_runs_from_cheap_to_accurate():
    """Costs rise and errors fall along it; what is not finite never stands on it."""
    points = [(1e-3, 1.0), (1e-6, 3.0), (1e-5, 4.0), (float("inf"), 0.1), (1e-9, float("nan"))]
    assert front(points) == [0, 1]


# ------------------------------------------------------------------ references and errors


def test_errors_are_those_against_the_closed_form(wire, tmp_path):
    """lambda = m (r0 w)^2 sinh(2 w t): the torque of the motor, known for all time."""
    assert wire.reference.source["lambda.drive"] == "closed form in time"
    fmu = built("rotating_wire", Scene("Wire", stop_time=1.5, step_size=0.05), tmp_path)
    for row in (r for r in wire.rows if r.setting.method == "dop853"):
        h, tolerance = row.setting.communication, row.setting.tolerance
        run = simulate(fmu, 1.5, h, tolerance, {"solver.method": "dop853"})
        torque = (0.1 * 2.0) ** 2 * np.sinh(4.0 * run["time"])
        error = np.abs(run["lambda.drive"] - torque).max() / np.abs(torque).max()
        assert row.errors["lambda.drive"] == pytest.approx(error, rel=1e-6, abs=1e-15)
    fixed = [r.errors["lambda.drive"] for r in wire.rows if r.setting.method == "rk4"]
    assert fixed[-1] < 1e-6 < max(fixed)


def test_a_closed_form_in_the_state_becomes_one_in_time(fmu):
    """lambda(phi) of the knife edge and phi = omega t give lambda = -2 m g sin(alpha) sin(omega t)."""
    path = fmu("KnifeEdge")
    with Importer(path) as importer:
        found = refer(importer, closed_forms_in(path), {"phi": 0.3}, 0.1, 1.0)
        plain = refer(importer, closed_forms_in(path), None, 0.1, 1.0)
    expected = -2 * 9.81 * 0.5 * np.sin(plain.run["time"])
    assert found.source["lambda.edge"] == plain.source["lambda.edge"] == "closed form in time"
    assert plain.values["lambda.edge"] == pytest.approx(expected, abs=1e-14)
    assert found.checked < 1e-13


def test_a_converged_run_states_its_own_error(swing):
    """The pendulum's lambda is known by Jacobi's sn: the reference is as near as it says."""
    reference = swing[1].reference
    assert reference.source["lambda.rod"] == "converged run"
    exact = jacobi(reference.run["time"])
    error = np.abs(reference.values["lambda.rod"] - exact).max() / np.abs(exact).max()
    assert error <= 2 * reference.own["lambda.rod"] < 1e-12
    method, difference = reference.opinion
    assert method.startswith("radau5")
    assert difference < 1e-9


def test_errors_against_the_converged_run_are_the_true_ones(swing):
    """They differ from those against Jacobi's sn by the reference's own error at most."""
    fmu, found = swing
    for row in found.rows:
        values = {"solver.method": row.setting.method}
        run = simulate(fmu, 2.0, 0.1, row.setting.tolerance, values)
        exact = jacobi(run["time"])
        error = np.abs(run["lambda.rod"] - exact).max() / np.abs(exact).max()
        assert abs(row.errors["lambda.rod"] - error) <= 3 * found.reference.own["lambda.rod"]


def test_what_is_below_the_references_error_is_marked(wire):
    """lambda of a coarser run that equals the reference says nothing below the reference's error."""
    reference = wire.reference
    row = replace(wire.rows[0], errors=dict.fromkeys(reference.own, 0.0))
    assert wire.worst(row, "lambda") == reference.own["lambda.drive"]
    for r in wire.rows:
        assert set(r.below) == {n for n, e in r.errors.items() if e < reference.own[n]}


def test_a_missed_event_is_an_infinite_error(fmu):
    """A run without the departure, or with one too many, has no right time of it."""
    path = fmu("Hemisphere")
    with Importer(path) as importer:
        reference = refer(importer, closed_forms_in(path), communication=0.1)
        run = importer.observe(Setting("dop853", 1e-6, 0.0, 0.1))
    assert reference.errors(run)["departure.surface.time"] < 1e-6
    run["departure.surface.count"] = 0
    assert reference.errors(run)["departure.surface.time"] == float("inf")


def test_the_residual_counts_while_the_constraint_acts(fmu):
    """r - a grows to half a metre in flight: that is no error of the hemisphere's surface."""
    with Importer(fmu("Hemisphere")) as importer:
        run = importer.observe(Setting("dop853", 1e-6, 0.0, 0.1))
    assert run["residual.surface"].max() > 0.4
    assert residual(run) < 1e-12


# ------------------------------------------------------------------ measuring


def test_settings_take_turns():
    """Each round does every piece of work once, and no round all in the order of another."""
    order: list[int] = []

    def piece(k: int) -> float:
        order.append(k)
        return 1.0

    found = take_turns(
        [lambda k=k: piece(k) for k in range(6)], Plan((0.1,), repeats=5), lambda *_: None
    )
    rounds = [tuple(order[6 * k : 6 * k + 6]) for k in range(1, 6)]  # the first warms up
    assert all(sorted(r) == list(range(6)) for r in rounds)
    assert len(set(rounds)) == 5
    assert [len(s) for s in found] == [5] * 6


def test_a_refused_method_is_reported_and_the_others_are_measured(wire):
    """The python target has no rattle: its refusal is told, dop853 and rk4 have rows and times."""
    assert "expected one of" in wire.refused["rattle"]
    assert {r.setting.method for r in wire.rows} == {"dop853", "rk4"}
    assert all(len(r.seconds) == 2 and min(r.seconds) > 0 for r in wire.rows)
    assert all(0 < seconds < r.median for seconds in wire.floor.values() for r in wire.rows)


def test_a_fixed_step_of_order_four_gains_sixteenfold(wire):
    """Halving rk4's step divides the error by 2^4."""
    rows = [r for r in wire.rows if r.setting.method == "rk4" and r.setting.communication == 0.15]
    ratio = rows[1].errors["lambda.drive"] / rows[2].errors["lambda.drive"]
    assert np.log2(ratio) == pytest.approx(4, abs=0.15)


def test_the_command_writes_table_files_and_figure(tmp_path):
    """JSON with everything, CSV with as many rows, the figure twice; the reference's error is told."""
    model = tmp_path / "link.py"
    model.write_text(SMALL.replace("WRONG", "-1"))
    out = tmp_path / "out"
    text = lagfmu(
        *("tradeoff", model, "--scene", "Link", "--out", out, "--repeats", 2, "--target", "python"),
        *("--tolerance", 1e-4, "--method", "dop853", "--method", "rk4", "--step-size", 0.02),
    )
    assert "Link (python), 5 communication steps of 0.02 s" in text
    assert "own error" in text
    data = json.loads((out / "python" / "Link.json").read_text())
    assert data["reference"]["quantities"]["lambda.link"]["own_error"] > 0
    rows = list(csv.DictReader((out / "python" / "Link.csv").read_text().splitlines()))
    assert len(rows) == len(data["rows"]) > 1
    assert float(rows[0]["error(lambda.link)"]) == data["rows"][0]["errors"]["lambda.link"]
    assert (out / "python" / "Link.png").stat().st_size > 1e4
    assert (out / "python" / "Link.svg").read_text().count("<svg") == 1


def test_an_output_of_ones_own_is_measured_too(tmp_path):
    """The pull of the link is -lambda: it has the same error."""
    model, out = tmp_path / "link.py", tmp_path / "out"
    text = SMALL.replace("WRONG", "-1").replace(
        "constraints=", "outputs=[Output('pull', -multiplier('link'), 'N')], constraints="
    )
    model.write_text("from lagfmu import Output, multiplier\n" + text)
    words = ["tradeoff", model, "--scene", "Link", "--out", out, "--repeats", 1]
    words += ["--target", "python", "--tolerance", 1e-4, "--method", "rk4", "--step-size", 0.05]
    lagfmu(*words)
    for row in csv.DictReader((out / "python" / "Link.csv").read_text().splitlines()):
        assert row["error(pull)"] == row["error(lambda.link)"]


def test_a_pipeline_reads_what_was_measured(tmp_path):
    """A case a setting, none of which fails, for a trade-off measures: a link that is said to pull twice as
    hard as it does is marked, with its sentence.  3 for a missing file, 2 for a method that is none."""
    model, xml, data = tmp_path / "link.py", tmp_path / "out.xml", tmp_path / "out.json"
    model.write_text(SMALL.replace("WRONG", "-2"))
    words = ["tradeoff", model, "--scene", "Link", "--out", tmp_path / "out", "--repeats", 1]
    words += ["--tolerance", 1e-4, "--method", "dop853", "--method", "rk4", "--step-size", 0.05]
    printed = lagfmu(*words, "--junit", xml, "--json", data)
    assert re.search(r"✗ dop853 1e-4, every 0\.05 s: lambda\.link", printed)
    suite = ET.parse(xml).getroot().find("testsuite")
    assert not suite.findall("testcase[failure]")
    (found,) = json.loads(data.read_text())
    missed = {r["method"]: r["closed_forms_that_do_not_hold"] for r in found["rows"]}
    assert "lambda" in missed["dop853"][0]
    assert not missed["rk4"]
    assert found["verdict"] == "pass"
    assert int(suite.get("tests")) == len(found["rows"]) > 1
    text = lagfmu("tradeoff", tmp_path / "gone.fmu", "--out", tmp_path / "out", code=3)
    assert "there is no such file" in text
    assert "expected one of dop853, rk4" in lagfmu("tradeoff", model, "--method", "rk45", code=2)


def test_the_table_fits_80_columns_whole(swing):
    """Every error, step count and time stands there with all its digits; on 40 columns row by row."""
    found = swing[1]
    for width in (80, 40):
        text = io.StringIO()
        print_whole(Console(file=text, width=width), table(found, 0.1))
        printed = text.getvalue()
        assert "…" not in printed
        assert max(map(len, printed.splitlines())) <= width
        for row in found.rows:
            assert str(row.steps) in printed
            assert f"{found.worst(row, 'lambda'):.1e}" in printed


def test_without_options_a_tradeoff_is_short(native_fmu):
    """The pendulum's FMU, 10 s in 1,000 steps: at most 60 settings, and 5 s for repeated timing."""
    with Importer(native_fmu("PendulumCartesian")) as importer:
        quick, whole = quick_plan(importer), default_plan(importer)
    assert quick.budget <= 5
    assert len(quick.tolerances) < len(whole.tolerances)
    assert quick.communications == whole.communications


# ------------------------------------------------------------------ choosing


@pytest.mark.parametrize("text", ["tight", "1e-6:", "0", "1e-20", "2"])
def test_an_accuracy_that_means_nothing_is_refused(text):
    """An accuracy is a relative error between 1e-12 and 0.1, and names after a colon."""
    with pytest.raises(BuildError, match="expected a relative error"):
        parse(text)


def test_an_accuracy_may_name_outputs():
    """1e-6:lambda.surface,Q.* asks it of those only."""
    assert parse("1e-6:lambda.surface,Q.*") == Goal(1e-6, ("lambda.surface", "Q.*"))


def test_other_values_are_near_within_bounds_and_keep_the_contacts(fmu):
    """Each parameter and start value within 5 %; the particle still starts on the sphere."""
    with Importer(fmu("Hemisphere")) as importer:
        scene = importer.observe(Setting("", 0.0, 0.0, 0.01), stop=0.01)
        for k in range(4):
            values = other_values(importer, scene, random.Random(k))
            assert values.keys() == {"m", "g", "a", "r", "theta"}
            starts = {"m": 1.0, "g": 9.81, "a": 1.0, "r": 1.0, "theta": 0.01}
            assert all(0 < abs(v / starts[n] - 1) <= 0.05 for n, v in values.items())
            run = importer.observe(Setting("", 0.0, 0.0, 0.01), values, 0.01)
            assert run["contact.surface"][0]


def test_a_scene_that_names_its_formulation_keeps_it():
    """The default may become any that the model has; nullspace and minimal are somebody's wish."""
    all_three = ("multipliers", "nullspace", "minimal")
    assert formulations(PENDULUM.model, SWING) == all_three
    for name in all_three[1:]:
        assert formulations(PENDULUM.model, replace(SWING, formulation=name)) == (name,)


@pytest.fixture(scope="module")
def choices():
    """The pendulum in its default formulation, chosen for 1e-4 and for 1e-9 of lambda."""
    model, forms = PENDULUM.model, PENDULUM.closed_forms
    goals = (Goal(1e-4, ("lambda.rod",)), Goal(1e-9, ("lambda.rod",)))
    plan = Plan((0.25,), methods=("dop853", "radau5"), repeats=1, limit=1e9)
    scene = replace(SWING, stop_time=1.0, step_size=0.25)
    found = []
    for goal in goals:
        measured = survey(model, scene, forms, goal, plan=plan)
        counted = [  # times in proportion to the work, so that the choice is the same on every machine
            replace(o, row=replace(o.row, seconds=(1e-5 * o.evaluations,)))
            for o in measured.options
        ]
        found.append(pick(model, replace(measured, options=tuple(counted)), forms, goal))
    return found


class Powers:
    """A method whose error is 3 tol, or (10 h)^4 with a fixed step; counts what is measured."""

    def __init__(self) -> None:
        self.coarse_runs: list[Setting] = []
        self.full_runs: list[Setting] = []

    def error(self, setting: Setting) -> float:
        return 3 * setting.tolerance or (10 * setting.step) ** 4

    def coarse(self, setting: Setting, limit: float) -> float:
        self.coarse_runs.append(setting)
        return self.error(setting)

    def full(self, setting: Setting, limit: float):
        self.full_runs.append(setting)
        return None, self.error(setting)


@pytest.mark.parametrize("goal", [1e-2, 1e-5, 1e-6, 1e-9, 1e-12])
@pytest.mark.parametrize("near", [0, 4, 10])
@pytest.mark.parametrize("method", ["dop853", "rk4"])
def test_the_coarsest_setting_that_holds_is_found_wherever_the_search_begins(goal, near, method):
    """Error 3 tol <= goal, or (10 h)^4 <= goal: the search ends at the largest such tol or h."""
    grid = dials(method, 0.1, tolerances(1), 10)
    bench = Powers()
    near = near if method == "dop853" else 0
    held = coarsest(Walk(grid, bench, goal, Clock()), near, thorough=False)
    assert held == next(k for k, d in enumerate(grid) if bench.error(d) <= goal)
    assert len(bench.full_runs) <= 2
    assert len(set(bench.coarse_runs)) == len(bench.coarse_runs)


def test_an_fmu_built_for_an_accuracy_is_verified_to_that(tmp_path):
    """1e-6 was asked of lambda: 1e-6 is allowed of it as built, 10 tol of it at another tolerance, and
    of what was not asked 10 times the tolerance that was chosen."""
    scene = replace(SWING, method="dop853", tolerance=1e-4, accuracy="1e-6:lambda.*")
    fmu = write(prepare(PENDULUM.model, scene), tmp_path, PENDULUM.closed_forms, target="native")
    found = {c.name: c for c in verify(fmu, stop_time=0.1).checks}
    assert found["lambda.rod"].allowed == 1e-6
    assert found["energy"].allowed == pytest.approx(1e-3)
    found = {c.name: c for c in verify(fmu, stop_time=0.1, tolerance=1e-9).checks}
    assert found["lambda.rod"].allowed == pytest.approx(1e-8)


def test_the_choice_holds_the_accuracy_on_held_out_values(choices, tmp_path):
    """lambda by Jacobi's sn, at another mass, gravity and length, at angles that it was not chosen on."""
    for choice in choices:
        fmu = write(prepare(PENDULUM.model, choice.scene), tmp_path, PENDULUM.closed_forms)
        for theta0, m, g, L in ((0.96, 1.04, 9.5, 0.97), (1.04, 0.97, 10.1, 1.03)):
            start = {"m": m, "g": g, "L": L}
            if choice.scene.formulation == "minimal":
                start |= {"theta": theta0}
            else:
                start |= {"x": L * np.sin(theta0), "y": -L * np.cos(theta0)}
            for h in (0.1, 0.25):
                run = simulate(fmu, 1.0, h, start_values=start)
                exact = jacobi(run["time"], theta0, m, g, L)
                error = np.abs(run["lambda.rod"] - exact).max() / np.abs(exact).max()
                assert error <= choice.goal.accuracy / 2
        assert choice.held_out_error <= choice.goal.accuracy / 2
        assert choice.option.error <= choice.goal.accuracy / 5


def test_the_coarse_choice_is_cheaper(choices):
    """1e-4 needs at least a quarter fewer evaluations of the equations than 1e-9."""
    coarse, fine = (c.option for c in choices)
    assert coarse.evaluations <= 0.75 * fine.evaluations
    assert coarse.evaluations == coarse.row.steps * EVALUATIONS[coarse.row.setting.method]


def test_what_misses_elsewhere_gives_way_to_something_tighter(choices, monkeypatch):
    """A choice that fails on held-out values is replaced by one whose error is smaller."""
    coarse, fine = choices  # what is on the front of a survey, by seconds, depends on the machine
    measured = replace(coarse.survey, options=(coarse.option, fine.option))
    names = measured.names
    bad = [Case({}, dict.fromkeys(names, 1.0), dict.fromkeys(names, 0.0), 1)]
    answers = iter([bad, list(coarse.cases)])
    monkeypatch.setattr(choosing, "held_out", lambda *_: next(answers))
    choice = pick(PENDULUM.model, measured, PENDULUM.closed_forms, coarse.goal)
    assert [o for o, _ in choice.failed] == [coarse.option]
    assert choice.option == fine.option
    assert choice.option.error < coarse.option.error


def test_what_nothing_holds_is_refused_with_the_best_that_was_reached(choices):
    """The message names the setting, its error and the output that is worst."""
    measured = choices[0].survey
    loose = [o for o in measured.options if o.error > 1e-6]
    best = min(loose, key=lambda o: o.error)
    with pytest.raises(BuildError, match=re.escape(f"{best}: {best.error:.1e} of lambda.rod")):
        pick(PENDULUM.model, replace(measured, options=tuple(loose)), (), Goal(1e-7))


def test_an_output_that_is_not_measured_is_refused():
    """--accuracy 1e-6:pull: no such output; the message lists those that there are."""
    with pytest.raises(SimulationError, match=r"'pull'.*lambda\.rod"):
        choose(PENDULUM.model, SWING, (), Goal(1e-4, ("pull",)))


def test_the_built_fmu_says_what_was_chosen_and_why(tmp_path):
    """Its defaults are the choice; its page has the section with the table and the curve."""
    model = tmp_path / "link.py"
    model.write_text(SMALL.replace("WRONG", "-1"))
    arguments = ("--scene", "Link", "--accuracy", "1e-6:lambda.link", "--out", tmp_path / "dist")
    text = lagfmu("build", model, *arguments)
    assert "chosen for 1e-06 of lambda.link" in text
    assert "Link: pass" in text
    fmu = tmp_path / "dist" / "python" / "Link.fmu"
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
        description = archive.read("modelDescription.xml").decode()
    method = re.search(r"chosen for 1e-06 of lambda\.link: \w+, (\w+)", text)[1]
    assert f'start="{NUMBERS[method]}"' in description
    section = page[page.index('id="choice"') :]
    assert "<svg" in section
    assert "Held-out values" in section
    assert section.count('"pass">chosen<') == 1
