"""Verification that a pipeline can read: exit codes, JSON, JUnit, reference results."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import replay
from conftest import MODELS, of_each_kind
from junitparser import JUnitXml
from lxml import etree
from sympy import symbols
from typer.testing import CliRunner

from lagfmu import ClosedForm, Scene, build_fmu
from lagfmu.testing import app, load, read_table

WEIGHT = """
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from lagfmu import ClosedForm, Contact, Model, Parameter
m, g = symbols("m g", positive=True)
z = dynamicsymbols("z")
model = Model(name="Resting", lagrangian=m * z.diff() ** 2 / 2 - m * g * z, coordinates={z: "m"},
    constraints=[Contact("floor", z)], parameters=[Parameter(m, 2.0, "kg"), Parameter(g, 9.81, "m/s^2")])
"""


def run(*words) -> tuple[int, str]:
    done = CliRunner().invoke(app, [str(w) for w in words])
    return done.exit_code, " ".join(done.output.split())


@pytest.fixture(scope="module")
def hemisphere(native_fmu) -> Path:
    return native_fmu("Hemisphere")


@pytest.fixture(scope="module")
def wrong(tmp_path_factory) -> Path:
    """An FMU that says a floor carries twice the weight."""
    folder = tmp_path_factory.mktemp("wrong")
    (folder / "resting.py").write_text(WEIGHT)
    file = load(folder / "resting.py")
    m, g = symbols("m g", positive=True)
    forms = [ClosedForm("lambda.floor", 2 * m * g)]
    return build_fmu(file.model, folder, Scene("Resting"), forms, "native", check=False)


def test_the_exit_code_is_the_worst_of_all(hemisphere, wrong, tmp_path):
    """0 all hold, 1 a statement about the physics fails, 2 wrong usage, 3 an FMU could not be run; what can
    be run is run all the same."""
    missing = tmp_path / "missing.fmu"
    assert run("verify", hemisphere)[0] == 0
    assert run("verify", hemisphere, wrong)[0] == 1
    code, text = run("verify", missing, wrong, hemisphere)
    assert "3 FMUs: 1 pass, 1 fail, 1 not run" in text
    assert code == 3
    assert "there is no such file" in text
    assert "Hemisphere: pass" in text
    assert run("verify", hemisphere, "--rtol", "1e-3")[0] == 2
    assert run("verify", hemisphere, "--no-such-option")[0] == 2
    assert run("verify", hemisphere, "--reference", tmp_path / "none.csv")[0] == 2
    code, text = run("verify", hemisphere, "--set", "thta=1", "--json", tmp_path / "out.json")
    assert code == 2
    assert "did you mean 'theta'" in text
    assert json.loads((tmp_path / "out.json").read_text())[0]["verdict"] == "wrong usage"
    assert run("verify", hemisphere, missing, "--set", "thta=1")[0] == 3


def test_what_no_run_reached_is_no_success(tmp_path):
    """The weight never leaves its floor: of a statement on its flight alone nothing is known, status 1."""
    (tmp_path / "resting.py").write_text(WEIGHT)
    forms = [ClosedForm("lambda.floor", symbols("g"), while_open="floor")]
    model = load(tmp_path / "resting.py").model
    fmu = build_fmu(model, tmp_path, Scene("Resting"), forms, "native", check=False)
    code, text = run("verify", fmu)
    assert code == 1
    assert "none of 1 was: nothing is known of its physics" in text


def test_a_suite_an_fmu_and_a_case_a_statement(hemisphere, wrong, tmp_path):
    """JUnit's XML: the numbers of suites, cases, failures and errors are those of what was found."""
    xml, data = tmp_path / "out.xml", tmp_path / "out.json"
    run("verify", hemisphere, wrong, tmp_path / "gone.fmu", "--junit", xml, "--json", data)
    root = ET.parse(xml).getroot()
    suites = root.findall("testsuite")
    assert root.tag == "testsuites"
    assert [s.get("name") for s in suites] == [
        str(hemisphere),
        str(wrong),
        str(tmp_path / "gone.fmu"),
    ]
    for suite in suites:
        assert int(suite.get("tests")) == len(suite.findall("testcase"))
    assert [int(s.get("failures")) for s in suites] == [0, 1, 0]
    assert [int(s.get("errors")) for s in suites] == [0, 0, 1]
    found = json.loads(data.read_text())
    assert [f["verdict"] for f in found] == ["pass", "fail", "not run"]
    statements = {s["name"]: s for s in found[1]["statements"]}
    assert statements["lambda.floor"]["error"] == pytest.approx(0.5)
    assert "der(theta,2)" in found[0]["uncovered_outputs"]
    assert "lambda.surface" not in found[0]["uncovered_outputs"]


