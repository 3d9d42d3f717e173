"""`lagfmu report`: what an FMU does, as one file to hand on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .. import options
from ..terminal import console, kilobytes, plainly, say_wrote


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
    set_: options.Settings = None,
    stop_time: options.StopTime = None,
    step_size: options.StepSize = None,
    tolerance: options.Tolerance = None,
    inputs: options.InputFile = None,
    reference: options.ReferenceFile = None,
    statements: options.StatementsFile = None,
    scene: options.SceneName = None,
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
            start_values=options.assignments(set_, lambda: known),
            stop_time=stop_time,
            step_size=step_size,
            tolerance=tolerance,
            inputs=None if inputs is None else read_table(inputs),
            reference=None if reference is None else Reference(read_table(reference)),
            statements=statements,
        )
        say_wrote(done, kilobytes(done))
