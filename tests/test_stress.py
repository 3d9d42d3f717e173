"""`lagfmu stress`: what is right passes, what is not is found, and a crash is one wrong row."""

from __future__ import annotations

import io
import json
import shutil
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from conftest import MODELS
from rich.console import Console
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner

from lagfmu import Model, Nonholonomic, Parameter, Scene
from lagfmu.testing import (
    CONSISTENT,
    NO_WORRY,
    NOT_RUN,
    REFUSED,
    RIGHT,
    UNFINISHED,
    VERDICTS,
    WORRY,
    WRONG,
    WRONG_USAGE,
    Bench,
    CarriedForm,
    Check,
    Finding,
    Probe,
    RedundantConstraintWarning,
    RefusalError,
    Stressed,
    Verdict,
    app,
    attempt,
    facts_of,
    lagrange,
    landed,
    lay_beside,
    load,
    name_of,
    prepare,
    probes,
    sizes_of,
    stress,
    verdict,
    write,
)
from lagfmu.testing import judged as judged_forms
from lagfmu.testing import stress_command as command

UNSEEN = Path(__file__).parent / "unseen"


@pytest.fixture(scope="module")
def lawful(native_fmu, prepared, tmp_path_factory):
    """lawful(NAME): a native FMU with Lagrange's equations of its model beside it."""

    def get(name):
        path = tmp_path_factory.mktemp("lawful") / f"{name}.fmu"
        shutil.copy(native_fmu(name), path)
        lay_beside(path, prepared(name))
        return path

    return get


@pytest.fixture(scope="module")
def bench(lawful):
    with Bench(lawful("Hemisphere"), quick=True) as one:
        yield one


def judged(bench, change):
    """Names of the checks that fail after `change` has altered the rows of the default run."""
    rows = bench.ordinary.rows.copy()
    change(rows)
    return [c.what for c in bench.checks(replace(bench.ordinary, rows=rows)) if c.ratio > 1]


def test_the_hemisphere_is_never_wrong(native_fmu):
    """Every quick probe is right or refused; the summary is a table."""
    text = io.StringIO()
    (tried,) = stress([native_fmu("Hemisphere")], Console(file=text), quick=True, limit=60.0)
    found = tried.found
    assert [r for r in found.rows if r.verdict in (WRONG, UNFINISHED)] == []
    assert sum(r.verdict == RIGHT for r in found.rows) > 25
    assert not any(r.worry for r in found.rows)
    families = {"parameters", "starts", "communication step", "tolerance", "method", "long run"}
    assert families <= {r.family for r in found.rows}
    assert [tried.data["verdicts"][v] for v in VERDICTS] == found.counts()[1:-2]
    assert "Hemisphere (native)" in text.getvalue()


def test_the_default_run_passes_every_check(bench):
    assert judged(bench, lambda rows: None) == []


