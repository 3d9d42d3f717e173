"""Build every model in models/ as an FMU of either target, verify each through fmpy, print one table.

Exit status 1 if a model cannot be built or misses a closed form.
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn
from rich.table import Table

from lagfmu import LagfmuError, Verification, verify
from lagfmu.api import settled
from lagfmu.fmu.compiler import HOST, find_compiler
from lagfmu.fmu.native import takes_long
from lagfmu.fmu.write import TARGETS, write
from lagfmu.model.file import ModelFile, load
from lagfmu.model.scene import Scene
from lagfmu.prepare.prepare import prepare

MODELS = Path(__file__).parent / "models"
RUNS = 3  # the time is the median of these


def build_one(
    file: ModelFile, scene: Scene, target: str, out: Path, platforms: Sequence[str]
) -> tuple[Path, float, Verification, float]:
    """The FMU, seconds to build it, its verification, seconds to simulate it."""
    begun = time.perf_counter()
    scene, choice = settled(file.model, scene, file.closed_forms, target)
    prepared = prepare(file.model, scene)
    path = write(prepared, out, file.closed_forms, (), target, platforms, choice)
    built = time.perf_counter() - begun
    runs = [verify(path) for _ in range(RUNS)]
    write(prepared, out, file.closed_forms, runs[0].rows(), target, platforms, choice)
    return path, built, runs[0], statistics.median(r.seconds for r in runs)


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
    console = Console(width=None if sys.stdout.isatty() else 120)
    places = tuple(platforms or [HOST])
    targets = TARGETS if find_compiler() is not None else ("python",)
    if targets != TARGETS:
        console.print(
            "no C compiler: python FMUs only; pip install lagfmu\\[native] for the others"
        )
    table = Table(title="FMUs, held against their closed forms", title_justify="left")
    for column in (
        "FMU",
        "target",
        "size",
        "build",
        "steps per s",
        "ms per s",
        "closed form",
        "error",
    ):
        left = column in ("FMU", "target", "closed form")
        table.add_column(
            column, justify="left" if left else "right", no_wrap=column != "closed form"
        )
    table.add_column("verdict")
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
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=len(work))
        for file, scene, target in work:
            name = f"{target}/{scene.name}"
            wait = " (compiles the runtime first)" if first(target, places) else ""
            progress.update(task, description=f"{name}{wait}")
            try:
                path, built, found, seconds = build_one(file, scene, target, out / target, places)
            except LagfmuError as error:
                problems.append(f"{name}: {error}")
                table.add_row(scene.name, target, *[""] * 6, "[bold red]FAIL[/]")
            else:
                head = (
                    scene.name,
                    target,
                    f"{path.stat().st_size / 1e3:.0f} kB",
                    f"{built:.2f} s",
                    f"{found.steps / found.simulated:.0f}",
                    f"{1e3 * seconds / found.simulated:.3g}",
                )
                for check, row in zip(found.checks, found.rows(), strict=True):
                    good = check.passed and check.points > 0
                    verdict = f"[green]{row[3]}[/]" if good else f"[bold red]{row[3]}[/]"
                    table.add_row(*head, escape(row[0]), row[1], verdict)
                    head = ("",) * 6
                    if not good:
                        problems.append(f"{name}: {row[0]}: {row[3]} {check.detail}")
                table.add_section()
            progress.advance(task)
    console.print(table)
    for problem in problems:
        console.print(f"[bold red]FAIL[/] {escape(problem)}", highlight=False)
    if problems or not work:
        sys.exit(1)
    console.print(f"[green]all {len(work)} FMUs in {out} hold their closed forms[/]")


if __name__ == "__main__":
    typer.run(main)
