"""Joints: what ties a marker of the second body to one of the first.

A row that holds back a translation is f = e . (p2 - p1) [m] with an axis e of the first marker: its
multiplier is the component along e of the force [N] that the second body receives at p2; the first receives
the opposite force there.  A row that holds back a rotation is f = angle2 - angle1 [rad] in the plane; in
space, with a, b, c right-handed from the axis a of the joint, a2 . b1 and -a2 . c1, which vanish at half a
turn, too (`side`: a2 . a1 > 0), and whose rates are (w2 - w1) . (a2 x b1) and -(w2 - w1) . (a2 x c1): where
f is 0 its multiplier is the torque [N.m] on the second body about c, about b.  The rows of the joint A are
A.x, A.y, A.z, A.rx, A.ry, A.rz: named by the axes of the first marker.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import sympy as sp

from ..model.elements import Expr, Friction, Holonomic, Nonholonomic, Parameter, is_number
from ..model.model import Model
from ..model.reactions import multiplier, norm
from .body import Marker, Number, several, value_of
from .draft import Draft, Relative, Wrench
from .guess import Guess, Reach
from .motion import (
    AXES,
    Placed,
    Timed,
    about,
    between,
    cross,
    distance,
    dot,
    minus,
    plus,
    product,
    times,
)

CROSS = "cross"  # the row by which the axes of a universal joint stay square


def places(draft: Draft, tie: Any) -> tuple[Placed, Placed]:
    """Both markers of a tie in the ground's axes."""
    first = draft.place(tie.first, f"{tie.name}.first")
    return first, draft.place(tie.second, f"{tie.name}.second")


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of that name between the markers `first` and `second`.

    `axis` is that of the first marker about which it turns or along which it slides; `limits` are the
    smallest and the largest angle [rad] or position [m], where it strikes and, with Newton's `restitution`,
    rebounds.  `friction` (a coefficient, or the static and the kinetic one) rubs with the norm of the two
    radial components of its force; a joint that turns needs the `radius` [m] of its pin for it.  With the
    `length` [m] of its bearing, whose middle is the second marker, moments and thrust rub too.
    """

    name: str
    first: Marker
    second: Marker
    axis: str = ""
    limits: Sequence[Number] | None = None
    friction: Number | Sequence[Number] | None = None
    radius: Number = 0.0
    length: Number | None = None
    restitution: Number = 0.0

    usual: ClassVar[tuple[str, str]] = ("z", "z")  # axis in the plane, and in space
    possible: ClassVar[tuple[str, str]] = ("z", "xyz")
    slides: ClassVar[str] = ""  # what it leaves free: "along" its axis, "across" it
    turns: ClassVar[str] = ""  # "about" its axis, "across" it
    coupled: ClassVar[bool] = False  # its turn and its slide are one motion, which may have limits
    smooth: ClassVar[str] = ""  # why `friction` is refused though it moves, and what to do instead

    def problems(self) -> Iterator[str]:
        """What is wrong with the arguments that joints of its kind alone have, in words."""
        yield from ()

    def add(self, draft: Draft) -> None:
        """Its rows, its coordinate with the limits, and what the second body receives."""
        axis = AXES.index(self.axis or self.usual[len(draft.components) - 2])
        a, b = places(draft, self)
        wrench = draft.wrench(self.name)
        self.rows(draft, a, b, axis, wrench)
        self.coordinate(draft, a, b, axis, wrench)
        if self.friction is not None:
            self.rub(draft, axis, wrench)
        if self.constant is not None:
            self.stick(draft, axis, wrench)

    @property
    def constant(self) -> Any:
        """The torque or force of its friction, where no normal force makes it."""
        return None

    @property
    def crossed(self) -> str:
        """The axis of the second marker about which it turns besides."""
        return ""

    def relative_pose(self, guess: Guess) -> Reach:
        """A rough place of the second marker in the first."""
        axis = AXES.index(self.axis or self.usual[0 if guess.planar else 1])
        angle = guess.given.get(f"angle.{self.name}")
        reach = np.eye(3)[axis] * guess.given.get(f"position.{self.name}", 0.0)
        fixed = not self.turns or (self.turns == "about" and angle is not None)
        hinge = axis if self.turns == "about" and not guess.planar else None
        return Reach(reach, angle, hinge, fixed)

    def rows(self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench) -> None:
        """A row for each motion that it holds back."""
        for k, x in enumerate(draft.components):
            if ("along" if k == axis else "across") not in self.slides:
                text = f"{self.name} does not move along {x} of its first marker"
                draft.hold(f"{self.name}.{x}", product(a.axes[k], between(a, b)), text)
                wrench.force[k] += multiplier(f"{self.name}.{x}")
        if len(draft.components) == 2:
            if ("about" if axis == 2 else "across") not in self.turns:
                self.hold(draft, wrench, 2, Timed(b.angle - a.angle, about(a, b, 2), sp.S.Zero))
            return
        self.hold_turns(draft, a, b, axis, wrench, self.turns)

    def hold_turns(
        self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench, free: str
    ) -> None:
        """The rows of the rotations, in space, that are not `free`: "about" the axis, "across" it."""
        i, j, k = axis, (axis + 1) % 3, (axis + 2) % 3  # a, b, c: right-handed
        if "across" not in free:
            along = dot(b.axes[i].value, a.axes[i].value)
            self.hold(draft, wrench, k, product(b.axes[i], a.axes[j]), along)
            opposite = product(b.axes[i], a.axes[k])
            self.hold(draft, wrench, j, Timed(*(-x for x in opposite)))
        if "about" not in free:
            along = dot(b.axes[j].value, a.axes[j].value)
            self.hold(draft, wrench, i, product(b.axes[j], a.axes[k]), along)

    def hold(self, draft: Draft, wrench: Wrench, axis: int, f: Timed, side: Expr = 1) -> None:
        """A row that holds back the rotation about an axis of the first marker."""
        row, text = f"{self.name}.r{AXES[axis]}", f"{self.name} does not turn about {AXES[axis]}"
        draft.hold(row, f, text, side)
        wrench.torque[axis] += multiplier(row)

    @property
    def measures(self) -> list[str]:
        """What the FMU calls the motions that it leaves free: angle.A, position.A."""
        turns, slides = self.turns == "about", self.slides == "along"
        return [f"angle.{self.name}"] * turns + [f"position.{self.name}"] * slides

    def coordinate(self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench) -> None:
        """The motions that it leaves free, with two derivatives, and the limits of the first."""
        for name in self.measures:
            turns = name.startswith("angle")
            f = draft.angle(name, a, b, axis) if turns else product(a.axes[axis], between(a, b))
            values = (f.value, f.rate, draft.second(f))
            of = Relative(self.name, name, "rad" if turns else "m", values, a, b, axis)
            kind = name.split(".")[0]
            of.report(draft, f"{kind} of {self.name}, of its second marker from the first", "the ")
        if self.limits is not None:
            text = f"restitution of {self.name} at its limits"
            e = draft.number(self.restitution, f"{self.name}.restitution", "1", text)
            draft.relative[self.measures[0]].stop(draft, self.name, self.limits, e)

    def rub(self, draft: Draft, axis: int, wrench: Wrench) -> None:
        """Coulomb's law for the motion that it leaves free: |torque| <= mu r N, |force| <= mu N, of a
        cylindrical joint for the vector (v, r w)."""
        normal = self.normal(draft, axis, wrench)
        coefficients = draft.coefficients(self.friction, self.name)
        r = draft.number(
            self.radius, f"{self.name}.radius", "m", f"radius of the pin of {self.name}"
        )
        both = len(self.measures) > 1  # rows that are velocities
        rows = [
            self.along(
                draft, axis, wrench, measure, r if both and measure.startswith("angle") else 1
            )
            for measure in self.measures
        ]
        if len(rows) == 1 and self.turns:
            normal *= r
        draft.constraints.append(Friction(self.name, rows, normal, *coefficients))

    def along(self, draft: Draft, axis: int, wrench: Wrench, measure: str, lever: Expr = 1) -> str:
        """The row by which a motion that it leaves free sticks."""
        turns, of = measure.startswith("angle"), draft.relative[measure]
        row = f"{self.name}.{'r' if turns else ''}{AXES[axis]}"
        text = f"{self.name} does not {'turn' if turns else 'slide'}"
        draft.constraints.append(Nonholonomic(row, lever * of.values[1], text))
        (wrench.torque if turns else wrench.force)[axis] += lever * multiplier(row)
        return row

    def stick(self, draft: Draft, axis: int, wrench: Wrench) -> None:
        """|torque| or |force| is at most a limit of its own: dry friction of a gear, of a seal."""
        (measure,) = self.measures
        static, kinetic = (*several(self.constant), None)[:2]
        kind, unit = ("torque", "N.m") if self.turns else ("force", "N")
        name = f"{self.name}.friction_{kind}"
        text = f"friction {kind} of {self.name}"
        limit = draft.number(static, name, unit, text)
        if limit == 0:
            return
        if kinetic is not None:
            kinetic = (
                draft.number(kinetic, f"{name}_kinetic", unit, f"{text} while it slips") / limit
            )
        row = self.along(draft, axis, wrench, measure)
        draft.constraints.append(Friction(self.name, [row], limit=limit, kinetic=kinetic))

    def normal(self, draft: Draft, axis: int, wrench: Wrench) -> Expr:
        """N [N]: the norm of the force F across the axis a.  Of a bearing of length b the sum over its edges,
        at which F and the moment M about its middle are F/2 +- M x a / b, and the thrust on its shoulder."""
        j, k = (axis + 1) % 3, (axis + 2) % 3  # a, b, c: right-handed
        F = wrench.force[j], wrench.force[k]
        if self.length is None:
            return norm(*F)
        text = f"length of the bearing of {self.name}"
        b = draft.number(self.length, f"{self.name}.length", "m", text, positive=True)
        arm = wrench.torque[k] / b, -wrench.torque[j] / b
        edges = [norm(*(f / 2 + sign * a for f, a in zip(F, arm, strict=True))) for sign in (1, -1)]
        return sp.Add(*edges, 0 if "along" in self.slides else norm(wrench.force[axis]))


@dataclass(frozen=True, eq=False)
class Revolute(Joint):
    """A hinge: the markers' origins coincide, the second turns about the axis (z) of the first.

    It sticks while it needs no more than a `friction_torque` [N.m], and slips with it, or, of two, with the
    second.
    """

    friction_torque: Number | Sequence[Number] | None = None

    turns = "about"

    @property
    def constant(self) -> Any:
        """The torque."""
        return self.friction_torque


@dataclass(frozen=True, eq=False)
class Prismatic(Joint):
    """A slide: the second marker moves along an axis of the first (in the plane x), parallel to it.

    It sticks while it needs no more than a `friction_force` [N], and slips with it, or, of two, with the
    second.
    """

    friction_force: Number | Sequence[Number] | None = None

    usual = ("x", "z")
    possible = ("xy", "xyz")
    slides = "along"

    @property
    def constant(self) -> Any:
        """The force."""
        return self.friction_force


@dataclass(frozen=True, eq=False)
class Fixed(Joint):
    """A weld: the markers coincide."""


@dataclass(frozen=True, eq=False)
class PointOnPlane(Joint):
    """The second marker's origin stays in the plane through the first whose normal is the axis (z; of the
    plane xy a line with the normal y)."""

    usual = ("y", "z")
    possible = ("xy", "xyz")
    slides = "across"
    turns = "about across"


@dataclass(frozen=True, eq=False)
class Spherical(Joint):
    """A ball: the markers' origins coincide (in space)."""

    possible = ("", "")
    turns = "about across"


