"""`auto` against dop853 and radau5 on stiff and not so stiff systems, on native FMUs.

    python benchmarks/stiff.py

Steps, wall time of fmi2DoStep (the least of interleaved repetitions, 20 communication steps) and the
largest error of any coordinate against dop853 at 1e-13 (radau5 where that would take too many steps).
The last column is the time of auto in that of the better of the two.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import fmpy
import fmpy.fmi2
import numpy as np
from sympy import sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Model, Parameter, Scene, build_fmu
from lagfmu.methods import NUMBERS
from lagfmu.model.file import load

METHODS = ("dop853", "radau5", "auto")
TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
REPEATS = 9
POINTS = 20
x, y = dynamicsymbols("x y")
m, g, k, c, a, mu = symbols("m g k c a mu", positive=True)
KG, METRE = Parameter(m, 1.0, "kg"), Parameter(a, 1.0, "m")


def relaxation() -> Model:
    """Van der Pol's oscillator."""
    return Model(
        name="VanDerPol",
        kinetic_energy=m * x.diff() ** 2 / 2,
        forces={x: mu * (1 - x**2 / a**2) * x.diff() - k * x},
        coordinates={x: "m"},
        parameters=[KG, METRE, Parameter(k, 1.0, "N/m"), Parameter(mu, 1.0, "N.s/m")],
        start={x: 2.0},
    )


def elastic() -> Model:
    """A pendulum on a stiff spring with a damper beside it."""
    r = sqrt(x**2 + y**2)
    pull = c * (x * x.diff() + y * y.diff()) / r**2
    return Model(
        name="ElasticPendulum",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y - k * (r - a) ** 2 / 2,
        forces={x: -pull * x, y: -pull * y},
        coordinates={x: "m", y: "m"},
        parameters=[
            KG,
            METRE,
            Parameter(g, 9.81, "m/s^2"),
            Parameter(k, 1e6, "N/m"),
            Parameter(c, 1.0, "N.s/m"),
        ],
        start={x: 0.8414709848078965, y: -0.5403023058681398},
    )


def cases() -> Iterator[tuple[str, Model, dict[str, float], float]]:
    """Name, model, values, stop time [s]."""
    models = Path(__file__).parent.parent / "models"
    yield "slider-crank", load(models / "slider_crank.py").model, {}, 1.0
    cart = load(models / "cart_pendulum.py").model
    for friction in (1e2, 1e3, 1e4, 1e6, 1e8):
        yield f"cart, c = {friction:.0e}", cart, {"c": friction}, 2.0
    for strength, stop in ((1.0, 60.0), (10.0, 60.0), (100.0, 300.0), (1000.0, 2000.0)):
        yield f"van der Pol, mu = {strength:g}", relaxation(), {"mu": strength}, stop
    for stiffness, damping in ((1e4, 1e5), (1e6, 2e3), (1e6, 1e2), (1e6, 1.0), (1e6, 1e-3)):
        name = f"elastic pendulum, {stiffness:.0e} {damping:.0e}"
        yield name, elastic(), {"k": stiffness, "c": damping}, 2.0


def run(
    fmu: Path, folder: str, values: dict[str, Any], tolerance: float, stop: float
) -> tuple[float, int, Any]:
    """Wall time [s] of fmi2DoStep, internal steps, coordinates at the communication points."""
    description = fmpy.read_model_description(str(fmu))
    reference = {v.name: v.valueReference for v in description.modelVariables}
    coordinates = [reference[n] for n in ("x", "y", "s", "phi") if n in reference]
    one = fmpy.fmi2.FMU2Slave(
        guid=description.guid,
        unzipDirectory=folder,
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="stiff",
    )
    one.instantiate()
    one.setupExperiment(tolerance=tolerance)
    one.enterInitializationMode()
    for name, value in values.items():
        if isinstance(value, str):
            one.setInteger([reference[name]], [NUMBERS[value]])
        else:
            one.setReal([reference[name]], [value])
    one.exitInitializationMode()
    wall, seen = 0.0, []
    for n in range(POINTS):
        begun = time.perf_counter()
        one.doStep(stop * n / POINTS, stop / POINTS)
        wall += time.perf_counter() - begun
        seen.append(one.getReal(coordinates))
    steps = one.getInteger([reference["solver.steps"]])[0]
    one.terminate()
    one.freeInstance()
    return wall, steps, np.array(seen)


def main() -> None:
    """The table."""
    made: dict[str, Path] = {}
    print("| | tolerance | " + " | ".join(f"{n}: steps, ms, error" for n in METHODS) + " | |")
    print("| --- " * 6 + "|")
    with tempfile.TemporaryDirectory() as out:
        for name, model, values, stop in cases():
            if model.name not in made:
                made[model.name] = build_fmu(
                    model, out, Scene(model.name), target="native", check=False
                )
            fmu = made[model.name]
            folder = fmpy.extract(str(fmu))
            right = None
            for tolerance in TOLERANCES:
                walls: dict[str, list[float]] = {n: [] for n in METHODS}
                seen: dict[str, Any] = {}
                for turn in range(REPEATS):
                    for n in METHODS:
                        if turn and walls[n][0] > 0.5:
                            continue
                        seen[n] = run(fmu, folder, values | {"solver.method": n}, tolerance, stop)
                        walls[n].append(seen[n][0])
                if right is None:
                    best = "dop853" if seen["dop853"][1] < 2e5 else "radau5"
                    right = run(fmu, folder, values | {"solver.method": best}, 1e-13, stop)[2]
                cells, least = [], {n: min(walls[n]) for n in METHODS}
                for n in METHODS:
                    size = np.abs(right).max()
                    error = np.abs(seen[n][2] - right).max() / size
                    cells.append(f"{seen[n][1]}, {1e3 * least[n]:.3f}, {error:.0e}")
                ratio = least["auto"] / min(least["dop853"], least["radau5"])
                print(f"| {name} | {tolerance:.0e} | " + " | ".join(cells) + f" | {ratio:.2f} |")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
