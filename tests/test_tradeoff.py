"""Speed against accuracy: what is measured is right, and what is chosen from it holds."""

from __future__ import annotations

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
from conftest import model_file
from rich.console import Console
from scipy.special import ellipj, ellipk
from test_cli import SMALL, lagfmu

from lagfmu import Scene, simulate, verify
from lagfmu.errors import BuildError, SimulationError, UsageError
from lagfmu.testing import (
    Goal,
    Point,
    Setting,
    Tradeoff,
    choose,
    measure,
    observe,
    opened,
    other_values,
    prepare,
    print_whole,
    refer,
    write,
)
from lagfmu.testing import TradeoffPlan as Plan
from lagfmu.testing import parse_goal as parse
from lagfmu.testing import tradeoff_table as table

MODELS = Path(__file__).parent.parent / "models"
PENDULUM = model_file("pendulum")
SWING = Scene("Swing", stop_time=2.0, step_size=0.1)
SHORT = Scene("Swing", stop_time=1.0, step_size=0.05)
WIRE = Scene("Wire", stop_time=1.5, step_size=0.05)


def built(name: str, scene: Scene, folder: Path) -> Path:
    """The FMU of models/NAME.py in a scene of its own, with those closed forms that fit it."""
    file = model_file(name)
    return write(prepare(file.model, scene), folder, file.closed_forms)


@pytest.fixture(scope="module")
def wire(tmp_path_factory) -> tuple[Path, Tradeoff]:
    """The rotating wire at two tolerances and some fixed steps."""
    fmu = built("rotating_wire", WIRE, tmp_path_factory.mktemp("wire"))
    methods = ("dop853", "rattle", "rk4")
    return fmu, measure(fmu, Plan(0.15, (1e-3, 1e-6), methods, halvings=3, repeats=2))


@pytest.fixture(scope="module")
def swing(tmp_path_factory) -> tuple[Path, Tradeoff]:
    """The Cartesian pendulum, whose motion in time stands in no closed form of its file."""
    fmu = built("pendulum", SWING, tmp_path_factory.mktemp("swing"))
    plan = Plan(0.1, (1e-4, 1e-7, 1e-10), ("dop853", "radau"), repeats=1)
    return fmu, measure(fmu, plan)


def jacobi(t, theta0=1.0, m=1.0, g=9.81, L=1.0):
    """lambda = -T/(2L), T = m g (3 cos theta - 2 cos theta0), sin(theta/2) = k sn(w t + K)."""
    k = np.sin(theta0 / 2)
    sn = ellipj(np.sqrt(g / L) * t + ellipk(k**2), k**2)[0]
    return -m * g * (3 * (1 - 2 * (k * sn) ** 2) - 2 * np.cos(theta0)) / (2 * L)


# ------------------------------------------------------------------ references and errors


def test_what_won_is_what_nothing_dominates(wire):
    """A setting wins if and only if none is as good in both error and time, and better in one."""
    chance = random.Random(1)
    setting = Setting("dop853", 1e-6, 0.0, 0.1)
    for _ in range(50):
        points = tuple(
            Point(setting, {"lambda.drive": e / 7}, k, seconds=(c / 7,))
            for k in range(20)
            for e, c in [(1 + chance.randrange(8), chance.randrange(8))]
        )
        found = replace(wire[1], points=points)
        places = [(found.error(p), p.cost) for p in points]
        kept = {(found.error(p), p.cost) for p in found.front}
        assert len(kept) == len(found.front)
        for e, c in places:
            beaten = any(x <= e and y <= c and (x, y) != (e, c) for x, y in places)
            assert ((e, c) in kept) == (not beaten)


def test_the_reference_is_as_near_as_it_says(swing):
    """The pendulum's lambda is known by Jacobi's sn, at 1e-13 and at every tolerance that is measured."""
    fmu, found = swing
    reference = found.reference
    exact = jacobi(reference.run["time"])
    error = np.abs(reference.run["lambda.rod"] - exact).max() / np.abs(exact).max()
    assert error <= 2 * reference.own["lambda.rod"] < 1e-12
    for point in found.points:
        values = {"solver.method": point.setting.method}
        run = simulate(fmu, 2.0, 0.1, point.setting.tolerance, values)
        exact = jacobi(run["time"])
        error = np.abs(run["lambda.rod"] - exact).max() / np.abs(exact).max()
        assert abs(point.errors["lambda.rod"] - error) <= 3 * reference.own["lambda.rod"]


