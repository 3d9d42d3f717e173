"""Build every model in models/ as an FMU of either target, where both can, and verify each through fmpy.

One line an FMU, as soon as it is done.  All figures stand in OUT/verification.csv.
Exit status 1 if a model cannot be built or misses a closed form.
"""

from __future__ import annotations

import csv
import io
import multiprocessing
import os
import statistics
import sys
import textwrap
import time
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Annotated

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: the processes share the cores

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn
from rich.text import Text

from lagfmu import LagfmuError, Verification, verify
from lagfmu.api import package
from lagfmu.cli.terminal import prepare_streams
from lagfmu.files import write_whole
from lagfmu.fmu.compiler import HOST
from lagfmu.fmu.native import takes_long
from lagfmu.fmu.python import refusals
from lagfmu.fmu.target import NATIVE, PYTHON, TARGETS, USUAL, Face, missing_for_native
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare
from lagfmu.prepare.steps import Prepared

MODELS = Path(__file__).parent / "models"
RUNS = 3  # the time is the median of these
COLUMNS = """ms/s: wall time of a simulated second in ms, with unpacking and loading
worst: the error that comes nearest to what is allowed, and of which statement"""
HEADINGS = ["fmu", "target", "bytes", "build_s", "steps", "wall_ms_per_s"]
HEADINGS += ["statement", "error", "allowed", "points", "verdict"]

load_once = cache(load)


@dataclass(frozen=True)
class Made:
    """One FMU: where it stands and what it cost [s], or why it could not be built, or is `refused`: what of
    its scene the python target does not do."""

    scene: str
    target: str
    path: Path = Path()
    built: float = 0.0
    found: Verification | None = None
    seconds: float = 0.0
    error: str = ""
    refused: str = ""
    notes: tuple[str, ...] = ()


def build_scene(
    work: tuple[Path, str],
    targets: Sequence[str],
    out: Path,
    platforms: Sequence[str],
    face: Face = USUAL,
) -> list[Made]:
    """The FMUs of one scene of a model file, an FMU a target: what is prepared serves all."""
    path, name = work
    file = load_once(path)
    scene = next(s for s in file.scenes if s.name == name)
    prepared: Prepared | None = None
    made = []
    for target in targets:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                begun = time.perf_counter()
                prepared = prepared or prepare(file.model, scene)
                if target == PYTHON and (reasons := refusals(prepared)):
                    made.append(Made(name, target, refused="; ".join(reasons)))
                    continue
                folder, forms = out / face.folder(target), file.closed_forms
                fmu = package(prepared, folder, forms, target, platforms, reference=True, face=face)
                spent = time.perf_counter() - begun
                found = fmu.verification or verify(fmu.path)
                runs = [found, *(verify(fmu.path) for _ in range(RUNS - 1))]
                seconds = statistics.median(r.seconds for r in runs)
                one = partial(Made, name, target, fmu.path, spent, found, seconds)
            except LagfmuError as error:
                one = partial(Made, name, target, error=str(error))
        made.append(one(notes=tuple(str(w.message) for w in caught)))
    return made


def build_all(
    work: Sequence[tuple[Path, str]],
    targets: Sequence[str],
    out: Path,
    platforms: Sequence[str],
    face: Face = USUAL,
) -> Iterator[list[Made]]:
    """The FMUs of each scene in turn, made by as many processes as the machine has cores."""
    build = partial(build_scene, targets=targets, out=out, platforms=platforms, face=face)
    processes = min(len(work), os.cpu_count() or 1)
    if processes < 2:
        yield from map(build, work)
        return
    with ProcessPoolExecutor(processes, multiprocessing.get_context("spawn")) as pool:
        yield from pool.map(build, work)


