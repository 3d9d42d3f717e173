"""The table of a sweep as part of a report: what varied, what was kept, a figure."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from markupsafe import Markup

from ...errors import SimulationError
from ...files import foreign
from ...verification.result import as_text
from ..sweep.plot import figure_of
from ..sweep.table import happened, numbers, one_by_one, read_rows, varied
from .figures import svg


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
        figure = svg(figure_of(found), "The study")
    facts = [(k.replace("_", " "), str(v)) for k, v in found.attrs.items() if v]
    return Study(
        Path(found.attrs.get("fmu", path.name)).stem,
        len(status),
        int((status != "ok").sum()),
        rows,
        facts,
        figure,
    )