@dataclass(frozen=True, eq=False)
class Cylindrical(Joint):
    """The second marker turns about an axis of the first and slides along it (in space)."""

    possible = ("", "xyz")
    slides = "along"
    turns = "about"


@dataclass(frozen=True, eq=False)
class Screw(Cylindrical):
    """A nut on a thread (in space): the second marker moves along an axis of the first by `lead` [m] in each
    turn, position = lead / (2 pi) angle (a right-handed thread has a positive lead), as a helical joint does
    (Featherstone, Rigid Body Dynamics Algorithms, 2008, sect. 4.4).

    The multiplier of NAME.z is the thrust F [N] on the second body along the axis; with it goes the torque
    -lead / (2 pi) F about the axis, so that the thread takes no power.
    """

    lead: Number = 0.0

    coupled = True
    smooth = "a thread has none here: brake its turn by a Torsion's damping"

    def problems(self) -> Iterator[str]:
        """A lead of 0."""
        if is_number(lead := value_of(self.lead)) and not float(lead):
            yield f"lead is {self.lead!r}, expected metres a turn, not 0 (left-handed: negative)"

    def coordinate(self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench) -> None:
        """Both motions, and the row of the thread."""
        super().coordinate(draft, a, b, axis, wrench)
        turn = draft.angle(self.measures[0], a, b, axis)
        slide = product(a.axes[axis], between(a, b))
        text = f"way of {self.name} along its axis in a turn"
        pitch = draft.number(self.lead, f"{self.name}.lead", "m", text) / (2 * sp.pi)
        row = f"{self.name}.{AXES[axis]}"
        thread = Timed(*(s - pitch * t for s, t in zip(slide, turn, strict=True)))
        draft.hold(row, thread, f"{self.name} moves along its axis as it turns")
        wrench.force[axis] += multiplier(row)
        wrench.torque[axis] -= pitch * multiplier(row)


