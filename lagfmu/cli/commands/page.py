"""`lagfmu page`: one HTML file in which an FMU runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from ...errors import UsageError
from ..options import AddOutput, Arguments, Needs, takes
from ..terminal import console, plainly

if TYPE_CHECKING:
    from ...model.model import Model


@takes("outputs", "fixed", "inputs")
def page(
    target: Annotated[
        Path, typer.Argument(metavar="MODEL.py|FILE.fmu", help="A model file, or a native FMU.")
    ],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The file; default dist/page/NAME.html.")
    ] = None,
    scene: Annotated[str | None, typer.Option(help="Which FMU of a model file.")] = None,
    arguments: Arguments = None,
    *,
    needs: Needs,
    add_output: AddOutput = None,
) -> None:
    """Write one HTML file in which the FMU runs: offline, with sliders, curves and the mechanism."""
    from ...live.command import write_page
    from ..scenes import chosen, loaded, narrowed

    given = {"scene": scene, "p": arguments, **needs, "add-output": add_output}
    with plainly():
        source: Model | Path = target
        shown = None
        if target.suffix == ".py":
            file = loaded(target, add_output, arguments)
            source = file.model
            scenes = chosen(file, None if scene is None else [scene])
            shown = narrowed(scenes[:1], needs)[0]
        elif said := [
            f"{'--' if len(n) > 1 else '-'}{n}" for n, value in given.items() if value is not None
        ]:
            raise UsageError(
                f"{' and '.join(said)}: an FMU is one scene with outputs of its own; leave it out, or "
                "make the page from the model file"
            )
        with console.status("compiling to WebAssembly"):
            path = write_page(source, out, shown)
        console.print(
            f"[green]wrote[/] {escape(str(path))} ({path.stat().st_size / 1e3:.0f} kB)",
            soft_wrap=True,
        )
