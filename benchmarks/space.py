"""Mechanisms in space as data, and what their joints and springs do to each body: for others.py.

A04 and A05 of the IFToMM library (tests/independent/iftomm.py): Bricard's mechanism, whose six hinges hold
each other (no force of one alone is determined), and the stiff flyball governor.  Asked is m (a + g)
of each body, the sum of all that joints and springs do to it; the references
are those of tests/independent/: Newton's and
Euler's equations by hand, and Lagrange's in three coordinates.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import cos, pi, sin
from pathlib import Path
from typing import Any

import numpy as np
from loops import samples

sys.path.insert(0, str(Path(__file__).parent.parent / "tests" / "independent"))
import iftomm
from linkage import Linkage, Spring, Tie
from rigid import Mass
from system import G, integrate

from lagfmu import Scene, build_fmu


@dataclass(frozen=True)
class Space:
    """Bodies, parallel to the ground at the start; the first ties, one a body, make a tree."""

    name: str
    linkage: Linkage
    exact: Any  # m (a + g) [N] (samples, 3 n) of all bodies, x, y and z of the ground
    step: float
    stop: float

    @property
    def times(self) -> list[float]:
        """The samples [s]."""
        return samples(self.stop, self.step)

    @property
    def tree(self) -> list[Tie]:
        """The ties by which bodies hang on what comes before them."""
        return list(self.linkage.ties.values())[: len(self.linkage.bodies)]

    @property
    def closing(self) -> list[Tie]:
        """The other ties, all of them hinges."""
        return list(self.linkage.ties.values())[len(self.linkage.bodies) :]

    @property
    def masses(self) -> Any:
        """[kg] (3 n)."""
        return np.repeat([mass.m for mass, _ in self.linkage.bodies.values()], 3)

    def place(self, body: str) -> Any:
        """Of its centre of mass at the start [m]."""
        return np.zeros(3) if body == "ground" else np.asarray(self.linkage.bodies[body][1])

    def rates(self) -> Iterator[float]:
        """Of the tree's hinges and slides at the start [rad/s, m/s]: what slides does not move."""
        spin = {"ground": np.zeros(3)} | {name: np.zeros(3) for name in self.linkage.bodies}
        spin |= {name: np.asarray(w) for name, w in self.linkage.spin.items()}
        for tie in self.tree:
            turns = tie.kind == "hinge"
            yield float(np.dot(tie.axis, spin[tie.second] - spin[tie.first])) if turns else 0.0

    def build(self, out: Path) -> Path:
        """The native FMU."""
        model = self.linkage.model()
        scene = Scene(model.name, stop_time=self.stop)
        return build_fmu(model, out, scene, target="native", check=False)

    @property
    def outputs(self) -> Sequence[str]:
        """What is read of it."""
        return [f"der({name}.position.{x},2)" for name in self.linkage.bodies for x in "xyz"]

    def read(self, accelerations: Any) -> Any:
        """(samples, 3 n) [m/s^2] -> forces."""
        return self.masses * (accelerations + np.tile([0, 0, G], len(self.linkage.bodies)))


def bricard() -> Space:
    """A04."""
    linkage = iftomm.bars()
    mechanism, y = linkage.reference()
    found = Space("bricard", linkage, None, 0.1, 2.0)
    states = mechanism.moved(y, (0.0, *found.times))[1:]
    a = [mechanism.solve(t, y)[0][:, :3].ravel() for t, y in zip(found.times, states, strict=True)]
    return replace(found, exact=found.read(np.array(a)))


def governor() -> Space:
    """A05 as iftomm.py has it, its bodies' axes those of the ground at the start."""
    (upright, along), across, cube = iftomm.SHAFT, iftomm.ACROSS, iftomm.CUBE
    bodies = {
        "shaft": (Mass.of(iftomm.ROD, upright, upright, along), (0.0, 0.0, iftomm.HALF)),
        "base": (Mass.of(iftomm.BASE, cube, cube, cube), (0.0, 0.0, iftomm.HALF)),
    }
    ties = {
        "bearing": Tie("hinge", "ground", "shaft", (0, 0, 0), (0, 0, 1)),
        "guide": Tie("slide", "shaft", "base", (0, 0, iftomm.HALF), (0, 0, 1)),
    }
    springs = []
    for name, side in (("right", 1), ("left", -1)):
        way = np.array([side * cos(pi / 6), 0.0, -sin(pi / 6)])
        J = across * (np.eye(3) - np.outer(way, way)) + along * np.outer(way, way)
        hung = np.array([side * iftomm.SIDE, 0.0, 2 * iftomm.HALF])
        bodies[name] = Mass(iftomm.ARM, J), (hung + iftomm.MIDDLE * way).tolist()
        ties[f"{name}_hinge"] = Tie("hinge", "shaft", name, hung.tolist(), (0, 1, 0))
        ends = (hung + iftomm.HALF * way).tolist(), (side * iftomm.SIDE, 0.0, iftomm.HALF)
        numbers = iftomm.STIFFNESS, iftomm.FREE, iftomm.DAMPING
        springs.append(Spring(name, "base", *ends, *numbers))
    spin = dict.fromkeys(bodies, (0.0, 0.0, 2 * pi))
    linkage = Linkage("A05", bodies, ties, spin, G, springs)
    found = Space("governor", linkage, None, 0.1, 2.0)
    rows, y, t = [], np.array(iftomm.FLYBALLS), 0.0
    for until in found.times:
        y, t = integrate(iftomm.flyballs, y, until, t), until
        c, s = cos(y[5]), sin(y[5])
        out, aside, up = iftomm.swing(y)
        x, side = c * out - s * aside, s * out + c * aside
        lift = iftomm.flyballs(t, y)[4]
        rows.append([0, 0, 0, 0, 0, lift, x, side, up, -x, -side, up])
    return replace(found, exact=found.read(np.array(rows)))


PROBLEMS = {"bricard": bricard, "governor": governor}
