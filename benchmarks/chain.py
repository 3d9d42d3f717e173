"""How does derivation grow with the model?  A chain of n links in absolute coordinates.

    python benchmarks/chain.py [n ...]

L is a sum of local terms, M and G are sparse, so that derivation and code should cost O(n).  Prints
the median of three for each n and the growth exponent between neighbours.
"""

from __future__ import annotations

import math
import statistics
import sys
import time
from itertools import pairwise

from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter, derive
from lagfmu.codegen.py.equations import source

RUNS = 3


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


def main() -> None:
    """Measure model checks, derivation and code generation."""
    sizes = [int(a) for a in sys.argv[1:]] or [4, 16, 64]
    derive(chain(2))  # SymPy's own start-up
    print(f"{'n':>5} {'model s':>9} {'derive s':>9} {'code s':>9}   growth exponent of each")
    before: tuple[int, list[float]] | None = None
    for n in sizes:
        runs = []
        for _ in range(RUNS):
            moments = [time.perf_counter()]
            model = chain(n)
            moments.append(time.perf_counter())
            eom = derive(model)
            moments.append(time.perf_counter())
            source(eom, None, "multipliers")
            moments.append(time.perf_counter())
            runs.append([b - a for a, b in pairwise(moments)])
        medians = [statistics.median(column) for column in zip(*runs, strict=True)]
        growth = ""
        if before is not None:
            growth = "  ".join(
                f"{math.log(b / a) / math.log(n / before[0]):.2f}"
                for a, b in zip(before[1], medians, strict=True)
            )
        print(f"{n:5d} " + " ".join(f"{s:9.3f}" for s in medians) + f"   {growth}")
        before = (n, medians)


if __name__ == "__main__":
    main()
