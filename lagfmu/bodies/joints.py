"""Joints: what ties a marker of the second body to one of the first.

A row that holds back a translation is f = e . (p2 - p1) [m] with an axis e of the first marker: its
multiplier is the component along e of the force [N] that the second body receives at p2; the first receives
the opposite force there.  In the plane a row that holds back the rotation is f = angle2 - angle1 [rad]: its
multiplier is the torque [N.m] on the second body.  The rows of the joint A are A.x, A.y, A.rz: named by axis.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import sympy as sp

from ..model.elements import Contact, Expr, Holonomic, Nonholonomic, Parameter
from ..model.model import Model
from ..model.reactions import multiplier
from ..names import derivative
from .body import Marker, Number
from .draft import Draft, Relative, Wrench
from .motion import Placed, about, along, distance
from .vectors import AXES, dot, minus


def places(draft: Draft, tie: Any) -> tuple[Placed, Placed]:
    """Both markers of a tie in the ground's axes."""
    first = draft.place(tie.first, f"{tie.name}.first")
    return first, draft.place(tie.second, f"{tie.name}.second")


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of that name between the markers `first` and `second`.

    `axis` is that of the first marker about which it turns or along which it slides; `limits` are the
    smallest and the largest angle [rad] or position [m], where it strikes without rebounding.
    """

    name: str
    first: Marker
    second: Marker
    axis: str = ""
    limits: Sequence[Number] | None = None

    usual: ClassVar[tuple[str, str]] = ("z", "z")  # axis in the plane, and in space
    possible: ClassVar[tuple[str, str]] = ("z", "xyz")
    slides: ClassVar[str] = ""  # what it leaves free: "along" its axis, "across" it
    turns: ClassVar[str] = ""  # "about" its axis, "across" it

    def add(self, draft: Draft) -> None:
        """Its rows, its coordinate with the limits, and what the second body receives."""
        axis = AXES.index(self.axis or self.usual[len(draft.components) - 2])
        a, b = places(draft, self)
        wrench = draft.wrench(self.name)
        self.rows(draft, a, b, axis, wrench)
        self.coordinate(draft, a, b, axis, wrench)

    def relative_pose(
        self, draft: Draft, model: Model, given: Mapping[str, float]
    ) -> tuple[float | None, complex]:
        """A rough place of the second marker in the first, in the plane: its angle [rad], None where that is
        free and not given, and its origin x + iy [m]."""
        axis = AXES.index(self.axis or self.usual[0])
        turn = given.get(f"angle.{self.name}") if self.turns else 0.0
        return turn, given.get(f"position.{self.name}", 0.0) * (1, 1j, 0)[axis]

    def rows(self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench) -> None:
        """A row for each motion that it holds back."""
        for k, x in enumerate(draft.components):
            if ("along" if k == axis else "across") not in self.slides:
                f = dot(a.axes[k], minus(b.point, a.point))
                text = f"{self.name} does not move along {x} of its first marker"
                draft.constraints.append(Holonomic(f"{self.name}.{x}", f, text))
                wrench.force[k] += multiplier(f"{self.name}.{x}")
        if ("about" if axis == 2 else "across") not in self.turns:
            f = b.angle - a.angle
            draft.constraints.append(Holonomic(f"{self.name}.rz", f, f"{self.name} does not turn"))
            wrench.torque[2] += multiplier(f"{self.name}.rz")

    @property
    def measure(self) -> str:
        """What the FMU calls the one motion that it leaves free: angle.A or position.A; empty if none."""
        kind = {("", "about"): "angle", ("along", ""): "position"}.get((self.slides, self.turns))
        return f"{kind}.{self.name}" if kind else ""

    def coordinate(self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench) -> None:
        """The motion that it leaves free, with two derivatives and its limits."""
        name = self.measure
        if not name:
            return
        turns = bool(self.turns)
        values = (b.angle - a.angle, *about(a, b, axis)) if turns else along(a, b, axis)
        of = draft.relative[self.name] = Relative(name, "rad" if turns else "m", values, a, b, axis)
        text = f"{name.split('.')[0]} of {self.name}, of its second marker from the first"
        for order, expression in enumerate(values):
            what = ("", "rate of the ", "second derivative of the ")[order] + text
            draft.report(
                derivative(name, order), expression, of.unit + ("", "/s", "/s^2")[order], what
            )
        if self.limits is None:
            return
        acts = wrench.torque if turns else wrench.force
        for which, sign, value in zip(("lower", "upper"), (1, -1), self.limits, strict=True):
            row = f"{self.name}.{which}"
            stop = draft.number(value, row, of.unit, f"{which} limit of {name}")
            text = f"{name} stops at its {which} limit"
            draft.constraints.append(Contact(row, sign * (values[0] - stop), text))
            acts[axis] += sign * multiplier(row)


@dataclass(frozen=True, eq=False)
class Revolute(Joint):
    """A hinge: the markers' origins coincide, the second turns about the axis (z) of the first."""

    turns = "about"


