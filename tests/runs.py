"""FMUs that run many times: unpacked, and the description read and checked, once."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import fmpy

FOLDERS: list[tempfile.TemporaryDirectory[str]] = []  # each goes with this process


def simulate_fmu(path: str | Path, **options: Any) -> Any:
    """fmpy.simulate_fmu(path, **options)."""
    folder, description = unpacked(path)
    return fmpy.simulate_fmu(folder, model_description=description, **options)


def evenly(
    path: str | Path, stop: float, points: int, tolerance: float | None, start: Any, **options: Any
) -> Any:
    """A run of fmpy to `stop` [s] in equal communication steps, from the values `start`."""
    step = stop / points
    sizes = {"stop_time": stop, "step_size": step, "output_interval": step}
    return simulate_fmu(path, relative_tolerance=tolerance, start_values=start, **sizes, **options)


def unpacked(path: str | Path) -> tuple[str, Any]:
    """The folder and the description of an FMU as it is now."""
    state = Path(path).stat()
    return _unpacked(str(path), state.st_mtime_ns, state.st_size)


@cache
def _unpacked(path: str, *_: int) -> tuple[str, Any]:
    FOLDERS.append(tempfile.TemporaryDirectory(prefix="lagfmu_run_"))
    return fmpy.extract(path, FOLDERS[-1].name), fmpy.read_model_description(path)
