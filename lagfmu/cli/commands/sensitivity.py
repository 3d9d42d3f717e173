"""`lagfmu sensitivity`: what outputs at the end of a run depend on."""

from __future__ import annotations

import math
from typing import Annotated, Any

import typer

from ...errors import UsageError
from .. import options
from ..terminal import console, plainly, say, say_wrote


def sensitivity(
    target: options.Runnable,
    of: Annotated[
        list[str],
        typer.Option(
            metavar="OUTPUT,...",
            help="Outputs at the end of the run, such as departure.surface.time,peak.lambda.rod.max.",
        ),
    ],
    to: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="Parameters and start values (default: all)."),
    ] = None,
    over: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=LOW:HIGH",
            help="Indices over ranges instead of derivatives, by SALib; repeatable.",
        ),
    ] = None,
    method: Annotated[
        str, typer.Option(help="With --over: sobol (parts of the variance) or morris.")
    ] = "sobol",
    samples: Annotated[
        int, typer.Option(help="With --over: of Sobol's plan, or Morris's trajectories.")
    ] = 256,
    seed: Annotated[int, typer.Option(help="With --over: of the samples.")] = 0,
    set_: options.Settings = None,
    stop_time: options.StopTime = None,
    step_size: options.StepSize = None,
    tolerance: Annotated[
        float | None, typer.Option(help="Relative tolerance of the runs (default 1e-11).")
    ] = None,
    inputs: options.InputFile = None,
    scene: options.SceneName = None,
    on: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="With --over: a Dask scheduler.")
    ] = None,
    json: options.JsonFile = None,
    figure: options.Plot = None,
) -> None:
    """How outputs change with parameters: derivatives at the given values, or indices over ranges."""
    from ...files import write_whole
    from ...fmu.read import read_description, units_of
    from ...model.selection import listed
    from ...page.table import print_whole
    from ...studio.sensitivity.local import ALL, TOLERANCE, made_for
    from ...studio.sensitivity.local import sensitivity as found_by
    from ...studio.sensitivity.ranges import over_ranges
    from ...verification.junit import text_of

    outputs = [n for text in of for n in listed(text)]
    by = [n for text in to or () for n in listed(text)] or ALL
    with plainly(), made_for(target, outputs, by, scene) as fmu:
        units = units_of(read_description(fmu).modelVariables)
        given = options.assignments(set_, lambda: units)
        run: dict[str, Any] = {"stop_time": stop_time, "step_size": step_size, "inputs": inputs}
        found: Any
        if over:
            if to or given:
                raise UsageError(
                    "--to and --set are for derivatives; --over says itself what varies"
                )
            ranges = options.once(_range(text) for text in over)
            found = over_ranges(
                fmu,
                list(outputs),
                ranges,
                method,
                samples,
                seed,
                tolerance=tolerance,
                on=on,
                **run,
            )
        else:
            if on is not None:
                raise UsageError("--on is for --over")
            found = found_by(
                fmu,
                outputs,
                by,
                start_values=given,
                tolerance=TOLERANCE if tolerance is None else tolerance,
                **run,
            )
        for table in found.tables():
            print_whole(console, table)
        for text in found.remarks():
            say(text, "note:", "yellow")
        if json is not None:
            write_whole(json, text_of(found.to_dict()).encode())
            say_wrote(json)
        if figure is not None:
            say_wrote(found.plot(figure))


def _range(text: str) -> tuple[str, tuple[float, float]]:
    name, sign, ends = (part.strip() for part in text.partition("="))
    try:
        low, high = (float(part) for part in ends.split(":"))
    except ValueError:
        sign = ""
    if not sign or not math.isfinite(low + high):
        raise UsageError(f"--over {text!r}: expected NAME=LOW:HIGH, finite numbers in SI")
    return name, (low, high)
