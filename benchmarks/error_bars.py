"""Do the error bars hold for whole runs, how sharp are they, and what do they cost?

    python benchmarks/error_bars.py [--runs 40] [--seed 1] [--quick] [--drawn 40] [--misses 10] [SCENE ...]

Every scene of models/ and tests/unseen/ is built with error bars, and runs are drawn: parameters and
start values up to 20 % off, tolerances from 1e-4 to 1e-11, communication steps from a third of the scene's
to twenty times it, inputs that swing, every fourth batch four times as long.  The true error of every
quantity at every communication point is taken against the same run at a tolerance of 1e-13, less what that
one may be off itself (its difference to 3e-13).  A run holds if no bar is missed at any point.

Printed for each scene: runs, the part of them that hold, the worst true error in bars, the median of
bar / true error, the part of the points whose bar is infinite, runs that were refused, and the processor time
in that of the same FMU without error bars (median ratio of interleaved runs).  Then, by tolerance, by kind of
quantity and by the index of the communication point, the part of the runs in which none of these was missed.

--drawn N takes systems drawn at random instead (drawn_systems.py), on which the bars are calibrated
(runtime/fmi/error_bars.c); --quick takes four runs of each scene and no cost; --misses N names the worst N.
"""

from __future__ import annotations

import argparse
import heapq
import re
import statistics
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import fmpy
import numpy as np
from drawn_systems import drawn

from lagfmu.errors import LagfmuError
from lagfmu.fmu.session import LAST, Plan, Session, run_batch
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.model.model import Model
from lagfmu.model.scene import Scene
from lagfmu.names import bar as bar_of
from lagfmu.prepare.prepare import prepare

HERE = Path(__file__).parent
FOLDERS = (HERE.parent / "models", HERE.parent / "tests" / "unseen")
OFF, LONG, EVERY, TOGETHER = 0.2, 4, 4, 5
TOLERANCES, STEPS = (-11.0, -4.0), (-0.5, 1.3)  # powers of ten; of the scene's communication step
MOST_POINTS = 300
REFERENCE, SECOND = 1e-13, 3e-13
INFINITE = np.finfo(float).max
INDICES = (1, 2, 3, 4, 6, 11, 31, 101)  # where a group of communication points begins
KINDS = {
    "lambda": r"lambda\.",
    "Q": r"Q\.",
    "time of an event": r"(departure|slipping|sticking|closing)\.",
    "velocity": r"der\(",
}


@dataclass(frozen=True)
class Runs:
    """Runs with the same communication points, whose true errors and bars are (runs, points, names)."""

    scene: str
    step: float
    names: tuple[str, ...]
    tolerances: np.ndarray
    values: list[dict[str, float]]
    true: np.ndarray
    bars: np.ndarray
    refused: int


@dataclass
class Tally:
    """Of a group of points: runs that have some, those that miss none, the worst in bars, bar / error."""

    runs: int = 0
    held: int = 0
    worst: float = 0.0
    points: int = 0
    infinite: int = 0
    sharp: list[np.ndarray] = field(default_factory=list)

    def add(self, true: np.ndarray, bars: np.ndarray) -> None:
        """The points of one run."""
        if not true.size:
            return
        over = np.divide(true, bars, out=np.zeros_like(true), where=true > 0)
        finite = (bars < INFINITE) & (true > 0)
        self.runs += 1
        self.held += bool((over <= 1).all())
        self.worst = max(self.worst, float(over.max()))
        self.points += true.size
        self.infinite += int((bars >= INFINITE).sum())
        self.sharp.append(bars[finite] / true[finite])

    def line(self, name: str, more: str = "") -> None:
        """One row of a table."""
        if not self.runs:
            return
        every = np.concatenate(self.sharp)
        sharp = np.median(every) if every.size else np.nan
        part, lost = 100 * self.held / self.runs, 100 * self.infinite / self.points
        print(
            f"{name:24s} {self.runs:6d} {part:8.2f} {self.worst:9.3g} {sharp:9.3g} {lost:8.3f} {more}",
            flush=True,
        )


