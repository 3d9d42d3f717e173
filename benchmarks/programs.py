"""Native FMUs in a C host (native/host.c): what a run costs, and its error at each tolerance."""

from __future__ import annotations

import math
import statistics
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

from lagfmu.fmu.compiler import FAST, FLAGS
from lagfmu.methods import NUMBERS

HERE = Path(__file__).parent
FMI = Path(fmpy.__file__).parent / "c-code"
sys.path[:0] = [str(HERE), str(HERE.parent / "models")]

STOP, STEP = 10.0, 0.1  # [s] of a run, between samples of lambda
BUDGET = 0.02  # [s] for which a program repeats its run


@dataclass
class Curve:
    """One program: error, costs [us a simulated second] and steps at each tolerance."""

    label: str
    errors: dict[float, float] = field(default_factory=dict)
    costs: dict[float, list[float]] = field(default_factory=dict)
    steps: dict[float, int] = field(default_factory=dict)

    def add(
        self, tolerance: float, lam: NDArray[Any], exact: NDArray[Any], us: float, n: int
    ) -> None:
        """One more run."""
        error = float(np.abs(lam - exact).max() / np.abs(exact).max())
        self.errors[tolerance] = error if math.isfinite(error) else math.inf
        self.costs.setdefault(tolerance, []).append(us)
        self.steps[tolerance] = n

    @property
    def total(self) -> float:
        """Cost of all tolerances."""
        return sum(statistics.median(c) for c in self.costs.values())

    def at(self, error: float) -> float:
        """Cost at an error, interpolated along the front of what is cheapest; nan: not reached."""
        points = sorted((self.errors[k], statistics.median(c)) for k, c in self.costs.items())
        front: list[tuple[float, float]] = []
        for e, cost in points:
            if not front or cost < front[-1][1]:
                front.append((e, cost))
        if not front or front[0][0] > error:
            return math.nan
        for (e, a), (f, b) in pairwise(front):
            if e <= error < f:
                s = math.log(error / e) / math.log(f / e)
                return a ** (1 - s) * b**s
        return front[-1][1]


def compiled(target: Path, *sources: str) -> Path:
    """A program of files of benchmarks/native, for this machine."""
    target.parent.mkdir(parents=True, exist_ok=True)
    files = [str(HERE / "native" / name) for name in sources]
    words = ["gcc", *FLAGS, FAST, "-isystem", str(FMI), "-o", str(target), *files, "-ldl", "-lm"]
    subprocess.run(words, check=True, timeout=600)
    return target


def launch(command: Sequence[Any], m: int) -> tuple[int, float, NDArray[Any]] | None:
    """Steps, ns of one run, lambda (samples, m); None if the program gave up."""
    words = [str(c) for c in command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600)
    if done.returncode != 0:
        return None
    first, *rest = done.stdout.splitlines()
    lam = np.array([[float(x) for x in line.split()] for line in rest]).reshape(-1, m)
    return int(first.split()[0]), float(first.split()[2]), lam


@dataclass(frozen=True)
class Ours:
    """The binary of an FMU for this machine, and what host.c must be told of it."""

    host: Path
    library: Path
    guid: str
    resources: str
    references: dict[str, int]

    def command(
        self,
        tolerance: float,
        communication: float,
        outputs: Iterable[str],
        method: str = "",
        step: float = STEP,
        mode: str = "run",
        stop: float = STOP,
    ) -> list[Any]:
        """The command line of host.c."""
        chosen = f"{self.references['solver.method']}={NUMBERS[method]}" if method else "-"
        return [
            *(self.host, mode, self.library, self.guid, self.resources, tolerance, stop, step),
            *(BUDGET, communication, self.references["solver.steps"], chosen),
            *(self.references[name] for name in outputs),
        ]


def unpacked(fmu: Path, out: Path) -> Ours:
    """A native FMU in a folder beside it; the host in `out`."""
    folder = fmu.with_suffix("")
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    description = fmpy.read_model_description(str(folder), validate=False)
    return Ours(
        compiled(out / "host", "host.c", "stopwatch.c"),
        folder / "binaries" / "linux64" / f"{description.coSimulation.modelIdentifier}.so",
        description.guid,
        (folder / "resources").as_uri(),
        {v.name: v.valueReference for v in description.modelVariables},
    )
