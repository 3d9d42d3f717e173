"""Loads: what acts on bodies besides joints.  A number becomes a parameter of the FMU, what is left out an
input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import sympy as sp
from sympy.physics.vector import dynamicsymbols

from ..model.elements import TIME, Expr, Holonomic, Input, Nonholonomic
from ..model.reactions import multiplier
from .body import Body, Marker, Number
from .draft import Curve, Draft
from .joints import places
from .motion import AXES, Vector, distance, times


@dataclass(frozen=True, eq=False)
class Gravity:
    """A uniform field of gravity: its acceleration in the ground's axes [m/s^2]."""

    acceleration: Sequence[Number]
    name: str = "gravity"

    def add(self, draft: Draft) -> None:
        """V = -m g . r of each body."""
        g = draft.vector(self.acceleration, self.name, "m/s^2", "acceleration of gravity")
        draft.gravity[self.name] = g
        for body, motion in draft.motions.items():
            if isinstance(body, Body):
                weight = times(-1, times(motion.mass, g))
                draft.potential += [
                    w * x for w, x in zip(weight, motion.position, strict=True) if w * x != 0
                ]


@dataclass(frozen=True, eq=False)
class SpringDamper:
    """A spring of `length` [m] and a damper beside it, between the origins of two markers.

    It pulls with k (d - length) + c d' + preload [N], which the FMU reports as force.NAME.
    """

    name: str
    first: Marker
    second: Marker
    stiffness: Number = 0.0
    length: Number = 0.0
    damping: Number = 0.0
    preload: Number = 0.0

    def add(self, draft: Draft) -> None:
        """The potential of the spring and of its preload, the force of the damper."""
        name = self.name
        a, b = places(draft, self)
        (size, rate, _), direction = distance(a, b)
        k = draft.number(self.stiffness, f"{name}.stiffness", "N/m", f"stiffness of {name}")
        c = draft.number(self.damping, f"{name}.damping", "N.s/m", f"damping of {name}")
        free = draft.number(self.length, f"{name}.length", "m", f"length of {name} without force")
        pull = draft.number(self.preload, f"{name}.preload", "N", f"preload of {name}")
        draft.potential += [e for e in (k * (size - free) ** 2 / 2, pull * size) if e != 0]
        if c != 0:
            draft.pull_together(a, b, b.point, times(-c * rate, direction))
        text = f"pull of {name}"
        draft.report(f"force.{name}", k * (size - free) + c * rate + pull, "N", text)


@dataclass(frozen=True, eq=False)
class Torsion:
    """A torsion spring that is slack at `angle` [rad], and a damper, in a joint that turns.

    The second body receives -k (angle.JOINT - angle) - c der(angle.JOINT) + preload [N.m], reported as
    torque.NAME; in a slide likewise, as force.NAME [N], with `angle` in m.
    """

    name: str
    joint: Any
    stiffness: Number = 0.0
    angle: Number = 0.0
    damping: Number = 0.0
    preload: Number = 0.0

    def add(self, draft: Draft) -> None:
        """The potential of the spring and of its preload, the torque of the damper."""
        name, of = self.name, draft.motion_of(self.joint)
        effort = "N.m" if of.unit == "rad" else "N"
        per = "/rad" if of.unit == "rad" else "/m"
        k = draft.number(
            self.stiffness, f"{name}.stiffness", f"{effort}{per}", f"stiffness of {name}"
        )
        c = draft.number(self.damping, f"{name}.damping", f"{effort}.s{per}", f"damping of {name}")
        slack = draft.number(self.angle, f"{name}.angle", of.unit, f"where {name} is slack")
        push = draft.number(self.preload, f"{name}.preload", effort, f"preload of {name}")
        at, rate, _ = of.values
        draft.potential += [e for e in (k * (at - slack) ** 2 / 2, -push * at) if e != 0]
        if c != 0:
            of.drive(draft, -c * rate)
        kind = "torque" if of.unit == "rad" else "force"
        text = f"{kind} of {name} on the second body"
        draft.report(f"{kind}.{name}", -k * (at - slack) - c * rate + push, effort, text)


@dataclass(frozen=True, eq=False)
class Rotor:
    """What turns with a joint and has its `inertia` [kg.m^2] at the rate of that alone, as the rotor of a
    motor behind a gear of the ratio n, which has n^2 J; in a slide a mass [kg].

    Kinetic energy inertia/2 der(angle.JOINT)^2; lambda.NAME is the torque [N.m] (in a slide the force [N])
    by which it speeds up the second body: -inertia der(angle.JOINT,2).  NAME.rotor.angle counts its way
    from the start.
    """

    name: str
    joint: Any
    inertia: Number

    def add(self, draft: Draft) -> None:
        """A coordinate of its own, so that M stays constant, and the row der(angle.JOINT) = its rate."""
        name, of = self.name, draft.motion_of(self.joint)
        unit, text = ("kg.m^2", "inertia") if of.unit == "rad" else ("kg", "mass")
        J = draft.number(self.inertia, f"{name}.inertia", unit, f"{text} of {name}", positive=True)
        kind = of.name.split(".")[0]
        way = dynamicsymbols(f"{name}.rotor.{kind}")
        draft.curves[way] = Curve(of.unit, J, f"way of {name} from the start")
        draft.kinetic.append(J * way.diff(TIME) ** 2 / 2)
        row = of.values[1] - way.diff(TIME)
        draft.constraints.append(Nonholonomic(name, row, f"{name} turns with {of.name}"))


