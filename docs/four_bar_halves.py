"""Two halves of a four-bar, each an FMU, joined at a pin whose force IDA (SUNDIALS) solves for.

The crank and the coupler are one half, the rocker the other.  Each takes the force on its end of the pin
as inputs, and tells that end's position, velocity and acceleration.  With the force lambda on the first
half and -lambda on the second,

    0 = y' - f(t, y, lambda) ,   0 = a_A(t, y, lambda) - a_B(t, y, lambda)

is a differential-algebraic equation of index 1.  What drifts, p_A - p_B and v_A - v_B, is projected away
at each communication point.

    pip install scikit-sundae
    python docs/four_bar_halves.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Model, fmi3Float64
from numpy.typing import NDArray
from sksundae.ida import IDA
from sympy import Matrix, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Input, Model, Output, Parameter, build_fmu

Vector = NDArray[np.float64]

t = dynamicsymbols._t
crank, coupler, rocker, Fx, Fy = dynamicsymbols("crank coupler rocker Fx Fy")
mu, g, a, b, c, d = symbols("mu g a b c d", positive=True)
SIZES = {a: 0.5, b: 1.2, c: 1.0, d: 1.4}  # m: crank, coupler, rocker, frame
ANGLE, RATE = 1.0, 6.0  # rad, rad/s: of the crank at the start
COMMON = [Parameter(mu, 2.0, "kg/m", "mass of the bars"), Parameter(g, 9.81, "m/s^2")]


def closed() -> dict:
    """The start: the triangle of coupler, rocker and diagonal, and the rates that keep it closed."""
    arm = SIZES[a] * np.exp(1j * ANGLE)
    diagonal = SIZES[d] - arm
    cosine = (SIZES[b] ** 2 + abs(diagonal) ** 2 - SIZES[c] ** 2) / (2 * SIZES[b] * abs(diagonal))
    link = SIZES[b] * np.exp(1j * (np.angle(diagonal) + np.arccos(cosine)))
    lever = arm + link - SIZES[d]
    rates = np.linalg.solve(
        [[link.real, -lever.real], [link.imag, -lever.imag]], [-RATE * arm.real, -RATE * arm.imag]
    )
    angles = ANGLE, float(np.angle(link)), float(np.angle(lever))
    moving = zip((crank, coupler, rocker), angles, (RATE, *map(float, rates)), strict=True)
    return {
        key: value for q, angle, rate in moving for key, value in ((q, angle), (q.diff(), rate))
    }


START = closed()


def rod(base: Matrix, length, angle):
    """Lagrangian of a uniform rod from `base` on, and its end."""
    along = length * Matrix([cos(angle), sin(angle)])
    middle, mass = base + along / 2, mu * length
    v = middle.diff(t)
    L = mass * (v.dot(v) / 2 + length**2 * angle.diff(t) ** 2 / 24 - g * middle[1])
    return L, base + along


L_crank, joint = rod(Matrix([0, 0]), a, crank)
L_coupler, pin_a = rod(joint, b, coupler)
L_rocker, pin_b = rod(Matrix([d, 0]), c, rocker)


def of(lengths) -> list[Parameter]:
    return [*COMMON, *(Parameter(s, SIZES[s], "m") for s in lengths)]


def half(name: str, lagrangian, angles, pin: Matrix, lengths) -> Model:
    """One that is driven at its end of the pin."""
    motion = zip(
        ("p", "v", "a"), ("m", "m/s", "m/s^2"), (pin, pin.diff(t), pin.diff(t, 2)), strict=True
    )
    return Model(
        name=name,
        lagrangian=lagrangian,
        coordinates=dict.fromkeys(angles, "rad"),
        forces={q: Matrix([Fx, Fy]).dot(pin.diff(q)) for q in angles},
        inputs=[Input(Fx, "N"), Input(Fy, "N")],
        parameters=of(lengths),
        outputs=[
            Output(f"{kind}{axis}", value, unit)
            for kind, unit, values in motion
            for axis, value in zip("xy", values, strict=True)
        ],
        start={
            q: value for q, value in START.items() if q in (*angles, *(x.diff() for x in angles))
        },
    )


side_a = half("CrankAndCoupler", L_crank + L_coupler, (crank, coupler), pin_a, (a, b))
side_b = half("Rocker", L_rocker, (rocker,), pin_b, (c, d))
whole = Model(
    name="FourBar",
    lagrangian=L_crank + L_coupler + L_rocker,
    coordinates=dict.fromkeys((crank, coupler, rocker), "rad"),
    constraints=[
        Holonomic(f"pin.{axis}", p_a - p_b)
        for axis, p_a, p_b in zip("xy", pin_a, pin_b, strict=True)
    ],
    parameters=of((a, b, c, d)),
    start=START,
)


class Half:
    """An instance for model exchange: states x = (q1, v1, ...), and the force on its end of the pin."""

    def __init__(self, fmu: Path, folder: str, sign: float) -> None:
        told = fmpy.read_model_description(str(fmu))
        self.sign, self.reference = sign, {v.name: v.valueReference for v in told.modelVariables}
        self.states = [u.variable.derivative.name for u in told.derivatives]
        self.one = FMU3Model(
            guid=told.instantiationToken,
            unzipDirectory=fmpy.extract(str(fmu), f"{folder}/{fmu.stem}"),
            modelIdentifier=told.modelExchange.modelIdentifier,
        )
        self.one.instantiate()
        self.one.enterInitializationMode(startTime=0.0)
        self.one.exitInitializationMode()
        self.one.updateDiscreteStates()
        self.one.enterContinuousTimeMode()

    def get(self, *names: str) -> Vector:
        return np.array(self.one.getFloat64([self.reference[n] for n in names]))

    def put(self, time: float, x: Vector, force: Vector) -> None:
        self.one.setTime(time)
        self.one.setContinuousStates((fmi3Float64 * len(x))(*x), len(x))
        self.one.setFloat64([self.reference[n] for n in ("Fx", "Fy")], (self.sign * force).tolist())

    def rates(self) -> Vector:
        found = (fmi3Float64 * len(self.states))()
        self.one.getContinuousStateDerivatives(found, len(found))
        return np.array(found)

    def slopes(self, kind: str, by: list[str]) -> Vector:
        """How "p", "v" or "a" of the pin changes by each of these variables."""
        unknowns = [self.reference[f"{kind}{axis}"] for axis in "xy"]
        columns = [
            self.one.getDirectionalDerivative(unknowns, [self.reference[n]], [1.0]) for n in by
        ]
        return np.array(columns).T


class Joined:
    """Both halves: y = (states of the first, of the second, lambda)."""

    def __init__(self, one: Half, other: Half) -> None:
        self.halves, self.n = (one, other), len(one.states)
        self.begin = np.concatenate([one.get(*one.states), other.get(*other.states), np.zeros(2)])

    def put(self, time: float, y: Vector) -> None:
        for h, x in zip(self.halves, (y[: self.n], y[self.n : -2]), strict=True):
            h.put(time, x, y[-2:])

    def apart(self, kind: str) -> Vector:
        """p_A - p_B, v_A - v_B or a_A - a_B."""
        one, other = (h.get(f"{kind}x", f"{kind}y") for h in self.halves)
        return one - other

    def residual(self, time: float, y: Vector, yp: Vector, res: Vector) -> None:
        self.put(time, y)
        res[:-2] = yp[:-2] - np.concatenate([h.rates() for h in self.halves])
        res[-2:] = self.apart("a")

    def project(self, time: float, y: Vector) -> Vector:
        """y onto the nearest positions that meet, then velocities, then the force; y'."""
        one, other = self.halves
        for kind, first, rounds in (("p", 0, 8), ("v", 1, 1)):
            for _ in range(rounds):
                self.put(time, y)
                J = np.hstack(
                    [
                        one.slopes(kind, one.states[first::2]),
                        -other.slopes(kind, other.states[first::2]),
                    ]
                )
                y[first:-2:2] -= np.linalg.pinv(J) @ self.apart(kind)
        self.put(time, y)
        slope = sum(h.slopes("a", ["Fx", "Fy"]) for h in self.halves)
        y[-2:] -= np.linalg.solve(slope, self.apart("a"))
        self.put(time, y)
        return np.concatenate([*(h.rates() for h in self.halves), np.zeros(2)])

    def run(self, times: Vector, tolerance: float) -> Vector:
        """y at each time."""
        y, found = self.begin.copy(), []
        ida = IDA(
            self.residual,
            algebraic_idx=[len(y) - 2, len(y) - 1],
            rtol=tolerance,
            atol=tolerance,
            max_num_steps=100_000,
        )
        for k, time in enumerate(times):
            yp = self.project(time, y)
            found.append(y.copy())
            if k + 1 < len(times):
                ida.init_step(time, y, yp)
                y = ida.step(times[k + 1], tstop=times[k + 1]).y.copy()
        return np.array(found)


def joined(folder: str) -> Joined:
    """The two FMUs, built and started."""
    sides = [build_fmu(model, folder, fmi=3, check=False) for model in (side_a, side_b)]
    return Joined(*(Half(fmu, folder, s) for fmu, s in zip(sides, (1.0, -1.0), strict=True)))


if __name__ == "__main__":
    from lagfmu import simulate

    times = np.linspace(0, 2, 21)
    with tempfile.TemporaryDirectory() as folder:
        force = joined(folder).run(times, 1e-11)[:, -2:]
    one = simulate(whole, stop_time=2.0, step_size=0.1, tolerance=1e-12)
    for axis, found in zip("xy", force.T, strict=True):
        expected = one[f"lambda.pin.{axis}"]
        print(f"lambda.pin.{axis}: {np.abs(found - expected).max() / np.abs(expected).max():.1e}")
