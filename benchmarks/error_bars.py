"""Do the error bars hold, how sharp are they, and what do they cost?

    python benchmarks/error_bars.py [--runs 1000] [--seed 1] [--target native|python] [MODEL ...]

Every scene of models/ is built with error bars.  Of each, runs are drawn: parameters and start values up to
20 % off, tolerances from 1e-4 to 1e-10, inputs that swing, every fourth run four times as long.  The true
error of every quantity at every communication point is taken against the same run at a tolerance of 1e-13.
Printed per model: the part of the points where the true error is at most the bar, the median of bar / true
error, the part of the points whose bar is infinite; then per kind of quantity and tolerance, and the cost in
processor time against the same FMU without error bars (median ratio of interleaved runs).

Bars are calibrated (lagfmu/solver/bars.py) on the seeds from 100 on; judge them on others.
"""

from __future__ import annotations

import argparse
import re
import statistics
import tempfile
import time
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import fmpy
import numpy as np

from lagfmu.fmu.session import LAST, Plan, Session, plug
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.model.model import Model
from lagfmu.model.scene import Scene
from lagfmu.names import bar as bar_of
from lagfmu.prepare.prepare import prepare

MODELS = Path(__file__).parent.parent / "models"
OFF, LONG, EVERY = 0.2, 4, 4
REFERENCE = 1e-13
INFINITE = np.finfo(float).max
KINDS = {
    "lambda": r"lambda\.",
    "Q": r"Q\.",
    "time of an event": r"(departure|slipping)\.",
    "velocity": r"der\(",
}


@dataclass(frozen=True)
class Runs:
    """Values (runs, points, names) of the delivered runs and of their references, bars, and steps so far."""

    scene: str
    names: tuple[str, ...]
    tolerances: np.ndarray
    delivered: np.ndarray
    true: np.ndarray
    bars: np.ndarray
    steps: np.ndarray
    refused: int
    driven: bool


def scenes(wanted: list[str]) -> list[tuple[Model, Scene]]:
    """All that models/ holds, or those whose scene is named."""
    found = []
    for path in sorted(MODELS.glob("*.py")):
        file = load(path)
        found += [(file.model, s) for s in file.scenes if not wanted or s.name in wanted]
    return found


def swing(session: Session, model: Model, times: np.ndarray, chance: np.random.Generator) -> dict:
    """Inputs at the communication points: forces swing, prescribed motions stay where they start."""
    found = {}
    for i in model.inputs:
        name = str(i.symbol).removesuffix("(t)")
        if i in model.prescribed or name not in session.plug.variables:
            continue
        found[name] = chance.uniform(0.5, 2) * np.sin(chance.uniform(1, 5) * times)
    return found


def drawn(description, chance: np.random.Generator) -> dict[str, float]:
    """Parameters and start values up to 20 % off."""
    values = {}
    for v in description.modelVariables:
        settable = v.causality == "parameter" or v.initial in ("exact", "approx")
        if v.type != "Real" or not settable or v.name.startswith("solver.") or v.start is None:
            continue
        value = float(v.start) * (1 + OFF * chance.uniform(-1, 1))
        low, high = (None if x is None else float(x) for x in (v.min, v.max))
        value = value if low is None else max(value, low)
        values[v.name] = value if high is None else min(value, high)
    return values