@pytest.mark.parametrize(
    ("column", "factor", "what"),
    [
        ("Q.r", 1 + 1e-12, "shares of Q.r"),
        ("lambda.surface", 1 + 1e-5, "lambda.surface"),
        ("Q.r", 1 + 1e-10, "Lagrange's equation of r"),
        ("der(theta,2)", 1 + 1e-10, "Lagrange's equation of theta"),
        ("der(theta)", 1 + 1e-9, "Lagrange's equation of r"),
        ("Q.surface.r", 1 + 1e-12, "Q.surface.r"),
        ("energy.total", 1.001, "energy"),
    ],
)
def test_a_small_error_of_an_output_is_found(bench, column, factor, what):
    """Q that is not the sum of its shares by 1e-12; Q, an acceleration or a velocity that does not fulfil
    Lagrange's equations by 1e-10; lambda off its closed form by 1e-5; energy that drifts."""

    def change(rows):
        rows[column][len(rows) // 2] *= factor

    assert what in judged(bench, change)


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("FallingRod", ["margin.grip", "power.grip"]),
        ("Bowling", ["margin.grip", "power.grip"]),
        pytest.param(
            "CrankWithBearingFriction", ["power.A", "power.D"], marks=pytest.mark.thorough
        ),
        ("RotatingWire", ["bead.speed", "motor.power"]),
        ("Atwood", ["der(x1,2)"]),
    ],
)
def test_a_small_error_of_what_follows_from_other_outputs_is_found(lawful, name, columns):
    """How far a friction is from slipping and the power that it takes, an output of one's own, an
    acceleration with a closed form: off by 1e-10 at one instant. A power while it sticks is none."""
    with Bench(lawful(name), quick=True) as one:
        ordinary = one.ordinary.rows
        assert judged(one, lambda rows: None) == []
        for column in columns:
            row = int(np.argmax(np.abs(ordinary[column])))
            wrong = [(row, ordinary[column][row] * (1 + 1e-10))]
            if column == "power.grip" and ordinary["sticks.grip"].any():
                wrong.append((int(np.argmax(ordinary["sticks.grip"])), -1e-100))
            for place, value in wrong:
                assert value != ordinary[column][place]

                def change(rows, column=column, place=place, value=value):
                    rows[column][place] = value

                assert column in judged(one, change), (column, value)


def test_eulers_equations_are_held_against_what_turns_in_space(lawful):
    """J w' + w x J w = M of a gyroscope: an angular acceleration off by 1e-9 of itself is found."""
    with Bench(lawful("Gyroscope"), quick=True) as one:
        assert judged(one, lambda rows: None) == []
        for x in "xy":

            def change(rows, x=x):
                row = int(np.argmax(np.abs(rows[f"der(wheel.omega.{x})"])))
                rows[f"der(wheel.omega.{x})"][row] *= 1 + 1e-9

            assert f"Lagrange's equation of wheel.omega.{x}" in judged(one, change)


def test_axes_are_parallel_to_rounding_of_their_length(lawful):
    """A door's hinges hold products of axes of length 1 at 0, of which no coordinate shows the size: what is
    left of them is rounding of 1, and 1e-12 is not."""
    with Bench(lawful("Door"), quick=True) as one:
        assert judged(one, lambda rows: None) == []

        def change(rows):
            rows["residual.lower.ry"][3] = 3e-13

        assert judged(one, change) == ["residual.lower.ry"]


@pytest.mark.parametrize("name", ["Door", "SliderCrankBodies"])
def test_what_is_assumed_of_a_joints_row_holds_what_the_model_says_of_it(lawful, name):
    """Places, levers and axes give e . (p2 - p1) at most 14 sqrt(3) lengths: each row of a door in space, and
    of a crank in the plane while it turns, is within that, and begins at more than a hundredth of it."""
    with Bench(lawful(name), quick=True) as one:
        known = sizes_of(one.facts, one.ordinary, one.forms)
        assumed = sizes_of(one.facts, one.ordinary, [])
        for row, size in known.items():
            assert np.all(size <= assumed[row]), row
            assert size[0] > 0.01 * assumed[row][0], row


def test_a_surface_that_pulls_is_found(bench):
    """lambda < 0 while closed; lambda != 0 in flight; r < a in flight; r = a + 1e-12 while closed."""
    closed = bench.ordinary.rows["contact.surface"]
    first, last = int(np.argmax(closed)), len(closed) - 1
    assert closed[first]
    assert not closed[last]
    for column, row, value, what in (
        ("lambda.surface", first, -1e-3, "push of surface"),
        ("lambda.surface", last, 1e-200, "no pull of surface in the open"),
        ("residual.surface", last, -1e-6, "outside of surface"),
        ("residual.surface", first, 1e-12, "residual.surface"),
        ("der(theta,2)", last, np.nan, "finite der(theta,2)"),
    ):

        def change(rows, column=column, row=row, value=value):
            rows[column][row] = value

        assert what in judged(bench, change), what