@dataclass(frozen=True, eq=False)
class Planar(Joint):
    """The second marker slides in the plane of the first whose normal is the axis, and turns about it (in
    space)."""

    possible = ("", "xyz")
    slides = "across"
    turns = "about"
    smooth = "no force across its axis could press: rub a Contact instead"


@dataclass(frozen=True, eq=False)
class Universal(Joint):
    """A Hooke's joint: the origins coincide, and an `axis` (x) of the first marker stays square to the
    `second_axis` (y) of the second (in space).

    The multiplier of NAME.cross is the torque along b2 x a1 [N.m], which turns with the bodies.
    """

    second_axis: str = "y"

    usual = ("x", "x")
    possible = ("", "xyz")
    turns = "about across"

    def problems(self) -> Iterator[str]:
        """A second axis that is none."""
        if self.second_axis not in tuple(AXES):
            yield f"second_axis is {self.second_axis!r}, expected 'x', 'y' or 'z'"

    @property
    def crossed(self) -> str:
        """The second axis."""
        return self.second_axis

    def rows(self, draft: Draft, a: Placed, b: Placed, axis: int, wrench: Wrench) -> None:
        """Three rows of the origins, and a1 . b2 = 0."""
        super().rows(draft, a, b, axis, wrench)
        second, row = b.axes[AXES.index(self.second_axis)], f"{self.name}.{CROSS}"
        draft.hold(row, product(a.axes[axis], second), f"the axes of {self.name} stay square")
        j, k = (axis + 1) % 3, (axis + 2) % 3  # b2 x a1 has no component along a1
        wrench.torque[j] += multiplier(row) * dot(second.value, a.axes[k].value)
        wrench.torque[k] -= multiplier(row) * dot(second.value, a.axes[j].value)


