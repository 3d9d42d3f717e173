"""Newton's and Euler's laws of each body, on what a run returned.

At each instant an FMU solves M v' = F + G^T lambda, backward stably, so that what is left of a body's law is
below (8 N + c) u times the sizes of its terms (Higham, Accuracy and Stability of Numerical Algorithms, 2nd
ed., sect. 3.1 and 9.3): N speeds and rows, u = 2^-53, and c operations on the way from what the FMU tells.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from ..fmu.closed_forms import motion_of, needed, stated
from ..fmu.read import Trajectory
from ..model.closed_form import GROUND, Act, Laws, Where
from ..model.elements import Expr
from ..numeric.functions import rotation
from .check import Check
from .closed_forms import evaluate, measured

Floats = NDArray[np.float64]
U = 2.0**-53
OWN, EACH = 60, 120  # operations: of a law without anything that acts, and of each that does
NEAR = 1e-9  # of the terms of a jump's argument: nearer to it an event has just come, or comes


class CarriedLaws:
    """The laws of an FMU's bodies, as a run is held against them (check.Against)."""

    stop_time = None

    def __init__(self, laws: Laws, known: set[str]) -> None:
        self.laws, self.bodies = laws, stated(laws, known)

    @property
    def left_out(self) -> int:
        """Statements that need what this FMU does not have."""
        return 2 * (len(self.laws.names) - len(self.bodies))

    @property
    def variables(self) -> set[str]:
        """All that they need."""
        return set().union(*(needed(self.laws, k) for k in self.bodies))

    def checks(self, result: Trajectory, values: Mapping[str, float]) -> list[Check]:
        """Two statements a body."""
        run = _Run(self.laws, result, values)
        return [check for k in self.bodies for check in run.checks(k)]


