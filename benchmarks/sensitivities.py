"""Are the derivatives of a run those that differences of runs show, and what do they cost?

    python benchmarks/sensitivities.py [--systems 60] [--runs 10] [--seed 1] [--worst 5]
    python benchmarks/sensitivities.py --cost [--instructions] [SCENE ...]

Systems drawn at random (drawn_systems.py: rods, springs, curves, floors with rebound, rough floors), each
with parameters and start values up to 20 % off, run at a tolerance of 1e-11 with the derivatives of all
outputs by three of its numbers.  They are held against central differences of fourth order of runs at 1e-13,
at two steps, small ones and larger, where those know more.  How much they know is said by their difference,
and by the scatter of the runs over the step: the impulse of the last of many rebounds is known to 1e-8 of
itself, its difference at the small steps to a hundredth.  Where an event lies between the runs, or they know
less than 1e-4, there is nothing to compare; where sensitivity.valid is false there are no derivatives.

Printed: points that agree (to 1e-6, three times what the differences know, and rounding, 1e-11 of the largest
output of that unit by the number), that were flagged, that cannot
be compared, and, one by one, those that disagree and were not flagged.

--cost: the processor time of a run with 1, 2, 4 and 8 columns in that of a run without, both of which read
all outputs, and in that of the p + 1 runs of a one-sided difference.  --instructions: those that valgrind
counts, in the place of the time.
"""

from __future__ import annotations

import argparse
import heapq
import re
import statistics
import subprocess
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
from drawn_systems import drawn
from error_bars import scenes, swing, varied
from programs import unpacked

from lagfmu import names
from lagfmu.errors import LagfmuError
from lagfmu.fmu.session import LAST, Plan, Session, run_batch
from lagfmu.fmu.write import write
from lagfmu.model.model import Model
from lagfmu.model.scene import Scene
from lagfmu.prepare.prepare import prepare

STENCIL = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])
WEIGHTS = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12
# what no polynomial of third order explains
NOISE = np.array([1.0, -4.0, 6.0, -4.0, 1.0]) / np.sqrt(70)
PAIRS = ((3e-5, 1e-5), (1e-3, 3e-4))  # of a number's size
TOLERANCE, REFERENCE = 1e-11, 1e-13
AGREED, KNOWN, TRUSTED, ROUNDED = 1e-6, 1e-4, 3.0, 1e-11
POINTS, SPAN, COLUMNS = 9, 2.0, 3
DEFAULT_COST = ("PendulumCartesian", "Hemisphere", "HalfCar", "Chain", "RoughHemisphere", "Bowling")