def test_no_error_is_below_the_references_own(wire):
    """lambda of a run that equals the reference says nothing below the reference's error."""
    found = wire[1]
    point = replace(found.points[0], errors=dict.fromkeys(found.reference.own, 0.0))
    assert found.error(point) == found.reference.own["lambda.drive"]


def test_a_missed_event_is_an_infinite_error(native_fmu):
    """A run without the departure, or with one too many, has no right time of it."""
    path = native_fmu("Hemisphere")
    with opened(path) as session:
        reference = refer(session, communication=0.1)
        run = observe(session, Setting("dop853", 1e-6, 0.0, 0.1))
    assert reference.errors(run)["departure.surface.time"] < 1e-6
    run["departure.surface.count"] = 0
    assert reference.errors(run)["departure.surface.time"] == float("inf")


def test_a_contact_that_closes_a_little_later_is_no_error_but_one_that_stays_open_is(native_fmu):
    """A ball that has come to rest presses with m g.  At the first point after that a run in which it comes
    to rest a rounding later has 0; a run that has it at two points is off by the whole weight."""
    with opened(native_fmu("BouncingBall")) as session:
        reference = refer(session, communication=0.1)
        run = observe(session, Setting("dop853", 1e-6, 0.0, 0.1))
    rests = int(np.flatnonzero(run["contact.floor"])[0])
    assert run["lambda.floor"][rests] == pytest.approx(9.81)
    for late, error in ((1, 0.0), (2, 1.0)):
        run["contact.floor"][rests : rests + late] = False
        run["lambda.floor"][rests : rests + late] = 0.0
        assert reference.errors(run)["lambda.floor"] == pytest.approx(error, abs=1e-6)


# ------------------------------------------------------------------ measuring


def test_a_refused_method_is_reported_and_the_others_are_measured(wire):
    """The python target has no rattle: its refusal is told, dop853 and rk4 have points and times."""
    found = wire[1]
    (note,) = found.notes
    assert note.startswith("rattle is refused")
    assert {p.setting.method for p in found.points} == {"dop853", "rk4"}
    assert all(len(p.seconds) == 2 and min(p.seconds) > 0 for p in found.points)


def test_the_command_writes_table_file_and_figure(tmp_path):
    """JSON with everything, the figure; the pull of the link, an output of one's own, is -lambda and
    has the same error."""
    model, out, file = tmp_path / "link.py", tmp_path / "out", tmp_path / "all.json"
    text = SMALL.replace("WRONG", "-1").replace(
        "constraints=", "outputs=[Output('pull', -multiplier('link'), 'N')], constraints="
    )
    model.write_text("from lagfmu import Output, multiplier\n" + text)
    text = lagfmu(
        *("tradeoff", model, "--scene", "Link", "--out", out, "--repeats", 2, "--target", "python"),
        *("--tolerance", 1e-4, "--method", "dop853", "--method", "radau", "--step-size", 0.02),
        *("--json", file),
    )
    assert "Link (python), every 0.02 s" in text
    assert "own error" in text
    (data,) = json.loads(file.read_text())
    assert data["reference"]["lambda.link"]["own"] > 0
    assert len(data["points"]) > 1
    for point in data["points"]:
        assert point["errors"]["pull"] == point["errors"]["lambda.link"]
    assert (out / "python" / "Link.svg").read_text().count("<svg") == 1


