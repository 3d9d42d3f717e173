"""CasADi swings the pole of CartPendulum.fmu up with the least effort, by direct collocation on the FMU.

Unknown are the states x at the points of collocation (Radau's, of order 5) in each of N intervals, and a
force F that is constant in each; minimize the integral of F^2 such that

    sum_j D_jk x_j = h f(x_k, F) ,   x = hanging at 0 ,   s = x = s' = x' = 0, y > 0 at T

f is the FMU: CasADi takes its first derivatives from it, and differences of these for the second.  Then fmpy
runs the FMU with the force that was found.

    pip install casadi
    python docs/swing_up.py
"""

from __future__ import annotations

import runpy
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import fmpy
import numpy as np
from numpy.typing import NDArray

from lagfmu import build_fmu

STOP, N, DEGREE = 2.0, 40, 3  # s; intervals; points of collocation in each
MOST = 40.0  # N
FORCE = "lambda.rod"


@dataclass(frozen=True)
class Plan:
    """At the ends of the intervals: time, states by name, and lambda before F changes there; F in each."""

    time: NDArray[np.float64]
    states: dict[str, NDArray[np.float64]]
    multiplier: NDArray[np.float64]
    force: NDArray[np.float64]


def build(folder: Path, fmi: int = 2) -> Path:
    """models/cart_pendulum.py as an FMU."""
    file = Path(__file__).parent.parent / "models" / "cart_pendulum.py"
    model = runpy.run_path(str(file))["model"]
    return build_fmu(model, folder, fmi=fmi, check=False)


def opened(fmu: Path, folder: Path) -> ca.DaeBuilder:
    """The FMU in CasADi; of its outputs the multiplier."""
    dae = ca.DaeBuilder("cart", str(fmpy.extract(str(fmu), str(folder))))
    dae.set_y([FORCE])
    return dae


def guess(t: float) -> dict[str, float]:
    """The pole turns evenly, the cart stands."""
    angle, rate = np.pi * t / STOP, np.pi / STOP
    return {
        "x": np.sin(angle),
        "y": -np.cos(angle),
        "der(x)": rate * np.cos(angle),
        "der(y)": rate * np.sin(angle),
    }


def plan(dae: ca.DaeBuilder, intervals: int = N) -> Plan:
    """The swing-up.  Raises RuntimeError if Ipopt finds none."""
    names, h = dae.x(), STOP / intervals
    f = dae.create("f", ["x", "u"], ["ode"])
    out = dae.create("out", ["x", "u"], ["y"])
    points = [0.0, *ca.collocation_points(DEGREE, "radau")]
    D = ca.collocation_coeff(points[1:])[0]  # (DEGREE + 1, DEGREE)
    place = {n: k for k, n in enumerate(names)}

    problem = ca.Opti()
    F = problem.variable(intervals)
    ends = [problem.variable(len(names)) for _ in range(intervals + 1)]
    problem.subject_to(problem.bounded(-MOST, F, MOST))
    for n, x in zip(names, ca.vertsplit(ends[0]), strict=True):
        problem.subject_to(x == (-1.0 if n == "y" else 0.0))
    for n in ("s", "x", "der(s)", "der(x)"):
        problem.subject_to(ends[-1][place[n]] == 0)
    problem.subject_to(ends[-1][place["y"]] > 0.5)
    for k in range(intervals):
        inner = [problem.variable(len(names)) for _ in range(DEGREE)]
        x = ca.horzcat(ends[k], *inner)
        rates = ca.horzcat(*(f(z, F[k]) for z in inner))
        problem.subject_to(ca.vec(x @ D - h * rates) == 0)
        problem.subject_to(ends[k + 1] == inner[-1])
        for part, z in zip(points, [ends[k], *inner], strict=True):
            for n, value in guess((k + part) * h).items():
                problem.set_initial(z[place[n]], value)
    for n, value in guess(STOP).items():
        problem.set_initial(ends[-1][place[n]], value)
    problem.minimize(h * ca.sumsqr(F))
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    found = problem.solve()
    X = np.array([found.value(z) for z in ends])
    force = np.array(found.value(F))
    before = np.concatenate([force[:1], force])
    told = [float(out(x, u)) for x, u in zip(X, before, strict=True)]
    columns = dict(zip(names, X.T, strict=True))
    return Plan(np.linspace(0.0, STOP, intervals + 1), columns, np.array(told), force)


def run(fmu: Path, found: Plan) -> NDArray[Any]:
    """The FMU in fmpy with the force that was found, from hanging at rest."""
    force = np.zeros(len(found.time), [("time", float), ("F", float)])
    force["time"], force["F"] = found.time, [*found.force, found.force[-1]]
    return fmpy.simulate_fmu(
        str(fmu),
        stop_time=STOP,
        output_interval=found.time[1],
        start_values={"x": 0.0, "y": -1.0},
        input=force,
        relative_tolerance=1e-10,
        output=["s", "x", "y", FORCE],
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        path = build(Path(made))
        swing = plan(opened(path, Path(made, "unzipped")))
        ran = run(path, swing)
    off = np.abs(ran[FORCE][1:] - swing.multiplier[1:]).max() / np.abs(swing.multiplier).max()
    print(
        f"F up to {np.abs(swing.force).max():.1f} N, effort {(swing.force**2).sum() * STOP / N:.2f} N^2.s"
    )
    print(f"the bob ends at y = {ran['y'][-1]:.6f} m, s = {ran['s'][-1]:.2e} m")
    print(f"lambda of the optimizer and of the simulation differ by {off:.1e} of its largest")
