"""What native FMUs cost and weigh, against another checkout of lagfmu.

    python benchmarks/native_versions.py OTHER [ROUNDS]

Both build the same scenes of models without friction (each from its own models/); the FMUs then run in this
process in turn, so that what else the machine does falls on both alike.  Prints, ours over theirs, the
median over the rounds of the ratio of processor time of the steps, with its quartiles, ours over ours (what
is noise), the files' sizes and the binaries'.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave

SCENES = {  # file: scene, what is read, stop [s]
    "pendulum": ("PendulumCartesian", "lambda.rod", 20.0),
    "hemisphere": ("Hemisphere", "lambda.surface", 2.0),
    "chain": ("Chain", "lambda.link1", 2.0),
}
STEP, ROUNDS, REPEATS = 0.1, 41, 20
BUILD = """
import sys
from pathlib import Path
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare
from lagfmu.fmu.write import write
for file, name in zip(sys.argv[2::2], sys.argv[3::2]):
    loaded = load(Path("models", file + ".py"))
    scene = next(s for s in loaded.scenes if s.name == name)
    write(prepare(loaded.model, scene), Path(sys.argv[1]), (), target="native")
"""


def build(tree: Path, folder: Path) -> None:
    words = [w for file, (scene, *_) in SCENES.items() for w in (file, scene)]
    subprocess.run(
        [sys.executable, "-c", BUILD, str(folder), *words],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree)},
        check=True,
    )


class Run:
    """An instance that is run again and again."""

    def __init__(self, path: Path, read: str, stop: float) -> None:
        description = fmpy.read_model_description(str(path))
        self.at = [v.valueReference for v in description.modelVariables if v.name == read]
        self.points = round(stop / STEP)
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.fmu.instantiate()

    def seconds(self) -> float:
        spent = 0.0
        for _ in range(REPEATS):
            self.fmu.setupExperiment(tolerance=1e-8)
            self.fmu.enterInitializationMode()
            self.fmu.exitInitializationMode()
            begun = time.process_time()
            for j in range(self.points):
                self.fmu.doStep(j * STEP, STEP)
                self.fmu.getReal(self.at)
            spent += time.process_time() - begun
            self.fmu.reset()
        return spent


def weigh(path: Path) -> tuple[int, int]:
    """Bytes of the archive, and of the binary in it."""
    with zipfile.ZipFile(path) as archive:
        return path.stat().st_size, max(
            i.file_size for i in archive.infolist() if i.filename.startswith("binaries/")
        )


def main() -> None:
    other = Path(sys.argv[1]).resolve()
    rounds = int(sys.argv[2]) if len(sys.argv) > 2 else ROUNDS
    with tempfile.TemporaryDirectory() as temporary:
        mine, theirs = Path(temporary, "mine"), Path(temporary, "theirs")
        build(Path(__file__).resolve().parent.parent, mine)
        build(other, theirs)
        for scene, read, stop in SCENES.values():
            found = [next(folder.rglob(f"{scene}.fmu")) for folder in (mine, theirs)]
            runs = [Run(path, read, stop) for path in (*found, found[0])]
            times = [[run.seconds() for run in runs] for _ in range(rounds)]
            ratio = statistics.quantiles([a / b for a, b, _ in times])
            noise = statistics.quantiles([a / b for a, _, b in times])
            (whole, binary), (whole_then, binary_then) = map(weigh, found)
            print(
                f"{scene}: time {ratio[1]:.3f} ({ratio[0]:.3f} to {ratio[2]:.3f}), ours over ours "
                f"{noise[1]:.3f} ({noise[0]:.3f} to {noise[2]:.3f}); archive {whole / 1e3:.1f} kB over "
                f"{whole_then / 1e3:.1f} kB, binary {binary / 1e3:.1f} over {binary_then / 1e3:.1f}"
            )


if __name__ == "__main__":
    main()
