"""Files that others wrote: what is wrong is told with the remedy, and nothing hangs, runs or is lost."""

from __future__ import annotations

import os
import random
import re
import resource
import stat
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import MODELS
from typer.testing import CliRunner

import lagfmu
from lagfmu.errors import BuildError, LagfmuError, SettingError, UnitError, VerificationError
from lagfmu.testing import app, described_rules, junit, parse_unit, read_description

NUMBERS = ("", "abc", "nan", "-1", "0", "1e999", "9" * 400, "0x10", "1,5", "time", "\u0661", " 7 ")
XML = "modelDescription.xml"


@pytest.fixture(scope="module")
def pendulum(native_fmu) -> Path:
    return native_fmu("PendulumAngle")


@pytest.fixture
def changed(pendulum, tmp_path):
    """A pendulum with another description."""

    def make(change) -> Path:
        path = tmp_path / "Changed.fmu"
        with zipfile.ZipFile(pendulum) as ours, zipfile.ZipFile(path, "w") as theirs:
            for entry in ours.infolist():
                content = ours.read(entry)
                theirs.writestr(entry, change(content) if entry.filename == XML else content)
        return path

    return make


@pytest.mark.parametrize(
    "text",
    [
        "m^(9^9^9)",
        "m^9^9",
        "m**9**9",
        "((9^99)^99)^99",
        "m^99999999",
        "m^1e9",
        "(m^99)^99",
        "m" * 300,
    ],
)
def test_a_power_of_a_power_is_no_unit(text):
    """An exponent is a short number; a tower of them would be evaluated for ever."""
    with pytest.raises(UnitError, match=r"exponents to 99|shorten it"):
        parse_unit(text, "x")


def test_a_unit_whose_size_no_double_holds_is_refused():
    """1 Mm^99 is 1e594 m^99, which is no double, and 1 um^99 rounds to 0."""
    for text in ("Mm^99", "um^99"):
        with pytest.raises(UnitError, match="double precision"):
            parse_unit(text, "x")


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (rb'stepSize="[^"]*"', b'stepSize="0"', "stepSize is .*expected a positive number"),
        (rb'stepSize="[^"]*"', b'stepSize="abc"', "finite number|cannot be read"),
        (rb'stopTime="[^"]*"', b'stopTime="-1"', "stopTime is .*after the startTime"),
        (rb'name="theta"', b'name="time"', "'time', which names the time itself"),
        (rb'name="lambda.rod"', b'name="theta"', "several variables are called 'theta'"),
        (rb'name="L"([^<]*<Real[^>]*)start="[^"]*"', rb'name="L"\1start="x"', "'L': start is 'x'"),
    ],
)
def test_a_description_that_contradicts_itself_is_refused(changed, old, new, told):
    """A step of 0, a stop before the start and a name that stands twice describe no run."""
    with pytest.raises(VerificationError, match=told):
        lagfmu.simulate(changed(lambda xml: re.sub(old, new, xml)))


def edited(xml: bytes, draw: random.Random) -> bytes:
    """One attribute gets another value, is taken away or repeated; or a piece is lost or doubled."""
    spots = list(re.finditer(rb'\s([\w:]+)="([^"]*)"', xml))
    one = draw.choice(spots)
    kind = draw.randrange(6)
    if kind < 3:
        return xml[: one.start(2)] + draw.choice(NUMBERS).encode() + xml[one.end(2) :]
    if kind == 3:
        return xml[: one.start()] + xml[one.end() :]
    if kind == 4:
        return xml[: one.start(2)] + draw.choice(spots)[2] + xml[one.end(2) :]
    begin = draw.randrange(len(xml))
    return xml[:begin] + xml[begin + draw.randrange(80) :]


def descriptions(pendulum: Path, folder: Path, count: int) -> None:
    with zipfile.ZipFile(pendulum) as ours:
        xml = ours.read(XML)
    draw = random.Random(33)
    for k in range(count):
        text = edited(xml, draw)
        (folder / XML).write_bytes(text)
        told = "correct it"
        try:
            described_rules(read_description(folder))
        except LagfmuError as error:
            told = str(error)
        assert "correct it" in told, k


def test_an_edited_description_is_read_or_refused(pendulum, tmp_path):
    """Of 60 seeded edits each is read, or refused with the remedy."""
    descriptions(pendulum, tmp_path, 60)


@pytest.mark.thorough
def test_a_thousand_edited_descriptions_are_read_or_refused(pendulum, tmp_path):
    """Of 1,000 seeded edits each is read, or refused with the remedy."""
    descriptions(pendulum, tmp_path, 1000)


def test_a_column_without_a_heading_is_told(pendulum, tmp_path):
    """NumPy would call it f1."""
    table = tmp_path / "table.csv"
    table.write_text("time,,theta\n0,1,2\n1,2,3\n")
    with pytest.raises(SettingError, match="column 2 has no heading: give it one"):
        lagfmu.fit(pendulum, table, ["L"])


