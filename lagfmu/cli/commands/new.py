"""`lagfmu new`: a model file to start from."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ...model.library import known
from ...model.library import new as written
from ..terminal import plainly, say, say_wrote


def new(
    file: Annotated[Path, typer.Argument(help="The Python file to write.")],
    source: Annotated[
        str | None,
        typer.Option(
            "--from", help=f"A URDF or MJCF file, or a model to copy: {', '.join(known())}."
        ),
    ] = None,
) -> None:
    """Write a commented model to start from."""
    with plainly():
        path = written(file, source)
        say_wrote(path)
        say(f"next: lagfmu show {path}")