def measure(
    fmu: Path, model: Model, scene: Scene, count: int, seed: int, folder: str
) -> list[Runs]:
    """`count` runs of a scene: short ones, then long ones."""
    description = fmpy.read_model_description(str(fmu))
    session = Session(plug(fmu, description, fmpy.extract(str(fmu), unzipdir=folder)))
    known = [v.name for v in description.modelVariables]
    names = tuple(n for n in known if bar_of(n) in known)
    chance = np.random.default_rng([seed, sum(map(ord, scene.name))])
    made = []
    for factor, number in ((1, count - count // EVERY), (LONG, count // EVERY)):
        if number == 0:
            continue
        points = int(np.ceil(scene.stop_time * factor / scene.step_size))
        times = np.arange(points + 1) * scene.step_size
        inputs = swing(session, model, times, chance)
        rows = [drawn(description, chance) for _ in range(number)]
        tolerances = 10 ** chance.uniform(-10, -4, number)
        plan = Plan(
            vary=(*rows[0], "solver.tolerance"),
            keep=tuple((n, LAST) for n in (*names, *(bar_of(n) for n in names), "solver.steps")),
            times=times,
            drive=tuple(inputs),
            drives=np.array(list(inputs.values())).T if inputs else None,
            whole=True,
        )
        values = np.array([list(r.values()) for r in rows])
        found = session.batch(plan, np.column_stack([values, tolerances]))
        converged = session.batch(plan, np.column_stack([values, np.full(number, REFERENCE)]))
        good = (found.status <= 1) & (converged.status <= 1)
        whole, fine, n = found.trajectory[good], converged.trajectory[good], len(names)
        made.append(
            Runs(
                scene.name,
                names,
                tolerances[good],
                whole[:, :, :n],
                np.abs(whole[:, :, :n] - fine[:, :, :n]),
                whole[:, :, n : 2 * n],
                whole[:, :, -1],
                int((~good).sum()),
                bool(model.inputs),
            )
        )
    session.close()
    return made


def kind(name: str) -> str:
    """What a quantity is."""
    return next((k for k, pattern in KINDS.items() if re.match(pattern, name)), "coordinate, own")


def judged(true: np.ndarray, bars: np.ndarray) -> tuple[float, float, float, int]:
    """Part covered, median of bar / true where both are finite and not zero, part infinite, points."""
    if not true.size:
        return np.nan, np.nan, np.nan, 0
    finite = (bars < INFINITE) & (true > 0)
    sharp = np.median(bars[finite] / true[finite]) if finite.any() else np.nan
    return float(np.mean(true <= bars)), float(sharp), float(np.mean(bars >= INFINITE)), true.size


def line(name: str, group: tuple[float, float, float, int], more: str = "") -> None:
    """One row of a table."""
    covered, sharp, infinite, points = group
    print(f"{name:26s} {100 * covered:8.3f} {sharp:9.3g} {100 * infinite:9.3f} {points:10d} {more}")


def cost(with_bars: Path, without: Path, folder: str, scene: Scene) -> float:
    """Processor time of a run with error bars, in that of one without; both read the same outputs."""
    sessions = []
    for k, fmu in enumerate((with_bars, without)):
        description = fmpy.read_model_description(str(fmu))
        where = fmpy.extract(str(fmu), unzipdir=f"{folder}/cost{k}")
        sessions.append(Session(plug(fmu, description, where)))
    names = [n for n in sessions[1].plug.variables if bar_of(n) in sessions[0].plug.variables]
    points = int(np.ceil(scene.stop_time / scene.step_size))
    plan = Plan((), tuple((n, LAST) for n in names), np.arange(points + 1) * scene.step_size)
    ratios = []
    for _ in range(15):
        spent = []
        for session in sessions:
            begun = time.process_time()
            session.batch(plan, np.zeros((20, 0)))
            spent.append(time.process_time() - begun)
        ratios.append(spent[0] / spent[1])
    for session in sessions:
        session.close()
    return statistics.median(ratios)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--runs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--target", default="native")
    chosen = parser.parse_args()
    every = scenes(chosen.scenes)
    count = -(-chosen.runs // len(every))
    groups: dict[str, list[tuple[np.ndarray, np.ndarray]]] = defaultdict(list)
    print(
        f"{'':26s} {'covered%':>8s} {'bar/true':>9s} {'infinite%':>9s} {'points':>10s} refused, cost"
    )
    costs, refused, runs = [], 0, 0
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        for k, (model, scene) in enumerate(every):
            barred = replace(scene, error_bars=True)
            fmu = write(prepare(model, barred), f"{folder}/with", target=chosen.target)
            plain = write(prepare(model, scene), f"{folder}/without", target=chosen.target)
            found = measure(fmu, model, scene, count, chosen.seed, f"{folder}/{k}")
            costs.append(cost(fmu, plain, f"{folder}/{k}", scene))
            mine = []
            for r in found:
                refused += r.refused
                runs += len(r.tolerances) + r.refused
                for j, name in enumerate(r.names):
                    for i, tolerance in enumerate(r.tolerances):
                        pair = r.true[i, :, j], r.bars[i, :, j]
                        mine.append(pair)
                        groups[kind(name)].append(pair)
                        groups[f"tolerance 1e{round(np.log10(tolerance))}"].append(pair)
            groups["all"] += mine
            lost = sum(r.refused for r in found)
            line(
                scene.name,
                judged(*map(np.concatenate, zip(*mine, strict=True))),
                f"{lost} {costs[-1]:.2f}",
            )
    for name, pairs in sorted(groups.items()):
        line(name, judged(*map(np.concatenate, zip(*pairs, strict=True))))
    print(
        f"{runs} runs, {refused} refused; cost: median {statistics.median(costs):.2f}, most {max(costs):.2f}"
    )


if __name__ == "__main__":
    main()
