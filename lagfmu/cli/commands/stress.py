"""`lagfmu stress`: FMUs at the extremes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..options import JsonFile, JunitFile, Target
from ..terminal import console, plainly


def stress(
    targets: Annotated[
        list[Path], typer.Argument(metavar="MODEL.py|FILE.fmu...", help="Model files and FMUs.")
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("dist/stress"),
    target: Target = None,
    scene: Annotated[
        list[str] | None, typer.Option(help="Only these FMUs of model files; repeatable.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Half of the probes.")] = False,
    limit: Annotated[float, typer.Option(help="Time limit of one probe in s.")] = 60.0,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Try FMUs at extreme values: each probe is right, refused with a reason, or wrong."""
    from ..finish import finish
    from ..stress import stress as probed

    with plainly():
        done = probed(targets, out, console, target, scene or (), quick, limit=limit)
        finish("stress", done, json, junit)
