"""What Coulomb friction costs: against a constraint that always sticks, and against a tanh of the slip.

    python benchmarks/friction.py

A disk that rolls to and fro, with friction that never slips and as a plain constraint; a mass on a spring
that rubs on the floor and comes to rest, with friction and with lambda = -mu N tanh(s/s0), for smaller
and smaller s0.  Prints ratios of the time that the steps take (medians), and the errors of the place.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from pathlib import Path

import fmpy
from fmpy.fmi2 import FMU2Slave
from sympy import sin, symbols, tanh
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, Scene, multiplier
from lagfmu.fmu.write import write
from lagfmu.prepare.prepare import prepare

x, z, theta = dynamicsymbols("x z theta")
m, R, k, g, s0 = symbols("m R k g s0", positive=True)
REPEATS, STOP = 15, 20.0


def disk(friction: bool) -> Model:
    """A disk on an incline of 0.3 rad."""
    row = Nonholonomic("rolling", x.diff() - R * theta.diff(), while_closed="plane")
    grip = [Friction("grip", of=["rolling"], normal=multiplier("plane"), static=5)]
    return Model(
        name="Rubbing" if friction else "Rolling",
        lagrangian=m * (x.diff() ** 2 + z.diff() ** 2) / 2
        + m * R**2 * theta.diff() ** 2 / 4
        - k * x**2 / 2
        - m * g * (z - 0.3 * sin(x / R) * R),
        coordinates={x: "m", z: "m", theta: "rad"},
        constraints=[Contact("plane", z), row, *(grip if friction else [])],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(R, 0.1, "m"),
            Parameter(k, 30.0, "N/m"),
            Parameter(g, 9.81, "m/s^2"),
        ],
        start={x: 0.3},
    )


def mass(smooth: float | None) -> Model:
    """A mass on a spring that rubs; `smooth`: s0 [m/s] of the tanh."""
    common = {
        "lagrangian": m * (x.diff() ** 2 + z.diff() ** 2) / 2 - k * x**2 / 2 - m * g * z,
        "coordinates": {x: "m", z: "m"},
        "start": {x: 0.2},
    }
    numbers = [Parameter(m, 1.0, "kg"), Parameter(k, 100.0, "N/m"), Parameter(g, 9.81, "m/s^2")]
    if smooth is not None:
        return Model(
            name="Smooth",
            constraints=[Contact("floor", z)],
            forces={x: -0.2 * m * g * tanh(x.diff() / s0)},
            parameters=[*numbers, Parameter(s0, smooth, "m/s")],
            **common,
        )
    return Model(
        name="Mass",
        constraints=[
            Contact("floor", z),
            Nonholonomic("rest", x.diff()),
            Friction("grip", of=["rest"], normal=multiplier("floor"), static=0.2),
        ],
        parameters=numbers,
        **common,
    )


def seconds(model: Model, read: str) -> tuple[float, list[float]]:
    """Median wall time of a run [s], and what is read at every second of it."""
    with tempfile.TemporaryDirectory() as folder:
        path = write(prepare(model, Scene(model.name)), Path(folder), (), target="native")
        description = fmpy.read_model_description(str(path))
        at = next(v.valueReference for v in description.modelVariables if v.name == read)
        fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        fmu.instantiate()
        times, values = [], []
        for _ in range(REPEATS):
            fmu.setupExperiment(tolerance=1e-8)
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
            begun, values = time.perf_counter(), []
            for step in range(int(STOP)):
                fmu.doStep(float(step), 1.0)
                values.append(fmu.getReal([at])[0])
            times.append(time.perf_counter() - begun)
            fmu.reset()
        fmu.freeInstance()
    return statistics.median(times), values


def main() -> None:
    rolling, _ = seconds(disk(friction=False), "lambda.rolling")
    rubbing, _ = seconds(disk(friction=True), "lambda.rolling")
    print(f"friction that sticks, over the same constraint without: {rubbing / rolling:.2f}")
    exact, right = seconds(mass(None), "x")
    print(f"a mass that rubs and comes to rest: {1e6 * exact / STOP:.0f} us per simulated second")
    for smooth in (1e-3, 1e-5, 1e-7, 1e-9):
        took, found = seconds(mass(smooth), "x")
        miss = max(abs(a - b) for a, b in zip(found, right, strict=True))
        print(f"tanh(s/{smooth:.0e} m/s): {took / exact:.1f} times that, x off by {miss:.1e} m")


if __name__ == "__main__":
    main()
