"""Commands for one run of an FMU: simulated, held against what is known, written for other tools, told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from ...errors import LagfmuError, SettingError, SimulationError, UsageError
from ..options import (
    AddOutput,
    Arguments,
    ErrorBars,
    FmuPath,
    InputFile,
    JsonFile,
    JunitFile,
    Plot,
    ReferenceFile,
    Runnable,
    SceneName,
    Settings,
    StatementsFile,
    StepSize,
    StopTime,
    Target,
    Tolerance,
    assignments,
)
from ..terminal import console, kilobytes, plainly, say, say_wrote

if TYPE_CHECKING:
    from ...verification.pipeline import Report
    from ...verification.simulate import Result


def simulate(
    source: Runnable,
    set_: Settings = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    tolerance: Tolerance = None,
    scene: SceneName = None,
    arguments: Arguments = None,
    plot_: Plot = None,
    variable: Annotated[
        list[str] | None,
        typer.Option("--variable", "-v", help="What to print and plot; repeatable."),
    ] = None,
    csv: Annotated[Path | None, typer.Option(help="Write all outputs as a CSV file.")] = None,
    animate: Annotated[
        Path | None,
        typer.Option(help="Write a film of the model's picture: .gif, .webp, .mp4 or .html."),
    ] = None,
    inputs: InputFile = None,
    error_bars: ErrorBars = None,
    target: Target = None,
    add_output: AddOutput = None,
) -> None:
    """Simulate an FMU or a model; print the last values, plot or save the rest.

    With a figure, a table or a film only multipliers, coordinates and times of events are printed; -v names
    others.
    """
    from ...fmu.read import read_description, units_of
    from ...model.file import is_model
    from ...prepare.prepare import prepare
    from ...verification.simulate import simulate as simulated
    from ..options import for_models, loaded, narrowed

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
        given = assignments(set_, lambda: units_of(variables))
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
    from ...verification.simulate import NOT_YET, as_text

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


def verify(
    fmus: Annotated[list[Path], typer.Argument(metavar="FILE.fmu...", help="FMUs.")],
    set_: Settings = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    tolerance: Tolerance = None,
    inputs: InputFile = None,
    reference: ReferenceFile = None,
    rtol: Annotated[
        list[str] | None,
        typer.Option(
            metavar="RTOL|NAME=RTOL",
            help="Allowed error relative to a reference column's largest value (default 1e-6); repeatable.",
        ),
    ] = None,
    atol: Annotated[
        float, typer.Option(help="Allowed absolute error, in the column's unit.")
    ] = 0.0,
    statements: StatementsFile = None,
    validation: Annotated[
        bool,
        typer.Option(help="Hold the file against fmpy's own check, which refuses some tools'."),
    ] = True,
    html: Annotated[
        Path | None,
        typer.Option(help="Write a page with what was found, and pictures of what fails."),
    ] = None,
    json: JsonFile = None,
    junit: JunitFile = None,
) -> None:
    """Simulate FMUs through fmpy and check them against closed forms, statements and a reference.

    The exit code is the largest of all FMUs'.
    """
    from ...files import write_whole
    from ...verification.pipeline import refused, report
    from ...verification.reference import Reference, read_table
    from ...verification.verify import verify as held
    from ..progress import finish, print_verdicts

    with plainly():
        if reference is None and (rtol or atol):
            raise UsageError("--rtol and --atol are for --reference")
        if reference is not None and len(fmus) > 1:
            raise UsageError("--reference belongs to one FMU")
        common, own = _tolerances(rtol or ())
        try:
            signals = None if inputs is None else read_table(inputs)
            known = None if reference is None else read_table(reference)
            table = None if known is None else Reference(known, common, atol, own)
        except SimulationError as error:
            raise UsageError(str(error)) from None
        values = assignments(set_, lambda: _units(fmus))
        done = []
        for fmu in fmus:  # one that cannot be run does not keep the others from it
            try:
                found = held(
                    fmu,
                    values,
                    stop_time,
                    step_size,
                    tolerance,
                    signals,
                    table,
                    statements,
                    validation=validation,
                )
            except LagfmuError as error:
                done.append(refused(str(fmu), error))
            else:
                done.append(report(str(fmu), found))
                if len(fmus) > 1:  # that may all have one name
                    say(str(fmu))
                print_verdicts(found)
        if html is not None:
            from ...studio.report.report import verified

            page = verified([(r.file, r.found, r.error) for r in done])
            write_whole(html, page.encode())
            say_wrote(html)
        if len(done) > 1:
            passed, ran = (sum(map(test, done)) for test in (_passed, lambda r: not r.error))
            say(f"{len(done)} FMUs: {passed} pass, {ran - passed} fail, {len(done) - ran} not run")
        finish("verify", done, json, junit)


def _passed(one: Report) -> bool:
    return not one.error and one.found.passed


def _units(fmus: Sequence[Path]) -> dict[str, str | None]:
    """The unit of each variable of these FMUs."""
    from ...fmu.read import read_description, units_of

    return {
        n: u for path in fmus for n, u in units_of(read_description(path).modelVariables).items()
    }


def _tolerances(texts: Sequence[str]) -> tuple[float, dict[str, float]]:
    """RTOL or NAME=RTOL, repeatable: the one for all, and those of single variables."""
    common, own = 1e-6, {}
    for text in texts:
        name, sign, value = (part.strip() for part in text.rpartition("="))
        try:
            number = float(value)
        except ValueError:
            number = float("nan")
        if not 0 <= number < float("inf"):
            raise UsageError(f"--rtol {text!r}: expected a number from 0, or NAME=NUMBER")
        if sign:
            own[name] = number
        else:
            common = number
    return common, own


def reference(
    fmu: FmuPath,
    out: Annotated[Path | None, typer.Option("--out", "-o", help="Folder (default: NAME).")] = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    inputs: InputFile = None,
) -> None:
    """Write reference results of an FMU for other tools: the files of the FMI cross-check."""
    from ...verification.crosscheck import write_crosscheck
    from ...verification.reference import read_table

    with plainly():
        signals = None if inputs is None else read_table(inputs)
        folder = out or Path(fmu.stem)
        for path in write_crosscheck(fmu, folder, stop_time, step_size, signals):
            say_wrote(path)


def report(
    source: Annotated[
        Path, typer.Argument(help="A model file, an FMU, or the table of a sweep (.parquet, .csv).")
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="report.html, or report.pdf with a browser.")
    ] = Path("report.html"),
    study: Annotated[
        Path | None, typer.Option(help="The table of a sweep of this FMU, to stand in the report.")
    ] = None,
    set_: Settings = None,
    stop_time: StopTime = None,
    step_size: StepSize = None,
    tolerance: Tolerance = None,
    inputs: InputFile = None,
    reference: ReferenceFile = None,
    statements: StatementsFile = None,
    scene: SceneName = None,
) -> None:
    """Write what an FMU does as one file: the mechanism, equations, curves with events, forces with their
    extremes, verification, accuracy, versions."""
    from ...fmu.read import read_description, units_of
    from ...model.file import is_model
    from ...studio.report.report import STUDIES
    from ...studio.report.report import report as written
    from ...verification.reference import Reference, read_table

    with plainly(), console.status(f"reporting on {source}"):
        known = {}
        if set_ and source.suffix not in STUDIES and not is_model(source):
            known = units_of(read_description(source).modelVariables)
        done = written(
            source,
            out,
            study=study,
            scene=scene,
            start_values=assignments(set_, lambda: known),
            stop_time=stop_time,
            step_size=step_size,
            tolerance=tolerance,
            inputs=None if inputs is None else read_table(inputs),
            reference=None if reference is None else Reference(read_table(reference)),
            statements=statements,
        )
        say_wrote(done, kilobytes(done))
