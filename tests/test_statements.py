"""Statements on FMUs of any tool, from a TOML file (lagfmu verify --statements)."""

from __future__ import annotations

import json
import re
import shutil
import zipfile
from pathlib import Path

import pytest
from conftest import model_file
from typer.testing import CliRunner

import lagfmu
from lagfmu import Scene
from lagfmu.errors import SettingError
from lagfmu.testing import RECORD, app


@pytest.fixture(scope="module")
def foreign(native_fmu, tmp_path_factory) -> Path:
    """The particle on the hemisphere as the FMU of another tool: without anything of lagfmu's inside."""
    path = tmp_path_factory.mktemp("foreign") / "Dome.fmu"
    with zipfile.ZipFile(native_fmu("Hemisphere")) as ours, zipfile.ZipFile(path, "w") as theirs:
        for entry in ours.infolist():
            if entry.filename != RECORD:
                theirs.writestr(entry, ours.read(entry))
    return path


@pytest.fixture
def held(foreign, tmp_path):
    """The verdict on each statement of a text, in the order in which they stand."""

    def verdicts(text: str, **settings) -> list:
        (tmp_path / "claims.toml").write_text(text, encoding="utf-8")
        found = lagfmu.verify(foreign, statements=tmp_path / "claims.toml", **settings)
        return list(found.checks[3:])

    return verdicts


def test_what_is_known_of_the_hemisphere_holds_of_any_fmu(held):
    """m = 1 kg on a dome of radius a, from theta_0 at rest: lambda = m g (3 cos theta - 2 cos theta_0) while
    it slides, it presses and never pulls, energy is kept, theta never falls back while it touches, and it
    leaves at cos theta = (2/3) cos theta_0."""
    checks = held("""
        within = 1e-5
        [[equal]]
        of = "lambda.surface"
        to = "m*g*(3*cos(theta) - 2*cos(initial(theta)))"
        when = "contact.surface"
        [[equal]]
        name = "where it leaves"
        of = "cos(departure.surface.theta)"
        to = "2*cos(initial(theta))/3"
        when = "departure.surface.count >= 1"
        [[bounds]]
        of = "lambda.surface"
        at_least = 0
        at_most = "m*g"
        [[conserved]]
        of = "energy.total"
        [[monotone]]
        of = "theta"
        direction = "rising"
        when = "contact.surface"
        [[event]]
        becomes = "contact.surface < 0.5"
        at = "departure.surface.time"
    """)
    assert [c.verdict for c in checks] == ["pass"] * 6
    assert checks[1].name == "where it leaves"
    assert 0 < checks[0].error < 1e-5


def test_a_statement_that_fails_says_whether_a_finer_tolerance_cures_it(held):
    """Energy is kept to what the tolerance allows: at 1e-5 not to 1e-8, at 1e-7 it is; that the kinetic part
    is kept is wrong at every tolerance."""
    claims = """
        within = 1e-8
        [[conserved]]
        of = "energy.total"
        [[conserved]]
        of = "energy.kinetic"
    """
    energy, kinetic = held(claims, tolerance=1e-5)
    assert energy.failed
    assert re.search(r"at a tolerance of 1e-07 it holds \(\S+e-\d+\)$", energy.detail)
    assert kinetic.failed
    assert "at a tolerance of 1e-07 it fails too" in kinetic.detail
    assert all(c.passed for c in held(claims.split('[[conserved]]\n        of = "energy.kin')[0]))


@pytest.mark.parametrize(
    ("text", "detail"),
    [
        ('[[equal]]\nof = "lambda.surface"\nto = "m*g*cos(theta)"', "first missed at t ="),
        ('[[bounds]]\nof = "theta"\nat_most = 0.8', "first missed at t ="),
        ('[[bounds]]\nof = "theta"\nat_least = "2*initial(theta)"', "first missed at t = 0 s"),
        ('[[conserved]]\nof = "energy.kinetic"', "first missed"),
        ('[[monotone]]\nof = "theta"\ndirection = "falling"', "first missed"),
        ('[[event]]\nbecomes = "lambda.surface <= 0"\nat = 0.2', "expected at 0.2 s"),
        ('[[event]]\nbecomes = "theta > 40"\nat = 0.1', "came 0 times until"),
        ('[[equal]]\nof = "sqrt(-theta)"\nto = 1', "not a finite number"),
    ],
)
def test_what_does_not_hold_fails_and_says_when(held, text, detail):
    """A weight that presses with m g cos theta alone would not leave; theta passes 0.8 rad; kinetic energy
    is not conserved on a slope."""
    (check,) = [c for c in held(text) if c.name != "statements reached"]
    assert check.verdict == "FAIL"
    assert detail in check.detail


