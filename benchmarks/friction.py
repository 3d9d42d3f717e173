"""What Coulomb friction costs: against a constraint that always sticks, and against a tanh of the slip.

    python benchmarks/friction.py [stick | place | lambda ...]

stick: a disk that rolls to and fro, with friction that never slips and as a plain constraint.
place: a mass on a spring that rubs on the floor and comes to rest, with friction and with
lambda = -mu N tanh(s/s0), for smaller and smaller s0: what it costs, and how far the place is off.
lambda: the same comparison at equal error of lambda, for several models.  Each is run at several tolerances,
and with several s0; the error is the mean of |lambda - right| over the communication points, relative to the
largest |lambda|, `right` being Coulomb's law at a tolerance of 1e-13.  Of each kind the cheapest run that
reaches an error counts, in one communication step.

Prints ratios of the processor time that the steps take (medians).
"""

from __future__ import annotations

import statistics
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave
from sympy import cos, sin, symbols, tanh
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Friction, Model, Nonholonomic, Output, Parameter, Scene, multiplier
from lagfmu.fmu.write import write
from lagfmu.prepare.prepare import prepare

x, z, theta, r = dynamicsymbols("x z theta r")
m, R, k, g, s0, v = symbols("m R k g s0 v", positive=True)
REPEATS, STOP, STEP = 15, 20.0, 0.1
WIDTHS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # s0 [m/s]
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
LEVELS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
NUMBERS = [Parameter(m, 1.0, "kg"), Parameter(g, 9.81, "m/s^2")]


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
        parameters=[*NUMBERS, Parameter(R, 0.1, "m"), Parameter(k, 30.0, "N/m")],
        start={x: 0.3},
    )


@dataclass(frozen=True)
class Rubs:
    """A system that rubs: its coordinates and lengths, its contact, the slip velocity, the coefficient, and
    the normal force as it must be written down where there is no multiplier to name."""

    lagrangian: object
    coordinates: dict
    contact: object
    slip: object
    mu: float
    normal: object
    start: dict
    stop: float
    parameters: tuple = ()

    def model(self, smooth: bool) -> Model:
        common = {
            "lagrangian": self.lagrangian,
            "coordinates": self.coordinates,
            "start": self.start,
        }
        if not smooth:
            return Model(
                name="Exact",
                constraints=[
                    Contact("floor", self.contact),
                    Nonholonomic("row", self.slip),
                    Friction("grip", of=["row"], normal=multiplier("floor"), static=self.mu),
                ],
                parameters=[*NUMBERS, *self.parameters],
                outputs=[Output("friction", multiplier("row"), "N")],
                **common,
            )
        force = -self.mu * self.normal * tanh(self.slip / s0)
        return Model(
            name="Smooth",
            constraints=[Contact("floor", self.contact)],
            forces={
                q: force * self.slip.diff(q.diff())
                for q in self.coordinates
                if self.slip.diff(q.diff()) != 0
            },
            parameters=[*NUMBERS, *self.parameters, Parameter(s0, 1e-3, "m/s")],
            outputs=[Output("friction", force, "N")],
            **common,
        )


def rolling(kappa: float) -> object:
    return m * (x.diff() ** 2 + z.diff() ** 2 + kappa * R**2 * theta.diff() ** 2) / 2


MASS = m * (x.diff() ** 2 + z.diff() ** 2) / 2 - m * g * z
ROUND = {x: "m", z: "m", theta: "rad"}
SYSTEMS = {
    "a mass on a spring comes to rest": Rubs(
        MASS - k * x**2 / 2,
        {x: "m", z: "m"},
        z,
        x.diff(),
        0.2,
        m * g,
        {x: 0.2},
        3.0,
        (Parameter(k, 100.0, "N/m"),),
    ),
    "a bowling ball slides, then rolls": Rubs(
        rolling(0.4) - m * g * z,
        ROUND,
        z,
        x.diff() - R * theta.diff(),
        0.12,
        m * g,
        {x.diff(): 8.0},
        3.0,
        (Parameter(R, 0.108, "m"),),
    ),
    "a disk slides up an incline, rolls back": Rubs(
        rolling(0.5) - m * g * (z * cos(0.2) - x * sin(0.2)),
        ROUND,
        z,
        x.diff() - R * theta.diff(),
        0.3,
        m * g * cos(0.2),
        {x.diff(): -3.0},
        3.0,
        (Parameter(R, 0.1, "m"),),
    ),
    "a block swings on a belt, touching s = 0": Rubs(
        MASS - k * x**2 / 2,
        {x: "m", z: "m"},
        z,
        x.diff() - v,
        0.3,
        m * g,
        {x.diff(): 0.2},
        3.0,
        (Parameter(k, 100.0, "N/m"), Parameter(v, 0.2, "m/s")),
    ),
    "a particle slides down a rough sphere": Rubs(
        m * (r.diff() ** 2 + r**2 * theta.diff() ** 2) / 2 - m * g * r * cos(theta),
        {r: "m", theta: "rad"},
        r - R,
        R * theta.diff(),
        0.3,
        m * g * cos(theta) - m * R * theta.diff() ** 2,
        {r: 1.0, theta: 0.4},
        0.6,
        (Parameter(R, 1.0, "m"),),
    ),
}


