"""report(): what an FMU does, its forces and how far they can be relied on, as one file to hand on."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ...errors import UsageError
from ...files import write_whole
from ...fmu.write import as_fmu
from ...model.model import Model
from ...model.scene import Scene
from ...page.template import template
from ...verification.check import Verification
from ...verification.reference import Driven, Reference
from . import figures, tables
from .findings import Findings, findings
from .pdf import printed
from .study import Study, study_in

ENDINGS = (".html", ".pdf")
STUDIES = (".parquet", ".csv")
PEAKS = ("lambda.*", "force.*", "torque.*")


def report(
    source: str | os.PathLike[str] | Model,
    out: str | os.PathLike[str],
    *,
    study: str | os.PathLike[str] | None = None,
    scene: Scene | str | None = None,
    start_values: Mapping[str, Any] | None = None,
    stop_time: float | None = None,
    step_size: float | None = None,
    tolerance: float | None = None,
    inputs: Driven | None = None,
    reference: Reference | None = None,
    statements: str | os.PathLike[str] | None = None,
) -> Path:
    """Write a report of an FMU (or of a model, or a model file, which is built), or of the table of a sweep,
    to `out`: .html, or .pdf where Chromium or Firefox is installed.

    It is run twice, at its tolerance and at a hundredth of it, and verified as verify() does; `study` is a
    table that `sweep` wrote, .parquet or .csv, of the same FMU.  A `source` that is such a table gives a
    report of the study alone.  Raises UsageError for another ending, SimulationError for an FMU that does not
    run, BuildError for a file that cannot be written.
    """
    path = Path(out)
    if path.suffix not in ENDINGS:
        raise UsageError(f"{str(path)!r}: expected a file {' or '.join(ENDINGS)}")
    if isinstance(source, (str, os.PathLike)) and Path(source).suffix in STUDIES:
        page = rendered(None, study_in(Path(source)))
    else:
        with as_fmu(source, scene, peaks=PEAKS) as fmu:
            named = fmu if isinstance(source, Model) else Path(source)
            found = findings(
                fmu,
                named,
                start_values=start_values,
                stop_time=stop_time,
                step_size=step_size,
                tolerance=tolerance,
                inputs=inputs,
                reference=reference,
                statements=statements,
            )
            page = rendered(found, None if study is None else study_in(Path(study)))
    write_whole(path, printed(page, str(path)) if path.suffix == ".pdf" else page.encode())
    return path


def rendered(found: Findings | None, study: Study | None) -> str:
    """The page."""
    about: dict[str, Any] = {"study": study}
    if found is None:
        assert study is not None
        return template("studio/report/study.html.j2").render(name=study.name, **about)
    rows, continuous = tables.extremes(found)
    checks = () if found.verification is None else found.verification.checks
    return template("studio/report/report.html.j2").render(
        name=found.description.modelName,
        described=found.description.description or "",
        found=found,
        picture=figures.mechanism(found),
        curves=figures.curves(found),
        forces=rows,
        continuous=continuous,
        events=tables.events(found),
        constraints=tables.constraints(found),
        settings=tables.settings(found),
        accuracy=tables.accuracy(found),
        misses=figures.misses(checks),
        uncovered=tables.uncovered(found),
        **about,
    )


def verified(results: Sequence[tuple[str, Verification | None, str]]) -> str:
    """The page of `lagfmu verify --html`: of each file what was found, or why nothing was."""
    told = [
        (file, found, why, figures.misses(found.checks) if found else [])
        for file, found, why in results
    ]
    return template("studio/report/verified.html.j2").render(results=told)
