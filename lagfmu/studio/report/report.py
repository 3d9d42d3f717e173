"""report(): what an FMU does, its forces and how far they can be relied on, as one file to hand on."""

from __future__ import annotations

import io
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from ... import names
from ...errors import SimulationError, UsageError
from ...files import foreign, write_whole
from ...fmu.write import as_fmu
from ...model.model import Model
from ...model.scene import Scene
from ...page.documentation import template
from ...verification.check import Check, Verification
from ...verification.plot import COLOURS, figure_of
from ...verification.reference import Driven, Reference
from ...verification.simulate import as_text
from ..live.page import facts
from ..live.view import sketch
from ..sweep.plot import figure_of as of_study
from ..sweep.results import happened, numbers, one_by_one, read_rows, varied
from .findings import (
    Findings,
    accuracy,
    constraints,
    events,
    extremes,
    findings,
    forces,
    settings,
    uncovered,
)
from .pdf import printed

MOST = 12  # curves of one figure
FEW = 20  # points that are marked
QUIET = "#5b6570"


def _svg(figure: Any, title: str) -> Markup:
    """A figure inline; what reads the page aloud says `title`."""
    import matplotlib as mpl

    text = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": title, "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    drawn = text.getvalue()[text.getvalue().index("<svg") :]
    drawn = re.sub(r'(<svg[^>]*?) width="[^"]*" height="[^"]*"', r"\1", drawn, count=1)
    width = figure.get_figwidth() * 96
    label = Markup.escape(title)
    return (
        Markup(f'<figure style="max-width:{width:.0f}px" role="img" aria-label="{label}">')
        + Markup(_own_names(drawn, title))
        + Markup("</figure>")
    )


def _own_names(drawn: str, title: str) -> str:
    """Identifiers that no other figure of the page has: matplotlib calls groups alike in each."""
    mark = re.sub(r"\W", "", title)
    drawn = re.sub(r'\bid="([^"]+)"', rf'id="{mark}-\1"', drawn)
    drawn = re.sub(r'(xlink:href="#|href="#)', rf"\g<1>{mark}-", drawn)
    return drawn.replace("url(#", f"url(#{mark}-")


def _mechanism(found: Findings) -> Markup | None:
    """The model's picture where the run begins; None without one."""
    if found.told.picture is None:
        return None
    known = facts(found.told.description, found.told.picture, found.told.preset)["variables"]
    starts = {v["name"]: v["start"] for v in known} | dict(found.given)
    return _svg(sketch(found.told.picture, found.run, starts), "The mechanism at its start")


def _curves(found: Findings) -> list[tuple[str, Markup]]:
    """Forces, and the motion, along the run with its events."""
    known = list(found.run.dtype.names or ())
    preset = [n for n in (found.told.preset or {}).get("curves", ()) if n in known]
    held, own, drawn = forces(found), names.of_interest(known), []
    for title, push in (("Forces of constraint", True), ("Motion", False)):
        told = ([n for n in of if (n in held) == push] for of in (preset, own))
        if chosen := next(filter(None, told), held if push else []):
            figure = figure_of(found.run, found.units, chosen[:MOST])
            drawn.append((title, _svg(figure, title)))
    return drawn


def _misses(checks: Sequence[Check]) -> list[tuple[str, Markup]]:
    """Of each statement that fails: what was found, and what was expected."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from ...verification.plot import STYLE

    drawn = []
    for k, check in enumerate(checks):
        if check.missed is None:
            continue
        with mpl.rc_context(STYLE | {"font.size": 10}):
            figure = Figure(figsize=(7.0, 2.4), layout="constrained")
            panel = figure.subplots()
            time, actual, expected = check.missed.time, check.missed.actual, check.missed.expected
            mark = "." if len(time) < FEW else ""
            panel.plot(time, expected, color=QUIET, lw=3, alpha=0.4, label="expected", marker=mark)
            panel.plot(time, actual, color=COLOURS[6], lw=1.4, label="found", marker=mark)
            panel.set_xlabel("time [s]")
            panel.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1.0))
            drawn.append((check.name, _svg(figure, f"missed {k}")))
    return drawn


@dataclass(frozen=True)
class Study:
    """`rows`: name, smallest, median and largest value, unit; `facts`: how it was made."""

    name: str
    runs: int
    refused: int
    rows: list[tuple[str, ...]]
    facts: list[tuple[str, str]]
    figure: Markup


def study_in(path: Path) -> Study:
    """Of a .parquet or .csv file that `sweep` wrote.  Raises SimulationError for another."""
    found = read_rows(path)
    runs = one_by_one(found)
    status = runs["status"].values
    rows = []
    for n in (*varied(runs), *numbers(found)):
        values = np.asarray(runs[n].values if n in runs.coords else happened(runs, n), dtype=float)
        values = values[np.isfinite(values)]
        cells = (values.min(), np.median(values), values.max()) if len(values) else ()
        rows.append(
            (n, *([as_text(x) for x in cells] or ["never"] * 3), runs[n].attrs.get("units", ""))
        )
    with foreign(
        lambda said: SimulationError(
            f"{str(path)!r} cannot be drawn ({said}): expected runs of a sweep, with numbers of usual sizes"
        )
    ):
        figure = _svg(of_study(found), "The study")
    facts = [(k.replace("_", " "), str(v)) for k, v in found.attrs.items() if v]
    return Study(
        Path(found.attrs.get("fmu", path.name)).stem,
        len(status),
        int((status != "ok").sum()),
        rows,
        facts,
        figure,
    )


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
        page = _rendered(None, study_in(Path(source)))
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
            page = _rendered(found, None if study is None else study_in(Path(study)))
    write_whole(path, printed(page, str(path)) if path.suffix == ".pdf" else page.encode())
    return path


def _rendered(found: Findings | None, study: Study | None) -> str:
    """The page."""
    about: dict[str, Any] = {"study": study}
    if found is None:
        assert study is not None
        return template("studio/report/study.html.j2").render(name=study.name, **about)
    rows, continuous = extremes(found)
    checks = () if found.verification is None else found.verification.checks
    return template("studio/report/report.html.j2").render(
        name=found.description.modelName,
        described=found.description.description or "",
        found=found,
        picture=_mechanism(found),
        curves=_curves(found),
        forces=rows,
        continuous=continuous,
        events=events(found),
        constraints=constraints(found),
        settings=settings(found),
        accuracy=accuracy(found),
        misses=_misses(checks),
        uncovered=uncovered(found),
        **about,
    )


def verified(results: Sequence[tuple[str, Verification | None, str]]) -> str:
    """The page of `lagfmu verify --html`: of each file what was found, or why nothing was."""
    told = [
        (file, found, why, _misses(found.checks) if found else []) for file, found, why in results
    ]
    return template("studio/report/verified.html.j2").render(results=told)
