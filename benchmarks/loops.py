"""Closed loops of links in the plane on pins, and the forces in the pins that close them: for others.py.

A02 and A03 of the IFToMM library (tests/independent/iftomm.py): the N-four-bar mechanism with two windows,
which passes configurations in which its rows lose rank and its forces grow without bound, and Andrews'
squeezer.
The references are those of tests/independent/: a closed form, and Newton's and Euler's equations by hand.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "independent"))
import andrews
import iftomm
from plane import GROUND, Mechanism, Pin

from lagfmu import Model, Scene, build_fmu


@dataclass(frozen=True)
class Loops:
    """Bodies on pins; the first pins, one a body, make a tree, the others close its loops.

    `forces` names the joints of `model` whose forces are those of the closing pins, `carriers` the bodies in
    whose axes the FMU reports them.  `pull`: a torque [N m] on the first body; `spring`: body, point from its
    centre [m], hook on the ground [m], stiffness [N/m], length without force [m].
    """

    name: str
    model: Model
    mechanism: Mechanism
    start: Any  # (6 n): x, y, angle of each body, then their rates
    forces: Sequence[str]
    carriers: Sequence[str]
    exact: Any  # forces [N] (samples, 2 k) on the second bodies of the closing pins, x and y of the ground
    gravity: float
    step: float
    stop: float
    torque: float = 0.0
    spring: tuple[int, complex, complex, float, float] | None = None

    @property
    def times(self) -> list[float]:
        """The samples [s]."""
        return samples(self.stop, self.step)

    @property
    def tree(self) -> list[Pin]:
        """The pins by which bodies 0, 1, ... hang on what comes before them."""
        return list(self.mechanism.joints[: len(self.mechanism.masses)])

    @property
    def closing(self) -> list[Pin]:
        """The other pins."""
        return list(self.mechanism.joints[len(self.mechanism.masses) :])

    def build(self, out: Path) -> Path:
        """The native FMU."""
        scene = Scene(self.model.name, stop_time=self.stop)
        return build_fmu(self.model, out, scene, target="native", check=False)

    @property
    def outputs(self) -> list[str]:
        """What is read of it."""
        forces = [f"force.{name}.{x}" for name in self.forces for x in "xy"]
        return [*forces, *(f"{name}.orientation.z" for name in self.carriers)]

    def read(self, values: Any) -> Any:
        """Outputs (samples, m) -> forces in the axes of the ground."""
        k = len(self.forces)
        z = values[:, : 2 * k : 2] + 1j * values[:, 1 : 2 * k : 2]
        z = z * np.exp(1j * values[:, 2 * k :])
        return np.stack([z.real, z.imag], axis=2).reshape(len(values), 2 * k)


def samples(stop: float, step: float) -> list[float]:
    """Equidistant times [s] after 0."""
    points = round(stop / step)
    return [stop * k / points for k in range(1, points + 1)]


def windows() -> Loops:
    """A02."""
    system, n, step, stop = iftomm.windows(), iftomm.WINDOWS, 0.1, 2.0
    J = 1 / 12
    place, rate, pins, closing = [], [], [], []
    for k in range(n + 1):
        link = len(place)
        pins.append(Pin(GROUND, complex(k), link, -0.5j))
        place.append((k, 0.5, 0.0))
        rate.append((0.5, 0.0, -1.0))
        if k > 0:
            closing.append(Pin(link - 1, 0.5 + 0j, link, 0.5j))
        if k < n:
            pins.append(Pin(link, 0.5j, link + 1, -0.5 + 0j))
            place.append((k + 0.5, 1.0, 0.0))
            rate.append((1.0, 0.0, 0.0))
    mechanism = Mechanism([(1.0, J)] * len(place), [*pins, *closing], lambda _: np.zeros(0))
    names = [f"C{k}" for k in range(1, n + 1)]
    exact = []
    for t in samples(stop, step):
        known = system.expected(t)
        exact.append([known[f"force.{name}.{x}"] for name in names for x in "xy"])
    return Loops(
        *("windows", system.model, mechanism, np.ravel([*place, *rate]).astype(float)),
        *(names, [f"rod{k}" for k in range(1, n + 1)], np.array(exact), iftomm.G, step, stop),
    )


def squeezer() -> Loops:
    """A03."""
    mechanism, y = andrews.by_hand()
    step, stop = 0.002, 0.03
    exact, state = [], y
    for _ in samples(stop, step):
        state = mechanism.moved(state, step, 1e-4)
        exact.append(mechanism.solve(state)[1][14:])
    return Loops(
        *("squeezer", andrews.model(), mechanism, y, ["P3", "P4", "P6"], ["K2"] * 3),
        *(np.array(exact), 0.0, step, stop, andrews.TORQUE),
        (2, andrews.HOOK - andrews.BODIES[2][2], andrews.C, andrews.STIFFNESS, andrews.FREE),
    )


PROBLEMS = {"windows": windows, "squeezer": squeezer}
