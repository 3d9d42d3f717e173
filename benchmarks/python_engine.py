"""What the python engine costs a communication step, against another checkout of lagfmu.

    python benchmarks/python_engine.py [OTHER]

Each checkout runs in a process of its own and the two take turns, so that what else the machine does falls
on both alike; the figure is the median over the rounds of CPU time a communication step, in microseconds.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
from pathlib import Path

MODELS = {"pendulum": ("PendulumCartesian", 2.0), "hemisphere": ("Hemisphere", 1.0)}
MODELS |= {"chain": ("Chain", 1.0)}
ROUNDS = 7
RUN = """
import json, sys, time
from pathlib import Path
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare
from lagfmu.verification.simulate import simulate
runs = []
for file, (name, stop) in json.loads(sys.argv[1]).items():
    loaded = load(Path("models", file + ".py"))
    ready = prepare(loaded.model, next(s for s in loaded.scenes if s.name == name))
    simulate(ready, stop / 10)
    runs.append((ready, stop))
print(flush=True)
for _ in sys.stdin:
    spent = []
    for ready, stop in runs:
        begun = time.process_time()
        points = len(simulate(ready, stop)["time"]) - 1
        spent.append((time.process_time() - begun) / points)
    print(json.dumps(spent), flush=True)
"""


def begin(tree: Path) -> subprocess.Popen[str]:
    """A process that runs every model once for each line that it reads."""
    one = {"PYTHONPATH": str(tree), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    process = subprocess.Popen(
        [sys.executable, "-c", RUN, json.dumps(MODELS)],
        cwd=tree,
        env={**os.environ, **one},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.readline()
    return process


def turn(process: subprocess.Popen[str]) -> list[float]:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write("\n")
    process.stdin.flush()
    return [float(x) for x in json.loads(process.stdout.readline())]


def main() -> None:
    trees = [Path(__file__).parent.parent, *map(Path, sys.argv[1:2])]
    processes = [begin(tree) for tree in trees]
    rounds = [[turn(process) for process in processes] for _ in range(ROUNDS)]
    for process in processes:
        process.communicate()
    for k, (name, _) in enumerate(MODELS.values()):
        spent = [statistics.median(r[i][k] for r in rounds) for i in range(len(trees))]
        text = "  ".join(f"{1e6 * s:7.0f} us" for s in spent)
        ratio = statistics.median(r[-1][k] / r[0][k] for r in rounds)
        print(f"{name:20}{text}" + (f"   {ratio:.2f} times" if len(trees) > 1 else ""))


if __name__ == "__main__":
    main()
