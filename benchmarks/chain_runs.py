"""What does a simulated second cost as a mechanism grows?  Beside SciPy's DOP853 on as few angles as it has.

    python benchmarks/chain_runs.py [hanging|windows] [n ...]

hanging: n rods in space on ball joints, from rest at 1 rad from the vertical.  The upper ones carry all that
hang below, so that a longer chain is quicker: its steps grow for everybody.  windows: A02 of the IFToMM
library with n windows, in space, swinging from rest at 1 rad: 2 n + 1 bodies that move alike for each n.

A second is simulated at several tolerances; errors are those of the forces in all joints, every 0.1 s,
relative to the largest of them.  Printed for each number of bodies, at an error of 1e-8: internal steps of
the native FMU (in C; no initialization), microseconds of processor time a step, steps of SciPy; then steps
at a tolerance of 1e-8 with the error that they make, of both; and of the first three columns the growth
exponents from the line before.  That of a simulated second is the sum of the first two: what the motion asks
of any integrator of this order, which SciPy's steps tell too, and what a step costs.
"""

from __future__ import annotations

import math
import os
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, pi, sin
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from programs import Curve, Ours, launch, unpacked
from scipy.integrate import DOP853
from scipy.linalg import solve

from lagfmu import Model, Scene, build_fmu
from lagfmu.bodies import Body, Gravity, Ground, Revolute, Spherical, Universal, mechanism

STOP, STEP, ERROR, REPEATS = 1.0, 0.1, 1e-8, 3
TOLERANCES = [10.0**-k for k in range(5, 12)]
EXACT, SHOWN = 1e-13, 1e-8  # tolerances: of the reference, of what is printed besides
G, LENGTH, ANGLE = 9.81, 0.5, 1.0  # m/s2, m, rad
MASS, ACROSS, ALONG = 1.0, 0.02, 0.002  # kg, kg m2 across and along a rod
Rate = Callable[[float, Any], Any]


@dataclass(frozen=True)
class Family:
    """One size of it: bodies and joints, what is read, and both in angles."""

    bodies: int
    model: Model
    outputs: Sequence[str]  # magnitudes of forces in joints
    start: Any  # angles and their rates
    rate: Rate
    forces: Callable[[Any], Any]


def turned(axis: Sequence[float], by: float) -> dict[str, float]:
    """The quaternion of a rotation about an axis of unit length."""
    vector = zip("xyz", (sin(by / 2) * x for x in axis), strict=True)
    return {"orientation.w": cos(by / 2)} | {f"orientation.{x}": e for x, e in vector}


def rod(name: str, place: Sequence[float], by: float, start: dict[str, Any]) -> Body:
    """Along z, turned about y; `start` gets its place."""
    start |= {f"{name}.position": tuple(place)}
    start |= {f"{name}.{what}": e for what, e in turned((0, 1, 0), by).items()}
    return Body(name, MASS, (ACROSS, ACROSS, ALONG))


