"""How does a build grow with the model?  Chains of n links, as point masses and as bodies with hinges.

    python benchmarks/chain.py [masses|bodies] [n ...]

masses: L is a sum of local terms, M and G are sparse.  bodies: a chain in space whose hinges turn about x and
y by turns; bodies and joints are of a few kinds, instantiated and not derived anew.  Both should cost O(n).
Prints for each n the processor time [s] of each stage, of masses the median of three runs, and the growth
exponent between neighbours.
"""

from __future__ import annotations

import math
import os
import statistics
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command does

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter, Scene, derive
from lagfmu.bodies import Body, Gravity, Ground, Revolute, mechanism
from lagfmu.codegen.py.equations import source
from lagfmu.fmu.compiler import chosen
from lagfmu.fmu.native import sources_of
from lagfmu.mechanics.form import Form
from lagfmu.prepare import prepare as steps
from lagfmu.prepare.steps import Request

RUNS = 3
Stages = Iterator[str]


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
    loads = [Gravity((0, 0, -9.81))]
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
    """The model with its assembly, equations, variables and Python, start and rank, C, the library."""
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
    made.compiled(model.name, chosen(["host"]))
    yield "compile"


def measured(stages: Callable[[int], Stages], n: int) -> dict[str, float]:
    """Processor time [s] of each stage, that of compilers included."""
    found, before = {}, sum(os.times()[:4])
    for name in stages(n):
        now = sum(os.times()[:4])
        found[name], before = now - before, now
    return found


def main() -> None:
    """A line a size."""
    words = sys.argv[1:] or ["masses"]
    kind = words.pop(0) if not words[0].isdigit() else "masses"
    stages, runs = (of_masses, RUNS) if kind == "masses" else (of_bodies, 1)
    sizes = [int(word) for word in words] or [4, 16, 64]
    warnings.simplefilter("ignore")
    measured(stages, 2)  # SymPy's own start-up
    before: tuple[int, Sequence[float]] | None = None
    for n in sizes:
        taken = [measured(stages, n) for _ in range(runs)]
        medians = [statistics.median(run[name] for run in taken) for name in taken[0]]
        if before is None:
            print(
                f"{'n':>5} " + " ".join(f"{name:>9}" for name in taken[0]) + "   growth exponents"
            )
        growth = ""
        if before is not None:
            growth = "  ".join(
                f"{math.log(max(b, 0.01) / max(a, 0.01)) / math.log(n / before[0]):.2f}"
                for a, b in zip(before[1], medians, strict=True)
            )
        line = " ".join(f"{seconds:9.3f}" for seconds in medians)
        print(f"{n:5d} {line}   {growth}", flush=True)
        before = (n, medians)


if __name__ == "__main__":
    main()
