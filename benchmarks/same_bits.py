"""Are the numbers of native FMUs the same bits as another checkout's?

    python benchmarks/same_bits.py OTHER [MODEL ...]

Each checkout builds the scenes of its own models/ as FMI 2.0 and as FMI 3.0, and runs the default
experiment through fmpy, by co-simulation and by model exchange; of every scene and output that both have: how
many outputs agree in every bit, and of the others the largest difference, relative to the output's largest
value, and when it first arises.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import fmpy
import numpy as np

ROOT = Path(__file__).parent.parent


def run(checkout: Path, folder: Path, models: list[str]) -> None:
    """Every scene's results in `folder`: of FMI 2.0 and 3.0, by co-simulation and by model exchange."""
    for version in ("2", "3"):
        built = folder / version
        command = [sys.executable, "-m", "lagfmu", "build", "--target", "native", "--no-check"]
        command += ["--fmi", version, "--out", str(built)]
        for path in sorted((checkout / "models").glob("*.py")):
            if not models or path.stem in models:
                subprocess.run(
                    [*command, str(path)],
                    cwd=checkout,
                    env={**os.environ, "PYTHONPATH": str(checkout)},
                    stdout=subprocess.DEVNULL,
                    check=True,
                )
        for path in built.rglob("*.fmu"):
            _simulate(path, folder / f"{path.stem} {version}")


def _simulate(fmu: Path, out: Path) -> None:
    """The default experiment, each way as NAME WAY.npy."""
    description = fmpy.read_model_description(str(fmu))
    shown = [
        v.name
        for v in description.modelVariables
        if v.type in ("Real", "Float64") and v.causality in ("output", "local")
    ]
    for way, offered in (
        ("CoSimulation", description.coSimulation),
        ("ModelExchange", description.modelExchange),
    ):
        if offered is not None:
            result = fmpy.simulate_fmu(str(fmu), output=shown, fmi_type=way)
            np.save(out.with_name(f"{out.name} {way}.npy"), result)


def main() -> None:
    """Print a line a scene."""
    other, *models = sys.argv[1:] or ["--help"]
    if not Path(other, "models").is_dir():
        sys.exit(__doc__)
    with tempfile.TemporaryDirectory() as text:
        ours, theirs = Path(text, "ours"), Path(text, "theirs")
        for checkout, folder in ((ROOT, ours), (Path(other).resolve(), theirs)):
            folder.mkdir()
            run(checkout, folder, models)
        for path in sorted(ours.glob("*.npy")):
            if not (theirs / path.name).is_file():
                print(f"{path.stem:40} only here")
                continue
            one, two = (np.load(f, max_header_size=10**6) for f in (path, theirs / path.name))
            print(f"{path.stem:40} {compared(one, two)}")


def compared(a: np.ndarray, b: np.ndarray) -> str:
    """How the two results differ, in words."""
    assert a.dtype.names is not None
    assert b.dtype.names is not None
    names = [n for n in a.dtype.names if n in b.dtype.names]
    if len(a) != len(b):
        return f"{len(a)} points, there {len(b)}"
    differing = [n for n in names if a[n].tobytes() != b[n].tobytes()]
    if not differing:
        return f"all {len(names)} outputs the same bits"
    off = {
        n: np.abs(a[n] - b[n]).max() / max(np.abs(b[n]).max(), np.finfo(float).tiny)
        for n in differing
    }
    worst = max(off, key=lambda n: off[n])
    first = min(float(a["time"][np.flatnonzero(a[n] != b[n])[0]]) for n in differing)
    same = len(names) - len(differing)
    return f"{same} of {len(names)} the same bits; {worst} off by {off[worst]:.1e}, from {first:.4g} s on"


if __name__ == "__main__":
    main()
