"""`lagfmu new`: a model file to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from ...model.library import known
from ...model.library import new as written
from ..terminal import console, plainly


def new(
    file: Annotated[Path, typer.Argument(help="The Python file to write.")],
    source: Annotated[
        str | None, typer.Option("--from", help=f"Copy a model: {', '.join(known())}.")
    ] = None,
) -> None:
    """Write a commented model to start from."""
    with plainly():
        path = written(file, source)
        console.print(f"[green]wrote[/] {escape(str(path))}", soft_wrap=True)
        console.print(f"next: lagfmu show {escape(str(path))}", soft_wrap=True, highlight=False)
