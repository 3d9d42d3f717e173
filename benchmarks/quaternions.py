"""Angular velocities as speeds with a unit quaternion, against Euler parameters whose length a row holds.

    python benchmarks/quaternions.py

The same body, as native FMUs: free near its middle axis; heavy, about a fixed point; and the same with its
centre of mass as coordinates, held by a ball joint.  For each tolerance: internal steps, the time of
fmi2DoStep (the least of interleaved repetitions), and the largest error over 20 communication points, against
Newton's and Euler's equations by hand (independent/rigid.py) in steps of 5 ms: of the rotation matrix, of the
angular velocity relative to its largest, of the joint's force relative to its largest.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp
from sympy import Matrix
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter, Scene, build_fmu
from lagfmu.fmu.session import Session

sys.path.insert(0, str(Path(__file__).parent / "independent"))
from joints import pin
from rigid import GROUND, Mass, Mechanism, Vector, rotation, state

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
REPEATS, POINTS, STOP = 15, 20, 20.0
MASS, TIP = Mass.of(2.0, 1.0, 2.0, 3.0), (0.0, 0.0, -0.3)
HEAVY = 9.81  # m/s2
r, p = Matrix(dynamicsymbols("x y z")), Matrix(dynamicsymbols("p0:4"))
w = Matrix(dynamicsymbols("wx wy wz"))
m, A, B, C, g, d = symbols = sp.symbols("m A B C g d", positive=True)
UNITS = ("kg", "kg.m^2", "kg.m^2", "kg.m^2", "m/s^2", "m")


@dataclass(frozen=True)
class Case:
    """What holds the body: nothing, a point that does not move, or a ball joint with its force."""

    name: str
    gravity: float
    held: str
    spin: Sequence[float]  # rad/s

    def start(self) -> tuple[Mechanism, Vector]:
        """By hand, and where it begins."""
        joints = {"A": [partial(pin, GROUND, (0, 0, 0), 0, TIP)]} if self.held else {}
        by_hand = Mechanism([MASS], joints, (0, 0, -self.gravity))
        y = state((np.negative(TIP), np.eye(3)))
        y[10:] = self.spin
        return by_hand, by_hand.speeds(y, {0: self.spin}) if self.held else y

    def model(self, speeds: bool) -> Model:
        """With the angular velocity as speeds, or with the parameters' own rates and their length held."""
        _, y = self.start()
        e0, e = p[0], Matrix(p[1:])
        local = Matrix.hstack(-e, e0 * sp.eye(3) - skew(e))  # w = 2 local p', p' = local^T w / 2
        W = w if speeds else 2 * local * p.diff(dynamicsymbols._t)
        tip = (
            (e0**2 - e.dot(e)) * Matrix([0, 0, -d])
            + 2 * e * -d * e[2]
            + 2 * e0 * e.cross(Matrix([0, 0, -d]))
        )
        moves = self.held == "joint"
        J = (A, B, C) if moves or not self.held else (A + m * d**2, B + m * d**2, C)
        energy = sum(j * x**2 / 2 for j, x in zip(J, W, strict=True))
        rows = [] if speeds else [Holonomic("unit", p.dot(p) - 1)]
        coordinates = dict.fromkeys(p, "1")
        start = dict(zip(p, map(float, y[3:7]), strict=True))
        if speeds:
            start |= dict(zip(w, map(float, self.spin), strict=True))
        else:
            rates = local.T.subs(start) * Matrix(self.spin) / 2
            start |= dict(zip(p.diff(), map(float, rates), strict=True))
        if moves:
            v = r.diff(dynamicsymbols._t)
            energy += m * v.dot(v) / 2
            coordinates |= dict.fromkeys(r, "m")
            rows += [Holonomic(f"A.{x}", f) for x, f in zip("xyz", r + tip, strict=True)]
            start |= dict(zip([*r, *v], map(float, [*y[:3], *y[7:10]]), strict=True))
        own = {
            "speeds": dict.fromkeys(w, "rad/s"),
            "kinematics": dict(zip(p, local.T * w / 2, strict=True)),
        }
        values = (MASS.m, *np.diag(MASS.J), self.gravity, -TIP[2])
        return Model(
            f"{self.name}{'Speeds' if speeds else 'Parameters'}",
            lagrangian=energy - (m * g * (r[2] if moves else -tip[2]) if self.held else 0),
            coordinates=coordinates,
            constraints=rows,
            parameters=[
                Parameter(s, float(x), unit)
                for s, x, unit in zip(symbols, values, UNITS, strict=True)
                if s in energy.free_symbols or (self.held and s in (m, g, d))
            ],
            start=start,
            **(own if speeds else {}),
        )