class _Run:
    """What acts on the bodies along a run: arrays (points, 3)."""

    def __init__(self, laws: Laws, result: Trajectory, values: Mapping[str, float]) -> None:
        self.laws, self.result, self.values = laws, result, values
        self.frames: dict[int, Floats] = {}
        self.acting: list[list[Act]] = [[] for _ in laws.names]
        for act in laws.acts:
            for k in act.bodies - {GROUND}:
                self.acting[k].append(act)

    @cached_property
    def chosen(self) -> NDArray[np.bool_]:
        """Points at which no load jumps."""
        found = np.ones(len(self.result), dtype=bool)
        for h in self.laws.jumps:
            size = sum(np.abs(self.column(term)) for term in sp.Add.make_args(h))
            found &= np.abs(self.column(h)) > NEAR * size
        return found

    def column(self, e: Expr) -> Floats:
        """The values of an expression."""
        if e.is_Symbol and str(e) in (self.result.dtype.names or ()):
            return np.asarray(self.result[str(e)], dtype=float)
        if e.is_Symbol and str(e) in self.values:
            return np.full(len(self.result), self.values[str(e)])
        if e.is_Number:
            return np.full(len(self.result), float(e))
        return evaluate(e, self.result, self.result, self.values, "laws of motion")

    def vector(self, several: object) -> Floats:
        """Three expressions."""
        return np.stack([self.column(sp.sympify(e)) for e in several], axis=-1)  # type: ignore[attr-defined]

    def told(self, names: list[str]) -> Floats:
        """Three variables; in the plane two."""
        found = np.zeros((len(self.result), 3))
        for k, name in enumerate(names):
            found[:, k] = self.result[name]
        return found

    def frame(self, body: int) -> Floats:
        """R (points, 3, 3) of a body: components in its frame -> along the ground's axes."""
        if body not in self.frames:
            self.frames[body] = self._frame(body)
        return self.frames[body]

    def _frame(self, body: int) -> Floats:
        if body == GROUND:
            return np.broadcast_to(np.eye(3), (len(self.result), 3, 3))
        turned = motion_of(self.laws, body)[2 if self.laws.planar else 3 :]
        told = [np.asarray(self.result[n], dtype=float) for n in turned]
        if self.laws.planar:
            c, s = np.cos(told[0]), np.sin(told[0])
            o, i = np.zeros_like(c), np.ones_like(c)
            return np.stack([c, -s, o, s, c, o, o, o, i], axis=-1).reshape(-1, 3, 3)
        return np.stack(rotation(told), axis=-1).reshape(-1, 3, 3)

    def center(self, body: int) -> Floats:
        """Where the centre of mass is [m]."""
        if body == GROUND:
            return np.zeros((len(self.result), 3))
        return self.told(motion_of(self.laws, body)[: 2 if self.laws.planar else 3])

    def point(self, where: Where) -> Floats:
        """Where a marker is [m]."""
        return self.center(where.body) + turned(self.frame(where.body), self.vector(where.arm))

    def axes(self, where: Where) -> Floats:
        """Its axes, as columns."""
        own = np.stack([self.vector(where.axes[3 * k : 3 * k + 3]) for k in range(3)], axis=-1)
        return self.frame(where.body) @ own

    def act(self, act: Act) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """The point, the force and the torque on the body `on`, along the ground's axes, and their sizes."""
        point, force, torque = self.point(act.on), self.vector(act.force), self.vector(act.torque)
        size = np.abs(self.column(sp.sympify(act.size)))
        if act.line:
            other = self.point(act.along)
            d, far = other - point, norm(other) + norm(point)
            pulled = norm(force) * (1 + far / norm(d)) + size * far + norm(torque)
            return point, force[:, :1] * d / norm(d)[:, None], 0 * d, pulled, 0 * far
        R = self.axes(act.along)
        sizes = [norm(v) + size * norm(v).any() for v in (force, torque)]
        return point, turned(R, force), turned(R, torque), sizes[0], sizes[1]

    def checks(self, body: int) -> list[Check]:
        """Of one body."""
        laws, name, count = self.laws, self.laws.names[body], 2 if self.laws.planar else 3
        moving = motion_of(laws, body, True)
        m = self.column(sp.sympify(laws.masses[body]))[:, None]
        weight, center = m * self.vector(laws.gravity), self.center(body)
        second = moving[3:] if laws.planar else moving[7:]
        inert = m * self.told(second[:count])
        force, moment = weight - inert, np.zeros_like(inert)
        sizes = [norm(weight) + norm(inert), np.zeros(len(inert))]
        for act in self.acting[body]:
            point, push, turn, of_push, of_turn = self.act(act)
            sign = (act.on.body == body) - (act.against == body)
            force += sign * push
            moment += sign * (turn + np.cross(point - center, push))
            sizes[0] += of_push
            sizes[1] += of_turn + of_push * (norm(point) + norm(center))
        for turning in self.turning(body, second[count:]):
            moment -= turned(self.frame(body), turning)
            sizes[1] += norm(turning)
        allowed = (8 * laws.unknowns + OWN + EACH * len(self.acting[body])) * U
        return [
            self.check(f"Newton's law of {name}", force, sizes[0], allowed),
            self.check(f"Euler's law of {name}", moment, sizes[1], allowed),
        ]

    def turning(self, body: int, moving: list[str]) -> list[Floats]:
        """J w' and w x J w, in the body's frame; in the plane the first alone."""
        J = [self.column(sp.sympify(x)) for x in self.laws.inertias[body]]
        if self.laws.planar:
            found = np.zeros((len(self.result), 3))
            found[:, 2] = J[0] * self.result[moving[0]]
            return [found]
        xx, yy, zz, xy, xz, yz = J
        tensor = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(-1, 3, 3)
        w, rate = self.told(moving[:3]), self.told(moving[3:])
        return [turned(tensor, rate), np.cross(w, turned(tensor, w))]

    def check(self, name: str, left: Floats, size: Floats, allowed: float) -> Check:
        """What is left of a law, against the largest size of its terms."""
        if not self.chosen.any():
            return Check(name, 0.0, allowed, 0)
        off, where = norm(left)[self.chosen], self.chosen
        return measured(name, allowed, self.result, where, off, 0 * off, size[self.chosen])


def turned(R: Floats, v: Floats) -> Floats:
    """R v at each point."""
    return np.asarray(np.einsum("nij,nj->ni", R, v))


def norm(v: Floats) -> Floats:
    """|v| at each point."""
    return np.asarray(np.sqrt((v * v).sum(axis=-1)))