def test_an_fmu_knows_later_which_closed_forms_its_scene_left_out(tmp_path):
    """Of the atwood machine's, those that speak of more than its tension: build and verify say how many."""
    model, out = MODELS / "atwood.py", tmp_path / "out"
    narrow = ["--outputs", "lambda.string", "--name", "Tension", "--target", "python"]
    code, built = run("build", model, *narrow, "--out", out)
    assert code == 0
    [fmu] = out.rglob("Tension.fmu")
    code, told = run("verify", fmu, "--json", tmp_path / "found.json")
    assert code == 0
    [found] = json.loads((tmp_path / "found.json").read_text())
    assert found["closed_forms_left_out"] > 0
    whole = len(load(model).closed_forms)
    lacks = f"{found['closed_forms_left_out']} of {whole} closed forms were not checked"
    assert lacks in built
    assert lacks in told


JUNIT = """
<grammar xmlns="http://relaxng.org/ns/structure/1.0"
         datatypeLibrary="http://www.w3.org/2001/XMLSchema-datatypes">
  <start><element name="testsuites"><ref name="counts"/><zeroOrMore><element name="testsuite">
    <ref name="counts"/>
    <optional><element name="properties"><oneOrMore><element name="property">
      <attribute name="name"/><attribute name="value"/></element></oneOrMore></element></optional>
    <zeroOrMore><element name="testcase">
      <attribute name="name"/><attribute name="classname"/><ref name="time"/>
      <optional><choice>
        <element name="skipped"><ref name="told"/></element>
        <element name="failure"><ref name="told"/></element>
        <element name="error"><ref name="told"/></element>
      </choice></optional>
    </element></zeroOrMore></element></zeroOrMore></element></start>
  <define name="counts">
    <attribute name="name"/><ref name="time"/>
    <attribute name="tests"><data type="nonNegativeInteger"/></attribute>
    <attribute name="failures"><data type="nonNegativeInteger"/></attribute>
    <attribute name="errors"><data type="nonNegativeInteger"/></attribute>
    <optional><attribute name="skipped"><data type="nonNegativeInteger"/></attribute></optional>
  </define>
  <define name="time"><attribute name="time"><data type="decimal"/></attribute></define>
  <define name="told"><optional><attribute name="type"/></optional><attribute name="message"/><text/></define>
</grammar>"""


def test_the_xml_keeps_the_rules_of_junit(hemisphere, wrong, tmp_path):
    """Written down from what the schemas of Jenkins' xUnit plugin and of Apache Ant agree on: which elements
    and attributes stand where, in which order, with numbers where they count.  One FMU that holds, one that
    fails (with a character that XML does not know as it is in its folder), one that is not there."""
    xml, odd = tmp_path / "out.xml", tmp_path / "a<&b" / "wrong.fmu"
    odd.parent.mkdir()
    shutil.copy(wrong, odd)
    run("verify", hemisphere, odd, tmp_path / "gone.fmu", "--junit", xml)
    rules = etree.RelaxNG(etree.fromstring(JUNIT))
    rules.assertValid(etree.parse(str(xml)))
    read = JUnitXml.fromfile(str(xml))
    assert (read.failures, read.errors) == (1, 1)
    assert [suite.name for suite in read][1] == str(odd)


