"""What does FMI 3.0 cost beside FMI 2.0?

    python benchmarks/fmi_versions.py [MODEL ...]

A row a model of models/: FMI 3.0 over FMI 2.0 in bytes of the archive, in bytes of the binary, and in
processor time of runs in one call of the library (lagfmu_batch), each the least of 21 in turns.
"""

from __future__ import annotations

import sys
import tempfile
import time
import zipfile
from pathlib import Path

import numpy as np

from lagfmu.fmu.batch import LAST, Plan, run_batch
from lagfmu.fmu.face import Face
from lagfmu.fmu.session import Session
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare

MODELS = Path(__file__).parent.parent / "models"
KINDS = ("pendulum", "hemisphere", "cart_pendulum", "chain", "slider_crank_bodies")
PAIRS, RUNS = 21, 40


def sizes(path: Path) -> tuple[int, int]:
    """Bytes of the archive, and of its one binary."""
    with zipfile.ZipFile(path) as archive:
        inside = [i.file_size for i in archive.infolist() if i.filename.startswith("binaries/")]
    return path.stat().st_size, inside[0]


def seconds(session: Session, plan: Plan) -> float:
    """Processor time of RUNS runs [s]."""
    begun = time.process_time()
    run_batch(session, plan, np.empty((RUNS, 0)))
    return time.process_time() - begun


def main() -> None:
    """Print the table."""
    print("| | archive | binary | time |\n| --- | ---: | ---: | ---: |")
    with tempfile.TemporaryDirectory() as out:
        for name in sys.argv[1:] or KINDS:
            file = load(MODELS / f"{name}.py")
            scene = file.scenes[0]
            prepared = prepare(file.model, scene)
            made = [
                write(prepared, Path(out, str(fmi)), target="native", face=Face(fmi))
                for fmi in (2, 3)
            ]
            archive, binary = (b / a for a, b in zip(*map(sizes, made), strict=True))
            with Session(made[0]) as two, Session(made[1]) as three:
                kept = ((two.outputs[0], LAST),)
                times = np.linspace(0.0, scene.stop_time, 201)
                plan = Plan(vary=(), keep=kept, times=times)
                pairs = [(seconds(two, plan), seconds(three, plan)) for _ in range(PAIRS)]
            least = [min(times) for times in zip(*pairs, strict=True)]
            spent = least[1] / least[0]
            print(f"| {scene.name} | {archive:.3f} | {binary:.3f} | {spent:.2f} |", flush=True)


if __name__ == "__main__":
    main()
