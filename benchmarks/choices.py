"""What does accuracy cost once the settings are chosen for it?  `--accuracy` on every model.

    python benchmarks/choices.py [python|native] [MODEL.py ...]

For each FMU of the model files (default: all of models/) one survey, and from it the choices for 1e-4,
1e-7 and 1e-10 of every lambda, Q, coordinate and event time, each verified on held-out values.  Prints
formulation, method and dial, the largest error on the scene and elsewhere, the evaluations of the
equations, the wall time, the FMU's own part of it (without fmpy's calls), and the ratios of time and of
evaluations to those of 1e-4.
"""

from __future__ import annotations

import sys
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from lagfmu.errors import LagfmuError
from lagfmu.model.file import load
from lagfmu.model.goal import Goal
from lagfmu.study.tradeoff.choose import Choice, pick
from lagfmu.study.tradeoff.survey import survey

GOALS = (1e-4, 1e-7, 1e-10)
MODELS = Path(__file__).parent.parent / "models"


def main() -> None:
    """Measure and print."""
    arguments = sys.argv[1:]
    target = arguments.pop(0) if arguments[:1] in (["python"], ["native"]) else "native"
    console = Console(width=140)
    table = Table(
        title=f"chosen for an accuracy, {target} FMUs", title_justify="left", box=SIMPLE_HEAD
    )
    for name in ("FMU", "asked", "chosen", "on the scene", "held out", "evaluations"):
        table.add_column(name, no_wrap=True)
    for name in ("ms/s", "own ms/s", "time ratio", "work ratio"):
        table.add_column(name, justify="right", no_wrap=True)
    for path in [Path(a) for a in arguments] or sorted(MODELS.glob("*.py")):
        file = load(path)
        for scene in file.scenes:
            try:
                measured = survey(
                    file.model, scene, file.closed_forms, Goal(GOALS[-1]), target=target
                )
            except LagfmuError as error:
                table.add_row(scene.name, "", f"[red]{str(error)[:60]}[/]")
                continue
            first: Choice | None = None
            for accuracy in GOALS:
                try:
                    choice = pick(file.model, measured, file.closed_forms, Goal(accuracy))
                except LagfmuError as error:
                    table.add_row(scene.name, f"{accuracy:.0e}", "none")
                    console.print(f"{scene.name}: {error}", markup=False)
                    continue
                first = first or choice
                option, scale = choice.option, 1e3 / measured.simulated
                table.add_row(
                    scene.name,
                    f"{accuracy:.0e}",
                    str(option),
                    f"{option.error:.1e}",
                    f"{choice.held_out_error:.1e}",
                    str(option.evaluations),
                    f"{scale * option.row.median:.3g}",
                    f"{scale * (option.row.median - measured.floor):.2g}",
                    f"{option.row.median / first.option.row.median:.2f}",
                    f"{option.evaluations / first.option.evaluations:.1f}",
                )
            table.add_section()
            console.print(f"{scene.name} done")
    console.print(table)


if __name__ == "__main__":
    main()