def test_an_allowance_is_what_the_statement_says(held):
    """theta rises by a known amount: the same deviation is within an absolute or relative allowance that is
    larger than it, and beyond one that is smaller."""
    base = '[[bounds]]\nof = "time"\nat_most = 0.5\n'
    (plain,) = held(base, stop_time=0.6)
    assert plain.error == pytest.approx(0.1 / 0.6)
    for more, verdict in (
        ("within = 0.17", "pass"),
        ("within = 0.16", "FAIL"),
        ("absolute = 0.11", "pass"),
        ("absolute = 0.09", "FAIL"),
        ("scale = 10\nwithin = 0.011", "pass"),
        ("scale = 10\nwithin = 0.009", "FAIL"),
    ):
        assert held(base + more, stop_time=0.6)[0].verdict == verdict, more


def test_of_what_the_run_does_not_reach_nothing_is_known(held):
    """An event after the end, and a condition that never holds, are skipped; where nothing else is said the
    FMU fails."""
    checks = held('[[event]]\nbecomes = "time > 100"\nat = 100', stop_time=0.1)
    assert [c.verdict for c in checks] == ["not reached", "FAIL"]
    checks = held('[[conserved]]\nof = "m"\nwhen = "time > 100"\n[[conserved]]\nof = "m"')
    assert [c.verdict for c in checks] == ["not reached", "pass"]


def test_names_of_other_tools_are_read(tmp_path):
    """Modelica's indices, a derivative, and any name in quotes."""
    import sympy as sp

    from lagfmu.testing import read_named

    known = {n: sp.Symbol(n) for n in ("a.b[1].c", "a.r[1,2]", "der(a.b[1])", "my mass", "x", "E")}
    for text, value in (
        ("2*a.b[1].c - a.r[1, 2]", 2 * known["a.b[1].c"] - known["a.r[1,2]"]),
        ("(der(a.b[1]))^2", known["der(a.b[1])"] ** 2),
        ("'my mass'*sin(x) + 1e-3*E", known["my mass"] * sp.sin(known["x"]) + known["E"] / 1000),
    ):
        assert sp.simplify(read_named(text, known) - value) == 0


def test_every_mistake_in_a_file_is_named_at_once(held):
    """What is unknown, missing, no number, no formula or no name of the FMU, each with its table."""
    with pytest.raises(SettingError) as refused:
        held("""
            within = -1
            [[bound]]
            of = "theta"
            [[bounds]]
            of = "thta"
            at_least = true
            [[bounds]]
            of = "theta"
            [[equal]]
            of = "lambda.surfac"
            to = "__import__('os')"
            absolut = 3
            [[equal]]
            of = "lambda.surfac"
            to = "open(1)"
            [[monotone]]
            of = "theta"
            direction = "up"
            [[event]]
            becomes = "theta > 1"
            at = 1
            occurrence = 0
            [[reference]]
            file = "none.csv"
        """)
    text = str(refused.value)
    for part in (
        "within = -1",
        "[[bound]]: 'bound' is unknown; did you mean 'bounds'",
        "did you mean 'bounds'",
        "[[bounds]] 1: at_least = True",
        "[[bounds]] 2: 'at_least' or 'at_most' is missing",
        "[[equal]] 1: 'absolut' is unknown",
        "did you mean 'absolute'",
        "'lambda.surfac' is unknown; did you mean 'lambda.surface'",
        "'open' is no function of a formula",
        "direction = 'up', expected rising or falling",
        "occurrence = 0, expected 1, 2, ...",
        "none.csv' cannot be read",
    ):
        assert part in text, part


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (b"", "it says nothing"),
        (b"[[bounds]\n", "is no TOML"),
        (b"\xff\xfe", "is no TOML"),
        (b'bounds = "x"', "expected tables [[bounds]]"),
        (
            b'within = "a"\n[[bounds]]\nof = "theta"\nat_least = 0\n',
            "within = 'a', expected a number from 0",  # once, not with each table
        ),
        (b"x = " + b"[" * 3000, "is no TOML"),
    ],
)
def test_a_file_that_is_none_is_refused(foreign, tmp_path, content, told):
    """Empty, cut off, no text, nested without end."""
    (tmp_path / "claims.toml").write_bytes(content)
    with pytest.raises(SettingError, match=r"claims\.toml"):
        lagfmu.verify(foreign, statements=tmp_path / "claims.toml")
    done = CliRunner().invoke(
        app, ["verify", str(foreign), "--statements", str(tmp_path / "claims.toml")]
    )
    assert done.exit_code == 2
    assert " ".join(done.output.split()).count(told) == 1


