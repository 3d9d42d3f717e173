"""How does a build grow with the model?  Chains of n links, as point masses and as bodies with hinges.

    python benchmarks/chain.py [masses|bodies] [n ...] [--instructions]

masses: L is a sum of local terms, M and G are sparse.  bodies: a chain in space whose hinges turn about x and
y by turns; bodies and joints are of a few kinds, instantiated and not derived anew.  It hangs, and gravity
pulls aside.  Both should cost O(n).
Prints for each n the processor time [s] of each stage, of masses the median of three runs, and the growth
exponent between neighbours; of bodies also what the library does (loading, initializing, a step: the least
of a few times), and how large it, its description and the memory of an instance are.  --instructions: of
bodies' libraries alone, millions of instructions of an initialization and a step, as valgrind counts them.
"""

from __future__ import annotations

import gc
import math
import os
import statistics
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does, ...
os.environ.setdefault("SYMPY_CACHE_SIZE", "50000")

from fmpy import calloc
from sensitivities import instructions
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter, Scene, derive
from lagfmu.bodies import Body, Gravity, Ground, Revolute, mechanism
from lagfmu.codegen.py.equations import source
from lagfmu.fmu.binary import instantiated
from lagfmu.fmu.compiler import chosen
from lagfmu.fmu.native import lay_out, sources_of
from lagfmu.fmu.read import read_description
from lagfmu.fmu.target import USUAL
from lagfmu.fmu.write import write
from lagfmu.mechanics.formulations import Form
from lagfmu.names import STEPS
from lagfmu.prepare import prepare as steps
from lagfmu.prepare.steps import Request
from lagfmu.verification.simulate import simulate

RUNS = 3
TRIES = 5
COUNTED = 3  # runs of a program whose instructions are counted
STEP = 0.02  # s
Stages = Iterator[str | tuple[str, float]]


def chain(n: int) -> Model:
    """n point masses, each tied to the one before it by a rod of length L; the first to the origin."""
    x = dynamicsymbols(f"x1:{n + 1}")
    y = dynamicsymbols(f"y1:{n + 1}")
    m, g, L = symbols("m g L", positive=True)
    kinetic = sum(m * (a.diff() ** 2 + b.diff() ** 2) / 2 for a, b in zip(x, y, strict=True))
    potential = sum(m * g * b for b in y)
    ends = zip([0, *x[:-1]], [0, *y[:-1]], x, y, strict=True)
    return Model(
        name=f"Chain{n}",
        lagrangian=kinetic - potential,
        coordinates=dict.fromkeys((*x, *y), "m"),
        constraints=[
            Holonomic(f"rod{k + 1}", (b - a) ** 2 + (d - c) ** 2 - L**2)
            for k, (a, c, b, d) in enumerate(ends)
        ],
        parameters=[Parameter(m, 1, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1, "m")],
        start={a: float(k + 1) for k, a in enumerate(x)},
    )


def bodies(n: int) -> Model:
    """n bodies 1 m long, each hinged on the one before, the first on the ground; they hang."""
    links = [Body(f"b{k}", mass=1.0, inertia=(0.02, 0.03, 0.01)) for k in range(n)]
    hinges, last = [], Ground().at((0, 0, 0))
    for k, link in enumerate(links):
        hinges.append(Revolute(f"J{k}", last, link.at((0, 0, 0.5)), axis="xy"[k % 2]))
        last = link.at((0, 0, -0.5))
    start = {f"b{k}.position": (0, 0, -0.5 - k) for k in range(n)}
    loads = [Gravity((2, 3, -9.0))]
    return mechanism(f"Bodies{n}", bodies=links, joints=hinges, loads=loads, start=start)


def of_masses(n: int) -> Stages:
    """The model's checks, its equations, their code."""
    model = chain(n)
    yield "model"
    eom = derive(model)
    yield "derive"
    source(Form(eom))
    yield "code"


