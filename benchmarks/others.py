"""What do others take for the forces of constraint?  Drake, exudyn, heyoka, MuJoCo, Pinocchio with SciPy.

    pip install drake exudyn heyoka mujoco pin # those that you want; what is not there is skipped, and said
    python benchmarks/others.py [--out DIR] [--rounds N] [pendulum|chain|windows|bricard ...]

pendulum: one bob on a massless rod, 10 s; horizontal: as the IFToMM library's A01 has it.  chain: four of
them hanging from each other, 2 s.  windows, squeezer: closed loops, A02 and A03 of that library (loops.py);
bricard, governor: A04 and A05, in space (space.py).  Asked of each are the tensions of the rods, the forces
in the pins that close the loops, or what joints and springs do to each body, at equidistant times; an error
is the largest over samples and components, relative to the largest of them, against a reference that shares
no code with any of them (rods.py, independent/).  Printed are error and cost at each setting, then costs at
errors of 1e-3, 1e-6 and 1e-9, and the least error that was reached.  A cost is the processor time of stepping
and reading, in microseconds a simulated second; building the model is not counted.  Programs run interleaved,
N rounds; medians.  What each does differently: RESULTS.md.  Needs gcc for the C host.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import math
import statistics
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import fmpy
import loops
import loops_elsewhere
import numpy as np
import rods
import rods_elsewhere
import space
import space_elsewhere
from fmpy.fmi2 import FMU2Slave
from loops import Loops
from programs import BUDGET, Curve, Ours, launch, unpacked
from rods import Rods
from space import Space

from lagfmu import build_fmu
from lagfmu.model.file import load

MODELS = Path(__file__).parent.parent / "models"
SCENES = {"chain": "Chain"}  # of rods.py; else the pendulum's
PROBLEMS = {**rods.PROBLEMS, **loops.PROBLEMS, **space.PROBLEMS}
TOLERANCES = [10.0**-k for k in range(3, 14)]
TARGETS = (1e-3, 1e-6, 1e-9)
Problem = Rods | Loops | Space
ELSEWHERE = {Rods: rods_elsewhere, Loops: loops_elsewhere, Space: space_elsewhere}
Read = Callable[[Any], Any]  # outputs (samples, m) -> forces (samples, k)


def our_fmu(problem: Problem, out: Path) -> tuple[Path, Ours, list[str], Read]:
    """The folder of the native FMU, its binary, the outputs that are read, and what they say."""
    if not isinstance(problem, Rods):
        fmu = problem.build(out)
        return fmu.with_suffix(""), unpacked(fmu, out), problem.outputs, problem.read
    file = load(MODELS / f"{'chain' if problem.name in SCENES else 'pendulum'}.py")
    wanted = SCENES.get(problem.name, "PendulumCartesian")
    scene = next(s for s in file.scenes if s.name == wanted)
    start = dict(zip(file.model.coordinates, np.ravel(problem.start).tolist(), strict=True))
    fmu = build_fmu(replace(file.model, start=start), out, scene, target="native", check=False)
    ours = unpacked(fmu, out)
    names = [n for n in ours.references if n.startswith("lambda.")]
    return fmu.with_suffix(""), ours, names, lambda values: -2 * problem.length * values


def from_c(
    problem: Problem, fmu: Ours, names: list[str], read: Read, tolerance: float, method: str = ""
) -> tuple[Any, float]:
    """Forces, and us of one run, in the C host."""
    step = problem.step
    command = fmu.command(tolerance, step, names, method, step, stop=problem.stop)
    answer = launch(command, len(names))
    if answer is None:
        raise SystemExit(f"{problem.name}: the C host failed at a tolerance of {tolerance:g}")
    _, ns, values = answer
    return read(values), 1e-3 * ns


def from_fmpy(
    problem: Problem, folder: Path, names: list[str], read: Read
) -> Callable[[float], Any]:
    """A run of the FMU by fmpy's calls, one doStep and one getReal a sample, in an instance that is kept."""
    description = fmpy.read_model_description(str(folder), validate=False)
    references = {v.name: v.valueReference for v in description.modelVariables}
    wanted = [references[name] for name in names]
    one = FMU2Slave(
        guid=description.guid,
        unzipDirectory=str(folder),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="others",
    )
    one.instantiate()

    def run(tolerance: float) -> Any:
        one.reset()
        one.setupExperiment(tolerance=tolerance, startTime=0.0, stopTime=problem.stop)
        one.enterInitializationMode()
        one.exitInitializationMode()
        found, t = [], 0.0
        begun = time.process_time()
        for until in problem.times:
            one.doStep(t, until - t)
            found.append(one.getReal(wanted))
            t = until
        spent = time.process_time() - begun
        return read(np.array(found)), 1e6 * spent

    return run


