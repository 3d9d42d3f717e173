"""Files that others wrote: what is wrong is told with the remedy, and nothing hangs, runs or is lost."""

from __future__ import annotations

import errno
import os
import re
import resource
import stat
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from conftest import MODELS
from typer.testing import CliRunner

import lagfmu
from lagfmu.errors import (
    BuildError,
    SettingError,
    TemporaryFolderError,
    UnitError,
    VerificationError,
)
from lagfmu.testing import (
    app,
    compiler,
    film,
    parse_unit,
    pipeline,
    told_by,
    write_whole,
)

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
    text = pipeline.as_junit(
        "verify",
        [
            pipeline.Report(
                "a\x00b.fmu", cases=[pipeline.Case("\x1b[31m", "\x07", failure="\ufffe")]
            )
        ],
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


def test_a_device_and_a_link_stay_what_they_are(tmp_path):
    """What is written to a pipe goes through it, and what is written through a link to the file behind it."""
    run = lagfmu.simulate(MODELS / "pendulum.py", scene="PendulumAngle", stop_time=0.1)
    (tmp_path / "link.svg").symlink_to(tmp_path / "figure.svg")
    os.mkfifo(tmp_path / "pipe.svg")
    end = os.open(tmp_path / "pipe.svg", os.O_RDWR)
    write_whole(tmp_path / "pipe.svg", b"whole")
    assert os.read(end, 100) == b"whole"
    os.close(end)
    run.plot(out=tmp_path / "link.svg")
    assert (tmp_path / "link.svg").is_symlink()
    assert (tmp_path / "figure.svg").is_file()
    assert stat.S_ISFIFO((tmp_path / "pipe.svg").stat().st_mode)


def test_two_that_write_one_file_leave_one_of_theirs(tmp_path):
    """Whoever reads it meanwhile reads one of both, whole."""
    place = tmp_path / "shared"
    texts = [letter * 200_000 for letter in (b"a", b"b")]

    def write(text: bytes) -> set[bytes]:
        seen = set()
        for _ in range(20):
            write_whole(place, text)
            seen.add(place.read_bytes())
        return seen

    with ThreadPoolExecutor(2) as pool:
        assert set().union(*pool.map(write, texts)) <= set(texts)
    assert os.listdir(tmp_path) == ["shared"]


def test_a_full_disk_leaves_the_film_that_was_there(prepared, tmp_path):
    """A film is long, and written while it is drawn: it stands beside the old one until it is whole."""
    out = tmp_path / "film.gif"
    out.write_bytes(b"good")
    told = told_by(prepared("PendulumAngle"))
    run = lagfmu.simulate(MODELS / "pendulum.py", scene="PendulumAngle", stop_time=0.5)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
        with pytest.raises(BuildError, match="cannot write"):
            film.film(told, run, {}, out, "")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert out.read_bytes() == b"good"


def test_a_sweep_keeps_another_out_of_its_folder(pendulum, tmp_path):
    """Two sweeps into one file would take each other's chunks."""
    out, refused = tmp_path / "runs.csv", []

    def second(*_: int) -> None:
        with pytest.raises(
            SettingError, match=r"another sweep writes to .* choose another --out"
        ) as told:
            lagfmu.sweep(pendulum, {"theta": [0.1]}, out=out, resume=True, stop_time=0.1)
        refused.append(told)

    lagfmu.sweep(pendulum, {"theta": [0.1]}, out=out, workers=1, stop_time=0.1, progress=second)
    assert refused
    assert out.is_file()


def test_a_key_of_many_parts_is_told_at_once(pendulum, tmp_path):
    """tomllib would look at the parts of a dotted key in quadratic time: for a quarter of an hour here."""
    claims = tmp_path / "claims.toml"
    for text in (
        "a." * 400_000 + "a = 1",
        "[" + "a." * 400_000 + "a]",
        "x = {" + "a . " * 200_000 + "a = 1}",
    ):
        claims.write_text(text)
        with pytest.raises(SettingError, match="a key in line 1 has more than"):
            lagfmu.verify(pendulum, statements=claims)


def test_files_that_are_open_are_no_full_disk():
    """Each error of the system has its own remedy."""
    told = str(TemporaryFolderError(OSError(errno.EMFILE, "Too many open files", "/tmp")))
    assert "ulimit" in told
    assert "disk" not in told
    assert "disk full" in str(TemporaryFolderError(OSError(errno.ENOSPC, "No space left", "/tmp")))


def test_nobody_has_a_home(tmp_path):
    """Without HOME the compiler keeps what it makes in the cache of lagfmu."""
    known = {k: v for k, v in os.environ.items() if k not in ("HOME", "XDG_CACHE_HOME")}
    known[compiler.CACHE] = str(tmp_path / "cache")
    source = b"int one(void) { return 1; }"
    code = (
        "from lagfmu.testing import compile_libraries, host;"
        f"compile_libraries('one', {{'one.c': {source!r}}}, {{}}, [host()])"
    )
    done = subprocess.run([sys.executable, "-c", code], env=known, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
