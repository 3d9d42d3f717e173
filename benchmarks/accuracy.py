"""What does accuracy cost?  lambda of the Cartesian pendulum over 10 s against Jacobi's elliptic functions.

    python benchmarks/accuracy.py [DIST]

Runs DIST/python/PendulumCartesian.fmu (default: dist) through fmpy, method by method and tolerance by
tolerance, interleaved; prints the largest error of lambda relative to its largest value, internal steps,
and the cost relative to the cheapest run (median of five).
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path

import fmpy
import numpy as np
from scipy.special import ellipj, ellipk

from lagfmu.methods import NUMBERS

RUNS = 5
STOP, STEP = 10.0, 0.1
TOLERANCES = [10.0**-k for k in range(3, 14)]


def exact(t: np.ndarray, theta0: float = 1.0, m: float = 1.0, g: float = 9.81, L: float = 1.0):
    """lambda = -T/(2L), T = m g (3 cos theta - 2 cos theta0), sin(theta/2) = k sn(w t + K)."""
    k = np.sin(theta0 / 2)
    sn = ellipj(np.sqrt(g / L) * t + ellipk(k**2), k**2)[0]
    cosine = 1 - 2 * (k * sn) ** 2
    return -m * g * (3 * cosine - 2 * np.cos(theta0)) / (2 * L)


def main() -> None:
    """Measure and print."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "dist")
    unpacked = fmpy.extract(str(folder / "python" / "PendulumCartesian.fmu"))
    description = fmpy.read_model_description(unpacked)
    cases = [(method, tol) for method in ("dop853", "radau5") for tol in TOLERANCES]
    cases = [c for c in cases if c[0] == "dop853" or c[1] >= 1e-8]
    seconds: dict[tuple[str, float], list[float]] = {c: [] for c in cases}
    errors, steps = {}, {}
    for _ in range(RUNS):
        for method, tol in cases:
            begun = time.perf_counter()
            result = fmpy.simulate_fmu(
                unpacked,
                model_description=description,
                stop_time=STOP,
                output_interval=STEP,
                relative_tolerance=tol,
                start_values={"solver.method": NUMBERS[method]},
                output=["lambda.rod", "solver.steps"],
                validate=False,
            )
            seconds[method, tol].append(time.perf_counter() - begun)
            lam = exact(result["time"])
            errors[method, tol] = np.abs(result["lambda.rod"] - lam).max() / np.abs(lam).max()
            steps[method, tol] = result["solver.steps"][-1]
    medians = {c: statistics.median(s) for c, s in seconds.items()}
    cheapest = min(medians.values())
    print(
        f"{'method':8} {'tolerance':>9} {'error of lambda':>16} {'steps':>6} {'cost':>6} {'ms/s':>6}"
    )
    for method, tol in cases:
        c = method, tol
        print(
            f"{method:8} {tol:9.0e} {errors[c]:16.1e} {steps[c]:6d} "
            f"{medians[c] / cheapest:6.1f} {1e3 * medians[c] / STOP:6.1f}"
        )


if __name__ == "__main__":
    main()