def skew(e: Matrix) -> Matrix:
    """The matrix of e x."""
    return Matrix([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])


CASES = (
    Case("Free", 0.0, "", (0.0, -5.0, 0.05)),
    Case("Top", HEAVY, "point", (0.1, 0.2, 5.0)),
    Case("TopOnABall", HEAVY, "joint", (0.1, 0.2, 5.0)),
)


def errors(case: Case, run: Any, times: Vector, states: Vector, by_hand: Mechanism) -> list[float]:
    """Of the rotation, of the angular velocity, of the joint's force."""
    e = np.stack([run[f"p{k}"] for k in range(4)], axis=1)
    R, wanted = (np.array([rotation(x) for x in all_]) for all_ in (e, states[:, 3:7]))
    own = np.einsum("tji,tj->ti", wanted, states[:, 10:])
    if "wx" in run.dtype.names:
        seen = np.stack([run[x] for x in ("wx", "wy", "wz")], axis=1)
    else:
        rates = np.stack([run[f"der(p{k})"] for k in range(4)], axis=1)
        u = e[:, 1:]
        seen = 2 * (e[:, :1] * rates[:, 1:] - rates[:, :1] * u - np.cross(u, rates[:, 1:]))
    found = [np.abs(R - wanted).max(), np.abs(seen - own).max() / np.abs(own).max()]
    if case.held == "joint":
        force = np.stack([run[f"lambda.A.{x}"] for x in "xyz"], axis=1)
        right = np.array(
            [by_hand.solve(t, y)[2]["A"][:3] for t, y in zip(times, states, strict=True)]
        )
        found.append(np.abs(force - right).max() / np.abs(right).max())
    return found


def main() -> None:
    """A table a case."""
    times = np.linspace(0, STOP, POINTS + 1)
    with tempfile.TemporaryDirectory() as out:
        for case in CASES:
            by_hand, y = case.start()
            states = by_hand.moved(y, times, longest=0.005)
            paths = []
            for speeds in (True, False):
                model = case.model(speeds)
                scene = Scene(model.name, stop_time=STOP)
                paths.append(build_fmu(model, out, scene, target="native", check=False))
            kB = " and ".join(f"{path.stat().st_size / 1e3:.0f}" for path in paths)
            print(f"\n## {case.name}: FMUs of {kB} kB\n")
            print(
                "| tolerance | speeds: steps, ms, errors | parameters: steps, ms, errors | time ratio |"
            )
            print("| --- | --- | --- | --- |")
            sessions = [Session(path) for path in paths]
            for tolerance in TOLERANCES:
                least, cells = [np.inf, np.inf], ["", ""]
                for _ in range(REPEATS):
                    for k, session in enumerate(sessions):
                        run = session.run(times, tolerance=tolerance)
                        assert run.refusal is None, run.refusal
                        least[k] = min(least[k], run.seconds)
                        found = errors(case, run.rows, times, states, by_hand)
                        cells[k] = (
                            f"{run.rows['solver.steps'][-1]:.0f}, {1e3 * least[k]:.2f}, "
                            + " ".join(f"{x:.0e}" for x in found)
                        )
                print(
                    f"| {tolerance:.0e} | {' | '.join(cells)} | {least[1] / least[0]:.2f} |",
                    flush=True,
                )
            for session in sessions:
                session.close()


if __name__ == "__main__":
    main()
