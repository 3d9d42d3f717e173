"""`lagfmu simulate`: one run; the last values, a table, a figure, a film."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from ...errors import SettingError
from .. import options
from ..terminal import console, plainly, say_wrote

if TYPE_CHECKING:
    from ...verification.result import Result


def simulate(
    source: options.Runnable,
    set_: options.Settings = None,
    stop_time: options.StopTime = None,
    step_size: options.StepSize = None,
    tolerance: options.Tolerance = None,
    scene: options.SceneName = None,
    arguments: options.Arguments = None,
    plot_: options.Plot = None,
    variable: Annotated[
        list[str] | None,
        typer.Option("--variable", "-v", help="What to print and plot; repeatable."),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Write all outputs as a CSV file.")] = None,
    animate: Annotated[
        Path | None,
        typer.Option(help="Write a film of the model's picture: .gif, .webp, .mp4 or .html."),
    ] = None,
    inputs: options.InputFile = None,
    error_bars: options.ErrorBars = None,
    target: options.Target = None,
    add_output: options.AddOutput = None,
) -> None:
    """Simulate an FMU or a model; print the last values, plot or save the rest.

    With a figure, a table or a film only multipliers, coordinates and times of events are printed; -v names
    others.
    """
    from ...fmu.read import read_description, units_of
    from ...model.file import is_model
    from ...prepare.prepare import prepare
    from ...verification.simulate import simulate as simulated
    from ..scenes import for_models, loaded, narrowed

    with plainly():
        run: Any = source
        if is_model(source):
            file = loaded(source, add_output, arguments)
            scenes = narrowed(file.called(scene), {"error_bars": error_bars})
            run = prepare(file.model, scenes[0])
            name, variables = run.scene.name, run.table.variables
        else:
            for_models(source, scene=scene, p=arguments, add_output=add_output, target=target)
            description = read_description(source)
            name, variables = description.modelName, description.modelVariables
        known = {v.name: v.causality for v in variables if v.causality != "parameter"}
        besides = _besides(variable or (), known)
        given = options.assignments(set_, lambda: units_of(variables))
        with console.status(f"simulating {name}"):
            result = simulated(
                run,
                stop_time,
                step_size,
                tolerance,
                given,
                inputs,
                besides=besides,
                error_bars=bool(error_bars),
                target=target,
            )
        written = any(f is not None for f in (csv, plot_, animate))
        _print_last(result, variable or (_first_of(result) if written else ()))
        if csv is not None:
            _save(csv, result)
            say_wrote(csv)
        if plot_ is not None:
            say_wrote(result.plot(*(variable or ()), out=plot_))
        if animate is not None:
            from ...studio.film import film
            from ...studio.live.play import told_by

            with console.status(f"drawing {name}"):
                film(told_by(run), result, given, animate, name)
            say_wrote(animate)


def _besides(names: Sequence[str], known: Mapping[str, str]) -> list[str]:
    """Those of the names that are no outputs: inputs, and local variables.

    Raises SettingError with all that is unknown.
    """
    from ...model.rule import missing

    unknown = [n for n in names if n not in known and n != "time"]
    if unknown:
        raise SettingError(f"--variable: {'; '.join(missing(n, known) for n in unknown)}")
    return [n for n in names if n in known and known[n] != "output"]


def _first_of(result: Result) -> list[str]:
    """What one looks for first, and the times of events."""
    from ...names import DEPARTURE_TIME, SLIP_TIME, of_interest, those

    known = list(result.dtype.names or ())
    return of_interest(known) + those(known, DEPARTURE_TIME, SLIP_TIME)


def _print_last(result: Result, names: Sequence[str] = ()) -> None:
    """The last values of the named variables, of all outputs without names."""
    from ...model.units import for_reading
    from ...page.table import new_table, print_whole
    from ...verification.result import NOT_YET, as_text

    title = f"{result.name} ({result.target}) at t = {result['time'][-1]:g} s"
    table = new_table(title, "variable", "value", "unit")
    table.columns[0].justify = table.columns[2].justify = "left"
    for n in names or list(result.dtype.names or ())[1:]:
        text = as_text(result[n][-1], 9) if result.known(n)[-1] else NOT_YET
        table.add_row(escape(n), text, escape(for_reading(result.units.get(n))))
    print_whole(console, table)


def _save(path: Path, result: Any) -> None:
    """All columns; names are quoted, because that of an acceleration holds a comma."""
    from ...files import write_whole
    from ...verification.crosscheck import as_csv

    write_whole(path, as_csv(result, [n for n in result.dtype.names if n != "time"]).encode())