@pytest.mark.parametrize("name", ["RotatingWire", "KnifeEdge", "CartPendulum", "PendulumAngle"])
def test_lagranges_equations_hold_at_every_tolerance(lawful, prepared, name):
    """M vdot = F + Q and d2f/dt2 = 0 are no matter of the integration: at a tolerance of 1e-1 they hold
    to rounding, with a drive that depends on time, a rolling constraint, forces, or an embedding."""
    with Bench(lawful(name), quick=True) as one:
        run = one.run({}, one.times(one.facts.stop_time), 1e-1)
        checks = {c.what: c for c in one.checks(run)}
        laws = [checks[closed_form.name] for closed_form in one.facts.laws]
        names = {c.what for c in laws}
        for q in prepared(name).model.coordinates:
            assert f"Lagrange's equation of {name_of(q)}" in names
        for c in one.facts.constraints:
            assert {f"d2/dt2 of {c}", f"residual.{c}"} <= names
        assert all(c.instant for c in laws)
        assert max(c.ratio for c in laws) < 1


def test_what_is_judged_at_instants_only_is_not_called_right():
    """Without a check that follows the motion a row is consistent; a failed one is wrong all the same."""
    instant, course = Check("f", 0.0, 1.0, True), Check("energy", 0.0, 1.0)
    probe = Probe("", "", lambda bench: None)
    assert verdict(probe, Finding((instant,)), 0.0).verdict == CONSISTENT
    assert verdict(probe, Finding((instant, course)), 0.0).verdict == RIGHT
    assert verdict(probe, Finding((Check("f", 2.0, 1.0, True),)), 0.0).verdict == WRONG


def test_a_landing_between_two_points_is_seen(lawful):
    """A ladder let go in the air loses energy when its lower end hits the floor and is thrown back at
    once: the contact is open at every point, and still the energy is not asked for afterwards."""
    with Bench(lawful("Ladder"), quick=False) as one:
        values = {"l": 0.2}
        run = one.run(values, one.times(one.span(values)))
        energy = run.rows["energy.total"]
        hit = int(np.argmax(np.abs(np.diff(energy)) > 0.1 * energy[0])) + 1
        assert not run.rows["contact.floor"][: hit + 3].any()
        before = ~landed(run.rows)
        assert before[:hit].all()
        assert not before[hit:].any()


def test_the_summary_names_what_is_not_right():
    """Each row that is wrong says what is; of the refusals those within a factor of ten of the model's own
    values are the ones that a user should look at."""
    refused = "doStep: discard: the mass matrix is singular at t = 0 s"
    rows = (
        Verdict("parameters", "m = 1", RIGHT, "", "energy", 0.1, 9, 0.1),
        Verdict(
            "parameters", "m = 2", WRONG, "energy: 2.0e+00, allowed 1.0e+00", "energy", 2.0, 9, 0.1
        ),
        Verdict("parameters", "m = 0.1", REFUSED, refused, "", 0, 0, 0.1, near=True),
        Verdict("parameters", "m = 1e-6", REFUSED, refused, "", 0, 0, 0.1),
    )
    found = Stressed("A", "native", "ab" * 32, False, 60.0, True, rows)
    assert found.counts() == [4, 1, 0, 2, 1, 0, 1, 18]
    text = io.StringIO()
    Console(file=text, width=160).print(command.table(found))
    lines = {line.split("  ")[0].strip(): line for line in text.getvalue().splitlines()}
    assert "energy: 2.0e+00, allowed 1.0e+00" in lines["m = 2"]
    assert WORRY in lines["m = 0.1"]
    assert NO_WORRY in lines["m = 1e-6"]