def test_a_pipeline_reads_what_was_measured(tmp_path):
    """A case a setting, none of which fails, for a trade-off measures: a link that is said to pull twice as
    hard as it does is marked, with its sentence.  3 for a missing file, 2 for a method that is none."""
    model, xml, data = tmp_path / "link.py", tmp_path / "out.xml", tmp_path / "out.json"
    model.write_text(SMALL.replace("WRONG", "-2"))
    words = ["tradeoff", model, "--scene", "Link", "--out", tmp_path / "out", "--repeats", 1]
    words += ["--tolerance", 1e-4, "--method", "dop853", "--method", "rk4", "--step-size", 0.05]
    printed = lagfmu(*words, "--junit", xml, "--json", data)
    assert re.search(r"✗ dop853 1e-4: lambda\.link", printed)
    suite = ET.parse(xml).getroot().find("testsuite")
    assert not suite.findall("testcase[failure]")
    (found,) = json.loads(data.read_text())
    missed = {p["setting"]["method"]: p["missed"] for p in found["points"]}
    assert "lambda" in missed["dop853"][0]
    assert not missed["rk4"]
    assert found["verdict"] == "pass"
    assert int(suite.get("tests")) == len(found["points"]) > 1
    text = lagfmu("tradeoff", tmp_path / "gone.fmu", "--out", tmp_path / "out", code=3)
    assert "there is no such file" in text
    assert "expected one of dop853, rk4" in lagfmu("tradeoff", model, "--method", "rk45", code=2)


def test_the_table_fits_80_columns_whole(swing):
    """Every error, step count and time stands there with all its digits; on 40 columns row by row."""
    found = swing[1]
    for width in (80, 40):
        text = io.StringIO()
        print_whole(Console(file=text, width=width), table(found))
        printed = text.getvalue()
        assert "…" not in printed
        assert max(map(len, printed.splitlines())) <= width
        for point in found.points:
            assert str(point.steps) in printed
            assert f"{found.error(point):.1e}" in printed


# ------------------------------------------------------------------ choosing


@pytest.mark.parametrize("text", ["tight", "1e-6:", "0", "1e-20", "2"])
def test_an_accuracy_that_means_nothing_is_refused(text):
    """An accuracy is a relative error between 1e-12 and 0.1, and names after a colon."""
    with pytest.raises(UsageError, match="expected a relative error"):
        parse(text)


def test_an_accuracy_may_name_outputs():
    """1e-6:lambda.surface,Q.* asks it of those only."""
    assert parse("1e-6:lambda.surface,Q.*") == Goal(1e-6, ("lambda.surface", "Q.*"))


def test_other_values_are_near_within_bounds_and_keep_the_contacts(native_fmu):
    """Each parameter and start value within 5 %; the particle still starts on the sphere."""
    with opened(native_fmu("Hemisphere")) as session:
        scene = observe(session, Setting("", 0.0, 0.0, 0.01), stop=0.01)
        for k in range(4):
            values = other_values(session, scene, random.Random(k))
            assert values.keys() == {"m", "g", "a", "r", "theta"}
            starts = {"m": 1.0, "g": 9.81, "a": 1.0, "r": 1.0, "theta": 0.01}
            assert all(0 < abs(v / starts[n] - 1) <= 0.05 for n, v in values.items())
            run = observe(session, Setting("", 0.0, 0.0, 0.01), values, 0.01)
            assert run["contact.surface"][0]


def test_other_values_of_a_mechanism_are_those_of_its_coordinates(native_fmu):
    """Joints that are all moved by themselves would not close."""
    with opened(native_fmu("SliderCrankBodies")) as session:
        scene = observe(session, Setting("", 0.0, 0.0, 0.01), stop=0.01)
        values = other_values(session, scene, random.Random(1))
        assert "crank.orientation.z" in values
        assert not [n for n in values if "angle." in n or "position.D" in n]


@pytest.fixture(scope="module")
def choices():
    """The pendulum, chosen for 1e-4 and for 1e-9 of lambda."""
    goals = (Goal(1e-4, ("lambda.rod",)), Goal(1e-9, ("lambda.rod",)))
    return [choose(PENDULUM.model, SHORT, goal, target="native") for goal in goals]


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
        fmu = write(prepare(PENDULUM.model, choice.scene), tmp_path, target="native")
        for theta0, m, g, L in ((0.96, 1.04, 9.5, 0.97), (1.04, 0.97, 10.1, 1.03)):
            start = {"m": m, "g": g, "L": L, "x": L * np.sin(theta0), "y": -L * np.cos(theta0)}
            for h in (0.1, 0.25):
                run = simulate(fmu, 1.0, h, start_values=start)
                exact = jacobi(run["time"], theta0, m, g, L)
                error = np.abs(run["lambda.rod"] - exact).max() / np.abs(exact).max()
                assert error <= choice.goal.accuracy / 2
        assert choice.held_out_error <= choice.goal.accuracy / 2
        assert choice.trial.error <= choice.goal.accuracy / 5


