"""Mechanisms in space as data, all bodies parallel to the ground at the start; the same for both sides.

`reference` makes of them Newton's and Euler's equations (rigid.py), `model` a Model of lagfmu (space.py).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import joints
import numpy as np
import sympy as sp
from rigid import GROUND, Joint, Look, Mass, Mechanism, Vector, rotation, state
from space import Free, Parts
from system import System

from lagfmu import Holonomic, Model

Point = Sequence[float]


@dataclass(frozen=True)
class Tie:
    """A joint at a place of the start [m]: "ball"; with an axis "hinge", "slide"; "rod" to another place."""

    kind: str
    first: str
    second: str
    point: Point
    axis: Point = ()
    other: Point = ()


@dataclass(frozen=True)
class Spring:
    """Between two places of the start: stiffness [N/m] and length without force [m]."""

    first: str
    second: str
    point: Point
    other: Point
    k: float
    length: float


@dataclass(frozen=True)
class Linkage:
    """Bodies with the places of their centres of mass; what moves them is the angular velocity of some."""

    name: str
    bodies: Mapping[str, tuple[Mass, Point]]
    ties: Mapping[str, Tie]
    spin: Mapping[str, Point]
    gravity: float = 9.81
    springs: Sequence[Spring] = field(default=())

    def arm(self, body: str, point: Point) -> Vector:
        """A place of the start from the body's centre of mass."""
        r = (0, 0, 0) if body == "ground" else self.bodies[body][1]
        return np.subtract(point, r)

    def reference(self) -> tuple[Mechanism, Vector]:
        """Newton and Euler, and the state at the start."""
        numbers = {"ground": GROUND} | {name: k for k, name in enumerate(self.bodies)}

        def tied(tie: Tie) -> list[Joint]:
            first, second = numbers[tie.first], numbers[tie.second]
            a, b = self.arm(tie.first, tie.point), self.arm(tie.second, tie.other or tie.point)
            if tie.kind == "ball":
                return [partial(joints.pin, first, a, second, b)]
            if tie.kind == "hinge":
                return joints.hinge(first, a, tie.axis, second, b)
            if tie.kind == "rod":
                return [partial(joints.rod, first, a, second, b)]
            held = [partial(joints.along, first, a, e, second, b) for e in joints.across(tie.axis)]
            return [*held, partial(joints.turns, first, np.eye(3), second)]

        def pull(spring: Spring, look: Look) -> Mapping[int, Vector]:
            first, second = numbers[spring.first], numbers[spring.second]
            a, b = self.arm(spring.first, spring.point), self.arm(spring.second, spring.other)
            d = look.point(second, b) - look.point(first, a)
            size = np.linalg.norm(d)
            force = spring.k * (size - spring.length) * d / size
            return {
                first: np.array([*force, *np.cross(look.arm(first, a), force)]),
                second: -np.array([*force, *np.cross(look.arm(second, b), force)]),
            }

        masses, places = zip(*self.bodies.values(), strict=True)
        mechanism = Mechanism(
            masses,
            {name: tied(tie) for name, tie in self.ties.items()},
            (0, 0, -self.gravity),
            [partial(pull, spring) for spring in self.springs],
        )
        y = state(*((r, np.eye(3)) for r in places))
        return mechanism, mechanism.speeds(y, {numbers[k]: w for k, w in self.spin.items()})

    def model(self) -> Model:
        """The same for lagfmu, by hand in speeds."""
        _, y = self.reference()
        parts = Parts()
        states = y.reshape(-1, 13)
        free = {
            name: parts.body(name, mass, part)
            for (name, (mass, _)), part in zip(self.bodies.items(), states, strict=True)
        }
        for name, tie in self.ties.items():
            self._rows(parts, free, name, tie)
        for k, spring in enumerate(self.springs):
            a = self._at(parts, free, spring.first, f"s{k}", spring.point)
            b = self._at(parts, free, spring.second, f"t{k}", spring.other)
            stiffness = parts.number(f"k{k}", spring.k, "N/m")
            size = sp.sqrt((b - a).dot(b - a))
            parts.kinetic -= stiffness * (size - parts.number(f"l{k}", spring.length, "m")) ** 2 / 2
        return parts.model(self.name, self.gravity, {body.m: body.r[2] for body in free.values()})

    def _at(self, parts: Parts, free: Mapping[str, Free], body: str, label: str, at: Point) -> Any:
        if body != "ground":
            return free[body].at(label, self.arm(body, at))
        numbers = zip("xyz", at, strict=True)
        return sp.Matrix([parts.number(f"ground.{label}.{x}", v, "m") for x, v in numbers])

    def _rows(self, parts: Parts, free: Mapping[str, Free], name: str, tie: Tie) -> None:
        def turned(body: str, axis: Point) -> Any:
            return sp.Matrix(axis) if body == "ground" else free[body].axis(axis)

        a = self._at(parts, free, tie.first, name, tie.point)
        b = self._at(parts, free, tie.second, name, tie.other or tie.point)
        if tie.kind == "rod":
            span = float(np.linalg.norm(np.subtract(tie.other, tie.point)))
            length = parts.number(f"{name}.length", span, "m")
            d = b - a
            parts.rows.append(Holonomic(name, sp.sqrt(d.dot(d)) - length))
            return
        if tie.kind != "slide":
            parts.same(name, a, b)
        if tie.kind == "hinge":
            held = [turned(tie.first, e) for e in joints.across(tie.axis)]
            axis = np.asarray(tie.axis) / np.linalg.norm(tie.axis)
            parts.square(name, turned(tie.second, axis), held)
        if tie.kind == "slide":
            axes = joints.across(tie.axis)
            for k, e in enumerate(axes, 1):
                parts.rows.append(Holonomic(f"{name}.t{k}", turned(tie.first, e).dot(b - a)))
            axis = np.cross(*axes)
            held = [turned(tie.first, e) for e in axes]
            parts.square(name, turned(tie.second, axis), held)
            across = turned(tie.second, axes[0]).dot(turned(tie.first, axes[1]))
            parts.rows.append(Holonomic(f"{name}.r3", across))

    def system(self, stop: float) -> System:
        """Where each body is at `stop`, and what all joints together do to it."""

        def expected(stop: float) -> Mapping[str, float]:
            mechanism, begin = self.reference()
            y = mechanism.moved(begin, (0.0, stop))[-1]
            _, forces, _ = mechanism.solve(stop, y)
            found: dict[str, float] = {}
            for name, part, (f, tau) in zip(
                self.bodies, y.reshape(-1, 13), forces.reshape(-1, 2, 3), strict=True
            ):
                own = rotation(part[3:7]).T @ tau
                values = ("position", part[:3]), ("Q.position", f), ("Q.omega", own)
                for what, vector in values:
                    start = f"Q.{name}.{what[2:]}" if what[0] == "Q" else f"{name}.{what}"
                    found |= {f"{start}.{x}": v for x, v in zip("xyz", vector, strict=True)}
            least = 1e-3 * np.abs(forces).max()
            return {k: float(v) for k, v in found.items() if k[0] != "Q" or abs(v) > least}

        return System(self.model(), stop, expected)
