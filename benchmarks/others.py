"""What do others take for the forces of constraint?  Drake, exudyn, MuJoCo, and Pinocchio with SciPy.

    pip install drake exudyn mujoco pin        # those that you want; what is not there is skipped, and said
    python benchmarks/others.py [--out DIR] [--rounds N] [pendulum|chain ...]

pendulum: one bob on a massless rod, 10 s.  chain: four of them hanging from each other, 2 s.  Asked of each
is the tension of every rod at every 0.1 s; its error is the largest over samples and rods, relative to the
largest tension, against a reference that shares no code with any of them (rods.py).  Printed are error and
cost at each setting, then the costs at errors of 1e-3, 1e-6 and 1e-9, and the least error that was reached.
A cost is the processor time of stepping and reading, in microseconds a simulated second; building the model
is not counted.  Programs run interleaved, N rounds; medians.  What each does differently: RESULTS.md.
Needs gcc for the C host.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import math
import statistics
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import fmpy
import rods
import rods_elsewhere
from fmpy.fmi2 import FMU2Slave
from programs import BUDGET, STEP, Curve, Ours, launch, unpacked
from rods import Rods

from lagfmu import build_fmu
from lagfmu.model.file import load

MODELS = Path(__file__).parent.parent / "models"
FILES = {"pendulum": "PendulumCartesian", "chain": "Chain"}
TOLERANCES = [10.0**-k for k in range(3, 14)]
TARGETS = (1e-3, 1e-6, 1e-9)


def our_fmu(problem: Rods, out: Path) -> tuple[Path, Ours]:
    """The folder of the native FMU of models/, and its binary."""
    file = load(MODELS / f"{problem.name}.py")
    scene = next(s for s in file.scenes if s.name == FILES[problem.name])
    fmu = build_fmu(file.model, out, scene, target="native", check=False)
    return fmu.with_suffix(""), unpacked(fmu, out)


def tension(problem: Rods, multipliers: Any) -> Any:
    """Of f = |d|^2 - l^2:  lambda = -tension / (2 l)."""
    return -2 * problem.length * multipliers


def from_c(problem: Rods, fmu: Ours, names: list[str], tolerance: float) -> tuple[Any, float]:
    """Tensions, and us of one run, in the C host."""
    command = fmu.command(tolerance, STEP, names, stop=problem.stop)
    answer = launch(command, problem.count)
    if answer is None:
        raise SystemExit(f"{problem.name}: the C host failed at a tolerance of {tolerance:g}")
    _, ns, multipliers = answer
    return tension(problem, multipliers), 1e-3 * ns


def from_fmpy(problem: Rods, folder: Path, names: list[str]) -> Callable[[float], Any]:
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
        return tension(problem, rods.array(found)), 1e6 * spent

    return run


def jobs_of(
    problem: Rods, out: Path
) -> dict[str, list[tuple[float, Callable[[], tuple[Any, float]]]]]:
    """Every program by its label: its settings, and a run at each."""
    folder, fmu = our_fmu(problem, out)
    names = [n for n in fmu.references if n.startswith("lambda.")]
    in_fmpy = from_fmpy(problem, folder, names)
    jobs: dict[str, list[Any]] = {
        "lagfmu native, from C": [
            (tol, lambda tol=tol: from_c(problem, fmu, names, tol)) for tol in TOLERANCES
        ],
        "lagfmu native, fmpy's calls": [(tol, lambda tol=tol: in_fmpy(tol)) for tol in TOLERANCES],
    }
    for peer in rods_elsewhere.PEERS:
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


def measure(problem: Rods, out: Path, rounds: int) -> list[Curve]:
    """Every program at every setting, interleaved."""
    jobs = jobs_of(problem, out)
    curves = {label: Curve(label) for label in jobs}
    for _ in range(rounds):
        for label, settings in jobs.items():
            for setting, run in settings:
                found, us = run()
                curves[label].add(setting, found, problem.exact, us / problem.stop, 0)
    return list(curves.values())


def cells(values: Iterable[float]) -> str:
    """The end of a table's row."""
    return " | ".join("not reached" if math.isnan(x) else f"{x:.3g}" for x in values) + " |"


def tables(problem: Rods, curves: list[Curve]) -> None:
    """Every setting, then the costs at equal error."""
    print(f"\n## {problem.name}: setting: error of the tension, us a simulated second\n")
    for curve in curves:
        row = [
            f"{setting:g}: {curve.errors[setting]:.0e}, {statistics.median(costs):.4g}"
            for setting, costs in curve.costs.items()
        ]
        print(f"- {curve.label}: " + "; ".join(row))
    print(f"\n## {problem.name}: us a simulated second at an error of the tension\n")
    print(
        "| | 1e-3 | 1e-6 | 1e-9 | times that of lagfmu from C at the tightest that it reaches | least error |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    for curve in curves:
        costs = [curve.at(error) for error in TARGETS]
        reached = [(a, b) for a, b in zip(costs, map(curves[0].at, TARGETS), strict=True) if a == a]
        ratio = reached[-1][0] / reached[-1][1] if reached else math.nan
        least = min(curve.errors.values())
        print(f"| {curve.label} | {cells([*costs, ratio])} {least:.0e} |", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("problems", nargs="*", help=f"of {', '.join(FILES)}; default: all")
    parser.add_argument("--out", type=Path, help="folder for what is built (default: temporary)")
    parser.add_argument("--rounds", type=int, default=3)
    asked = parser.parse_args()
    if unknown := set(asked.problems) - set(FILES):
        parser.error(f"no such problem: {', '.join(sorted(unknown))}")
    with tempfile.TemporaryDirectory() as temporary:
        out = (asked.out or Path(temporary)).resolve()
        for name in asked.problems or FILES:
            problem = rods.PROBLEMS[name]()
            tables(problem, measure(problem, out / name, asked.rounds))


if __name__ == "__main__":
    main()
