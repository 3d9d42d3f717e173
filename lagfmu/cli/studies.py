"""What `stress`, `tradeoff` and `build --accuracy` do with FMUs as they are, and with the scenes of model
files, each to be built: progress, tables, files.

For `stress` each FMU has a process, which is started again behind the probe that took it down.
"""

from __future__ import annotations

import contextlib
import hashlib
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO

from rich.console import Console

from ..errors import BuildError, LagfmuError, UsageError
from ..fmu.archive import unpack
from ..fmu.read import target_in
from ..fmu.target import PYTHON, target_of
from ..fmu.write import write
from ..methods import INTEGRATORS, unknown
from ..model.file import ModelFile, is_model, load
from ..model.scene import Scene
from ..numeric.thresholds import tolerance_problem
from ..page.table import print_whole
from ..prepare.prepare import prepare
from ..studio.host import DiedError, Host, LateError
from ..studio.stress.lagrange import lay_beside
from ..studio.stress.probes import UNFINISHED, WRONG, Probe, Verdict, probes
from ..studio.stress.report import MEANING, Stressed, report, summary, table
from ..studio.stress.specimen import facts_of
from ..studio.tradeoff.choose import Choice
from ..studio.tradeoff.measure import (
    DECADES,
    Plan,
    Tradeoff,
    draw,
    measure,
    remarks,
)
from ..studio.tradeoff.measure import (
    report as told_of,
)
from ..studio.tradeoff.measure import (
    table as tabled,
)
from ..verification.pipeline import Report, refused
from .progress import progress
from .terminal import say, say_wrote


def _studied(
    paths: Sequence[Path],
    scenes: Sequence[str],
    build: Callable[[ModelFile, Scene], Path],
    study: Callable[[str, Path], Report],
) -> list[Report]:
    """What came of `study` of each FMU, given what it is called; `scenes`: only these of model files.

    What cannot be built or run does not keep the others from it.  Raises UsageError.
    """
    done = []

    def tried(name: str, make: Callable[[], Path]) -> None:
        try:
            done.append(study(name, make()))
        except LagfmuError as error:
            done.append(refused(name, error))

    for path in paths:
        if not is_model(path):
            tried(str(path), partial(Path, path))
            continue
        try:
            file = load(path)
        except LagfmuError as error:
            done.append(refused(str(path), error))
            continue
        for scene in file.scenes:
            if not scenes or scene.name in scenes:
                tried(f"{path} ({scene.name})", partial(build, file, scene))
    if not done:
        raise UsageError(f"no FMU is called {', '.join(scenes) or 'anything'}")
    return done


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
        tried = _studied(paths, scenes, made, study)
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
                answer, detail = WRONG, f"the process crashed ({_end(died, said)})"
            spent = time.monotonic() - begun
            rows.append(Verdict(probe.family, probe.name, answer, detail, "", 0.0, 0, spent))
    return rows


def _end(died: DiedError, said: BinaryIO) -> str:
    """How the process ended, and the last that it said."""
    said.seek(0)
    lines = said.read().decode(errors="replace").strip().splitlines()
    said.truncate(0)
    return f"{died}: {lines[-1]}" if lines else str(died)


def compare(
    paths: Sequence[Path],
    out: Path,
    console: Console,
    target: str | None = None,
    communication: float | None = None,
    tolerances: Sequence[float] = (),
    methods: Sequence[str] = (),
    repeats: int | None = None,
    scenes: Sequence[str] = (),
    full: bool = False,
) -> list[Report]:
    """Measure model files and FMUs, print tables, draw OUT/TARGET/NAME.svg.

    `full`: every decade.
    What cannot be built or run does not keep the others from it.  Raises UsageError.
    """
    wrong = [m for m in methods if m not in INTEGRATORS]
    if wrong:
        raise UsageError("; ".join(unknown(m, INTEGRATORS) for m in wrong))
    numbers = [x for x in (communication, repeats) if x is not None]
    if not all(0 < x < float("inf") for x in numbers):
        raise UsageError("the communication step and repeats must be positive numbers")
    if problems := [p for p in map(tolerance_problem, tolerances) if p]:
        raise UsageError("; ".join(problems))
    kind = target_of(target)
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:

        def build(file: ModelFile, scene: Scene) -> Path:
            with console.status(f"building {scene.name}"):
                return write(prepare(file.model, scene), folder, file.closed_forms, kind)

        def study(name: str, fmu: Path) -> Report:
            asked: dict[str, Any] = {}
            if target_in(fmu) == PYTHON:  # a run takes long
                asked |= {"halvings": 2, "repeats": 1}
            if full:
                asked |= {"tolerances": DECADES, "budget": 20.0, "limit": 3.0}
            if tolerances:
                asked["tolerances"] = tuple(sorted(set(tolerances), reverse=True))
            if methods:
                asked["methods"] = tuple(methods)
            if repeats:
                asked["repeats"] = repeats
            with progress(console, fmu.stem) as tick:
                one = measure(fmu, Plan(communication or 0.0, **asked), tick)
            if one.points:
                _show(one, out, console)
            return told_of(name, one)

        return _studied(paths, scenes, build, study)


def _show(one: Tradeoff, out: Path, console: Console) -> None:
    print_whole(console, tabled(one))
    for line in remarks(one):
        say(f"  {line}", on=console)
    say_wrote(draw(one, out / one.target / f"{one.name}.svg"), on=console)


def say_chosen(choice: Choice, console: Console) -> None:
    """Which tolerance was found for an accuracy, and what it holds."""
    say(
        f"for {choice.goal}: {choice.trial.setting}; error {choice.trial.error:.1e} on the scene, "
        f"{choice.held_out_error:.1e} at most on held-out values; {choice.trial.steps} steps",
        "chosen",
        on=console,
    )
    for trial, error in choice.failed:
        say(f"  refused: {trial} on the scene, {error:.1e} elsewhere", on=console)