def test_a_refusal_needs_a_cause():
    """discard with a reason is refused; without one, or where it has to work, it is wrong."""
    reason = RefusalError("doStep", 2, "the mass matrix is singular at t = 0 s")
    for refusal, may_refuse, answer in (
        (reason, True, REFUSED),
        (reason, False, WRONG),
        (RefusalError("doStep", 2, "no message"), True, WRONG),
        (RefusalError("doStep", 3, "internal error 17 in the solver"), True, WRONG),
    ):
        probe = Probe("", "", lambda bench, r=refusal: Finding((), r), may_refuse)
        assert verdict(probe, attempt(probe, None), 0.0).verdict == answer
    wrong = Finding((Check("x", 2.0, 1.0),), reason)
    assert verdict(Probe("", "", lambda bench: wrong), wrong, 0.0).verdict == WRONG
    assert verdict(Probe("", "", lambda bench: Finding(())), Finding(()), 0.0).verdict == WRONG


@pytest.fixture
def four_probes(monkeypatch, tmp_path):
    """In place of all: one that is right, one that crashes, one that hangs, one that is right."""
    (tmp_path / "four.py").write_text(
        "import os, time\n"
        "from lagfmu.testing import Check, Finding, Probe, worker as w\n"
        "good = Finding((Check('x', 0.0, 1.0),))\n"
        "w.probes = lambda *_: [Probe('f', 'good', lambda b: good),\n"
        "    Probe('f', 'crash', lambda b: os.abort()), Probe('f', 'hang', lambda b: time.sleep(99)),\n"
        "    Probe('f', 'last', lambda b: good)]\n"
        "w.serve(w.probing())\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(command, "WORKER", "four")
    named = [Probe("f", name, None) for name in ("good", "crash", "hang", "last")]
    monkeypatch.setattr(command, "probes", lambda *_: named)


@pytest.mark.thorough
@pytest.mark.usefixtures("four_probes")
def test_a_crash_is_one_wrong_row(native_fmu, tmp_path):
    """A probe that takes the process down is wrong, one that hangs is unfinished, the rest goes on; JSON and
    JUnit say the same, and a file that is missing is an error of its own: exit code 3, the worst of all."""
    xml, data, fmu = tmp_path / "out.xml", tmp_path / "out.json", str(native_fmu("Hemisphere"))
    words = ["stress", fmu, "--quick", "--limit", "1"]
    files = ["--junit", str(xml), "--json", str(data)]
    done = CliRunner().invoke(app, [*words, str(tmp_path / "gone.fmu"), *files])
    assert done.exit_code == NOT_RUN
    assert "there is no such file" in " ".join(done.output.split())
    found, gone = json.loads(data.read_text())
    assert [r["verdict"] for r in found["rows"]] == [RIGHT, WRONG, UNFINISHED, RIGHT]
    assert "SIGABRT" in found["rows"][1]["detail"]
    assert (found["verdict"], gone["verdict"]) == ("fail", "not run")
    first, second = ET.parse(xml).getroot().findall("testsuite")
    assert [first.get(what) for what in ("tests", "failures", "skipped")] == ["4", "1", "1"]
    assert second.get("errors") == "1"


def test_what_cannot_be_meant_is_wrong_usage():
    """A time limit of 0 s, a scene that no file has: exit code 2."""
    model = str(MODELS / "hemisphere.py")
    for words in ([model, "--limit", "0"], [model, "--scene", "Nobody"]):
        done = CliRunner().invoke(app, ["stress", *words])
        assert done.exit_code == WRONG_USAGE


def test_a_scale_of_a_difference_is_none_of_its_magnitudes(bench):
    """What is relative to |a - b| is so in every run; the magnitudes that both have at least, by the largest
    of their peers, say nothing of their difference (0, so that rounding was called wrong)."""
    theta, r = sp.symbols("theta r", real=True)
    small, zero = 1e-15 * theta, sp.Integer(0)
    law = CarriedForm("law", zero, small, scale=theta - 2 * r)
    (form,) = judged_forms((law,), set())
    run = bench.ordinary
    rows = np.ones(len(run.rows))
    error, allowed, _ = form.judge(run, rows, rows == 1, {"theta": 2.0, "r": 1.0}, 0 * rows)
    assert 0 < error < 1e-3 * allowed


def right(bench, wanted):
    """Runs the full probes of these names, none of which may be refused or wrong."""
    chosen = [p for p in probes(bench.facts, quick=False) if p.name in wanted]
    assert {p.name for p in chosen} == wanted
    for probe in chosen:
        found = probe.do(bench)
        assert found.refusal is None
        assert [c for c in found.checks if c.ratio > 1] == [], probe.name


def test_rounding_of_a_mechanism_is_judged_by_what_it_is_made_of(lawful):
    """A rod of 300 m, whose ends are known to 6e-14 m; joints that stick in a crank at rest, with slips of
    1e-29 rad/s; a crank set to its dead centre, 4e-16 rad off it, which turns in 0.1 s all the same."""
    with Bench(lawful("CrankWithBearingFriction"), quick=True) as one:
        right(one, {"b = 300", "at rest", "phi2 = pi"})
        assert one.span({"phi2": np.pi}) == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize(
    ("name", "wanted"),
    [
        pytest.param(
            "Bennett",
            {"three.inertia.xx = 9e-11", "two.center.x = 250", "one.position.y = 0"},
            marks=pytest.mark.thorough,
        ),
        ("Door", {"at rest"}),
    ],
)
def test_rounding_in_loops_is_judged_by_what_it_is_made_of(lawful, name, wanted):
    """Reactions with arms of 250 m that balance; hinges of a part of 9e-11 kg m^2; an angle of 1e-29 rad
    between axes of length 1; a door at rest for 200 s, which rounding of its balanced weight turns at 1e-9
    rad/s."""
    with Bench(lawful(name), quick=False) as one:
        right(one, wanted)


@pytest.mark.parametrize(
    ("axes", "sign", "probe"), [("body", 1, "C = 0.25"), ("ground", -1, "at rest")]
)
def test_a_body_that_may_not_turn_about_one_axis_is_judged_by_its_speeds(
    tmp_path, axes, sign, probe
):
    """Suslov's body, w_z = 0 to rounding of the other two angular velocities; a ball in angular velocities
    about the ground's axes, whose equations are none of those that are known here: what is left is held."""
    q, w = dynamicsymbols("e0:4"), dynamicsymbols("wx wy wz")
    J = sp.symbols("A B C D E")
    moments = (1.0, 2.0, 2.5, 0.3, -0.2) if sign == 1 else (1.0, 1.0, 1.0, 0.0, 0.0)
    across = sp.Matrix(q[1:]).cross(sp.Matrix(w))
    rates = {q[k + 1]: (q[0] * w[k] + sign * across[k]) / 2 for k in range(3)}
    model = Model(
        name=f"Held{axes.capitalize()}",
        kinetic_energy=sum(a * x**2 for a, x in zip(J, w, strict=False)) / 2
        + w[2] * (J[3] * w[0] + J[4] * w[1]),
        coordinates=dict.fromkeys(q, "1"),
        speeds=dict.fromkeys(w, "rad/s"),
        kinematics={q[0]: -sum(a * b for a, b in zip(q[1:], w, strict=True)) / 2, **rates},
        constraints=[Nonholonomic("held", w[2])],
        parameters=[Parameter(a, b, "kg.m^2") for a, b in zip(J, moments, strict=True)],
        start={q[0]: 1.0, w[0]: 1.0, w[1]: -2.0},
    )
    built = prepare(model, Scene(model.name, stop_time=20.0))
    path = write(built, tmp_path, (), target="native")
    lay_beside(path, built)
    with Bench(path, quick=True) as one:
        right(one, {probe})


@pytest.mark.thorough
def test_an_angle_between_axes_that_are_parallel_is_none(native_fmu):
    """The arms of a suspension begin 1e-18 rad from where their hinges are drawn: nothing of its motion
    happens in 1e-16 s."""
    with Bench(native_fmu("DoubleWishbone"), quick=True) as one:
        angle = one.ordinary.rows["angle.A"][0]
        assert 0 < abs(angle) < 1e-15
        assert one.ordinary_rate < 1e3


def test_the_laws_grow_with_the_mechanism():
    """An equation of a chain of 8 is as long as one of 4: what all of them make of its rounding is summed on
    the run (the laws of a suspension took the square of its equations, and 200 s did not do)."""
    lengths = []
    for n in (4, 8):
        file = load(MODELS / "chain.py", [f"n={n}"])
        table = prepare(file.model, file.scenes[0]).table
        forms = lagrange(file.model, frozenset(v.name for v in table.variables))
        assert len(forms) >= 2 * n
        lengths.append(max(len(str(f.scale)) + len(str(f.expected)) for f in forms))
    assert lengths[1] < 1.2 * lengths[0]


def test_probes_cover_the_ranges(bench):
    """Each parameter, steps and tolerances from short to long, every contact; what is within a factor of ten
    of the model's own values is known."""
    found = {f"{p.family}: {p.name}": p for p in probes(bench.facts, quick=False)}
    assert len(found) == len(probes(bench.facts, quick=False))
    for wanted in ("communication step: 1e-09", "communication step: 1000"):
        assert f"{wanted} natural times" in found
    assert {"tolerance: 1e-2", "tolerance: 1e-12"} <= set(found)
    for p in "mga":
        assert sum(n.startswith(f"parameters: {p} = ") for n in found) >= 8
    assert found["parameters: m = 10"].near
    assert not found["parameters: m = 1000"].near
    assert not found["parameters: m = 1e-06"].near
    assert not found["starts: der(theta) = 1000"].near
    assert found["starts: at rest"].near


def test_a_method_that_an_fmu_does_not_offer_is_not_tried(prepared, tmp_path):
    """The python target steps by dop853 and radau alone; rk4 ended the process that probes it."""
    fmu = write(prepared("Hemisphere"), tmp_path, (), target="python")
    found = [p.name for p in probes(facts_of(fmu), quick=True) if p.family == "method"]
    assert found == ["dop853", "radau"]


def test_what_balances_is_no_difference_of_runs(tmp_path):
    """A table stands on four legs, whose pushes of 37 N turn it nowhere: their moments balance to 1e-15 N m,
    the rounding of shares of 25 N m. Runs at two tolerances round otherwise and agree; a moment of 1e-6 N m
    is one."""
    file = load(UNSEEN / "table.py")
    with pytest.warns(RedundantConstraintWarning):
        prepared = prepare(file.model, file.scenes[0])
    with Bench(write(prepared, tmp_path, (), target="native"), quick=True) as one:
        times = np.linspace(0.9, 1.2, 7).tolist()
        run, other = (one.run({}, [0.0, *times], tolerance) for tolerance in (None, 1e-13))
        standing = replace(run, rows=run.rows[1:])
        against = replace(other, rows=other.rows[1:])
        for sign in (-1.0, 1.0):  # of the rounding, at its largest
            against.rows["Q.b"] = sign * 7e-15
            assert max(c.max() for c in one.differences(standing, against).values()) < 1e-12
        against.rows["Q.b"] += 1e-6
        assert one.differences(standing, against)["Q.b"].max() > 1e-9


@pytest.mark.thorough
def test_rates_that_an_fmu_estimates_are_read_by_the_judge(tmp_path):
    """A cam whose angle alone is given, a contact with a table, friction: nothing is wrong, and the laws that
    need the angle's rates are held against those that the FMU reports."""
    model = UNSEEN / "cam.py"
    file = tmp_path / "cam.json"
    arguments = ["stress", str(model), "--target", "native", "--quick", "--json", str(file)]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    (data,) = json.loads(file.read_text())
    assert data["verdicts"][WRONG] == 0
    assert data["verdicts"][RIGHT] > 5
