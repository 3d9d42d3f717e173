"""`lagfmu fit`: the values with which an FMU explains what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..options import JsonFile, Plot, Runnable, SceneName, Settings, StepSize, assignments, once
from ..terminal import console, plainly, say, say_wrote


def fit(
    target: Runnable,
    measured: Annotated[
        list[Path],
        typer.Argument(
            metavar="MEASURED.csv...",
            help="Tables with a column time and one for each measured output, input and parameter of the "
            "experiment; 'force.A.x \\[kN]' has a unit of its own, empty cells are gaps.",
        ),
    ],
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=LOW:HIGH[:START]]",
            help="A parameter or start value to be found; repeatable.",
        ),
    ] = None,
    measure: Annotated[
        list[str] | None,
        typer.Option(
            metavar="OUTPUT[:DEVIATION]",
            help="An output that was measured, and its standard deviation (else it is estimated); repeatable "
            "(default: every column that is an output).",
        ),
    ] = None,
    offset: Annotated[
        float, typer.Option(help="The clocks may be wrong by up to this many s, and are set right.")
    ] = 0.0,
    loss: Annotated[
        str, typer.Option(help="linear; soft_l1, huber, cauchy, arctan against outliers.")
    ] = "linear",
    set_: Settings = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Relative tolerance of the runs (default 1e-9).")
    ] = None,
    step_size: StepSize = None,
    scene: SceneName = None,
    json: JsonFile = None,
    figure: Plot = None,
) -> None:
    """Find the values of parameters and start values that explain what was measured.

    Exit code 1 if the search does not converge.
    """
    from ...files import write_whole
    from ...fmu.read import read_description, units_of
    from ...fmu.write import as_fmu
    from ...page.table import print_whole
    from ...studio.fit.problem import bounds_of, derivatives_of, deviation_of, named
    from ...studio.fit.solve import TOLERANCE
    from ...studio.fit.solve import fit as found_by
    from ...verification.exit_codes import FAILS
    from ...verification.junit import text_of

    with plainly():
        sought, wanted = once(named(free or (), "=")), once(named(measure or (), ":"))
        with as_fmu(target, scene, sensitivities=derivatives_of(sought, wanted)) as fmu:
            units = units_of(read_description(fmu).modelVariables)
            found = found_by(
                fmu,
                [str(p) for p in measured],
                {n: bounds_of(n, text, units) for n, text in sought.items()},
                {n: deviation_of(n, text, units) for n, text in wanted.items()},
                start_values=assignments(set_, lambda: units),
                offset=offset,
                loss=loss,
                tolerance=TOLERANCE if tolerance is None else tolerance,
                step_size=step_size,
            )
        say(found.summary())
        print_whole(console, found.table())
        for text in found.remarks():
            say(text, "note:", "yellow")
        if json is not None:
            write_whole(json, text_of(found.to_dict()).encode())
            say_wrote(json)
        if figure is not None:
            say_wrote(found.plot(figure))
        if not found.converged:
            raise typer.Exit(FAILS)
