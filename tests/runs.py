"""FMUs that run many times: unpacked, and the description read, once (test_fmu_contract.py says that it is
right)."""

from __future__ import annotations

import tempfile
import zipfile
from functools import cache
from pathlib import Path
from typing import Any

import fmpy

from lagfmu.testing import unbundled

UNUSED = ("documentation/", "sources/")  # no run needs them
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


def sources(path: str | Path) -> dict[str, bytes]:
    """The C files that an FMU carries, of the runtime and of its own, by name."""
    with zipfile.ZipFile(path) as archive:
        carried = [n for n in archive.namelist() if n.startswith("sources/")]
        assert carried, f"{path} was built without C files"
        return unbundled({n.removeprefix("sources/"): archive.read(n) for n in carried})


def unpacked(path: str | Path, whole: bool = False) -> tuple[str, Any]:
    """The folder and the description of an FMU as it is now; `whole`, with page and C files."""
    state = Path(path).stat()
    return _unpacked(str(path), whole, state.st_mtime_ns, state.st_size)


@cache
def _unpacked(path: str, whole: bool, *_: int) -> tuple[str, Any]:
    FOLDERS.append(tempfile.TemporaryDirectory(prefix="lagfmu_run_"))
    wanted = None if whole else lambda file: not file.startswith(UNUSED)
    folder = fmpy.extract(path, FOLDERS[-1].name, wanted)
    return folder, fmpy.read_model_description(path, validate=False)
