"""`lagfmu verify`: FMUs held against what is known, for eyes and for pipelines."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ...errors import LagfmuError, SimulationError, UsageError
from .. import options
from ..terminal import plainly, say, say_wrote

if TYPE_CHECKING:
    from ...verification.junit import Report


def verify(
    fmus: Annotated[list[Path], typer.Argument(metavar="FILE.fmu...", help="FMUs.")],
    set_: options.Settings = None,
    stop_time: options.StopTime = None,
    step_size: options.StepSize = None,
    tolerance: options.Tolerance = None,
    inputs: options.InputFile = None,
    reference: options.ReferenceFile = None,
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
    statements: options.StatementsFile = None,
    validation: Annotated[
        bool,
        typer.Option(help="Hold the file against fmpy's own check, which refuses some tools'."),
    ] = True,
    html: Annotated[
        Path | None,
        typer.Option(help="Write a page with what was found, and pictures of what fails."),
    ] = None,
    json: options.JsonFile = None,
    junit: options.JunitFile = None,
) -> None:
    """Simulate FMUs through fmpy and check them against closed forms, statements and a reference.

    The exit code is the largest of all FMUs'.
    """
    from ...files import write_whole
    from ...verification.junit import refused
    from ...verification.reference import Reference, read_table
    from ...verification.report import report
    from ...verification.verify import verify as held
    from ..finish import finish, print_verdicts

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
        values = options.assignments(set_, lambda: _units(fmus))
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