def of_bodies(n: int) -> Stages:
    """The model with its assembly, equations, variables and Python, start and rank, C, the library; what
    fmpy takes to read the description; see `of_library`."""
    model = bodies(n)
    yield "model"
    scene = Scene(model.name, stop_time=1.0, step_size=0.1)
    derived = steps.derive(Request(model, scene))
    yield "derive"
    lowered = steps.lower(steps.reduce(steps.narrow(derived)))
    yield "lower"
    prepared = steps.examine(lowered)
    yield "start"
    made = sources_of(prepared)
    yield "generate"
    (host,) = chosen(["host"])
    library = made.compiled(model.name, [host])[host.folder]
    yield "compile"
    with tempfile.TemporaryDirectory() as folder:
        place = f"{USUAL.binaries(host)}/{model.name}{host.suffix}"
        lay_out(Path(folder), made.description, library, place)
        described = read_description(Path(folder))
        yield "read"
        yield from of_library(Path(folder), described)
    yield "library kB", len(library) / 1e3
    yield "xml kB", len(made.description) / 1e3


def of_library(folder: Path, described: Any) -> Stages:
    """To load it and make an instance, to initialize that, a step: the least processor time [s]; and what
    memory an instance asks for."""
    taken: dict[str, list[float]] = {"load": [], "initialize": [], "step": []}
    (counted_by,) = (v.valueReference for v in described.modelVariables if v.name == STEPS)
    sizes: list[int] = []

    def counted(count: int, size: int) -> Any:
        sizes.append(count * size)
        return calloc(count, size)

    for _ in range(TRIES):
        times = [time.process_time()]
        with mock.patch("fmpy.calloc", counted):
            instance = instantiated(folder, described, "chain", False)
        times.append(time.process_time())
        instance.setupExperiment(startTime=0.0)
        instance.enterInitializationMode()
        instance.exitInitializationMode()
        times.append(time.process_time())
        for k in range(TRIES):
            instance.doStep(k * STEP, STEP)
        times.append(time.process_time())
        for name, a, b in zip(taken, times, times[1:], strict=False):
            taken[name].append(b - a)
        taken["step"][-1] /= instance.getInteger([counted_by])[0]
        instance.freeInstance()
    yield from ((name, min(times)) for name, times in taken.items())
    yield "memory kB", sum(sizes) / TRIES / 1e3


def of_instructions(n: int) -> Stages:
    """Millions of those of initializing bodies' library, and of a step of the motion under way."""
    model = bodies(n)
    scene = Scene(model.name, stop_time=TRIES * STEP, step_size=STEP)
    calls = {
        "initialize": ["EnterInitializationMode", "ExitInitializationMode"],
        "step": ["DoStep"],
    }
    with tempfile.TemporaryDirectory() as folder:
        fmu = write(steps.prepare(model, scene), folder, target="native")
        taken = simulate(fmu)[STEPS][-1]
        for name, called in calls.items():
            million = instructions(fmu, ["energy.total"], scene, called) / COUNTED / 1e6
            yield name, million / (taken if name == "step" else 1)


def processor() -> float:
    """Processor time [s] of this process and of those that it waited for."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def measured(stages: Callable[[int], Stages], n: int) -> dict[str, float]:
    """Of each stage the processor time [s], that of compilers included, or what it says itself."""
    found, before = {}, processor()
    for stage in stages(n):
        name, own = (stage, None) if isinstance(stage, str) else stage
        now = processor()
        found[name], before = now - before if own is None else own, now
    return found


def main() -> None:
    """A line a size, and one with the growth exponents."""
    words = [word for word in sys.argv[1:] if not word.startswith("--")] or ["masses"]
    kind = words.pop(0) if not words[0].isdigit() else "masses"
    stages, runs = (of_masses, RUNS) if kind == "masses" else (of_bodies, 1)
    if "--instructions" in sys.argv:
        stages, runs = of_instructions, 1
    sizes = [int(word) for word in words] or [4, 16, 64]
    warnings.simplefilter("ignore")
    gc.set_threshold(100_000, 20, 20)  # ... like this
    measured(stages, 2)  # SymPy's own start-up
    before: tuple[int, list[float]] | None = None
    for n in sizes:
        taken = [measured(stages, n) for _ in range(runs)]
        medians = [statistics.median(run[name] for run in taken) for name in taken[0]]
        if before is None:
            print(f"{'n':>5} " + " ".join(f"{name:>10}" for name in taken[0]))
        print(f"{n:5d} " + " ".join(f"{x:10.4g}" for x in medians), flush=True)
        if before is not None:
            ratio = math.log(n / before[0])
            growth = [math.log(b / a) / ratio for a, b in zip(before[1], medians, strict=True)]
            print(f"{'':>5} " + " ".join(f"{e:10.2f}" for e in growth), flush=True)
        before = (n, medians)


if __name__ == "__main__":
    main()