def hanging(n: int) -> Family:
    """Lagrange's equations in the angles a_k from the downward vertical, w = a':
    sum_j M_kj cos(a_k - a_j) w_j' = - sum_j M_kj sin(a_k - a_j) w_j^2 - h_k g sin a_k ,
    h_k = m l (n - k - 1/2) ,  M_kj = l h_max(k, j) but M_kk = l h_k - m l^2 / 4 + J."""
    start: dict[str, Any] = {}
    bodies, joints, above = [], [], Ground().at((0, 0, 0))
    for k in range(n):
        reach = (k + 0.5) * LENGTH
        place = reach * sin(ANGLE), 0.0, -reach * cos(ANGLE)
        body = rod(f"b{k}", place, -ANGLE, start)
        joints.append(Spherical(f"J{k}", above, body.at((0, 0, LENGTH / 2))))
        above = body.at((0, 0, -LENGTH / 2))
        bodies.append(body)
    loads = [Gravity((0, 0, -G))]
    model = mechanism(f"Hanging{n}", bodies=bodies, joints=joints, loads=loads, start=start)
    below = MASS * LENGTH * (n - np.arange(n) - 0.5)
    own = np.eye(n) * (ACROSS - MASS * LENGTH**2 / 4)
    M = LENGTH * np.minimum.outer(below, below)

    def rate(_: float, y: Any) -> Any:
        a, w = y[:n], y[n:]
        c, s = np.cos(a), np.sin(a)
        pull = -(M * (np.outer(s, c) - np.outer(c, s))) @ w**2 - below * G * s
        inertia = M * (np.outer(c, c) + np.outer(s, s)) + own
        return np.concatenate([w, solve(inertia, pull, assume_a="pos", check_finite=False)])

    def forces(y: Any) -> Any:
        a, w, dw = y[:n], y[n:], rate(0, y)[n:]
        bends = LENGTH * np.array(
            [dw * np.cos(a) - w**2 * np.sin(a), dw * np.sin(a) + w**2 * np.cos(a)]
        )
        felt = MASS * (np.cumsum(bends, axis=1) - bends / 2 + [[0.0], [G]])
        return np.linalg.norm(np.cumsum(felt[:, ::-1], axis=1), axis=0)[::-1]

    names = [f"force.J{k}.norm" for k in range(n)]
    return Family(n, model, names, np.repeat([ANGLE, 0.0], n), rate, forces)


def windows(n: int) -> Family:
    """All links hang at one angle a, and the rods between them do not turn:
    ((n + 1)(J + m l^2 / 4) + n m l^2) a'' = -((n + 1) / 2 + n) m g l sin a ."""
    start: dict[str, Any] = {}
    ground, down, end = Ground(), (0, 0, LENGTH / 2), (0, 0, -LENGTH / 2)
    places = [
        (k * LENGTH + LENGTH / 2 * sin(ANGLE), 0.0, -LENGTH / 2 * cos(ANGLE)) for k in range(n + 1)
    ]
    links = [rod(f"link{k}", place, -ANGLE, start) for k, place in enumerate(places)]
    rods, joints = [], []
    for k, link in enumerate(links):
        joints.append(Revolute(f"A{k}", ground.at((k * LENGTH, 0, 0)), link.at(down), axis="y"))
    for k in range(1, n + 1):
        place = ((k - 0.5) * LENGTH + LENGTH * sin(ANGLE), 0.0, -LENGTH * cos(ANGLE))
        rods.append(between := rod(f"rod{k}", place, pi / 2, start))
        joints.append(Spherical(f"B{k}", links[k - 1].at(end), between.at(end)))
        joints.append(
            Universal(f"C{k}", links[k].at(end), between.at(down), axis="y", second_axis="x")
        )
    model = mechanism(
        f"Windows{n}",
        bodies=[*links, *rods],
        joints=joints,
        loads=[Gravity((0, 0, -G))],
        start=start,
    )
    hung = ACROSS + MASS * LENGTH**2 / 4
    inertia, weight = (n + 1) * hung + n * MASS * LENGTH**2, ((n + 1) / 2 + n) * MASS * G * LENGTH

    def rate(_: float, y: Any) -> Any:
        return np.array([y[1], -weight / inertia * sin(y[0])])

    def forces(y: Any) -> Any:
        """What turns a link besides its weight is at its end; it tells what the next rod takes over."""
        (a, w), dw = y, rate(0, y)[1]
        way = np.array([cos(a), sin(a)])
        felt = MASS * (LENGTH * (dw * way + w**2 * np.array([-sin(a), cos(a)])) + [0, G])
        half = MASS * (LENGTH / 2 * (dw * way + w**2 * np.array([-sin(a), cos(a)])) + [0, G])
        turns = hung * dw / LENGTH + MASS * G * sin(a) / 2
        found: dict[str, float] = {}
        before = np.zeros(2)  # what link k - 1 and the rod after it give link k
        for k in range(n + 1):
            up = felt[1] / 2 if k < n else 0.0
            whole = (turns + (up - before[1]) * sin(a)) / cos(a)  # along x, of both rods
            after = np.array([before[0] - whole if k < n else 0.0, up])  # rod k + 1 receives
            found[f"A{k}"] = np.linalg.norm(half + after - before)
            before = after - felt
            if k < n:
                found |= {f"B{k + 1}": np.linalg.norm(after), f"C{k + 1}": np.linalg.norm(before)}
        return np.array([found[name] for name in names])

    names = [joint.name for joint in joints]
    outputs = [f"force.{name}.norm" for name in names]
    return Family(2 * n + 1, model, outputs, np.array([ANGLE, 0.0]), rate, forces)