def test_a_pipeline_reads_statements_as_it_reads_closed_forms(foreign, tmp_path):
    """Exit code 1 where one fails, a case of JUnit for each, and the figures in JSON; a reference beside
    the statements file."""
    begin = lagfmu.simulate(foreign, stop_time=0.1)["theta"][0]
    (tmp_path / "known.csv").write_text(f"time,theta\n0,{begin}\n")
    (tmp_path / "claims.toml").write_text(
        '[[bounds]]\nof = "theta"\nat_most = 0.8\n[[reference]]\nfile = "known.csv"\n'
    )
    out = tmp_path / "out.json"
    words = ["verify", foreign, "--statements", tmp_path / "claims.toml", "--json", out]
    done = CliRunner().invoke(app, [str(w) for w in words])
    assert done.exit_code == 1
    (found,) = json.loads(out.read_text())
    verdicts = {s["name"]: s["verdict"] for s in found["statements"]}
    assert verdicts["theta <= 0.8"] == "FAIL"
    assert verdicts["reference: theta"] == "pass"
    assert "theta" not in found["uncovered_outputs"]
    assert "lambda.surface" in found["uncovered_outputs"]


def test_an_fmu_of_ours_is_held_against_both(native_fmu, tmp_path):
    """Its own closed forms and the statements."""
    (tmp_path / "claims.toml").write_text('[[bounds]]\nof = "lambda.surface"\nat_least = 0\n')
    found = lagfmu.verify(native_fmu("Hemisphere"), statements=tmp_path / "claims.toml")
    assert found.passed
    assert found.closed_forms > 0
    assert found.checks[-1].name == "0 <= lambda.surface"


def test_the_file_of_the_documentation_holds(foreign, tmp_path):
    """What docs/verification.md says of the hemisphere, word for word, on the FMU without closed forms."""
    page = (Path(__file__).parent.parent / "docs" / "verification.md").read_text(encoding="utf-8")
    text = page.split("```toml\n")[1].split("```")[0]
    begin = lagfmu.simulate(foreign, stop_time=0.1)["theta"][0]
    (tmp_path / "claims").mkdir()
    (tmp_path / "claims" / "Hemisphere_ref.csv").write_text(f"time,theta\n0,{begin}\n")
    (tmp_path / "claims" / "claims.toml").write_text(text, encoding="utf-8")
    found = lagfmu.verify(foreign, statements=tmp_path / "claims" / "claims.toml")
    assert [c.verdict for c in found.checks[3:]] == ["pass"] * 6


def test_what_students_hand_in_is_corrected_by_file(foreign, native_fmu, tmp_path):
    """What docs/mechanics.md says of the dome, word for word, on FMUs of one name: a particle that cannot
    leave is pulled from where the other departs, and what has no theta is refused, each told by its file."""
    page = (Path(__file__).parent.parent / "docs" / "mechanics.md").read_text(encoding="utf-8")
    (tmp_path / "dome.toml").write_text(page.split("```toml\n")[1].split("```")[0], "utf-8")
    ann, ben, eve = (tmp_path / f"{name}.fmu" for name in ("ann", "ben", "eve"))
    shutil.copy(foreign, ann)
    held = Scene("Hemisphere", stop_time=2.0, contacts=())
    model = model_file("hemisphere").model
    shutil.copy(lagfmu.build_fmu(model, tmp_path, held, check=False), ben)
    shutil.copy(native_fmu("Loop"), eve)
    words = ["verify", ann, ben, eve, "--statements", tmp_path / "dome.toml"]
    done = CliRunner().invoke(app, [str(w) for w in words], env={"COLUMNS": "300"})
    assert done.exit_code == 2
    verdicts = re.findall(r"(\w+)\.fmu\nHemisphere: (\w+)", done.stdout)
    assert verdicts == [("ann", "pass"), ("ben", "FAIL")]
    departs = lagfmu.simulate(foreign)["departure.surface.time"][-1]
    first = re.search(r"the dome never pulls: first missed at t = (\S+) s", done.stderr)
    assert 0 <= float(first[1]) - departs <= 0.011  # one communication step
    assert re.search(rf"error: {re.escape(str(eve))}: .*'theta' is unknown", done.stderr)
    assert "was not checked" not in done.stdout
    done = CliRunner().invoke(app, ["verify", str(ben)])
    assert "carries no closed forms: its physics was not checked" in done.stdout
