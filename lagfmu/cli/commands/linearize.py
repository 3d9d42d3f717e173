"""`lagfmu linearize`: the linear system beside an equilibrium or a state of the motion."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..options import Runnable, SceneName, Settings, assignments
from ..terminal import console, plainly, say, say_wrote


def linearize(
    target: Runnable,
    at: Annotated[
        float | None,
        typer.Option(metavar="T", help="Beside the motion at this time in s (default: the start)."),
    ] = None,
    equilibrium: Annotated[
        bool,
        typer.Option(
            "--equilibrium", help="Beside the equilibrium that is found from the start, at rest."
        ),
    ] = False,
    inputs: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="Inputs u (default: all); '' for none."),
    ] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME,...",
            help="Outputs y (default: multipliers, forces of constraint, outputs of the model's own).",
        ),
    ] = None,
    set_: Settings = None,
    scene: SceneName = None,
    output: Annotated[
        list[Path] | None,
        typer.Option(help="Write A, B, C, D and all else: .json or .mat; repeatable."),
    ] = None,
    page: Annotated[
        Path | None, typer.Option(help="Write an HTML file on which the modes move.")
    ] = None,
) -> None:
    """A, B, C, D, poles and modes in coordinates that the constraints leave free."""
    from ...fmu.read import read_description, units_of
    from ...model.scene import listed
    from ...page.table import print_whole
    from ...studio.linearize.linearize import linearize as found_by
    from ...studio.linearize.linearize import made_for

    def names(given: list[str] | None) -> list[str] | None:
        return None if given is None else [n for text in given for n in listed(text)]

    with plainly(), made_for(target, scene) as fmu:
        found = found_by(
            fmu,
            at=at,
            equilibrium=equilibrium,
            inputs=names(inputs),
            outputs=names(outputs),
            start_values=assignments(set_, lambda: units_of(read_description(fmu).modelVariables)),
            page=page,
        )
        say(found.summary())
        for table in found.tables():
            print_whole(console, table)
        for text in found.remarks():
            say(text, "note:", "yellow")
        for path in output or ():
            say_wrote(found.save(path))
        if page is not None:
            say_wrote(page)