@dataclass(frozen=True, eq=False)
class Prismatic(Joint):
    """A slide: the second marker moves along an axis of the first (in the plane x), parallel to it."""

    usual = ("x", "z")
    possible = ("xy", "xyz")
    slides = "along"


@dataclass(frozen=True, eq=False)
class Fixed(Joint):
    """A weld: the markers coincide."""


@dataclass(frozen=True, eq=False)
class PointOnPlane(Joint):
    """The second marker's origin stays in the plane through the first whose normal is the axis (z; in the
    plane a line with the normal y)."""

    usual = ("y", "z")
    possible = ("xy", "xyz")
    slides = "across"
    turns = "about across"


@dataclass(frozen=True, eq=False)
class Distance:
    """A rod without mass between the origins of two markers, `length` [m].

    lambda [N] is the push of the rod: negative where it pulls.
    """

    name: str
    first: Marker
    second: Marker
    length: Number

    def relative_pose(
        self, draft: Draft, model: Model, given: Mapping[str, float]
    ) -> tuple[float | None, complex]:
        """The second marker to the right of the first."""
        return None, model_number(model, self.length)

    def add(self, draft: Draft) -> None:
        """|p2 - p1| - length = 0."""
        a, b = places(draft, self)
        size, direction, _ = distance(a, b)
        length = draft.number(
            self.length, f"{self.name}.length", "m", f"length of {self.name}", True
        )
        draft.constraints.append(
            Holonomic(self.name, size - length, f"{self.name} keeps its length")
        )
        force = draft.wrench(self.name).force
        for k in range(len(draft.components)):
            force[k] += multiplier(self.name) * dot(a.axes[k], direction)


@dataclass(frozen=True, eq=False)
class Rolling:
    """A wheel of `radius` [m] about the second marker rolls along the x axis of the first, on its y side.

    NAME.y [N] is the normal force on the wheel, NAME.x [N] the force along the line at the point of contact.
    """

    name: str
    first: Marker
    second: Marker
    radius: Number

    def relative_pose(
        self, draft: Draft, model: Model, given: Mapping[str, float]
    ) -> tuple[float | None, complex]:
        """The wheel above the first marker."""
        return None, 1j * model_number(model, self.radius)

    def add(self, draft: Draft) -> None:
        """e_y . d - r = 0, and the wheel's point on the line has the velocity of the line."""
        a, b = places(draft, self)
        r = draft.number(self.radius, f"{self.name}.radius", "m", f"radius of {self.name}", True)
        gap, slip = rolling(a, b, r)
        draft.constraints += [
            Holonomic(f"{self.name}.y", gap, f"{self.name} touches the line"),
            Nonholonomic(f"{self.name}.x", slip, f"{self.name} rolls without slipping"),
        ]
        wrench = draft.wrench(self.name)
        wrench.force[1] += multiplier(f"{self.name}.y")
        wrench.force[0] += multiplier(f"{self.name}.x")
        wrench.torque[2] += r * multiplier(f"{self.name}.x")


def rolling(a: Placed, b: Placed, radius: Expr) -> tuple[Expr, Expr]:
    """The gap between the x axis of a and a wheel about b, and the velocity of the wheel's lowest point
    against the line, which a turns with (both as they are where the gap is 0)."""
    x, y = a.axes[0], a.axes[1]
    rate = minus(b.velocity, a.velocity)
    return dot(y, minus(b.point, a.point)) - radius, dot(x, rate) + radius * b.motion.omega[2]


@dataclass(frozen=True, eq=False)
class Gear:
    """The motions of two joints are tied: angle.FIRST = ratio * angle.SECOND + offset.

    Angles are in rad, positions in m: a rack on a pinion has a ratio in m.  lambda [N.m] (or [N]) works on
    the second body of the joint `first`.
    """

    name: str
    first: Any
    second: Any
    ratio: Number
    offset: Number = 0.0

    def add(self, draft: Draft) -> None:
        """The one row."""
        a, b = (draft.relative[name_of_joint(j)] for j in (self.first, self.second))
        per = {("rad", "m"): "1/m", ("m", "rad"): "m"}.get((a.unit, b.unit), "1")
        ratio = draft.number(self.ratio, f"{self.name}.ratio", per, f"ratio of {self.name}")
        offset = draft.number(self.offset, f"{self.name}.offset", a.unit, f"offset of {self.name}")
        text = f"{a.name} follows {b.name}"
        row = a.values[0] - ratio * b.values[0] - offset
        draft.constraints.append(Holonomic(self.name, row, text))


def model_number(model: Model, value: Number) -> float:
    """A length as the model has it, in SI."""
    symbol = value.symbol if isinstance(value, Parameter) else value
    return float(sp.sympify(symbol).xreplace({p.symbol: p.value for p in model.parameters}))


def name_of_joint(joint: Any) -> str:
    """A joint may be given by its name."""
    return joint if isinstance(joint, str) else joint.name
