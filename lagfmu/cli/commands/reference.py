"""`lagfmu reference`: results of an FMU for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..options import FmuPath, InputFile, StepSize, StopTime
from ..terminal import plainly, say_wrote


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
