"""What does event mode give a coupling of two FMUs?

    python benchmarks/coupling.py [FIGURE.svg]

A block that rubs on a belt, and the belt's drive, coupled by the Gauss-Seidel master of tests/: the error of
the block's place against the monolith, with and without event mode, over the communication step.
"""

from __future__ import annotations

import math
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

import matplotlib as mpl
from coupled_belt import STOP, block, drive, whole
from fmi3 import Library
from master import error

import lagfmu
from lagfmu.verification.plot import STYLE, Drawn, save

STEPS = 0.016, 0.008, 0.004, 0.002, 0.001  # s
PLACES = 8


def measured() -> list[tuple[float, float]]:
    """The errors with and without event mode, of each step [m]."""
    with tempfile.TemporaryDirectory() as out:
        built = lagfmu.build_fmu(whole, Path(out), check=False)
        run = lagfmu.simulate(built, stop_time=STOP, step_size=STOP, tolerance=1e-12)
        sides = []
        for model in (drive, block):
            folder = Path(out, f"binary-{model.name}")
            path = lagfmu.build_fmu(model, Path(out), check=False, fmi=3)
            sides.append(Library(path, folder))
        truth = tuple(sides), run["x"][-1], STOP
        return [
            (
                error(*truth, h, events=True, places=PLACES),
                error(*truth, h, events=False, places=PLACES),
            )
            for h in STEPS
        ]


def draw(errors: list[tuple[float, float]], path: Path) -> None:
    """Both errors over the step."""
    with mpl.rc_context(STYLE):
        figure = Drawn(figsize=(6, 3.6), layout="constrained")
        axes = figure.add_subplot()
        met, missed = zip(*errors, strict=True)
        axes.loglog(STEPS, missed, "s-", label="without event mode: order 1")
        axes.loglog(STEPS, met, "o-", label="with event mode: order 2")
        axes.set_xlabel("communication step [s]")
        axes.set_ylabel("error of the block's place [m]")
        axes.legend()
        save(figure, path)


def main() -> None:
    """Print the table; draw it, if a file is named."""
    errors = measured()
    print(
        "| step | with event mode | order | without | order |\n| --- | ---: | ---: | ---: | ---: |"
    )
    last = None
    for h, pair in zip(STEPS, errors, strict=True):
        orders = (
            [f"{math.log2(b / a):.2f}" for a, b in zip(pair, last, strict=True)]
            if last
            else ["", ""]
        )
        cells = [
            c
            for e, o in zip(pair, orders, strict=True)
            for c in (f"{e:.1e}".replace("e-0", "e-"), o)
        ]
        print(f"| {h * 1e3:g} ms | " + " | ".join(cells) + " |")
        last = pair
    if sys.argv[1:]:
        draw(errors, Path(sys.argv[1]))


if __name__ == "__main__":
    main()