class Bench:
    """One FMU, kept alive."""

    def __init__(self, model: Model, folder: Path) -> None:
        path = write(prepare(model, Scene(model.name)), folder, (), target="native")
        description = fmpy.read_model_description(str(path))
        self.at = {v.name: v.valueReference for v in description.modelVariables}
        self.fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=fmpy.extract(str(path)),
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="one",
        )
        self.fmu.instantiate()

    def run(
        self,
        read: str,
        stop: float,
        step: float,
        tolerance: float,
        values: dict[str, float],
        repeats: int,
    ) -> tuple[float, np.ndarray]:
        """Median processor time of the steps of a run [s], and what is read after each."""
        at, points, times, found = [self.at[read]], round(stop / step), [], []
        for _ in range(repeats):
            self.fmu.setupExperiment(tolerance=tolerance)
            self.fmu.enterInitializationMode()
            for name, value in values.items():
                self.fmu.setReal([self.at[name]], [value])
            self.fmu.exitInitializationMode()
            begun, found = time.process_time(), []
            for j in range(points):
                self.fmu.doStep(j * step, step)
                found.append(self.fmu.getReal(at)[0])
            times.append(time.process_time() - begun)
            self.fmu.reset()
        return statistics.median(times), np.array(found)


@contextmanager
def bench(model: Model) -> Iterator[Bench]:
    with tempfile.TemporaryDirectory() as folder:
        one = Bench(model, Path(folder))
        yield one
        one.fmu.freeInstance()


def stick() -> None:
    with bench(disk(friction=False)) as plain, bench(disk(friction=True)) as rubbing:
        ratios = []
        for _ in range(REPEATS):  # in turn
            bare, grips = (
                b.run("lambda.rolling", STOP, 1.0, 1e-8, {}, 5)[0] for b in (plain, rubbing)
            )
            ratios.append(grips / bare)
    print(
        f"friction that sticks, over the same constraint without: {statistics.median(ratios):.2f}"
    )


def place() -> None:
    rubs = SYSTEMS["a mass on a spring comes to rest"]
    with bench(rubs.model(smooth=False)) as one:
        exact, right = one.run("x", STOP, 1.0, 1e-8, {}, REPEATS)
    print(f"a mass that rubs and comes to rest: {1e6 * exact / STOP:.0f} us per simulated second")
    with bench(rubs.model(smooth=True)) as one:
        for width in (1e-3, 1e-5, 1e-7, 1e-9):
            took, found = one.run("x", STOP, 1.0, 1e-8, {"s0": width}, REPEATS)
            miss = np.abs(found - right).max()
            print(f"tanh(s/{width:.0e} m/s): {took / exact:.1f} times that, x off by {miss:.1e} m")


def cheapest(runs: list[tuple[float, float, str]], level: float) -> tuple[float, str]:
    return min(((cost, text) for error, cost, text in runs if error <= level), default=(np.inf, ""))


def judged(
    one: Bench, rubs: Rubs, tolerance: float, values: dict[str, float], right: np.ndarray
) -> tuple[float, float]:
    """The error of lambda, and the time of one communication step as long as the run."""
    _, found = one.run("friction", rubs.stop, STEP, tolerance, values, 1)
    cost, _ = one.run("friction", rubs.stop, rubs.stop, tolerance, values, 5)
    return float(np.abs(found - right).mean() / np.abs(right).max()), cost


def equal_errors() -> None:
    for name, rubs in SYSTEMS.items():
        exact, smooth = [], []
        with bench(rubs.model(smooth=False)) as sharp, bench(rubs.model(smooth=True)) as soft:
            _, right = sharp.run("friction", rubs.stop, STEP, 1e-13, {}, 1)
            for tolerance in TOLERANCES:
                exact.append((*judged(sharp, rubs, tolerance, {}, right), f"{tolerance:.0e}"))
                for width in WIDTHS:
                    text = f"s0 = {width:.0e} m/s, {tolerance:.0e}"
                    try:
                        found = judged(soft, rubs, tolerance, {"s0": width}, right)
                    except FMICallException:  # too many steps
                        soft.fmu.reset()
                        continue
                    smooth.append((*found, text))
        print(f"\n{name}: time of the tanh over that of Coulomb's law, at equal error of lambda")
        for level in LEVELS:
            (ours, how), (theirs, other) = cheapest(exact, level), cheapest(smooth, level)
            text = f"{theirs / ours:6.1f}" if np.isfinite(theirs) else "not reached by the tanh"
            if not np.isfinite(ours):
                text = "not reached by Coulomb's law"
            print(f"  {level:.0e}  {text}   ({how}; {other})")


if __name__ == "__main__":
    tasks = {"stick": stick, "place": place, "lambda": equal_errors}
    for task in sys.argv[1:] or tasks:
        tasks[task]()
