"""`lagfmu tradeoff`, and what `lagfmu build --accuracy` does: progress, tables, files."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console

from ..errors import UsageError
from ..fmu.read import target_in
from ..fmu.target import PYTHON, target_of
from ..fmu.write import write
from ..methods import INTEGRATORS, unknown
from ..model.file import ModelFile
from ..model.scene import Scene
from ..numeric.tolerance import tolerance_problem
from ..page.table import print_whole
from ..prepare.prepare import prepare
from ..studio.tradeoff.choose import Choice
from ..studio.tradeoff.measure import DECADES, Plan, Tradeoff, draw, measure, remarks, report, table
from ..verification.junit import Report
from .progress import progress
from .terminal import say, say_wrote
from .works import studied


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
            return report(name, one)

        return studied(paths, scenes, build, study)


def _show(one: Tradeoff, out: Path, console: Console) -> None:
    print_whole(console, table(one))
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
