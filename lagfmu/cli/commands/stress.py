"""`lagfmu stress`: FMUs at the extremes."""

from __future__ import annotations

from typing import Annotated

import typer

from ..options import JsonFile, JunitFile, Runnables, SceneNames, Target
from ..terminal import console, plainly


def stress(
    targets: Runnables,
    target: Target = None,
    scene: SceneNames = None,
    quick: Annotated[bool, typer.Option("--quick", help="Half of the probes.")] = False,
    limit: Annotated[float, typer.Option(help="Time limit of one probe in s.")] = 60.0,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Try FMUs at extreme values: each probe is right, refused with a reason, or wrong."""
    from ..finish import finish
    from ..stress import stress as probed

    with plainly():
        done = probed(targets, console, target, scene or (), quick, limit=limit)
        finish("stress", done, json, junit)
