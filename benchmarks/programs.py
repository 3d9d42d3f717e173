"""What native.py runs: problems with a known lambda(t), C programs on the same model.c, our FMUs."""

from __future__ import annotations

import importlib
import math
import statistics
import subprocess
import sys
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray

import lagfmu
from lagfmu.codegen.c.equations import model_source
from lagfmu.fmu.compiler import FAST, FLAGS, find_compiler, host
from lagfmu.mechanics.equations import EquationsOfMotion
from lagfmu.mechanics.form import Form
from lagfmu.methods import NUMBERS
from lagfmu.prepare.prepare import Prepared, prepare

HERE = Path(__file__).parent
RUNTIME = Path(lagfmu.__file__).parent / "runtime"
FMI = Path(fmpy.__file__).parent / "c-code"
sys.path[:0] = [str(HERE), str(HERE.parent / "models")]

STOP, STEP = 10.0, 0.1  # [s] of a run, between samples of lambda
BUDGET = 0.02  # [s] for which a program repeats its run
SUNDIALS = (
    *("-lsundials_nvecserial", "-lsundials_sunmatrixdense", "-lsundials_sunlinsoldense"),
    *("-lsundials_sunnonlinsolfixedpoint", "-lsundials_generic"),
)
GCC = ("gcc",)


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


# ------------------------------------------------------------------------------ problems


@dataclass(frozen=True)
class Problem:
    """A model, lambda at the samples (samples, m), and the folder of its programs."""

    path: Path
    prepared: Prepared
    exact: NDArray[Any]
    folder: Path
    model: list[Path]  # model.c, problem.c

    @property
    def m(self) -> int:
        """Number of constraints."""
        return self.prepared.system.m

    @property
    def multipliers(self) -> list[str]:
        """Names of the outputs lambda, in the order of the rows."""
        return [f"lambda.{row.name}" for row in self.prepared.system.rows]


def problem_of(name: str, out: Path) -> Problem:
    """The pendulum of models/ or the four-bar linkage, as 'pendulum' or 'four-bar'."""
    t = STEP * np.arange(1, round(STOP / STEP) + 1)
    if name == "pendulum":
        path, scene = HERE.parent / "models" / "pendulum.py", "PendulumCartesian"
        exact = importlib.import_module("accuracy").exact(t)[:, None]
    else:
        path, scene = HERE / "four_bar.py", "FourBar"
        exact = importlib.import_module("four_bar").exact(t)
    module = importlib.import_module(path.stem)
    prepared = prepare(module.model, next(s for s in module.scenes if s.name == scene))
    folder = out / name
    return Problem(path, prepared, exact, folder, write_problem(folder, prepared.equations))


def write_problem(folder: Path, equations: EquationsOfMotion) -> list[Path]:
    """model.c, and problem.c with the start values."""
    folder.mkdir(parents=True, exist_ok=True)
    model = equations.model
    arrays = {
        "Q": start_values(equations)[: equations.nq],
        "V": start_values(equations)[equations.nq :],
        "P": [float(p.value) for p in model.parameters],
        "SCALE": [1.0] * (2 * equations.nq),
    }
    lines = [
        f"const double PROBLEM_{name}[] = {{{', '.join(map(repr, values))}}};\n"
        for name, values in arrays.items()
    ]
    (folder / "model.c").write_text(model_source(Form(equations)))
    (folder / "problem.c").write_text('#include "problem.h"\n\n' + "".join(lines))
    return [folder / "model.c", folder / "problem.c"]


def start_values(equations: EquationsOfMotion) -> list[float]:
    """q and v at the start; 0 where the model says nothing."""
    model = equations.model
    symbols = [*model.coordinates, *(c.diff() for c in model.coordinates)]
    return [float(model.start.get(s, 0.0)) for s in symbols]


# ------------------------------------------------------------------------------ programs


def native(*names: str) -> list[Path]:
    """Files of benchmarks/native."""
    return [HERE / "native" / name for name in names]


def fmu_compiler() -> tuple[str, ...]:
    """The command that compiles an FMU for this machine."""
    found = find_compiler()
    if found is None:
        raise SystemExit("no C compiler was found")
    return (*found.command, *(("-target", host().targets[0]) if found.cross else ()))


