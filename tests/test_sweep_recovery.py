"""Sweeps that are interrupted, that hold runs without an end, and that go on from damaged parts."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import lagfmu
from lagfmu.errors import SettingError
from lagfmu.testing import PartWarning, told

KEEP = ("lambda.surface:max", "theta:trajectory")
VALUES = {"theta": np.linspace(0.1, 1.0, 10)}


@pytest.fixture(scope="module")
def hemisphere(native_fmu) -> Path:
    """The native FMU of the particle on the hemisphere."""
    return native_fmu("Hemisphere")


@pytest.fixture(scope="module")
def alone(hemisphere):
    """The sweep that is never interrupted."""
    return lagfmu.sweep(hemisphere, VALUES, keep=KEEP, workers=1)


def stopped(hemisphere: Path, out: Path, after: int) -> Path:
    """The folder of a sweep that ends itself after some of its ten chunks of one run."""

    def stop(done: int, total: int, refused: int) -> None:
        if done >= after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        lagfmu.sweep(hemisphere, VALUES, keep=KEEP, out=out, workers=1, progress=stop)
    return out.with_name(f"{out.name}.parts")


def halve(place: Path) -> None:
    place.write_bytes(place.read_bytes()[: place.stat().st_size // 2])


def flip(place: Path) -> None:
    """A bit in every byte of a stretch, wherever numbers and what describes them stand."""
    content = bytearray(place.read_bytes())
    for k in range(len(content) // 4, len(content) // 2):
        content[k] ^= 1
    place.write_bytes(content)


def copy(place: Path) -> None:
    """Chunk 1 in place of another: as whole as it was, and of another run."""
    shutil.copy(place.with_name(f"part_00000001{place.suffix}"), place)


@pytest.mark.parametrize("ending", ["parquet", "npz"])
@pytest.mark.parametrize("spoil", [halve, flip, copy, Path.unlink])
def test_a_part_that_cannot_be_used_is_done_again(hemisphere, alone, tmp_path, ending, spoil):
    """What stands in the parts of a sweep that goes on is not believed: the result is that of one that was
    never interrupted, and which chunk was done again is said (one that is not there is no matter)."""
    out = tmp_path / "runs.nc"
    folder = stopped(hemisphere, out, 8)
    place = folder / f"part_00000002.{ending}"
    assert place.exists()
    spoil(place)
    if spoil is Path.unlink and ending == "parquet":
        found = lagfmu.sweep(hemisphere, VALUES, keep=KEEP, out=out, resume=True, workers=1)
    else:
        with pytest.warns(PartWarning, match=r"part_00000002\.parquet.*done again"):
            found = lagfmu.sweep(hemisphere, VALUES, keep=KEEP, out=out, resume=True, workers=1)
    for name in KEEP:
        np.testing.assert_array_equal(found[name].values, alone[name].values)


def test_a_folder_whose_record_is_damaged_is_told(hemisphere, tmp_path):
    """JSON of something else in place of the sweep's own."""
    out = tmp_path / "runs.nc"
    (stopped(hemisphere, out, 2) / "sweep.json").write_text("[]")
    with pytest.raises(SettingError, match="missing or damaged"):
        lagfmu.sweep(hemisphere, VALUES, keep=KEEP, out=out, resume=True)


def test_a_run_without_an_end_is_given_up(hemisphere):
    """Steps of at most 1 µs over 20 s would take a minute: after 0.5 s its row says so, and the runs beside
    it, on the same worker, are as they are alone."""
    steps = {"solver.maximum_step": [1.0, 1e-6, 0.5]}
    options = {"keep": KEEP[:1], "stop_time": 20.0, "workers": 1}
    found = lagfmu.sweep(hemisphere, steps, timeout=0.5, **options)
    assert found["status"].values.tolist() == ["ok", "timeout", "ok"]
    assert "longer than the 0.5 s of --timeout" in str(found["reason"].values[1])
    alone = lagfmu.sweep(hemisphere, {"solver.maximum_step": [1.0, 0.5]}, **options)
    np.testing.assert_array_equal(found[KEEP[0]].values[[0, 2]], alone[KEEP[0]].values)
    with pytest.raises(SettingError, match=r"timeout = 0\.0 s"):
        lagfmu.sweep(hemisphere, steps, timeout=0.0)


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_the_client_alone_is_interrupted(hemisphere, tmp_path):
    """SIGINT to the client and not to its workers, in the middle of long runs: nothing is tried again, no
    process is left, what was finished is there."""
    out = tmp_path / "runs.parquet"
    vary = "solver.maximum_step=" + ",".join(["1", "1e-6", "2e-6", "3e-6", "4e-6"])
    words = ["--vary", vary, "--stop-time", "1000", "--keep", KEEP[0], "--workers", "2"]
    command = [sys.executable, "-m", "lagfmu", "sweep", str(hemisphere), *words, "--out", str(out)]
    place = {"TMPDIR": str(tmp_path / "tmp")}
    Path(place["TMPDIR"]).mkdir()
    client = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ | place)
    parts = out.with_name("runs.parquet.parts")
    while client.poll() is None and not list(parts.glob("part_*")):
        time.sleep(0.02)
    time.sleep(1.0)
    client.send_signal(signal.SIGINT)
    said = client.communicate(timeout=60)[1]  # pipes that a worker holds would keep it waiting
    assert client.returncode == 130, said
    assert "what is finished is in" in said
    assert "go on with the same command and --resume" in " ".join(said.split())
    assert [p.name for p in parts.glob("part_*")] == ["part_00000000.parquet"]
    assert list(Path(place["TMPDIR"]).iterdir()) == []


def test_progress_tells_rate_cost_and_time_left(monkeypatch, capsys):
    """400 of 1000 runs were there; 100 more in 20 s on 4 workers: 5/s, 800 ms each, 100 s left."""
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    with told(None, 4) as tell:
        tell(400, 1000, 0)
        now = 2.5
        tell(400, 1000, 0)
        now = 20.0
        tell(500, 1000, 3)
    lines = capsys.readouterr().out.splitlines()
    assert lines == [
        "400 of 1000 runs: none done after 2 s",
        "500 of 1000 runs: 5/s, 800 ms a run, 2 min left, 3 refused",
    ]
