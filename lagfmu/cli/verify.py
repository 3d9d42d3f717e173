"""`lagfmu verify` and `lagfmu reference`: FMUs held against what is known, for eyes and for pipelines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..errors import LagfmuError, SettingError, SimulationError
from ..verification.pipeline import Report, UsageError
from ..verification.reference import Reference, read_table
from ..verification.report import report
from ..verification.verify import verify


def tolerances(texts: Sequence[str]) -> tuple[float, dict[str, float]]:
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


def examine(
    fmus: Sequence[Path],
    values: Mapping[str, Any],
    stop_time: float | None,
    step_size: float | None,
    tolerance: float | None,
    inputs: Path | None,
    reference: Path | None,
    rtol: Sequence[str],
    atol: float,
) -> list[Report]:
    """Each FMU; one that cannot be run does not keep the others from it.  Raises UsageError."""
    if reference is None and (rtol or atol):
        raise UsageError("--rtol and --atol are for --reference")
    if reference is not None and len(fmus) > 1:
        raise UsageError("--reference belongs to one FMU")
    common, own = tolerances(rtol)
    try:
        signals = None if inputs is None else read_table(inputs)
        table = None if reference is None else Reference(read_table(reference), common, atol, own)
    except SimulationError as error:
        raise UsageError(str(error)) from None
    done = []
    for fmu in fmus:
        try:
            found = verify(fmu, values, stop_time, step_size, tolerance, signals, table)
        except LagfmuError as error:
            misused = isinstance(error, SettingError)
            done.append(Report(str(fmu), error=str(error), misused=misused))
        else:
            done.append(report(str(fmu), found))
    return done