def main(
    models: Annotated[
        list[str] | None, typer.Argument(help="Names of files in models/; all of them if left out.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for python/ and native/NAME.fmu.")] = Path(
        "dist"
    ),
    platforms: Annotated[
        list[str] | None,
        typer.Option(metavar="all|host|NAME...", help="Where native FMUs can run; repeatable."),
    ] = None,
    fmi: Annotated[
        int,
        typer.Option(metavar="2|3", help="The version of FMI; of 3 there are native FMUs alone."),
    ] = 2,
) -> None:
    """Build and verify the models in models/, for both targets."""
    prepare_streams()
    face = Face(fmi)
    console = Console()
    places = tuple(platforms or [HOST])
    missing = missing_for_native()
    targets = (PYTHON,) if missing else TARGETS
    if fmi == 3:
        targets = (NATIVE,)
    elif missing:
        _say(console, f"{missing}; python FMUs only")
    problems: list[str] = []
    work: list[tuple[Path, str]] = []
    for name in models or ():
        if not (MODELS / f"{name}.py").is_file():
            problems.append(f"there is no models/{name}.py")
    for path in sorted(MODELS.glob("*.py")):
        if models and path.stem not in models:
            continue
        try:
            work += [(path, scene.name) for scene in load_once(path).scenes]
        except LagfmuError as error:
            problems.append(str(error))
    width = max((len(name) for _, name in work), default=0)
    if work and NATIVE in targets and takes_long(places):
        console.print("the C runtime is compiled first")
    console.print(COLUMNS, style="dim", highlight=False)
    console.print(_line(width, "", "FMU", "target", "ms/s", "worst", "of"), style="bold")
    rows: list[tuple[str, ...]] = []
    total = 0
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    shown = console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=not shown) as progress:
        task = progress.add_task("scenes", total=len(work))
        for scene in build_all(work, targets, out, places, face):
            for made in scene:
                problems += _report(console, width, made)
                total += not made.refused
                rows += _rows(made)
            progress.advance(task)
    if rows:
        file_of_all = out / "verification.csv"
        _write(file_of_all, rows)
        _say(console, f"every statement: {file_of_all}")
    for problem in problems:
        _say(console, f"FAIL {problem}", "bold red")
    if problems or not total:
        sys.exit(1)
    count = f"all {total} FMUs in {out} hold" if total > 1 else f"the FMU in {out} holds"
    closed = "their closed forms" if total > 1 else "its closed forms"
    _say(console, f"{count} {closed}", "green")


def _report(console: Console, width: int, made: Made) -> list[str]:
    """Prints the line of one FMU and its notes; returns what is wrong with it."""
    if made.refused:
        line = _line(width, "", made.scene, made.target)
        _say(console, f"{line}  refused: the python target has {made.refused}")
        return []
    name, found = f"{made.target}/{made.scene}", made.found
    problems = [f"{name}: {made.error}"] if found is None else []
    notes = list(made.notes)
    verdict, cells, style = "FAIL", [made.scene, made.target], "bold red"
    if found is not None:
        problems += [f"{name}: {c}" for c in found.checks if c.failed]
        # not reached: it is of another start than the default one
        notes += [f"{name}: {c}" for c in found.checks if not c.points]
        cells.append(_cost(made, found))
        if found.worst is not None:
            cells += [f"{found.worst.error:.1e}", found.worst.name]
        if found.passed:
            verdict, style = "pass", ""
    _say(console, _line(width, verdict, *cells), style)
    for note in notes:
        _say(console, f"note: {note}")
    return problems


def _say(console: Console, text: str, style: str = "") -> None:
    """Words on lines as wide as the console; the further ones are indented."""
    lines = textwrap.wrap(
        text,
        console.width,
        subsequent_indent="      ",
        replace_whitespace=False,
        drop_whitespace=True,
        break_long_words=False,
        break_on_hyphens=False,
    )
    for line in lines:
        console.print(Text(line, style=style), soft_wrap=True)


def _rows(made: Made) -> list[tuple[str, ...]]:
    """A row a statement of one FMU."""
    found = made.found
    if found is None:
        return []
    cost = (f"{made.path.stat().st_size}", f"{made.built:.3g}", f"{found.steps}")
    return [(made.scene, made.target, *cost, _cost(made, found), *row) for row in found.rows()]


def _cost(made: Made, found: Verification) -> str:
    """Wall time of a simulated second [ms]."""
    return f"{1e3 * made.seconds / found.simulated:.3g}"


def _line(
    width: int, verdict: str, name: str, target: str, spent: str = "", error: str = "", of: str = ""
) -> str:
    """One FMU; nothing is cut, however narrow the console."""
    return f"{verdict:4}  {name:{width}}  {target:6}  {spent:>5}  {error:>7}  {of}".rstrip()


def _write(path: Path, rows: Sequence[tuple[str, ...]]) -> None:
    """All figures as CSV; errors are relative, `allowed` is what each may be."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADINGS)
    writer.writerows(rows)
    write_whole(path, text.getvalue().encode())


if __name__ == "__main__":
    typer.run(main)