def scenes(wanted: list[str]) -> list[tuple[Model, Scene]]:
    """All that the folders hold, or those whose scene is named."""
    found = []
    for path in sorted(p for folder in FOLDERS for p in folder.glob("*.py")):
        file = load(path)
        found += [(file.model, s) for s in file.scenes if not wanted or s.name in wanted]
    return found


def swing(session: Session, model: Model, times: np.ndarray, chance: np.random.Generator) -> dict:
    """Inputs at the communication points: forces swing, prescribed motions go on as they start."""
    found = {}
    for i in model.inputs:
        name = str(i.symbol).removesuffix("(t)")
        if i in model.prescribed or name not in session.rules:
            continue
        found[name] = chance.uniform(0.5, 2) * np.sin(chance.uniform(1, 5) * times)
    return found


def varied(description, chance: np.random.Generator, speed: float) -> dict[str, float]:
    """Parameters and start values up to 20 % off; velocities, where they start from 0, of this size."""
    values = {}
    for v in description.modelVariables:
        settable = v.causality == "parameter" or v.initial in ("exact", "approx")
        if v.type != "Real" or not settable or v.name.startswith("solver.") or v.start is None:
            continue
        value = float(v.start) * (1 + OFF * chance.uniform(-1, 1))
        if v.name.startswith("der(") and v.causality != "parameter" and value == 0:
            value = float(speed * chance.normal())
        low, high = (None if x is None else float(x) for x in (v.min, v.max))
        value = value if low is None else max(value, low)
        values[v.name] = value if high is None else min(value, high)
    return values


