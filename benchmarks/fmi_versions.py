"""What does FMI 3.0 cost beside FMI 2.0?

    python benchmarks/fmi_versions.py [--sizes] [MODEL ...]

A row an FMU (MODEL `all`: each scene of each model in models/): FMI 3.0 over FMI 2.0 in bytes of the archive,
with sources and without, in bytes of the binary, and in processor time of runs in one call of the library
(lagfmu_batch), each the least of 21 in turns; --sizes: no times.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lagfmu.fmu.batch import LAST, Plan, run_batch
from lagfmu.fmu.face import Face
from lagfmu.fmu.session import Session
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import Prepared, prepare

MODELS = Path(__file__).parent.parent / "models"
KINDS = ("pendulum", "hemisphere", "cart_pendulum", "chain", "slider_crank_bodies")
PAIRS, RUNS = 21, 40


def scenes(names: list[str]) -> Iterator[Prepared]:
    """The first scene of each model; of `all` every one."""
    everything = "all" in names
    found = sorted(p.stem for p in MODELS.glob("*.py")) if everything else names or KINDS
    for name in found:
        file = load(MODELS / f"{name}.py")
        for scene in file.scenes[: None if everything else 1]:
            yield prepare(file.model, scene)


def sizes(with_sources: Path, without: Path) -> tuple[int, int, int]:
    """Bytes of the archives, and of the one binary."""
    with zipfile.ZipFile(without) as archive:
        inside = [i.file_size for i in archive.infolist() if i.filename.startswith("binaries/")]
    return with_sources.stat().st_size, without.stat().st_size, inside[0]


def seconds(session: Session, plan: Plan) -> float:
    """Processor time of RUNS runs [s]."""
    begun = time.process_time()
    run_batch(session, plan, np.empty((RUNS, 0)))
    return time.process_time() - begun


def spent(two: Path, three: Path, stop_time: float) -> float:
    """Processor time of runs, of the second over the first."""
    with Session(two) as a, Session(three) as b:
        kept = ((a.outputs[0], LAST),)
        plan = Plan(vary=(), keep=kept, times=np.linspace(0.0, stop_time, 201))
        pairs = [(seconds(a, plan), seconds(b, plan)) for _ in range(PAIRS)]
    least = [min(times) for times in zip(*pairs, strict=True)]
    return least[1] / least[0]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="*")
    parser.add_argument("--sizes", action="store_true", help="no times")
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    print("| | archive | without sources | binary | time |\n| --- | ---: | ---: | ---: | ---: |")
    with tempfile.TemporaryDirectory() as out:
        for prepared in scenes(asked.models):
            made = [
                [
                    write(prepared, Path(out, f"{fmi}{s}"), face=Face(fmi), sources=s)
                    for s in (True, False)
                ]
                for fmi in (2, 3)
            ]
            row = [f"{b / a:.3f}" for a, b in zip(*(sizes(*pair) for pair in made), strict=True)]
            ratio = (
                ""
                if asked.sizes
                else f"{spent(made[0][0], made[1][0], prepared.scene.stop_time):.2f}"
            )
            print(f"| {prepared.scene.name} | {' | '.join(row)} | {ratio} |", flush=True)


if __name__ == "__main__":
    main()