def differences(
    session: Session, plan: Plan, values: np.ndarray, by: int, step: float, first: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The derivatives by the number `by`, what scatter of the runs makes of them, and at which points no
    event lies between these: counts, which stand from `first` on among what is kept, are the same in all."""
    rows = np.repeat(values[None, :], len(STENCIL), axis=0)
    rows[:, by] += STENCIL * step
    found = run_batch(session, plan, rows)
    if (found.status > 1).any():
        raise ArithmeticError
    whole = found.trajectory
    same = (whole[:, :, first:] == whole[:1, :, first:]).all(axis=(0, 2))
    scatter = np.abs(np.tensordot(NOISE, whole, 1)) * np.linalg.norm(WEIGHTS) / step
    return np.tensordot(WEIGHTS, whole, 1) / step, scatter, same


def best_known(
    session: Session, plan: Plan, values: np.ndarray, by: int, size: float, first: int
) -> tuple[np.ndarray, np.ndarray]:
    """The derivatives by the pair of steps that knows most at each point, and how much; infinite: nothing."""
    pairs = []
    for pair in PAIRS:
        (wide, rough, same), (near, scatter, also) = (
            differences(session, plan, values, by, part * size, first) for part in pair
        )
        doubt = np.maximum(np.abs(wide - near), np.maximum(rough, scatter))
        doubt[~(same & also)] = np.inf
        pairs.append((near, doubt))
    (near, doubt), (larger, other) = pairs
    return np.where(other < doubt, larger, near), np.minimum(doubt, other)


def compare(
    session: Session, model: Model, description, values: dict[str, float], chance
) -> tuple[Counter, list[tuple[float, str]]]:
    """What becomes of each derivative at each point of one run."""
    known = {v.name for v in description.modelVariables}
    wanted = [n for n in known if names.read(n).quantity == names.SENSITIVITY]
    of = sorted({names.varied(n) for n in wanted})
    counts = [*sorted(n for n in known if n.endswith(".count")), names.SENSITIVITY_VALID]
    times = np.linspace(0, SPAN, POINTS)
    inputs = swing(session, model, times, chance)
    keep = [*wanted, *of, *counts]
    plan = Plan(
        vary=(*values, "solver.tolerance"),
        keep=tuple((n, LAST) for n in keep),
        times=times,
        drive=tuple(inputs),
        drives=np.array(list(inputs.values())).T if inputs else None,
        whole=True,
    )
    tally, worst = Counter(), []
    base = np.array([*values.values(), TOLERANCE])
    run = run_batch(session, plan, base[None, :])
    if run.status[0] > 1:
        return Counter(refused=1), []
    mine = run.trajectory[0]
    largest = {name: np.abs(mine[:, keep.index(name)]).max() for name in of}
    unit = {v.name: v.unit for v in description.modelVariables}
    bare = replace(plan, keep=tuple((n, LAST) for n in (*of, *counts[:-1])))
    fine = base.copy()
    fine[-1] = REFERENCE
    for by in sorted({names.read(n).constraint for n in wanted}):
        k = list(values).index(by)
        size = abs(values[by]) or 1.0
        try:
            near, doubts = best_known(session, bare, fine, k, size, len(of))
        except ArithmeticError:
            tally["refused beside"] += 1
            continue
        for j, name in enumerate(of):
            title = names.name(names.SENSITIVITY, by, name)
            if title not in known:
                continue
            value = mine[:, keep.index(title)]
            own = largest[name] / size
            scale = max(np.abs(near[:, j]).max(), own)
            rounding = (
                ROUNDED * max(largest[other] for other in of if unit[other] == unit[name]) / size
            )
            doubt = doubts[:, j]
            for i in range(1, POINTS):
                off = abs(value[i] - near[i, j])
                if not mine[i, -1]:
                    tally["flagged"] += 1
                elif doubt[i] > KNOWN * scale + rounding:
                    tally["not comparable"] += 1
                elif off <= AGREED * scale + TRUSTED * doubt[i] + rounding:
                    tally["agree"] += 1
                else:
                    tally["DISAGREE"] += 1
                    worst.append(
                        (
                            off / scale,
                            f"{title} at t = {times[i]:.4g}: {value[i]:.9g}, differences {near[i, j]:.9g} "
                            f"(known to {doubt[i]:.2g}), {values}",
                        )
                    )
    tally["runs"] += 1
    tally["runs flagged"] += not mine[-1, -1]
    return tally, worst


def judge(systems: int, runs: int, seed: int, most: int) -> None:
    """Systems drawn at random against differences."""
    total, worst = Counter(), []
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        for number in range(systems):
            chance = np.random.default_rng([seed, number])
            model, scene = drawn(number)
            try:
                whole = prepare(model, scene)
                by = [v.name for v in whole.table.variables if v.role in ("parameter", "start")]
                chosen = list(chance.permutation(by)[:COLUMNS])
                asked = replace(scene, sensitivities=(f"*:{','.join(chosen)}",))
                fmu = write(prepare(model, asked), folder, target="native")
            except LagfmuError as error:
                print(f"{scene.name} is not built: {str(error).splitlines()[0][:120]}")
                continue
            description = fmpy.read_model_description(str(fmu))
            session = Session(fmpy.extract(str(fmu), unzipdir=f"{folder}/{number}"))
            for _ in range(runs):
                values = varied(description, chance, 1.0)
                tally, more = compare(session, model, description, values, chance)
                total += tally
                worst += [(off, f"{scene.name} {text}") for off, text in more]
            session.close()
            print(f"{scene.name:10s} {dict(total)}", flush=True)
    for _, text in heapq.nlargest(most, worst):
        print(text)


def seconds(session: Session, plan: Plan, runs: int) -> float:
    """Processor time of some runs."""
    begun = time.process_time()
    run_batch(session, plan, np.zeros((runs, 0)))
    return time.process_time() - begun


COUNT = ["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null", "--collect-atstart=no"]
COUNTED = ("DoStep", "GetReal")


def instructions(
    fmu: Path, outputs: list[str], scene: Scene, counted: Sequence[str] = COUNTED
) -> int:
    """Those of the steps of three runs, and of reading the outputs after each; or of one of these."""
    ours = unpacked(fmu, fmu.parent)
    words = ours.command(1e-8, scene.step_size, outputs, step=scene.step_size, stop=scene.stop_time)
    words[8] = 0  # [s]: three runs
    told = subprocess.run(
        [*COUNT, *(f"--toggle-collect=fmi2{name}" for name in counted), *map(str, words)],
        check=True,
        capture_output=True,
        text=True,
    )
    return int(re.search(r"Collected : (\d+)", told.stderr)[1])


def ratios(fmus: tuple[Path, Path], outputs: tuple[list[str], list[str]], scene: Scene) -> float:
    """The median processor time of the second FMU's run in that of the first."""
    points = int(np.ceil(scene.stop_time / scene.step_size))
    times = np.arange(points + 1) * scene.step_size
    sessions = [Session(fmpy.extract(str(fmu))) for fmu in fmus]
    plans = [Plan((), tuple((n, LAST) for n in keep), times) for keep in outputs]
    found = []
    for _ in range(15):
        plain, more = (seconds(s, plan, 4) for s, plan in zip(sessions, plans, strict=True))
        found.append(more / plain)
    for session in sessions:
        session.close()
    return statistics.median(found)


def has_derivatives(fmu: Path, stop: float) -> bool:
    """Whether they exist to the end of the run."""
    session = Session(fmpy.extract(str(fmu)))
    plan = Plan((), ((names.SENSITIVITY_VALID, LAST),), np.array([0.0, stop]))
    found = run_batch(session, plan, np.zeros((1, 0))).result[0, 0]
    session.close()
    return bool(found)


def cost(model: Model, scene: Scene, folder: str, counted: bool) -> None:
    """A line: with p columns, in the time of a run without, and in that of p + 1 of them; or `counted`."""
    base = replace(scene, method="dop853", methods=("dop853",))
    whole = prepare(model, base)
    by = [v.name for v in whole.table.variables if v.role in ("parameter", "start")]
    of = [v.name for v in whole.table.outputs if v.kind == "Real"]
    plain = write(whole, f"{folder}/plain", target="native")
    text = f"{scene.name:20s}"
    for count in (1, 2, 4, 8):
        if count > len(by):
            break
        asked = replace(base, sensitivities=(f"*:{','.join(by[:count])}",))
        fmu = write(prepare(model, asked), f"{folder}/{count}", target="native")
        if not has_derivatives(fmu, scene.stop_time):
            text += f" {count}: no derivatives exist"
            break
        description = fmpy.read_model_description(str(fmu))
        both = [*of, *(v.name for v in description.modelVariables if ".by." in v.name)]
        if counted:
            ratio = instructions(fmu, both, scene) / instructions(plain, of, scene)
        else:
            ratio = ratios((plain, fmu), (of, both), scene)
        text += f" {count}: {ratio:5.3f} ({ratio / (count + 1):5.3f})"
    print(text, flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*")
    parser.add_argument("--systems", type=int, default=60)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--worst", type=int, default=5)
    parser.add_argument("--cost", action="store_true")
    parser.add_argument("--instructions", action="store_true")
    chosen = parser.parse_args()
    if not chosen.cost:
        judge(chosen.systems, chosen.runs, chosen.seed, chosen.worst)
        return
    with tempfile.TemporaryDirectory(prefix="lagfmu_") as folder:
        for model, scene in scenes(list(chosen.scenes or DEFAULT_COST)):
            cost(model, scene, f"{folder}/{scene.name}", chosen.instructions)


if __name__ == "__main__":
    main()
