"""Build every model in models/ as an FMU of either target and verify each through fmpy.

One line an FMU, as soon as it is done: wall time of a simulated second in ms, and of all its closed
forms the error that comes nearest to what is allowed.  All of them stand in OUT/verification.csv.
Exit status 1 if a model cannot be built or misses a closed form.
"""

from __future__ import annotations

import csv
import io
import statistics
import sys
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn
from rich.text import Text

from lagfmu import LagfmuError, Verification, verify
from lagfmu.api import package, settled
from lagfmu.cli.terminal import prepare_streams
from lagfmu.fmu.compiler import HOST, find_compiler
from lagfmu.fmu.native import takes_long
from lagfmu.fmu.write import TARGETS
from lagfmu.model.file import ModelFile, load
from lagfmu.model.scene import Scene
from lagfmu.prepare.prepare import Prepared, prepare

MODELS = Path(__file__).parent / "models"
RUNS = 3  # the time is the median of these
HEADINGS = ["fmu", "target", "bytes", "build_s", "steps", "wall_ms_per_s"]
HEADINGS += ["statement", "error", "allowed", "verdict"]


def build_one(
    file: ModelFile,
    scene: Scene,
    target: str,
    out: Path,
    platforms: Sequence[str],
    known: dict[str, Prepared],
) -> tuple[Path, float, Verification, float]:
    """The FMU, seconds to build it, its verification, seconds to simulate it.

    `known`: what was prepared so far by names of scenes, which serves both targets.
    """
    begun = time.perf_counter()
    asked, choice = settled(file.model, scene, file.closed_forms, target)
    prepared = known.get(scene.name)
    if prepared is None or prepared.asked != asked or prepared.derived.model is not file.model:
        prepared = known[scene.name] = prepare(file.model, asked)
    built = package(prepared, out, file.closed_forms, target, platforms, choice, reference=True)
    spent = time.perf_counter() - begun
    found = built.verification or verify(built.path)
    runs = [found, *(verify(built.path) for _ in range(RUNS - 1))]
    return built.path, spent, found, statistics.median(r.seconds for r in runs)


def first(target: str, platforms: Sequence[str]) -> bool:
    """True if the C runtime has to be compiled before this FMU."""
    return target == "native" and takes_long(platforms)


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
) -> None:
    """Build and verify the models in models/, for both targets."""
    prepare_streams()
    console = Console()
    places = tuple(platforms or [HOST])
    targets = TARGETS if find_compiler() is not None else ("python",)
    if targets != TARGETS:
        console.print("no C compiler: python FMUs only; pip install ziglang for the others")
    problems: list[str] = []
    files: list[ModelFile] = []
    for name in models or ():
        if not (MODELS / f"{name}.py").is_file():
            problems.append(f"there is no models/{name}.py")
    for path in sorted(MODELS.glob("*.py")):
        if models and path.stem not in models:
            continue
        try:
            files.append(load(path))
        except LagfmuError as error:
            problems.append(str(error))
    work = [(file, scene, target) for file in files for scene in file.scenes for target in targets]
    width = max((len(scene.name) for _, scene, _ in work), default=0)
    console.print(_line(width, "", "FMU", "target", "ms/s", "worst", "of"), style="bold")
    rows: list[tuple[str, ...]] = []
    known: dict[str, Prepared] = {}
    warnings.showwarning = lambda message, *_: console.print(
        Text(f"note: {message}"), soft_wrap=True
    )
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    shown = console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=not shown) as progress:
        task = progress.add_task("", total=len(work))
        for file, scene, target in work:
            name = f"{target}/{scene.name}"
            wait = " (compiles the runtime first)" if first(target, places) else ""
            progress.update(task, description=f"{name}{wait}")
            if wait and not shown:
                console.print(f"{name}{wait}")
            try:
                path, built, found, seconds = build_one(
                    file, scene, target, out / target, places, known
                )
            except LagfmuError as error:
                problems.append(f"{name}: {error}")
                console.print(_line(width, "FAIL", scene.name, target), style="bold red")
            else:
                spent = f"{1e3 * seconds / found.simulated:.3g}"
                good = found.passed
                verdict, style = ("pass", "green") if good else ("FAIL", "bold red")
                worst = found.worst
                text = (f"{worst.error:.1e}", worst.name) if worst is not None else ("", "")
                line = _line(width, verdict, scene.name, target, spent, *text)
                console.print(Text(line, style="" if good else style), soft_wrap=True)
                for check in found.checks:
                    if not check.passed:
                        problems.append(f"{name}: {check}")
                    elif not check.points:  # it is of another start than the default one
                        console.print(Text(f"note: {name}: {check}"), soft_wrap=True)
                cost = (f"{path.stat().st_size}", f"{built:.3g}", f"{found.steps}", spent)
                rows += [(scene.name, target, *cost, *row) for row in found.rows()]
            progress.advance(task)
    if rows:
        file_of_all = out / "verification.csv"
        _write(file_of_all, rows)
        console.print(f"every statement: {file_of_all}", highlight=False, soft_wrap=True)
    for problem in problems:
        console.print(Text(f"FAIL {problem}", style="bold red"), soft_wrap=True)
    if problems or not work:
        sys.exit(1)
    count = f"all {len(work)} FMUs in {out} hold" if len(work) > 1 else f"the FMU in {out} holds"
    closed = "their closed forms" if len(work) > 1 else "its closed forms"
    console.print(Text(f"{count} {closed}", style="green"), soft_wrap=True)


def _line(
    width: int, verdict: str, name: str, target: str, spent: str = "", error: str = "", of: str = ""
) -> str:
    """One FMU on one line: nothing is cut, however narrow the console."""
    return f"{verdict:4}  {name:{width}}  {target:6}  {spent:>5}  {error:>7}  {of}".rstrip()


def _write(path: Path, rows: Sequence[tuple[str, ...]]) -> None:
    """All figures as CSV; errors are relative, `allowed` is what each may be."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(HEADINGS)
    writer.writerows(rows)
    path.write_text(text.getvalue(), encoding="utf-8")


if __name__ == "__main__":
    typer.run(main)
