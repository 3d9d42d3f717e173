"""`lagfmu stress`: a process for each FMU, started again behind the probe that took it down."""

from __future__ import annotations

import errno
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console

from ..errors import BuildError, TemporaryFolderError, UsageError
from ..fmu.target import target_of
from ..fmu.write import write, write_whole
from ..model.file import ModelFile
from ..model.scene import Scene
from ..prepare.prepare import prepare
from ..study.stress.facts import facts_of
from ..study.stress.lagrange import lay_beside
from ..study.stress.probe import NO_ROOM, UNFINISHED, WRONG, Verdict
from ..study.stress.report import MEANING, Stressed, data, report, summary, table
from ..verification.junit import Report, text_of
from .progress import progress
from .terminal import say_wrote
from .works import studied

START = 120.0  # [s] for the process to begin with the first one
WIDTH = 110  # of tables that go into a file


def stress(
    paths: Sequence[Path],
    out: Path,
    console: Console,
    target: str | None = None,
    scenes: Sequence[str] = (),
    quick: bool = False,
    *,
    limit: float,
) -> list[Report]:
    """Probe model files and FMUs, print tables, write OUT/TARGET/NAME.json.

    What cannot be built or run does not keep the others from it.  Raises UsageError.
    """
    if not limit > 0:
        raise UsageError(f"the time limit is {limit!r} s, expected a positive number")
    if not console.is_terminal:
        console = Console(file=console.file, width=WIDTH, emoji=False)

    def study(name: str, fmu: Path) -> Report:
        return report(name, _one(fmu, out, console, quick, limit))

    kind = target_of(target)
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        made = partial(build, folder=Path(folder), target=kind, console=console)
        tried = studied(paths, scenes, made, study)
    found = [t.found for t in tried if t.found is not None]
    if found:
        console.print(summary(found))
        console.print(MEANING, highlight=False)
    return tried


def build(file: ModelFile, scene: Scene, folder: Path, target: str, console: Console) -> Path:
    """An FMU with all beside it that the judge takes from the model."""
    with console.status(f"building {scene.name}"):
        prepared = prepare(file.model, scene)
        fmu = write(prepared, folder, file.closed_forms, target=target)
        lay_beside(fmu, prepared)
        return fmu


def _one(fmu: Path, out: Path, console: Console, quick: bool, limit: float) -> Stressed:
    facts = facts_of(fmu)
    rows = _probe(fmu, console, quick, limit)
    digest = hashlib.sha256(fmu.read_bytes()).hexdigest()
    one = Stressed(facts.name, facts.target, digest, quick, limit, bool(facts.laws), tuple(rows))
    console.print(table(one))
    stem = out / one.target / one.name
    write_whole(stem.with_suffix(".json"), text_of(data(one)).encode())
    say_wrote(stem.with_suffix(".json"), on=console)
    return one


def _probe(fmu: Path, console: Console, quick: bool, limit: float) -> list[Verdict]:
    """Every row, with as many processes as it takes."""
    rows: list[Verdict] = []
    with progress(console, fmu.stem) as tick, tempfile.TemporaryDirectory() as folder:
        total, first = 1, 0
        while first < total:
            job = _Job(fmu, Path(folder, f"{first}.jsonl"), first, quick)
            for line in job.lines(limit):
                total = line.get("total", total)
                if "row" in line:
                    rows.append(Verdict(**line["row"]))
                    first = line["end"] + 1
                elif "probe" in line:
                    tick(f"{line['family']}: {line['probe']}", line["begin"], total)
            if job.process.returncode == NO_ROOM:
                raise TemporaryFolderError(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
            if job.cut is None:
                break
            if job.latest is None:
                raise BuildError(f"{str(fmu)!r} cannot be probed: {job.complaint()}")
            verdict, detail = job.cut
            rows.append(
                Verdict(
                    job.latest["family"],
                    job.latest["probe"],
                    verdict,
                    detail,
                    "",
                    0.0,
                    0,
                    job.waited,
                )
            )
            first = job.latest["begin"] + 1
    return rows


class _Job:
    """A worker process; `cut`: verdict and reason if it did not come to its end."""

    def __init__(self, fmu: Path, results: Path, first: int, quick: bool) -> None:
        self.results = results
        self.errors = results.with_suffix(".err")
        arguments = [str(fmu), str(results), str(first), "1" if quick else "0"]
        with self.errors.open("wb") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "lagfmu.study.stress.worker", *arguments],
                stdout=subprocess.DEVNULL,
                stderr=errors,
            )
        self.latest: dict[str, Any] | None = None
        self.cut: tuple[str, str] | None = None
        self.waited = 0.0

    def lines(self, limit: float) -> Any:
        """What it tells, as it comes; ends with the process."""
        read, done, since = 0, False, time.monotonic()
        try:
            while True:
                ended = self.process.poll() is not None
                text = self.results.read_bytes() if self.results.exists() else b""
                whole = text[: text.rfind(b"\n") + 1]
                for raw in whole[read:].splitlines():
                    line: dict[str, Any] = json.loads(raw)
                    done |= "done" in line
                    since = time.monotonic()
                    if "begin" in line:
                        self.latest = line
                    yield line
                read = len(whole)
                self.waited = time.monotonic() - since
                if ended:
                    break
                probing = self.latest is not None and not done
                if self.waited > (limit if probing else max(limit, START)):
                    self.cut = None if done else (UNFINISHED, f"no answer within {limit:g} s")
                    break
                time.sleep(0.05)
        finally:
            if self.process.poll() is None:
                self.process.kill()
            self.process.wait()
        if not done and self.cut is None:
            self.cut = (WRONG, f"the process was taken down ({self.complaint()})")

    def complaint(self) -> str:
        """How the process ended, and the last that it said."""
        code = self.process.returncode
        said = self.errors.read_text(errors="replace").strip().splitlines()
        how = signal.Signals(-code).name if code is not None and code < 0 else f"exit status {code}"
        return f"{how}: {said[-1]}" if said else how
