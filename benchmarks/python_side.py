"""Peers of the native target that run in Python: our python target, and SciPy on the index-1 equations."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import fmpy
import numpy as np
from numpy.typing import NDArray
from programs import STEP, STOP, Curve, Problem, built, start_values
from scipy.integrate import solve_ivp

import lagfmu

Answer = tuple[NDArray[Any], int]
METHODS = ("RK45", "DOP853", "Radau", "LSODA")


def curves(problem: Problem, tolerances: list[float], rounds: int) -> dict[str, Curve]:
    """Every peer in Python, interleaved."""
    runs: dict[str, Callable[[float], Answer]] = {
        "python FMU by fmpy": fmu_run(problem),
        "lagfmu.simulate": lambda tolerance: in_process(problem, tolerance),
    }
    for method in METHODS:
        runs[f"solve_ivp {method}"] = lambda tol, k=method: index_one(problem, k, tol)
    result = {label: Curve(label) for label in runs}
    for _ in range(rounds):
        for tolerance in tolerances:
            for label, run in runs.items():
                if "Radau" in label and tolerance < 1e-8:
                    continue  # of order 5 with a Jacobian by differences: minutes
                begun = time.process_time()
                lam, steps = run(tolerance)
                us = 1e6 * (time.process_time() - begun) / STOP
                result[label].add(tolerance, lam, problem.exact, us, steps)
    return result


def _columns(problem: Problem, trajectory: Any) -> Answer:
    lam = np.stack([trajectory[name][1:] for name in problem.multipliers], -1)
    return lam, int(trajectory["solver.steps"][-1])


def fmu_run(problem: Problem) -> Callable[[float], Answer]:
    """Simulates the python FMU with fmpy; unpacked and read once."""
    fmu = fmpy.extract(str(built(problem, "python")))
    description = fmpy.read_model_description(fmu)

    def run(tolerance: float) -> Answer:
        trajectory = fmpy.simulate_fmu(
            fmu,
            model_description=description,
            stop_time=STOP,
            output_interval=STEP,
            relative_tolerance=tolerance,
            output=[*problem.multipliers, "solver.steps"],
            validate=False,
        )
        return _columns(problem, trajectory)

    return run


def in_process(problem: Problem, tolerance: float) -> Answer:
    """The python target's solver without an FMU around it."""
    return _columns(problem, lagfmu.simulate(problem.prepared, STOP, STEP, tolerance))


def index_one(problem: Problem, method: str, tolerance: float) -> Answer:
    """What one writes without this package: the KKT matrix, numpy.linalg.solve, solve_ivp.

    M, F, G, gamma come from the generated Python code.  Counts evaluations instead of steps.
    """
    system, equations = problem.prepared.system, problem.prepared.equations
    n, m = system.nv, system.m
    p = [float(parameter.value) for parameter in equations.model.parameters]
    K, b = np.zeros((n + m, n + m)), np.zeros(n + m)

    def solve(t: float, y: NDArray[Any]) -> NDArray[Any]:
        M, F, G, _, gamma = system.assemble(t, y[:n], y[n:], (), p)
        K[:n, :n], K[:n, n:], K[n:, :n] = M, -G.T, G
        b[:n], b[n:] = F, gamma
        return np.linalg.solve(K, b)

    def rate(t: float, y: NDArray[Any]) -> NDArray[Any]:
        return np.concatenate([y[n:], solve(t, y)[:n]])

    t = STEP * np.arange(1, round(STOP / STEP) + 1)
    rtol = max(tolerance, 3e-14)  # SciPy takes no less
    result = solve_ivp(
        rate, (0, t[-1]), start_values(equations), method=method, t_eval=t, rtol=rtol, atol=rtol
    )
    lam = np.array([solve(s, y)[n:] for s, y in zip(t, result.y.T, strict=True)])
    return lam, int(result.nfev)
