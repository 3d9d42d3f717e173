"""`lagfmu show`: what a model file says, as mathematics."""

from __future__ import annotations

from typing import Annotated

import typer

from ..options import OPTIONS, AddOutput, Arguments, ModelPath, Needs, takes
from ..terminal import console, plainly


@takes(*(n for n in OPTIONS if n != "name"))
def show(
    model: ModelPath,
    scene: Annotated[str | None, typer.Option(help="Which FMU of the file.")] = None,
    arguments: Arguments = None,
    *,
    needs: Needs,
    add_output: AddOutput = None,
) -> None:
    """Print equations of motion, classification of constraints, degrees of freedom and units.

    For a scene that needs less than everything, print also what is removed and what that saves.
    """
    from ...errors import CannotStartError
    from ...fmu.native import try_start
    from ...page.text import show as show_prepared
    from ...page.text import show_what_is_known
    from ...prepare.prepare import prepare
    from ...prepare.starts import check_given
    from ..scenes import loaded, narrowed

    with plainly():
        file = loaded(model, add_output, arguments)
        for s in narrowed(file.called(scene), needs):
            try:
                prepared = prepare(file.model, s)
                untried = try_start(prepared)
            except CannotStartError as error:
                show_what_is_known(error.known, console)
                raise
            show_prepared(prepared, console, untried)
            structure = prepared.structure
            check_given(file.model.name, structure.start.moved, structure.missed)
