"""`lagfmu page`: one HTML file in which an FMU runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..options import AddOutput, Arguments, Needs, SceneName, takes
from ..terminal import console, kilobytes, plainly, say_wrote

if TYPE_CHECKING:
    from ...model.model import Model


@takes("outputs", "fixed", "inputs")
def page(
    target: Annotated[
        Path, typer.Argument(metavar="MODEL.py|FILE.fmu", help="A model file, or a native FMU.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The file, or its folder; default dist/page/NAME.html."),
    ] = None,
    scene: SceneName = None,
    arguments: Arguments = None,
    *,
    needs: Needs,
    add_output: AddOutput = None,
) -> None:
    """Write one HTML file in which the FMU runs: offline, with sliders, curves and the mechanism."""
    from ...model.file import is_model
    from ...studio.live.play import write_page
    from ..scenes import for_models, loaded, narrowed

    with plainly():
        source: Model | Path = target
        shown = None
        if is_model(target):
            file = loaded(target, add_output, arguments)
            source = file.model
            shown = narrowed(file.called(scene)[:1], needs)[0]
        else:
            for_models(target, scene=scene, p=arguments, **needs, add_output=add_output)
        with console.status("compiling to WebAssembly"):
            path = write_page(source, out, shown)
        say_wrote(path, kilobytes(path))
