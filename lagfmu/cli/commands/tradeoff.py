"""`lagfmu tradeoff`: what accuracy costs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..options import JsonFile, JunitFile, Runnables, SceneNames, Target
from ..terminal import console, plainly


def tradeoff(
    targets: Runnables,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path(
        "dist/tradeoff"
    ),
    target: Target = None,
    scene: SceneNames = None,
    step_size: Annotated[
        float | None, typer.Option(help="Communication step in s (default: the FMU's own).")
    ] = None,
    tolerance: Annotated[
        list[float] | None, typer.Option(help="Relative tolerance; repeatable.")
    ] = None,
    method: Annotated[list[str] | None, typer.Option(help="Solver method; repeatable.")] = None,
    repeats: Annotated[int | None, typer.Option(help="Timed runs of each setting.")] = None,
    full: Annotated[
        bool,
        typer.Option("--full", help="Every decade of the tolerance, not every other one."),
    ] = False,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Measure the error of lambda and the wall time of each method and tolerance.

    The table marks a closed form that a setting misses; the exit code does not judge it.
    """
    from ..finish import finish
    from ..tradeoff import compare

    with plainly():
        done = compare(
            targets,
            out,
            console,
            target,
            step_size,
            tolerance or (),
            method or (),
            repeats,
            scene or (),
            full,
        )
        finish("tradeoff", done, json, junit)
