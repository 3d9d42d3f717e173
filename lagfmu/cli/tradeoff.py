"""`lagfmu tradeoff`, and what `lagfmu build --accuracy` does: progress, tables, files."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn

from ..errors import UsageError
from ..fmu.compiler import find_compiler
from ..fmu.write import write, write_whole
from ..methods import INTEGRATORS, unknown
from ..model.file import ModelFile
from ..model.goal import Goal
from ..model.model import Model
from ..model.scene import Scene
from ..page.table import print_whole
from ..prepare.prepare import prepare
from ..solver.state import tolerance_problem
from ..study.tradeoff.choose import Choice, choose
from ..study.tradeoff.figure import draw
from ..study.tradeoff.importer import Importer
from ..study.tradeoff.measure import Plan, Tick, Tradeoff, default_plan, measure, quick_plan
from ..study.tradeoff.report import as_csv, data, digits, remarks, report, summary, table
from ..verification.pipeline import Report, text_of
from .works import studied


@contextlib.contextmanager
def progress(console: Console, title: str) -> Iterator[Tick]:
    """A bar that goes when the work is done; what it yields is told how far it has come."""
    columns = (
        SpinnerColumn(),
        TextColumn(escape(title)),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[what]}"),
    )
    if not console.is_terminal:
        console.print(f"{escape(title)} ...", highlight=False)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("", total=None, what="")

        def tick(what: str, done: int, total: int) -> None:
            bar.update(task, completed=done, total=total, what=escape(what))

        yield tick


def compare(
    paths: Sequence[Path],
    out: Path,
    console: Console,
    target: str | None = None,
    communications: Sequence[float] = (),
    tolerances: Sequence[float] = (),
    methods: Sequence[str] = (),
    repeats: int | None = None,
    scenes: Sequence[str] = (),
    full: bool = False,
) -> list[Report]:
    """Measure model files and FMUs, print tables, write OUT/TARGET/NAME.json, .csv, .svg and .png.

    Without a `target` native FMUs where there is a compiler, else python ones; `full`: the whole grid.
    What cannot be built or run does not keep the others from it.  Raises UsageError.
    """
    wrong = [m for m in methods if m not in INTEGRATORS]
    if wrong:
        raise UsageError("; ".join(unknown(m, INTEGRATORS) for m in wrong))
    numbers = [*communications, *([] if repeats is None else [repeats])]
    if not all(0 < x < float("inf") for x in numbers):
        raise UsageError("communication steps and repeats must be positive numbers")
    if problems := [p for p in map(tolerance_problem, tolerances) if p]:
        raise UsageError("; ".join(problems))
    kind = target or ("python" if find_compiler() is None else "native")
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:

        def build(file: ModelFile, scene: Scene) -> Path:
            with console.status(f"building {scene.name}"):
                prepared = prepare(file.model, scene)
                return write(prepared, Path(folder) / kind, file.closed_forms, target=kind)

        def study(name: str, fmu: Path) -> Report:
            with Importer(fmu) as importer:
                plan = default_plan(importer) if full else quick_plan(importer)
            if communications:
                plan = replace(plan, communications=tuple(sorted(set(communications))))
            if tolerances:
                plan = replace(plan, tolerances=tuple(sorted(set(tolerances), reverse=True)))
            if methods:
                plan = replace(plan, methods=tuple(methods))
            return report(name, _one(fmu, plan, repeats, out, console))

        done = studied(paths, scenes, build, study)
    found = [m.found for m in done if m.found is not None]
    if len(found) > 1:
        print_whole(console, summary(found))
    return done


def _one(fmu: Path, plan: Plan, repeats: int | None, out: Path, console: Console) -> Tradeoff:
    with progress(console, fmu.stem) as tick:
        one = measure(fmu, plan, tick, repeats)
    for h in one.floor:
        print_whole(console, table(one, h))
    for line in remarks(one):
        console.print(f"  {escape(line)}", highlight=False, soft_wrap=True)
    stem = out / one.target / one.name
    write_whole(stem.with_suffix(".json"), text_of(data(one)).encode())
    write_whole(stem.with_suffix(".csv"), as_csv(one).encode())
    draw(one, [stem.with_suffix(".svg"), stem.with_suffix(".png")])
    console.print(f"[green]wrote[/] {escape(str(stem))}.json, .csv, .svg, .png", soft_wrap=True)
    return one


def chosen_for(file: ModelFile, scene: Scene, goal: Goal, target: str, console: Console) -> Choice:
    """Measure, choose and say what was chosen.  Raises BuildError if nothing holds the accuracy."""
    with progress(console, scene.name) as tick:
        choice = choose(file.model, scene, file.closed_forms, goal, tick, target)
    measured, option = choice.survey, choice.option
    own = 1e3 * option.row.median / measured.simulated
    console.print(
        f"[green]chosen[/] for {escape(str(goal))}: {option}; error {option.error:.1e} on the scene, "
        f"{choice.held_out_error:.1e} at most on held-out values; {digits(own)} ms per simulated "
        f"second, {digits(1e3 * measured.floor / measured.simulated)} of them fmpy's own calls; "
        f"{option.row.steps} steps",
        highlight=False,
        soft_wrap=True,
    )
    for failed, error in choice.failed:
        console.print(
            f"  refused: {failed} ({failed.error:.1e} on the scene, {error:.1e} elsewhere)",
            highlight=False,
            soft_wrap=True,
        )
    for line in measured.dropped:
        console.print(f"  not available: {escape(line)}", highlight=False, soft_wrap=True)
    moved = _interface(file.model, scene, choice)
    if moved:
        console.print(f"  [yellow]note:[/] {escape(moved)}", soft_wrap=True)
    return choice


def _interface(model: Model, scene: Scene, choice: Choice) -> str:
    """What an importer notices of another formulation."""
    if choice.scene.formulation == scene.formulation or choice.scene.formulation != "minimal":
        return ""
    names = ", ".join(str(s.func) for s in model.embedding.coordinates) if model.embedding else ""
    return (
        f"the formulation minimal takes start values of {names} and their velocities only; name "
        "another in the scene to keep those of all coordinates"
    )
