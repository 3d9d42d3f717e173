"""FMUs that are damaged or hostile, and what is left of those that were unpacked."""

from __future__ import annotations

import io
import os
import re
import shutil
import stat
import subprocess
import sys
import time
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from lagfmu.testing import NOT_RUN, TERMINATED, app


def hostile(archive, kind):
    """Adds a file to an archive that no FMU holds."""
    if kind == "link":
        entry = zipfile.ZipInfo("resources/link")
        entry.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(entry, "/etc/passwd")
    elif kind == "bomb":
        archive.writestr("resources/zeros", "")
        archive.getinfo("resources/zeros").file_size = 3 << 30  # says the archive's directory
    else:
        archive.writestr(kind, "x")


HOSTILE = {
    "link": "'resources/link' is a link",
    "bomb": "its files have 3.22 GB, expected at most 2.15 GB",
    "/tmp/lagfmu_absolute": "'/tmp/lagfmu_absolute' would be put outside its folder",
    "resources/../../above": "'resources/../../above' would be put outside",
    "C:\\windows": "would be put outside",
}


@pytest.mark.parametrize("kind", HOSTILE)
@pytest.mark.parametrize("command", ["verify", "simulate", "sweep", "page"])
def test_an_archive_that_reaches_beyond_itself_is_not_unpacked(native_fmu, tmp_path, command, kind):
    """A link, paths outside its folder, more than it may hold: one message of every command, and nothing is
    written."""
    path = Path(shutil.copy(native_fmu("Atwood"), tmp_path / "X.fmu"))
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as archive:
        hostile(archive, kind)
    words = {"sweep": ["--vary", "m1=1,2"], "page": ["-o", str(tmp_path / "x.html")]}
    done = CliRunner().invoke(app, [command, str(path), *words.get(command, [])])
    assert done.exit_code == NOT_RUN
    text = " ".join(done.output.split())
    assert "X.fmu" in text
    assert HOSTILE[kind] in text
    assert done.exception is None or isinstance(done.exception, SystemExit)
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("command", ["verify", "simulate", "sweep", "page"])
def test_a_damaged_member_is_one_message(native_fmu, tmp_path, command):
    """A bit of each file of the archive is another one, or it is compressed in a way that nobody knows."""
    source = native_fmu("Atwood").read_bytes()
    with zipfile.ZipFile(io.BytesIO(source)) as archive:
        entries = [e for e in archive.infolist() if e.compress_size > 100]
    path = tmp_path / "X.fmu"
    words = {"sweep": ["--vary", "m1=1,2"], "page": ["-o", str(tmp_path / "x.html")]}
    read = ("modelDescription.xml", "sources/runtime.c" if command == "page" else "binaries/")
    for entry in entries:
        if not entry.filename.startswith(read):
            continue
        changed = bytearray(source)
        changed[entry.header_offset + 30 + len(entry.filename) + entry.compress_size // 2] ^= 0x10
        path.write_bytes(changed)
        done = CliRunner().invoke(app, [command, str(path), *words.get(command, [])])
        assert done.exit_code == NOT_RUN, (entry.filename, done.output)
        assert re.search(r"X\.fmu\S* is no FMU or damaged", " ".join(done.output.split()))
        assert done.exception is None or isinstance(done.exception, SystemExit)


def test_an_unpacked_folder_is_told_apart_from_a_missing_file(native_fmu, tmp_path):
    """A page is made of the archive."""
    with zipfile.ZipFile(native_fmu("Hemisphere")) as archive:
        archive.extractall(tmp_path / "unpacked")
    for words in (["page"], ["linearize", "--page", str(tmp_path / "x.html")]):
        done = CliRunner().invoke(app, [*words, str(tmp_path / "unpacked")])
        assert done.exit_code != 0
        assert "this is a folder, expected the archive" in " ".join(done.output.split())


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGTERM there")
@pytest.mark.parametrize(
    "words",
    [["simulate", "FMU", "--stop-time", "5e4"], ["sweep", "FMU", "--vary", "m1=1:2:100000"]],
)
def test_a_terminated_command_leaves_no_folders(native_fmu, tmp_path, words):
    """SIGTERM in the middle: status 143, and what it had unpacked is gone."""
    words = [w.replace("FMU", str(native_fmu("Atwood"))) for w in words]
    command = [sys.executable, "-m", "lagfmu", *words]
    run = subprocess.Popen(
        command, env=os.environ | {"TMPDIR": str(tmp_path)}, stdout=subprocess.DEVNULL
    )
    while run.poll() is None and not list(tmp_path.glob("lagfmu_*/binaries/*/*")):
        time.sleep(0.02)
    time.sleep(0.5)
    run.terminate()
    assert run.wait(timeout=60) == TERMINATED
    assert list(tmp_path.iterdir()) == []