def measure(
    fmu: Path, model: Model, scene: Scene, count: int, seed: int, folder: str, speed: float
) -> Iterator[Runs]:
    """`count` runs of a scene, some together."""
    description = fmpy.read_model_description(str(fmu))
    session = Session(fmpy.extract(str(fmu), unzipdir=folder))
    known = [v.name for v in description.modelVariables]
    names = tuple(n for n in known if bar_of(n) in known)
    chance = np.random.default_rng([seed, sum(map(ord, scene.name))])
    for batch in range(-(-count // TOGETHER)):
        step = float(scene.step_size * 10 ** chance.uniform(*STEPS))
        span = scene.stop_time * (LONG if batch % EVERY == EVERY - 1 else 1)
        times = np.arange(min(int(np.ceil(span / step)), MOST_POINTS) + 1) * step
        inputs = swing(session, model, times, chance)
        number = min(TOGETHER, count - batch * TOGETHER)
        rows = [varied(description, chance, speed) for _ in range(number)]
        tolerances = 10 ** chance.uniform(*TOLERANCES, len(rows))
        plan = Plan(
            vary=(*rows[0], "solver.tolerance"),
            keep=tuple((n, LAST) for n in (*names, *map(bar_of, names))),
            times=times,
            drive=tuple(inputs),
            drives=np.array(list(inputs.values())).T if inputs else None,
            whole=True,
        )
        values = np.array([list(r.values()) for r in rows]).reshape(len(rows), -1)
        found, *fine = (
            run_batch(session, plan, np.column_stack([values, np.broadcast_to(t, len(rows))]))
            for t in (tolerances, REFERENCE, SECOND)
        )
        good = np.all([o.status <= 1 for o in (found, *fine)], axis=0)
        whole, n = found.trajectory[good], len(names)
        exact, again = (o.trajectory[good][:, :, :n] for o in fine)
        yield Runs(
            scene.name,
            step,
            names,
            tolerances[good],
            [r for r, g in zip(rows, good, strict=True) if g],
            np.maximum(np.abs(whole[:, :, :n] - exact) - np.abs(exact - again), 0),
            whole[:, :, n:],
            int((~good).sum()),
        )
    session.close()


def kind(name: str) -> str:
    """What a quantity is."""
    return next((k for k, pattern in KINDS.items() if re.match(pattern, name)), "coordinate, own")


def split(runs: Runs, i: int) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """The groups in which the points of run i are counted, and these."""
    true, bars = runs.true[i], runs.bars[i]
    yield "all", true, bars
    yield f"tolerance 1e{round(np.log10(runs.tolerances[i]))}", true, bars
    of = np.array([kind(n) for n in runs.names])
    for k in sorted(set(of)):
        yield f"kind: {k}", true[:, of == k], bars[:, of == k]
    for first, after in zip(INDICES, (*INDICES[1:], None), strict=True):
        last = f"-{after - 1}" if after else " and later"
        name = f"point {first}{'' if after == first + 1 else last}"
        yield name, true[first:after], bars[first:after]


def misses(runs: Runs, i: int) -> Iterator[tuple[float, str]]:
    """The worst of run i, in bars, and where it is."""
    over = np.divide(
        runs.true[i], runs.bars[i], out=np.zeros_like(runs.true[i]), where=runs.true[i] > 0
    )
    if (over > 1).any():
        k, j = np.unravel_index(np.argmax(over), over.shape)
        first = int(np.flatnonzero((over > 1).any(axis=1))[0])
        name = f"{runs.scene} {runs.names[j]}"
        yield (
            over[k, j],
            (
                f"{over[k, j]:9.3g} bars: {name} at point {k} of {len(over)}, the first {first}, "
                f"step {runs.step!r} s, tolerance {runs.tolerances[i]:.4g}, "
                f"error {runs.true[i, k, j]:.3g}, bar {runs.bars[i, k, j]:.3g}, {runs.values[i]}"
            ),
        )


def cost(with_bars: Path, without: Path, folder: str, scene: Scene) -> float:
    """Processor time of a run with error bars, in that of one without; both read the same outputs."""
    sessions = []
    for k, fmu in enumerate((with_bars, without)):
        where = fmpy.extract(str(fmu), unzipdir=f"{folder}/cost{k}")
        sessions.append(Session(where))
    names = [n for n in sessions[1].rules if bar_of(n) in sessions[0].rules]
    points = int(np.ceil(scene.stop_time / scene.step_size))
    plan = Plan((), tuple((n, LAST) for n in names), np.arange(points + 1) * scene.step_size)
    ratios = []
    for _ in range(15):
        spent = []
        for session in sessions:
            begun = time.process_time()
            run_batch(session, plan, np.zeros((4, 0)))
            spent.append(time.process_time() - begun)
        ratios.append(spent[0] / spent[1])
    for session in sessions:
        session.close()
    return statistics.median(ratios)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--drawn", type=int, default=0)
    parser.add_argument("--misses", type=int, default=0)
    chosen = parser.parse_args()
    every = [drawn(k) for k in range(chosen.drawn)] or scenes(chosen.scenes)
    count = 4 if chosen.quick else chosen.runs
    groups: dict[str, Tally] = defaultdict(Tally)
    costs, refused, missed = [], 0, []
    print(
        f"{'':24s} {'runs':>6s} {'held%':>8s} {'worst':>9s} {'bar/true':>9s} {'inf%':>8s} refused, cost"
    )
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        for k, (model, scene) in enumerate(every):
            barred = replace(scene, error_bars=True)
            try:
                fmu = write(prepare(model, barred), f"{folder}/with", target="native")
            except LagfmuError as error:
                print(f"{scene.name:24s} is not built: {str(error).splitlines()[0][:120]}")
                continue
            mine, lost = Tally(), 0
            for runs in measure(
                fmu, model, scene, count, chosen.seed, f"{folder}/{k}", 1.0 if chosen.drawn else 0.0
            ):
                lost += runs.refused
                for i in range(len(runs.tolerances)):
                    mine.add(runs.true[i], runs.bars[i])
                    missed += misses(runs, i)
                    for name, true, bars in split(runs, i):
                        groups[name].add(true, bars)
            refused += lost
            if not chosen.quick:
                plain = write(prepare(model, scene), f"{folder}/without", target="native")
                costs.append(cost(fmu, plain, f"{folder}/{k}", scene))
            mine.line(scene.name, f"{lost} {costs[-1]:.2f}" if costs else f"{lost}")
    for name in sorted(
        groups, key=lambda n: [int(x) if x.isdigit() else x for x in re.split(r"(\d+)", n)]
    ):
        groups[name].line(name)
    print(f"{groups['all'].runs + refused} runs, {refused} refused", end="")
    print(f"; cost: median {statistics.median(costs):.2f}, most {max(costs):.2f}" if costs else "")
    for _, text in heapq.nlargest(chosen.misses, missed):
        print(text)


if __name__ == "__main__":
    main()