@dataclass(frozen=True, eq=False)
class Distance:
    """A rod without mass between the origins of two markers, `length` [m].

    lambda [N] is the push of the rod: negative where it pulls.
    """

    name: str
    first: Marker
    second: Marker
    length: Number

    def relative_pose(self, guess: Guess) -> Reach:
        """The second marker to the right of the first."""
        return Reach((model_number(guess.model, self.length), 0, 0))

    def add(self, draft: Draft) -> None:
        """|p2 - p1| - length = 0."""
        a, b = places(draft, self)
        size, direction = distance(a, b)
        length = draft.number(
            self.length, f"{self.name}.length", "m", f"length of {self.name}", True
        )
        f = Timed(size.value - length, size.rate, size.bend)
        draft.hold(self.name, f, f"{self.name} keeps its length")
        force = draft.wrench(self.name).force
        for k in range(len(draft.components)):
            force[k] += multiplier(self.name) * dot(a.axes[k].value, direction)


@dataclass(frozen=True, eq=False)
class Rolling:
    """A wheel of `radius` [m] about the second marker rolls along the x axis of the first, on its y side; in
    space a ball on the plane xy of the first, on its z side.

    The multiplier of NAME.y [N] is the normal force on the wheel, that of NAME.x [N] the force along the line
    at the point of contact; in space NAME.z, and NAME.x, NAME.y.
    """

    name: str
    first: Marker
    second: Marker
    radius: Number

    def relative_pose(self, guess: Guess) -> Reach:
        """The wheel above the first marker."""
        radius = model_number(guess.model, self.radius)
        return Reach((0, radius, 0) if guess.planar else (0, 0, radius))

    def add(self, draft: Draft) -> None:
        """n . d - r = 0, and the wheel's point on the line has the velocity of the line."""
        a, b = places(draft, self)
        r = draft.number(self.radius, f"{self.name}.radius", "m", f"radius of {self.name}", True)
        touch = Touch(draft, self.name, a, b, r)
        draft.hold(touch.normal, touch.gap, f"{self.name} touches")
        for row, slip in touch.slips.items():
            draft.constraints.append(Nonholonomic(row, slip, f"{self.name} rolls without slipping"))
        touch.transmit(draft.wrench(self.name), list(touch.slips))