def by_scipy(family: Family, tolerance: float) -> tuple[Any, int]:
    """Forces (samples, joints), and steps: one run, of which samples are dense output."""
    found, times = [], iter(np.linspace(0, STOP, round(STOP / STEP) + 1)[1:])
    solver = DOP853(family.rate, 0.0, family.start, STOP, rtol=tolerance, atol=tolerance)
    steps, t = 0, next(times)
    while solver.status == "running":
        solver.step()
        steps += 1
        at = solver.dense_output()
        while t is not None and t <= solver.t:
            found.append(family.forces(at(t)))
            t = next(times, None)
    return np.array(found), steps


def line(family: Family, fmu: Ours) -> tuple[list[float], str]:
    """Steps, processor time a step [us] and SciPy's steps at ERROR; both programs at SHOWN."""
    exact, _ = by_scipy(family, EXACT)
    ours, cost, angles = Curve("steps"), Curve("us"), Curve("SciPy's steps")
    for tolerance in TOLERANCES:
        found, steps = by_scipy(family, tolerance)
        angles.add(tolerance, found, exact, steps, steps)
        for _ in range(REPEATS):
            command = fmu.command(tolerance, STEP, family.outputs, step=STEP, stop=STOP)
            answer = launch(command, len(family.outputs))
            assert answer is not None, f"{family.model.name} does not run at {tolerance:g}"
            steps, ns, found = answer
            ours.add(tolerance, found, exact, steps, steps)
            cost.add(tolerance, found, exact, 1e-3 * ns, steps)
    at_tolerance = " | ".join(f"{c.steps[SHOWN]}, {c.errors[SHOWN]:.0e}" for c in (ours, angles))
    steps = ours.at(ERROR)
    return [steps, cost.at(ERROR) / steps, angles.at(ERROR)], at_tolerance


def lines(make: Callable[[int], Family], sizes: Sequence[int]) -> Iterator[str]:
    """A row a size."""
    before: tuple[int, list[float]] | None = None
    for n in sizes:
        family = make(n)
        with tempfile.TemporaryDirectory() as out:
            scene = Scene(family.model.name, stop_time=STOP)
            fmu = build_fmu(family.model, out, scene, target="native", check=False)
            found, at_tolerance = line(family, unpacked(fmu, Path(out)))
        growth = ""
        if before is not None:
            grown = math.log(family.bodies / before[0])
            growth = " ".join(
                f"{math.log(b / a) / grown:.2f}" for a, b in zip(before[1], found, strict=True)
            )
        cells = " | ".join(f"{x:.3g}" for x in found)
        yield f"| {family.bodies} | {cells} | {at_tolerance} | {growth} |"
        before = family.bodies, found


FAMILIES = {"hanging": hanging, "windows": windows}


def main() -> None:
    """A table a family."""
    names = [word for word in sys.argv[1:] if word in FAMILIES] or list(FAMILIES)
    sizes = [int(word) for word in sys.argv[1:] if word not in FAMILIES] or [4, 16, 64]
    warnings.simplefilter("ignore")
    for name in names:
        print(f"\n## {name}, at an error of {ERROR:g}; at a tolerance of {SHOWN:g}\n")
        print("| bodies | steps | us a step | SciPy's | steps, error | SciPy's | exponents |")
        print("| --- | --- | --- | --- | --- | --- | --- |")
        for row in lines(FAMILIES[name], sizes):
            print(row, flush=True)


if __name__ == "__main__":
    main()