def test_what_is_a_step_coarser_does_not_hold(choices):
    """The choice is the coarsest: the next coarser tolerance, which bisection has tried, misses; fewer digits
    cost fewer steps."""
    for choice in choices:
        coarser = [t for t in choice.trials if t.setting.tolerance > choice.trial.setting.tolerance]
        assert coarser[-1].setting.tolerance <= 2.5 * choice.trial.setting.tolerance
        assert coarser[-1].error > choice.goal.on_the_scene
    coarse, fine = (c.trial for c in choices)
    assert coarse.steps <= 0.75 * fine.steps


def test_what_misses_elsewhere_gives_way_to_something_finer(choices, monkeypatch):
    """A choice that fails on held-out values is replaced by one with a tighter tolerance."""
    monkeypatch.setattr(Goal, "held_out", property(lambda goal: goal.accuracy / 40))
    first, goal = choices[0], choices[0].goal
    choice = choose(PENDULUM.model, SHORT, goal, target="native")
    assert choice.failed[0][0] == first.trial
    assert choice.trial.setting.tolerance < first.trial.setting.tolerance
    assert choice.held_out_error <= goal.accuracy / 40


def test_a_fixed_step_is_halved_until_it_holds():
    """rk4 has no tolerance: its step is found, and the FMU states the accuracy that was asked for."""
    scene = replace(SHORT, method="rk4")
    choice = choose(PENDULUM.model, scene, Goal(1e-7, ("lambda.rod",)), target="native")
    halvings = np.log2(0.05 / choice.scene.step)
    assert halvings == round(halvings) > 1
    assert choice.scene.tolerance == 1e-7
    assert choice.trial.error <= 2e-8


def test_what_nothing_holds_is_refused_with_the_best_that_was_reached():
    """The message names the setting, its error and the output that is worst."""
    scene = replace(SHORT, method="radau")
    with pytest.raises(
        BuildError, match=r"best on the scene is radau \de-1\d: .*e-1\d of lambda\.rod"
    ):
        choose(PENDULUM.model, scene, Goal(1e-15, ("lambda.rod",)), target="native")


def test_an_output_that_is_not_measured_is_refused():
    """--accuracy 1e-6:pull: no such output; the message lists those that there are."""
    with pytest.raises(SimulationError, match=r"'pull'.*lambda\.rod"):
        choose(PENDULUM.model, SWING, Goal(1e-4, ("pull",)))


def test_the_built_fmu_says_what_was_chosen_and_why(tmp_path):
    """Its default is the choice; its page has the section with what was tried; the bytes are the same twice,
    for no time is measured."""
    model = tmp_path / "link.py"
    model.write_text(SMALL.replace("WRONG", "-1"))
    arguments = ("--scene", "Link", "--accuracy", "1e-6:lambda.link", "--out")
    text = lagfmu("build", model, *arguments, tmp_path / "dist")
    assert "Link: pass" in text
    fmu = tmp_path / "dist" / "native" / "Link.fmu"
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
        description = archive.read("modelDescription.xml").decode()
    tolerance = re.search(r"chosen for 1e-06 of lambda\.link: auto ([\de-]+)", text)[1]
    assert f'tolerance="{float(tolerance)!r}"' in description
    section = page[page.index('id="choice"') :]
    assert "Held-out values" in section
    assert section.count('"pass">chosen<') == 1
    lagfmu("build", model, *arguments, tmp_path / "again")
    assert (tmp_path / "again" / "native" / "Link.fmu").read_bytes() == fmu.read_bytes()