class Touch:
    """A wheel of a radius about b (in space a ball; a point where it is 0) on the side of a to which the
    normal points: the x axis and its y side in the plane, in space the plane xy and its z side.

    `normal` names the row of the `gap` [m], `slips` the rows of the velocities [m/s] of the lowest point
    against what it lies on, along the other axes, both as they are where the gap is 0.
    """

    def __init__(self, draft: Draft, name: str, a: Placed, b: Placed, radius: Expr) -> None:
        self.radius, self.tangents = radius, AXES[: len(draft.components) - 1]
        self.normal = f"{name}.{draft.components[-1]}"
        self._n = len(self.tangents)
        x, y, n = a.axes[0].value, a.axes[1].value, a.axes[self._n]
        d = between(a, b)
        height = product(n, d)
        self.gap = Timed(height.value - radius, height.rate, height.bend)
        rate = minus(d.rate, times(radius, cross(b.motion.omega, n.value)))
        if self._n == 2:  # a line turns across itself, a plane also within itself
            on_plane = plus(times(dot(x, d.value), x), times(dot(y, d.value), y))
            rate = minus(rate, cross(a.motion.omega, on_plane))
        self.slips = {
            f"{name}.{x}": dot(a.axes[k].value, rate) for k, x in enumerate(self.tangents)
        }

    def transmit(self, wrench: Wrench, rows: Sequence[str]) -> None:
        """The forces of the rows, which act at the lowest point, about the centre of the wheel."""
        wrench.force[self._n] += multiplier(self.normal)
        for k, row in enumerate(rows):
            wrench.force[k] += multiplier(row)
        fx, fy = (*map(multiplier, rows), sp.S.Zero, sp.S.Zero)[:2]
        if self._n == 1:
            wrench.torque[2] += self.radius * fx
        else:  # (0, 0, -r) x (fx, fy, 0)
            wrench.torque[0] += self.radius * fy
            wrench.torque[1] -= self.radius * fx


@dataclass(frozen=True, eq=False)
class Gear:
    """The motions of two joints are tied: angle.FIRST = ratio * angle.SECOND + offset.

    Angles are in rad, positions in m: a rack on a pinion has a ratio in m.  A cam has `higher` powers too,
    + higher[0] * angle.SECOND^2 + higher[1] * angle.SECOND^3 + ...  lambda [N.m] (or [N]) works on the second
    body of the joint `first`.
    """

    name: str
    first: Any
    second: Any
    ratio: Number
    offset: Number = 0.0
    higher: Sequence[Number] = ()

    def add(self, draft: Draft) -> None:
        """The one row."""
        a, b = (draft.motion_of(j) for j in (self.first, self.second))
        per = {("rad", "m"): "1/m", ("m", "rad"): "m"}.get((a.unit, b.unit), "1")
        ratio = draft.number(self.ratio, f"{self.name}.ratio", per, f"ratio of {self.name}")
        offset = draft.number(self.offset, f"{self.name}.offset", a.unit, f"offset of {self.name}")
        text = f"{a.name} follows {b.name}"
        row = a.values[0] - ratio * b.values[0] - offset
        for k, factor in enumerate(self.higher, 2):
            per = f"{'1' if a.unit == 'rad' else 'm'}{'' if b.unit == 'rad' else f'/m^{k}'}"
            word = f"{self.name}.higher{k}"
            text = f"factor of power {k} of {self.name}"
            row -= draft.number(factor, word, per, text) * b.values[0] ** k
        draft.constraints.append(Holonomic(self.name, row, text))


def model_number(model: Model, value: Number) -> float:
    """A length as the model has it, in SI."""
    symbol = value.symbol if isinstance(value, Parameter) else value
    return float(sp.sympify(symbol).xreplace({p.symbol: p.value for p in model.parameters}))


def name_of_joint(joint: Any) -> str:
    """A joint may be given by its name."""
    return joint if isinstance(joint, str) else getattr(joint, "name", joint)
