"""What do redundant rows cost? Mechanisms whose hinges hold too much, and the same motion with as few rows.

    python benchmarks/redundant.py [--instructions] [NAME ...]

In place of the third hinge of a loop stands a universal joint and in place of the fourth a ball; of a door's
two hinges one is left.  The motion is the same, and so are the forces that are determined.  Native FMUs:
rows, internal steps, and processor time of a run of 20 s a step (the least of repetitions in turns) at 1e-8;
the last column is that with redundant rows in that without.  --instructions: in place of the time thousands
of instructions of doStep a step, as valgrind counts them.
"""

from __future__ import annotations

import dataclasses
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

from lagfmu import Scene, build_fmu
from lagfmu.fmu.session import Session

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "independent"))
from joints import across
from linkage import Linkage, Tie
from mechanisms import bennett, door, four_bar
from sensitivities import instructions

STOP, POINTS, TOLERANCE, REPEATS, RUNS = 20.0, 20, 1e-8, 9, 3


def reduced(full: Linkage) -> Linkage:
    """With as many rows as are independent."""
    ties: dict[str, Tie] = dict(full.ties)
    *_, third, fourth = ties
    if len(ties) == 2:
        del ties[fourth]
    else:
        axis = tuple(across(ties[third].axis)[0])
        ties[third] = dataclasses.replace(ties[third], kind="universal", second_axis=axis)
        ties[fourth] = dataclasses.replace(ties[fourth], kind="ball", axis=())
    return dataclasses.replace(full, name=f"{full.name}Reduced", ties=ties)


def main() -> None:
    """The table."""
    chosen = [name for name in sys.argv[1:] if not name.startswith("--")]
    counted = "--instructions" in sys.argv
    each_step = "thousand instructions" if counted else "us"
    print(f"| | rows | steps | {each_step} a step | rows | steps | {each_step} a step | ratio |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    times = np.linspace(0, STOP, POINTS + 1)
    for make in (door, four_bar, bennett):
        if chosen and make.__name__ not in chosen:
            continue
        with tempfile.TemporaryDirectory() as out, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            sessions, least, cells, counts = [], [np.inf, np.inf], [], []
            for linkage in (make(), reduced(make())):
                model = linkage.model()
                scene = Scene(model.name, stop_time=STOP, step_size=STOP / POINTS)
                fmu = build_fmu(model, out, scene, target="native", check=False)
                sessions.append(Session(fmu))
                if counted:
                    counts.append(instructions(fmu, ["energy.total"], scene, ["DoStep"]) / RUNS)
            read = ["solver.steps"]
            steps = [0.0, 0.0]
            for _ in range(1 if counted else REPEATS):
                for k, session in enumerate(sessions):
                    begun = time.process_time()
                    run = session.run(times, tolerance=TOLERANCE, read=read)
                    least[k] = min(least[k], time.process_time() - begun)
                    assert run.refusal is None, run.refusal
                    steps[k] = float(run.rows["solver.steps"][-1])
            whole = [x / 1e3 for x in counts] if counted else [1e6 * x for x in least]
            each = [x / n for x, n in zip(whole, steps, strict=True)]
            for linkage, n, us in zip((make(), reduced(make())), steps, each, strict=True):
                mechanism, y = linkage.reference()
                rows, rank = mechanism.rank(y)
                cells.append(f"{rows} ({rank} count) | {n:.0f} | {us:.1f}")
            print(
                f"| {make.__name__} | {' | '.join(cells)} | {each[0] / each[1]:.2f} |", flush=True
            )
            for session in sessions:
                session.close()


if __name__ == "__main__":
    main()
