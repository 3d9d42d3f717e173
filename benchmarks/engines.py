"""Two engines that share nothing: how far do their multipliers differ, and which one is off?

    python benchmarks/engines.py [MODEL.py ...]

Every scene of models/ and of benchmarks/unseen/ that the python target can be built for is run by both FMUs
at the tolerances 1e-6 and 1e-10.  A difference is the largest over all constraints and communication
points, relative to the largest |lambda| of that constraint; where the contacts of the two stand otherwise
at a point (an event between its time in the one and in the other) it is left out and counted.  Beside it
each engine's distance from its own run at 1e-13, which says whose error the difference is; and that of the
two finest runs.
"""

from __future__ import annotations

import sys
import tempfile
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from lagfmu import names
from lagfmu.errors import LagfmuError
from lagfmu.fmu.python import refusals
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare
from lagfmu.verification.simulate import simulate

ROOT = Path(__file__).parent.parent
TOLERANCES = (1e-6, 1e-10)
FINEST = 1e-13
TARGETS = ("python", "native")


def main() -> None:
    """Build, run, print a row a scene and tolerance."""
    chosen = [Path(a) for a in sys.argv[1:]]
    files = chosen or sorted([*ROOT.glob("models/*.py"), *ROOT.glob("benchmarks/unseen/*.py")])
    table = Table(box=SIMPLE_HEAD)
    heads = (
        "scene",
        "tolerance",
        "difference",
        "python",
        "native",
        "finest",
        "left out",
        "events",
        "CPU",
    )
    for head in heads:
        table.add_column(head, justify="left" if head == "scene" else "right")
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in files:
            for row in rows(path, Path(folder)):
                table.add_row(*row)
                print(*row, flush=True)
    Console(width=140).print(table)


def rows(path: Path, folder: Path) -> Iterator[tuple[str, ...]]:
    """The rows of one model file."""
    file = load(path)
    for scene in file.scenes:
        prepared = prepare(file.model, scene)
        if reasons := refusals(prepared):
            yield (scene.name, f"native alone: {'; '.join(reasons)}")
            continue
        fmus = {t: write(prepared, folder / t, target=t) for t in TARGETS}
        best = {t: run(fmus[t], FINEST) for t in TARGETS}
        for tolerance in TOLERANCES:
            spent, found = {}, {}
            for t in TARGETS:
                begun = time.process_time()
                found[t] = run(fmus[t], tolerance)
                spent[t] = time.process_time() - begun
            if failed := [f"{t}: {x}" for t, x in found.items() if isinstance(x, str)]:
                yield scene.name, f"{tolerance:.0e}", *failed
                continue
            apart, left = difference(found["python"], found["native"])
            own = [difference(found[t], best[t])[0] for t in TARGETS]
            floor, _ = difference(best["python"], best["native"])
            counts = [events(found[t]) for t in TARGETS]
            yield (
                scene.name,
                f"{tolerance:.0e}",
                *(f"{x:.1e}" for x in (apart, *own, floor)),
                str(left),
                str(counts[0]) if counts[0] == counts[1] else f"{counts[0]} != {counts[1]}",
                f"{spent['python']:.1f} s",
            )


def run(fmu: Path, tolerance: float) -> np.ndarray | str:
    """The outputs; or why there are none."""
    try:
        return np.asarray(simulate(fmu, tolerance=tolerance))
    except LagfmuError as error:
        return str(error)


def difference(a: np.ndarray | str, b: np.ndarray | str) -> tuple[float, int]:
    """Of lambda, relative; and the points that are left out."""
    if isinstance(a, str) or isinstance(b, str):
        return float("nan"), 0
    known = a.dtype.names or ()
    same = np.ones(len(a), dtype=bool)
    for name in names.those(known, names.CONTACT):
        same &= a[name] == b[name]
    worst = 0.0
    for name in names.those(known, names.MULTIPLIER) or names.coordinates(known):
        size = np.abs(b[name]).max() or 1.0
        worst = max(worst, float(np.abs(a[name] - b[name])[same].max()) / size)
    return worst, int((~same).sum())


def events(a: np.ndarray) -> int:
    """Departures and closings of a run."""
    counts = names.those(a.dtype.names or (), names.DEPARTURES, names.CLOSINGS)
    return sum(int(a[name][-1]) for name in counts)


if __name__ == "__main__":
    main()
