"""What does a scene save that asks for less?  The full FMU against pruned ones, both targets.

    python benchmarks/scenes.py [REPEATS]

Of three models: everything; lambda alone; coordinates alone; and the same two with every parameter a
number.  Prints operations of the right-hand side, bytes (generated Python and C, the binary of this
machine, the FMU), and the wall time per simulated second through fmpy with one fmi2GetReal of all outputs a
communication step, without fmpy's own share (measured on a C function that returns at once).  All run
with dop853; runs are interleaved, medians shown, and below each the quartiles' distance.
"""

from __future__ import annotations

import ctypes
import statistics
import sys
import tempfile
import zipfile
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from lagfmu.fmu.session import Session
from lagfmu.fmu.target import TARGETS
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.page.savings import NATIVE, OPERATIONS, PYTHON, Cost, cost
from lagfmu.prepare.prepare import prepare
from lagfmu.studio.tradeoff.observe import opened, seconds
from lagfmu.studio.tradeoff.setting import Setting

MODELS = Path(__file__).parent.parent / "models"
FMUS = {"PendulumCartesian": "pendulum", "Hemisphere": "hemisphere", "Chain": "chain"}
REPEATS = 15


@dataclass
class Entry:
    """One FMU: what it costs, and the times [s] that were measured."""

    model: str
    scene: str
    cost: Cost
    sessions: dict[str, Session]
    binary: int
    sizes: dict[str, int]
    outputs: list[str]
    times: dict[str, list[float]]
    floors: dict[str, list[float]]


def main() -> None:
    """Build, measure in turns, print."""
    repeats = int(sys.argv[1]) if sys.argv[1:] else REPEATS
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="lagfmu_")))
        entries = [e for name in FMUS for e in built(name, folder, stack)]
        for _ in range(repeats):
            for entry in entries:
                for target, session in entry.sessions.items():
                    setting = Setting("", 0.0, 0.0, session.experiment.step_size)
                    read = [n for n in entry.outputs if n in session.rules]  # some are native alone
                    entry.times[target].append(seconds(session, setting, read))
                    entry.floors[target].append(floor(session, read))
        show(entries)


def built(name: str, folder: Path, stack: ExitStack) -> list[Entry]:
    """The FMUs of one model."""
    file = load(MODELS / f"{FMUS[name]}.py")
    whole = replace(next(s for s in file.scenes if s.name == name), method="dop853")
    places = [str(q.func) for q in file.model.coordinates]
    scenes = {
        "everything": whole,
        "lambda": replace(whole, outputs=["lambda.*"]),
        "lambda, numbers": replace(whole, outputs=["lambda.*"], fixed=["*"]),
        "coordinates": replace(whole, outputs=places),
        "coordinates, numbers": replace(whole, outputs=places, fixed=["*"]),
    }
    found = []
    for k, (title, scene) in enumerate(scenes.items()):
        prepared = prepare(file.model, scene)
        paths = {t: write(prepared, folder / str(k) / t, target=t) for t in TARGETS}
        with zipfile.ZipFile(paths["native"]) as archive:
            (binary,) = (i.file_size for i in archive.infolist() if "binaries/" in i.filename)
        found.append(
            Entry(
                model=name,
                scene=title,
                cost=cost(prepared),
                sessions={t: stack.enter_context(opened(p)) for t, p in paths.items()},
                binary=binary,
                sizes={t: p.stat().st_size for t, p in paths.items()},
                outputs=[v.name for v in prepared.table.outputs if v.kind == "Real"],
                times={t: [] for t in TARGETS},
                floors={t: [] for t in TARGETS},
            )
        )
    return found


def show(entries: list[Entry]) -> None:
    """The table."""
    table = Table(box=SIMPLE_HEAD)
    for head in ("FMU", "scene"):
        table.add_column(head)
    for head in (
        "operations",
        "Python",
        "C",
        "binary",
        "FMU native",
        "python",
        "µs/s",
        "native",
        "µs/s",
    ):
        table.add_column(head, justify="right")
    before = ""
    for e in entries:
        if e.model != before:
            table.add_section()
            whole, before = e, e.model
        row = [e.model if e is whole else "", e.scene, str(e.cost[OPERATIONS])]
        row += [str(e.cost[PYTHON]), str(e.cost[NATIVE])]
        row += [
            f"{e.binary / 1e3:.1f}",
            f"{e.sizes['native'] / 1e3:.0f}",
            f"{e.sizes['python'] / 1e3:.0f}",
        ]
        simulated = e.sessions["native"].experiment.stop_time
        own = {t: net(e, t) for t in TARGETS}
        full = {t: net(whole, t) for t in TARGETS}
        row.append(f"{1e6 * own['python'] / simulated:.0f} ({own['python'] / full['python']:.2f})")
        row.append("")
        row.append(f"{1e6 * own['native'] / simulated:.1f} ({own['native'] / full['native']:.2f})")
        table.add_row(*row)
    Console(width=160).print(table)


def floor(session: Session, names: list[str]) -> float:
    """Wall time [s] of the same loop with a C function that returns at once: fmpy's own share."""
    slave = session.instance
    unsigned, size = ctypes.c_uint, ctypes.c_size_t
    pointer, real = ctypes.c_void_p, ctypes.c_double
    step, get = slave.dll["fmi2GetTypesPlatform"], slave.dll["fmi2GetTypesPlatform"]
    step.restype = get.restype = None  # a constant text; further arguments are not read
    step.argtypes = [pointer, real, real, ctypes.c_int]
    get.argtypes = [pointer, ctypes.POINTER(unsigned), size, ctypes.POINTER(real)]
    slave.fmi2DoStep, slave.fmi2GetReal = step, get
    try:
        return seconds(session, Setting("", 0.0, 0.0, session.experiment.step_size), names)
    finally:
        del slave.fmi2DoStep, slave.fmi2GetReal


def net(entry: Entry, target: str) -> float:
    """Median wall time [s] of a run without fmpy's own share."""
    return statistics.median(entry.times[target]) - statistics.median(entry.floors[target])


if __name__ == "__main__":
    main()
