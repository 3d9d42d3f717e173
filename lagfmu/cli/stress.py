"""`lagfmu stress`: a process for each FMU, started again behind the probe that took it down."""

from __future__ import annotations

import contextlib
import hashlib
import shutil
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import BinaryIO

from rich.console import Console

from ..errors import BuildError, UsageError
from ..fmu.archive import unpack
from ..fmu.target import target_of
from ..fmu.write import write
from ..model.file import ModelFile
from ..model.scene import Scene
from ..prepare.prepare import prepare
from ..studio.host import DiedError, Host, LateError
from ..studio.stress.lagrange import lay_beside
from ..studio.stress.probes import UNFINISHED, WRONG, Probe, Verdict, probes
from ..studio.stress.report import MEANING, Stressed, report, summary, table
from ..studio.stress.specimen import facts_of
from ..verification.junit import Report
from .progress import progress
from .works import studied

WORKER = "lagfmu.studio.stress.worker"
START = 120.0  # [s] for the process to begin with the first one
WIDTH = 110  # of tables that go into a file


def stress(
    paths: Sequence[Path],
    console: Console,
    target: str | None = None,
    scenes: Sequence[str] = (),
    quick: bool = False,
    *,
    limit: float,
) -> list[Report]:
    """Probe model files and FMUs, print tables.

    What cannot be built or run does not keep the others from it.  Raises UsageError.
    """
    if not limit > 0:
        raise UsageError(f"the time limit is {limit!r} s, expected a positive number")
    if not console.is_terminal:
        console = Console(file=console.file, width=WIDTH, emoji=False)

    def study(name: str, fmu: Path) -> Report:
        return report(name, _one(fmu, console, quick, limit))

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


def _one(fmu: Path, console: Console, quick: bool, limit: float) -> Stressed:
    facts = facts_of(fmu)
    rows = _probe(fmu, probes(facts, quick), console, quick, limit)
    digest = hashlib.sha256(fmu.read_bytes()).hexdigest()
    one = Stressed(facts.name, facts.target, digest, quick, limit, bool(facts.laws), tuple(rows))
    console.print(table(one))
    return one


def _probe(
    fmu: Path, work: Sequence[Probe], console: Console, quick: bool, limit: float
) -> list[Verdict]:
    """Every row, with as many processes as it takes."""
    rows: list[Verdict] = []
    with contextlib.ExitStack() as last:
        folder = unpack(fmu)
        last.callback(shutil.rmtree, folder, ignore_errors=True)
        said = last.enter_context(tempfile.TemporaryFile())
        host = Host(WORKER, (str(fmu), folder, quick), said)
        last.callback(host.close)
        tick = last.enter_context(progress(console, fmu.stem))
        for k, probe in enumerate(work):
            tick(f"{probe.family}: {probe.name}", k, len(work))
            try:
                host.start(max(limit, START))
            except DiedError as died:
                raise BuildError(f"{str(fmu)!r} cannot be probed: {_end(died, said)}") from None
            begun = time.monotonic()
            try:
                rows.append(host.ask(k, limit))
                continue
            except LateError:
                answer, detail = UNFINISHED, f"no answer within {limit:g} s"
            except DiedError as died:
                answer, detail = WRONG, f"the process was taken down ({_end(died, said)})"
            spent = time.monotonic() - begun
            rows.append(Verdict(probe.family, probe.name, answer, detail, "", 0.0, 0, spent))
    return rows


def _end(died: DiedError, said: BinaryIO) -> str:
    """How the process ended, and the last that it said."""
    said.seek(0)
    lines = said.read().decode(errors="replace").strip().splitlines()
    said.truncate(0)
    return f"{died}: {lines[-1]}" if lines else str(died)