@dataclass(frozen=True, eq=False)
class Force:
    """A force [N] at a marker, in the ground's axes, or in those of the marker if `follows`.

    Components are numbers or expressions of parameters and time; without them the FMU has the inputs NAME.x,
    NAME.y.
    """

    name: str
    at: Marker
    force: Sequence[Number] | None = None
    follows: bool = False

    def add(self, draft: Draft) -> None:
        """Its generalized forces."""
        placed = draft.place(self.at, f"{self.name}.at")
        text = f"force {self.name}"
        if self.force is None:
            force = _inputs(draft, self.name, draft.components, "N", text)
        else:
            force = draft.vector(self.force, self.name, "N", text)
        if self.follows:
            parts = [
                times(f, e) for f, e in zip(force, (x.value for x in placed.axes), strict=True)
            ]
            force = tuple(map(sum, zip(*parts, strict=True)))  # type: ignore[assignment]
        draft.push(placed.body, placed.point, force)


@dataclass(frozen=True, eq=False)
class Torque:
    """A torque [N.m] on a body, in the ground's axes; in the plane one number.  Without it the FMU has the
    input NAME.z (in space NAME.x, NAME.y, NAME.z)."""

    name: str
    on: Body
    torque: Any = None

    def add(self, draft: Draft) -> None:
        """Its generalized forces."""
        text, axes = f"torque {self.name}", "z" if len(draft.components) == 2 else AXES
        if self.torque is None:
            torque = _inputs(draft, self.name, axes, "N.m", text)
        elif axes == "z":
            torque = (0, 0, draft.number(self.torque, f"{self.name}.z", "N.m", text))
        else:
            torque = draft.vector(self.torque, self.name, "N.m", text)
        draft.turn(self.on, torque)


def _inputs(draft: Draft, name: str, axes: str, unit: str, text: str) -> Vector:
    found: list[Expr] = [sp.S.Zero] * 3
    for x in axes:
        found[AXES.index(x)] = dynamicsymbols(f"{name}.{x}")
        draft.inputs.append(Input(found[AXES.index(x)], unit, 0.0, f"{text}, {x} component"))
    return found[0], found[1], found[2]


@dataclass(frozen=True, eq=False)
class Motor:
    """Drives a joint that turns or slides; its torque is part of what the joint transmits.

    `torque` [N.m] (in a slide [N]) is a number or an expression of parameters and time; without it the FMU
    has the input NAME.torque (NAME.force).  `motion`: True prescribes the joint's angle (position) instead,
    by the input NAME.angle (NAME.position) and its two derivatives, or, with `rates` = 'estimated', by its
    values alone; an expression of time and parameters prescribes it without an input.  lambda.NAME is then
    the torque.  NAME.power [W] is what it delivers.
    """

    name: str
    joint: Any
    torque: Number | None = None
    motion: Any = None
    start: float = 0.0
    rate: float = 0.0
    rates: str = "given"

    def add(self, draft: Draft) -> None:
        """A generalized force on the joint's coordinate, or a row for it."""
        name, of = self.name, draft.motion_of(self.joint)
        turns = of.unit == "rad"
        kind, unit = ("torque", "N.m") if turns else ("force", "N")
        if self.motion is None:
            effort = self._effort(draft, f"{name}.{kind}", unit)
            of.drive(draft, effort)
        else:
            effort = multiplier(name)
            draft.driven.add(of.name)
            where = self._motion(draft, f"{name}.{'angle' if turns else 'position'}", of.unit)
            text = f"motor {name} moves {of.name}"
            draft.constraints.append(Holonomic(name, of.values[0] - where, text))
        of.transmit(draft, effort)
        draft.report(f"{name}.power", effort * of.values[1], "W", f"power of motor {name}")

    def _effort(self, draft: Draft, name: str, unit: str) -> Expr:
        text = f"{name.split('.')[-1]} of motor {self.name} on the second body"
        if self.torque is not None:
            return draft.number(self.torque, name, unit, text)
        effort = dynamicsymbols(name)
        draft.inputs.append(Input(effort, unit, self.start, text))
        return effort

    def _motion(self, draft: Draft, name: str, unit: str) -> Expr:
        if self.motion is not True:
            return draft.number(self.motion, name, unit)
        where = dynamicsymbols(name)
        text = f"{name.split('.')[-1]} that motor {self.name} prescribes"
        draft.inputs.append(Input(where, unit, self.start, text, self.rate, self.rates))
        return where
