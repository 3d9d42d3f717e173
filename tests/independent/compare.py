"""Twenty-nine systems against integrations written by hand, in co-simulation and in model exchange.

    python tests/independent/compare.py [NAME ...]

A row a system: the largest error at its end of all that is known there, relative to the variable's size (of
a force's component: to the largest), in co-simulation at 1e-6 and 1e-10, in model exchange with fmpy's CVODE
at 1e-8, and with Runge's method at 1 ms and 0.1 ms and Euler's at 0.1 ms and 0.02 ms, which see events at the
ends of their steps alone.  `!`: other
events were counted than happen.  The exit code is 1 if co-simulation at 1e-10 is off by more than 1e-7, or
counts others.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path

import andrews
import events
import fmpy
import mechanisms
import smooth
from system import System

from lagfmu import Scene, build_fmu, simulate

sys.path.insert(0, str(Path(__file__).parents[2] / "tests"))  # the importer with fixed steps

ALLOWED = 1e-7  # of co-simulation at 1e-10
HEADINGS = ("1e-6", "1e-10", "CVODE", "RK4 1ms", "0.1ms", "Euler 0.1ms", "0.02ms")


def error_of(found: Mapping[str, float], wanted: Mapping[str, float]) -> str:
    """The largest relative error, marked where other events were counted."""
    counts = {n for n in wanted if n.endswith(".count")}
    sizes: dict[str, float] = {}
    for name, x in wanted.items():
        sizes[kind(name)] = max(sizes.get(kind(name), 1e-3), abs(x))
    worst = max(abs(found[n] - x) / sizes[kind(n)] for n, x in wanted.items() if n not in counts)
    missed = any(int(found[n]) != wanted[n] for n in counts)
    return f"{worst:.1e}{'!' if missed else ' '}"


def kind(name: str) -> str:
    """Components of vectors are compared with the largest of all."""
    first, *_, last = name.split(".")
    return first if first in ("force", "torque", "Q") and last in "xyz" else name


def row(system: System, folder: Path) -> list[str]:
    """The errors of one system."""
    stop = system.stop
    wanted = system.expected(stop)
    read = [*wanted]
    path = build_fmu(system.model, folder, Scene(system.model.name), target="native", check=False)
    cells = []
    for tolerance in (1e-6, 1e-10):
        found = simulate(path, stop, stop / 20, tolerance)
        cells.append(error_of({n: found[n][-1] for n in read}, wanted))
    found = fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=stop,
        output_interval=stop / 20,
        relative_tolerance=1e-8,
        output=read,
    )
    cells.append(error_of({n: found[n][-1] for n in read}, wanted))
    fixed = import_module("fixed_step")
    library = import_module("fmi2").Library(path, folder)
    rk4, euler = fixed.rk4, fixed.euler
    for method, h in ((rk4, 1e-3), (rk4, 1e-4), (euler, 1e-4), (euler, 2e-5)):
        ended = fixed.run(library, method, round(stop / h), stop, read)
        cells.append(error_of(ended.values, wanted))
    return cells


def main() -> int:
    """Print the table."""
    wrong = 0
    print(f"{'':22}", *(f"{h:>12}" for h in HEADINGS))
    for make in (*smooth.SYSTEMS, *events.SYSTEMS, *mechanisms.SYSTEMS, *andrews.SYSTEMS):
        if sys.argv[1:] and make.__name__ not in sys.argv[1:]:
            continue
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            cells = row(make(), Path(folder))
        print(f"{make.__name__:22}", *(f"{c:>12}" for c in cells), flush=True)
        wrong |= float(cells[1].rstrip(" !")) > ALLOWED or "!" in cells[1]
    return wrong


if __name__ == "__main__":
    sys.exit(main())