def jobs_of(
    problem: Problem, out: Path
) -> dict[str, list[tuple[float, Callable[[], tuple[Any, float]]]]]:
    """Every program by its label: its settings, and a run at each."""
    folder, fmu, names, read = our_fmu(problem, out)
    in_fmpy = from_fmpy(problem, folder, names, read)
    jobs: dict[str, list[Any]] = {
        "lagfmu native, from C": [
            (tol, lambda tol=tol: from_c(problem, fmu, names, read, tol)) for tol in TOLERANCES
        ],
        "the same by dop853": [
            (tol, lambda tol=tol: from_c(problem, fmu, names, read, tol, "dop853"))
            for tol in TOLERANCES
        ],
        "lagfmu native, fmpy's calls": [(tol, lambda tol=tol: in_fmpy(tol)) for tol in TOLERANCES],
    }
    for peer in ELSEWHERE[type(problem)].PEERS:
        try:
            version = importlib.metadata.version(peer.package)
        except importlib.metadata.PackageNotFoundError:
            print(f"skipped: {peer.label}: {peer.package} is not installed")
            continue
        jobs[f"{peer.label} ({peer.package} {version})"] = [
            (setting, timed(peer.prepare(problem, setting))) for setting in peer.settings
        ]
    return jobs


def timed(run: Callable[[], Any]) -> Callable[[], tuple[Any, float]]:
    """The run with the processor time that it took [us], as often as fills BUDGET."""

    def answer() -> tuple[Any, float]:
        spent: list[float] = []
        while not spent or sum(spent) < BUDGET:
            begun = time.process_time()
            found = run()
            spent.append(time.process_time() - begun)
        return found, 1e6 * statistics.median(spent)

    return answer


def measure(problem: Problem, out: Path, rounds: int) -> list[Curve]:
    """Every program at every setting, interleaved."""
    jobs = jobs_of(problem, out)
    curves = {label: Curve(label) for label in jobs}
    for _ in range(rounds):
        for label, settings in jobs.items():
            for setting, run in settings:
                try:
                    found, us = run()
                except (RuntimeError, ValueError):
                    continue  # it gave up at that setting, and said so
                curves[label].add(setting, found, problem.exact, us / problem.stop, 0)
    return list(curves.values())


def cells(values: Iterable[float]) -> str:
    """The end of a table's row."""
    return " | ".join("not reached" if math.isnan(x) else f"{x:.3g}" for x in values) + " |"


def tables(problem: Problem, curves: list[Curve]) -> None:
    """Every setting, then the costs at equal error."""
    print(f"\n## {problem.name}: setting: error of the force, us a simulated second\n")
    for curve in curves:
        row = [
            f"{setting:g}: {curve.errors[setting]:.0e}, {statistics.median(costs):.4g}"
            for setting, costs in curve.costs.items()
        ]
        print(f"- {curve.label}: " + "; ".join(row))
    print(f"\n## {problem.name}: us a simulated second at an error of the force\n")
    print(
        "| | 1e-3 | 1e-6 | 1e-9 | times that of lagfmu from C at the tightest that it reaches | least error |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    for curve in curves:
        costs = [curve.at(error) for error in TARGETS]
        reached = [(a, b) for a, b in zip(costs, map(curves[0].at, TARGETS), strict=True) if a == a]
        ratio = reached[-1][0] / reached[-1][1] if reached else math.nan
        least = min(curve.errors.values(), default=math.inf)
        print(f"| {curve.label} | {cells([*costs, ratio])} {least:.0e} |", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("problems", nargs="*", help=f"of {', '.join(PROBLEMS)}; default: all")
    parser.add_argument("--out", type=Path, help="folder for what is built (default: temporary)")
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args()
    if unknown := set(asked.problems) - set(PROBLEMS):
        parser.error(f"no such problem: {', '.join(sorted(unknown))}")
    with tempfile.TemporaryDirectory() as temporary:
        out = (asked.out or Path(temporary)).resolve()
        for name in asked.problems or PROBLEMS:
            problem = PROBLEMS[name]()
            tables(problem, measure(problem, out / name, asked.rounds))


if __name__ == "__main__":
    main()
