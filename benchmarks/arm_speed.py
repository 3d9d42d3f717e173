"""What the six-axis arm of models/arm.py costs: to build, to carry, and to evaluate.

    python benchmarks/arm_speed.py

Processor time of one build by the commands that a user gives (Python's start included, the runtime's objects
in the cache), the size of the FMU with and without sources, and one evaluation of all accelerations and
multipliers in C: the median of 1e5 along the motion, with the flags of an FMU's equations.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from programs import algebra, compiled, native, numbers, write_problem

from lagfmu import simulate
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare

ARM = Path(__file__).parent.parent / "models" / "arm.py"
POINTS = 501


def processor() -> str:
    """The machine's name for it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="ascii").splitlines()
    except OSError:
        lines = []
    known = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return known[0] if known else platform.processor() or platform.machine()


def build(out: Path, *options: str) -> tuple[float, int]:
    """Processor time [s] and bytes of one FMU."""
    command = [sys.executable, "-m", "lagfmu", "build", "--no-check", *options]
    before = os.times()
    done = subprocess.run([*command, "--out", str(out), str(ARM)], capture_output=True, check=True)
    after = os.times()
    assert done.returncode == 0
    seconds = after.children_user + after.children_system
    seconds -= before.children_user + before.children_system
    return seconds, sum(path.stat().st_size for path in out.rglob("*.fmu"))


def evaluation(out: Path) -> list[float]:
    """Median ns of a motion, and of the equations' terms alone."""
    file = load(ARM)
    prepared = prepare(file.model, file.scenes[0])
    eom = prepared.equations
    run = simulate(file.model, stop_time=3.0, step_size=3.0 / (POINTS - 1))
    names = ["time", *(str(s) for s in (*eom.q, *eom.v))]
    states = np.array([[row[name] for name in names] for row in run])
    states.tofile(out / "states")
    sources = [*native("along.c"), *write_problem(out / "arm", eom), *algebra("runtime", out)]
    return numbers([compiled(out / "along", sources), out / "states", POINTS])


def main() -> None:
    """Four lines."""
    print(processor())
    with tempfile.TemporaryDirectory() as text:
        out = Path(text)
        build(out / "first")
        seconds, size = build(out / "whole")
        print(f"build: {seconds:.1f} s of processor time, {size / 1000:.0f} kB")
        seconds, size = build(out / "lean", "--no-sources")
        print(f"without sources: {seconds:.1f} s, {size / 1000:.0f} kB")
        whole, terms = evaluation(out)
        print(
            f"accelerations and multipliers: {whole / 1000:.2f} us, of it the terms {terms / 1000:.2f}"
        )


if __name__ == "__main__":
    main()
