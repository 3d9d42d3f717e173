"""What does accuracy cost once the tolerance is chosen for it?  `--accuracy` on every model.

    python benchmarks/choices.py [python|native] [MODEL.py ...]

For each FMU of the model files (default: all of models/) the choices for 1e-4, 1e-7 and 1e-10 of every
lambda, Q, coordinate and event time, each verified on held-out values.  Prints the tolerance or step, the
largest error on the scene and elsewhere, the internal steps, and their ratio to those of 1e-4.
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
from lagfmu.studio.tradeoff.choose import choose

GOALS = (1e-4, 1e-7, 1e-10)
MODELS = Path(__file__).parent.parent / "models"


def main() -> None:
    """Choose and print."""
    arguments = sys.argv[1:]
    target = arguments.pop(0) if arguments[:1] in (["python"], ["native"]) else "native"
    console = Console(width=120)
    table = Table(
        title=f"chosen for an accuracy, {target} FMUs", title_justify="left", box=SIMPLE_HEAD
    )
    for name in ("FMU", "asked", "chosen"):
        table.add_column(name, no_wrap=True)
    for name in ("on the scene", "held out", "steps", "ratio"):
        table.add_column(name, justify="right", no_wrap=True)
    for path in [Path(a) for a in arguments] or sorted(MODELS.glob("*.py")):
        file = load(path)
        for scene in file.scenes:
            first = 0
            for accuracy in GOALS:
                try:
                    choice = choose(file.model, scene, Goal(accuracy), target=target)
                except LagfmuError as error:
                    table.add_row(scene.name, f"{accuracy:.0e}", "none")
                    console.print(f"{scene.name}: {error}", markup=False)
                    continue
                trial = choice.trial
                first = first or trial.steps
                table.add_row(
                    scene.name,
                    f"{accuracy:.0e}",
                    str(trial.setting),
                    f"{trial.error:.1e}",
                    f"{choice.held_out_error:.1e}",
                    str(trial.steps),
                    f"{trial.steps / max(first, 1):.1f}",
                )
            table.add_section()
    console.print(table)


if __name__ == "__main__":
    main()