def test_a_run_is_held_against_a_reference(hemisphere, tmp_path):
    """The cross-check's files come from a run at 1e-12: one at 1e-8 agrees within 1e-6, one with a mass
    that is off by a thousandth is off by that in lambda, and only there."""
    assert run("reference", hemisphere, "--out", tmp_path)[0] == 0
    name = hemisphere.stem
    assert {p.name for p in tmp_path.iterdir()} == {
        f"{name}_ref.csv", f"{name}_ref.opt", "README.md",
    }  # fmt: skip
    options = dict(line.split(",") for line in (tmp_path / f"{name}_ref.opt").read_text().split())
    assert float(options["RelTol"]) == 1e-12
    reference = tmp_path / f"{name}_ref.csv"
    assert run("verify", hemisphere, "--reference", reference)[0] == 0
    data = tmp_path / "off.json"
    off = ["verify", hemisphere, "--reference", reference, "--set", "m=1.001", "--json", data]
    assert run(*off)[0] == 1
    found = json.loads(data.read_text())[0]["statements"]
    errors = {s["name"]: s["error"] for s in found}
    assert errors["reference: lambda.surface"] == pytest.approx(1e-3, rel=1e-3)
    assert errors["reference: theta"] < 1e-8  # the tolerance of the run
    energies = [f"energy.{k}=1e-2" for k in ("kinetic", "potential", "total")]
    loose = [
        f"--rtol={n}" for n in ("lambda.surface=1e-2", "Q.r=1e-2", "Q.surface.r=1e-2", *energies)
    ]
    assert run(*off, *loose)[0] == 0


def test_a_column_that_the_fmu_does_not_have_is_told(hemisphere, tmp_path):
    """With the names that it has."""
    path = tmp_path / "other.csv"
    path.write_text("time,phi\n0,1\n1,1\n")
    code, output = run("verify", hemisphere, "--reference", path)
    assert code == 2
    assert "'phi' is no output" in output


def test_inputs_come_from_a_file(native_fmu, tmp_path):
    """A cart pushed by 2 N: `simulate` and `verify` take the same table."""
    path = tmp_path / "in.csv"
    path.write_text("time,F\n0,2\n1,2\n")
    cart = native_fmu("CartPendulum")
    pushed, rest = tmp_path / "pushed.csv", tmp_path / "rest.csv"
    assert run("simulate", cart, "--stop-time", 1, "--input", path, "--csv", pushed)[0] == 0
    assert run("simulate", cart, "--stop-time", 1, "--csv", rest)[0] == 0
    tables = [read_table(p) for p in (pushed, rest)]
    assert tables[0]["s"][-1] > tables[1]["s"][-1] + 0.1
    assert run("verify", cart, "--stop-time", 1, "--input", path)[0] == 0


@pytest.mark.parametrize(
    "name", of_each_kind(["hemisphere", "half_car", "pendulum"], kinds=("hemisphere",))
)
def test_the_results_that_an_fmu_carries_are_replayed(name, tmp_path):
    """A script that knows the layered standard and fmpy alone finds what it says: lambda, Q, coordinates and
    departures within 1e-9, at 200 points or fewer and in at most 20 kB."""
    code, output = run(
        "build", MODELS / f"{name}.py", "--target", "native", "--reference", "--out", tmp_path
    )
    assert code == 0, output
    for path in sorted((tmp_path / "native").glob("*.fmu")):
        errors = replay.replay(str(path), 1e-9)
        assert any(n.startswith(("lambda.", "body.")) for n in errors)
        with zipfile.ZipFile(path) as archive:
            told = archive.read("documentation/fmi-ls-ref.txt").decode()
            assert f"{path.stem}_ref.csv" in told
            assert 'href="fmi-ls-ref.txt"' in archive.read("documentation/index.html").decode()
            (table,) = (n for n in archive.namelist() if n.endswith("_ref.csv"))
            assert 10 < len(archive.read(table).splitlines()) - 1 <= 200
            sizes = [
                i.compress_size for i in archive.infolist() if i.filename.startswith(replay.PLACE)
            ]
        assert 0 < sum(sizes) <= 20_000


def test_a_changed_result_is_noticed(tmp_path):
    """The replay is no formality: a lambda that is off by 1e-6 fails it."""
    run("build", MODELS / "atwood.py", "--target", "native", "--reference", "--out", tmp_path)
    path = next((tmp_path / "native").glob("*.fmu"))
    spoilt = shutil.copy(path, tmp_path / "spoilt.fmu")
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(spoilt, "w") as new:
        for name in old.namelist():
            content = old.read(name)
            if name.endswith("_ref.csv"):
                head, *rows = content.decode().splitlines()
                place = [c.strip('"') for c in head.split(",")].index("lambda.string")
                cells = rows[1].split(",")
                cells[place] = repr(float(cells[place]) * (1 + 1e-6))
                content = "\n".join([head, rows[0], ",".join(cells), *rows[2:]]).encode()
            new.writestr(name, content)
    replay.replay(str(path), 1e-9)
    with pytest.raises(AssertionError, match=r"lambda\.string"):
        replay.replay(str(spoilt), 1e-9)
