"""Mechanisms in space as data, all bodies parallel to the ground at the start; the same for both sides.

`reference` makes of them Newton's and Euler's equations (rigid.py), `model` bodies and joints of lagfmu.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import joints
import numpy as np
from rigid import GROUND, Joint, Look, Mass, Mechanism, Vector, cross, rotation, state
from system import System

from lagfmu import Model
from lagfmu.bodies import (
    Body,
    Distance,
    Gravity,
    Ground,
    Prismatic,
    Revolute,
    Spherical,
    SpringDamper,
    Universal,
    mechanism,
)

Point = Sequence[float]
JOINTS = {"ball": Spherical, "hinge": Revolute, "slide": Prismatic}


@dataclass(frozen=True)
class Tie:
    """A joint at a place of the start [m]: "ball"; with an axis "hinge", "slide"; "rod" to another place."""

    kind: str
    first: str
    second: str
    point: Point
    axis: Point = ()
    other: Point = ()
    second_axis: Point = ()  # of a "universal" joint, square to `axis`


@dataclass(frozen=True)
class Spring:
    """Between two places of the start: stiffness [N/m], length without force [m], damping [N s/m]."""

    first: str
    second: str
    point: Point
    other: Point
    k: float
    length: float
    c: float = 0.0

    def pull(self, d: Vector, rate: Vector) -> Vector:
        """On its second body [N], d [m] beyond its first's place, which draws away at `rate` [m/s]."""
        size = np.linalg.norm(d)
        return -(self.k * (size - self.length) + self.c * (rate @ d) / size) * d / size


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
            if tie.kind == "universal":
                across = partial(joints.square, first, tie.axis, second, tie.second_axis)
                return [partial(joints.pin, first, a, second, b), across]
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
            force = spring.pull(d, look.rate(second, b) - look.rate(first, a))
            return {
                first: -np.array([*force, *np.cross(look.arm(first, a), force)]),
                second: np.array([*force, *np.cross(look.arm(second, b), force)]),
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
        """The same for lagfmu, of bodies and joints; it begins where the reference does."""
        _, y = self.reference()
        made: dict[str, Any] = {"ground": Ground()}
        start: dict[str, Sequence[float]] = {}
        for (name, (mass, _)), part in zip(self.bodies.items(), y.reshape(-1, 13), strict=True):
            J = mass.J
            made[name] = Body(name, mass.m, (*J.diagonal(), J[0, 1], J[0, 2], J[1, 2]))
            for what, vector in zip(("position", "velocity", "omega"), _motion(part), strict=True):
                start[f"{name}.{what}"] = tuple(map(float, vector))

        def marker(body: str, point: Point, axis: Point = ()) -> Any:
            at = tuple(map(float, self.arm(body, point)))
            return made[body].at(at, axis=tuple(map(float, axis)) if len(axis) else None)

        tied: list[Any] = []
        for name, tie in self.ties.items():
            a = marker(tie.first, tie.point, tie.axis)
            b = marker(tie.second, tie.other or tie.point, tie.second_axis or tie.axis)
            if tie.kind == "rod":
                length = float(np.linalg.norm(np.subtract(tie.other, tie.point)))
                tied.append(Distance(name, a, b, length))
            elif tie.kind == "universal":
                tied.append(Universal(name, a, b, axis="z", second_axis="z"))
            else:
                tied.append(JOINTS[tie.kind](name, a, b))
        loads: list[Any] = [Gravity((0, 0, -self.gravity))]
        for k, spring in enumerate(self.springs):
            a, b = marker(spring.first, spring.point), marker(spring.second, spring.other)
            loads.append(SpringDamper(f"spring{k}", a, b, spring.k, spring.length, spring.c))
        return mechanism(
            self.name,
            bodies=[body for body in made.values() if isinstance(body, Body)],
            joints=tied,
            loads=loads,
            start=start,
        )

    def system(self, stop: float) -> System:
        """At `stop` where each body is, what all joints together do to it, and of each joint's wrench what is
        determined; of the rows of hinges whether they are."""

        def expected(stop: float) -> Mapping[str, float]:
            by_hand, begin = self.reference()
            y = by_hand.moved(begin, (0.0, stop))[-1]
            found: dict[str, float] = {}
            _, forces, received = by_hand.solve(stop, y)
            parts = zip(self.bodies, y.reshape(-1, 13), forces.reshape(-1, 2, 3), strict=True)
            for name, part, (f, tau) in parts:
                found |= named(f"{name}.position", part[:3])
                found |= named(f"Q.{name}.position", f)
                found |= named(f"Q.{name}.omega", rotation(part[3:7]).T @ tau)
            look, doubts = Look(stop, y, len(self.bodies)), by_hand.doubts(stop, y)
            for name, tie in self.ties.items():
                seen = self._marked(tie, look)
                wrench, doubt = seen @ received[name], np.abs(seen @ doubts[name]).max(1, initial=0)
                every = named(f"force.{name}", wrench[:3]) | named(f"torque.{name}", wrench[3:])
                found |= dict(p for p, d in zip(every.items(), doubt, strict=True) if d < 1e-7)
                if tie.kind == "hinge":
                    rows = zip(("x", "y", "z", "rx", "ry"), doubt, strict=False)
                    found |= {f"unique.{name}.{row}": float(d < 1e-7) for row, d in rows}
            return found

        return System(self.model(), stop, expected)

    def _marked(self, tie: Tie, look: Look) -> Vector:
        """(6, 6): a wrench about the second body's centre of mass, in space -> about its marker, in the axes
        of the first body's, whose z is the tie's axis by the least rotation."""
        numbers = {"ground": GROUND} | {name: k for k, name in enumerate(self.bodies)}
        turn = look.R[numbers[tie.first]] @ least(tie.axis)
        arm = look.arm(numbers[tie.second], self.arm(tie.second, tie.other or tie.point))
        found = np.zeros((6, 6))
        found[:3, :3] = found[3:, 3:] = turn.T
        found[3:, :3] = -turn.T @ cross(arm)
        return found


def named(name: str, vector: Vector) -> dict[str, float]:
    """NAME.x, NAME.y, NAME.z."""
    return {f"{name}.{x}": float(v) for x, v in zip("xyz", vector, strict=True)}


def least(axis: Point) -> Vector:
    """The rotation about a line across both that turns z onto an axis; onto -z about y."""
    if not len(axis):
        return np.eye(3)
    e = np.asarray(axis) / np.linalg.norm(axis)
    if e[2] == -1:
        return np.diag([-1.0, 1.0, -1.0])
    K = cross(np.cross((0, 0, 1), e))
    return np.eye(3) + K + K @ K / (1 + e[2])


def _motion(part: Vector) -> tuple[Vector, Vector, Vector]:
    """Place, velocity, and angular velocity in its own axes of a body that is parallel to the ground."""
    return part[:3], part[7:10], part[10:]