@cache
def solver(out: Path, command: tuple[str, ...] = GCC) -> Path:
    """The runtime without its FMI layer, as an archive in `out`."""
    objects = out / ("runtime_gcc" if command == GCC else "runtime_fmu")
    objects.mkdir(parents=True, exist_ok=True)
    archive = objects / "runtime.a"
    archive.unlink(missing_ok=True)
    made = [
        compiled(objects / f"{p.stem}.o", [p], "-c", command=command)
        for p in sorted(RUNTIME.glob("*/*.c"))
        if p.parent.name != "fmi"
    ]
    subprocess.run(["ar", "rcs", str(archive), *map(str, made)], check=True, timeout=60)
    return archive


def algebra(name: str, out: Path) -> list[Path]:
    """The index-1 equations: 'dense' by hand, 'runtime' by our linear.c."""
    own = native("equations.c", f"equations_{name}.c", "stopwatch.c")
    return own + ([solver(out)] if name == "runtime" else [])


def compiled(
    target: Path, sources: Sequence[Path], *options: str, command: tuple[str, ...] = GCC
) -> Path:
    """One program of C files, for this machine."""
    target.parent.mkdir(parents=True, exist_ok=True)
    include = (
        f"-I{HERE / 'native'}",
        *(f"-I{folder}" for folder in sorted(RUNTIME.iterdir())),
        "-isystem",
        str(FMI),
    )
    words = [*command, *FLAGS, FAST, *include, "-o", str(target), *map(str, sources), *options]
    libraries = [] if "-c" in options else ["-lm"]
    subprocess.run([*words, *libraries], check=True, timeout=600)
    return target


def peer(problem: Problem, name: str, linear: str) -> Path:
    """'cvode' or 'ida' on the problem's model.c."""
    sources = [
        *native(f"sundials_{name}.c"),
        *problem.model,
        *algebra(linear, problem.folder.parent),
    ]
    target = problem.folder / f"{name}_{linear}"
    return compiled(target, sources, f"-lsundials_{name}", *SUNDIALS)


def core(folder: Path, model: Sequence[Path]) -> Path:
    """Our solver without the FMI layer, by the compiler that makes the FMUs."""
    own = fmu_compiler()
    sources = [*native("core.c", "stopwatch.c"), *model, solver(folder.parent, own)]
    return compiled(folder / "core", sources, command=own)


def launch(command: Sequence[Any], m: int) -> tuple[int, float, NDArray[Any]] | None:
    """Steps, ns of one run, lambda (samples, m); None if the program gave up."""
    words = [str(c) for c in command]
    done = subprocess.run(words, capture_output=True, text=True, timeout=600)
    if done.returncode != 0:
        return None
    first, *rest = done.stdout.splitlines()
    lam = np.array([[float(x) for x in line.split()] for line in rest]).reshape(-1, m)
    return int(first.split()[0]), float(first.split()[2]), lam


def evaluations(command: Sequence[Any]) -> int:
    """Of the equations, as a program counts them."""
    words = [str(c) for c in command]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=600)
    return int(done.stdout.split()[1])


def numbers(command: Sequence[Any]) -> list[float]:
    """The numbers on the line that a program prints."""
    words = [str(c) for c in command]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=600)
    return [float(x) for x in done.stdout.split()]


# ------------------------------------------------------------------------------ our FMUs


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


def built(problem: Problem, target: str) -> Path:
    """The problem's FMU of one target, for this machine."""
    options = ["--platforms", "host"] if target == "native" else []
    build(problem.path, problem.folder, target, "--scene", problem.prepared.scene.name, *options)
    return problem.folder / target / f"{problem.prepared.scene.name}.fmu"


def build(path: Path, out: Path, target: str, *options: str) -> None:
    """`lagfmu build` of a model file into a folder."""
    words = [sys.executable, "-m", "lagfmu", "build", str(path), "--out", str(out), "--no-check"]
    command = [*words, "--target", target, *options]
    subprocess.run(command, check=True, timeout=600, stdout=subprocess.DEVNULL)


def native_fmu(problem: Problem) -> Ours:
    """The problem's native FMU, unpacked."""
    return unpacked(built(problem, "native"), problem.folder)


def unpacked(fmu: Path, out: Path) -> Ours:
    """A native FMU in a folder beside it; the host in `out`."""
    folder = fmu.with_suffix("")
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    description = fmpy.read_model_description(str(folder), validate=False)
    return Ours(
        compiled(out / "host", native("host.c", "stopwatch.c"), "-ldl"),
        folder / "binaries" / "linux64" / f"{description.coSimulation.modelIdentifier}.so",
        description.guid,
        (folder / "resources").as_uri(),
        {v.name: v.valueReference for v in description.modelVariables},
    )