def test_the_unit_of_a_heading_is_never_evaluated(pendulum, tmp_path):
    """A power tower and a hundred thousand brackets are told at once."""
    table = tmp_path / "table.csv"
    for heading in ("theta [m^(9^9^9)]", "theta " + "[" * 100_000, "theta" + " " * 100_000):
        table.write_text(
            f"time,{heading}x\n0,1\n1,2\n" if "^" not in heading else f"time,{heading}\n0,1\n1,2\n"
        )
        with pytest.raises(SettingError):
            lagfmu.fit(pendulum, table, ["L"])


def test_as_many_numbers_as_unknowns_tell_no_error(pendulum, tmp_path):
    """One number and one unknown leave no residual of which a deviation could be estimated; with a deviation
    that is given the error is known."""
    run = lagfmu.simulate(pendulum, stop_time=0.4, step_size=0.1)
    one = {"time": run["time"][-1:], "theta": run["theta"][-1:]}
    with pytest.raises(SettingError, match=r"as many unknowns.*give standard deviations"):
        lagfmu.fit(pendulum, one, {"L": (0.3, 3.0)}, ["theta"])
    found = lagfmu.fit(pendulum, one, {"L": (0.3, 3.0)}, {"theta": 1e-3})
    assert np.isfinite(found.errors["L"])


@pytest.mark.parametrize("command", ["fit", "sensitivity"])
def test_an_fmu_that_cannot_be_instantiated_is_told(changed, tmp_path, command):
    """Its GUID is another one than that of the binary."""
    path = changed(lambda xml: re.sub(rb'guid="[^"]*"', b'guid="{other}"', xml))
    table = tmp_path / "table.csv"
    table.write_text("time,theta\n0,0.1\n1,0.2\n")
    more = [str(table), "--free", "L"] if command == "fit" else ["--of", "theta"]
    found = CliRunner().invoke(app, [command, str(path), *more])
    assert isinstance(found.exception, SystemExit)
    assert found.exit_code > 0
    assert "instantiate" in found.output


def test_a_reference_stands_beside_its_statements(pendulum, tmp_path):
    """A statement that others wrote reads no file of the reader's, no device and no pipe."""
    (tmp_path / "claims").mkdir()
    (tmp_path / "secret.csv").write_text("time,password\n0,hunter2\n")
    os.mkfifo(tmp_path / "claims" / "pipe")
    claims = tmp_path / "claims" / "claims.toml"
    for file, told in (
        ("../secret.csv", "outside the folder"),
        ("/dev/zero", "outside the folder"),
        ("pipe", "is no file"),
    ):
        claims.write_text(f'[[reference]]\nfile = "{file}"\n')
        with pytest.raises(SettingError, match=told) as refused:
            lagfmu.verify(pendulum, statements=claims)
        assert "hunter2" not in str(refused.value)


def test_what_xml_cannot_hold_is_marked():
    """JUnit's XML is read by every parser, whatever a name holds."""
    text = junit.as_junit(
        "verify",
        [junit.Report("a\x00b.fmu", cases=[junit.Case("\x1b[31m", "\x07", failure="\ufffe")])],
    )
    assert "\ufffd" in next(ElementTree.fromstring(text).iter("testcase")).get("name", "")


def test_dollars_are_no_mathematics(tmp_path):
    """A unit or a name with two dollars is shown as it is."""
    run = np.zeros(2, dtype=[("time", float), ("$x_$", float)])
    run["time"] = 0, 1
    out = tmp_path / "figure.svg"
    lagfmu.Result(run, {"$x_$": "$\\frac$"}, "$\\a$", "native").plot("$x_$", out=out)
    assert "$x_$" in out.read_text()


def test_a_full_disk_leaves_the_figure_that_was_there(tmp_path):
    """A figure is written beside the old one, and takes its place when it is whole."""
    run = lagfmu.simulate(MODELS / "pendulum.py", scene="PendulumAngle", stop_time=0.1)
    out = tmp_path / "figure.svg"
    run.plot(out=out)
    before, limits = out.read_bytes(), resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
        with pytest.raises(BuildError, match="cannot write"):
            run.plot(out=out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert out.read_bytes() == before
    assert os.listdir(tmp_path) == ["figure.svg"]


def test_the_umask_says_who_reads_a_file(tmp_path):
    """A file that is written anew is as private as the user's others; one that is replaced keeps its mode."""
    run = lagfmu.simulate(MODELS / "pendulum.py", scene="PendulumAngle", stop_time=0.1)
    out, before = tmp_path / "figure.svg", os.umask(0o077)
    try:
        run.plot(out=out)
    finally:
        os.umask(before)
    assert stat.S_IMODE(out.stat().st_mode) == 0o600
    run.plot(out=out)
    assert stat.S_IMODE(out.stat().st_mode) == 0o600
