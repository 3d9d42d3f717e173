"""A mechanism while it is put together: what its bodies, joints and loads add to the Model that it becomes.

Every number that is not 0 becomes a Parameter under the name of what it is of: crank.mass, A.first.x.

What is read of markers on request: where they are, how they move, how they are turned.

URDF's roll, pitch and yaw turn about the fixed axes x, y, z in turn, R = Rz(yaw) Ry(pitch) Rx(roll):

    yaw = atan2(R21, R11) ,  pitch = atan2(-R31, h) ,  roll = atan2(R21 R13 - R11 R23, R11 R22 - R21 R12)

with h^2 = R11^2 + R21^2 = cos^2 pitch.  At a pitch of +-pi/2 roll and yaw turn about one line: where h is
below 1e-8 the yaw is 0, and the roll all of the turn, so that the three together are R there too.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.vector import dynamicsymbols

from ..errors import UnitError
from ..model.elements import (
    TIME,
    Constraint,
    Contact,
    Expr,
    Friction,
    Input,
    Output,
    Parameter,
    Tie,
    is_number,
    name_of,
)
from ..model.reactions import multiplier
from ..model.units import parse_scaled, parse_unit
from ..names import derivative
from .body import Body, Ground, Marker, several
from .motion import AXES, ZERO, Motion, Placed, Timed, Vector, about, cross, dot, minus, times


class Wrench:
    """What the second body receives through a joint, about its own marker point, in the axes of the first
    marker: `force` [N] and `torque` [N.m], three components each."""

    def __init__(self) -> None:
        self.force: list[Expr] = [sp.S.Zero] * 3
        self.torque: list[Expr] = [sp.S.Zero] * 3


@dataclass(frozen=True, eq=False)
class Relative:
    """A motion that a joint leaves free: angle.A [rad] or position.A [m], and its two derivatives.

    What drives it acts along an axis of the first marker, or `along` a vector in the ground's axes, and is
    part of the wrench of the `joint`.
    """

    joint: str
    name: str
    unit: str
    values: tuple[Expr, Expr, Expr]
    first: Placed
    second: Placed
    axis: int
    along: Vector | None = None

    @property
    def shares(self) -> list[Expr]:
        """Components along the axes of the first marker of what an effort of 1 acts along."""
        if self.along is None:
            return [sp.Integer(k == self.axis) for k in range(3)]
        return [dot(e.value, self.along) for e in self.first.axes]

    def report(self, draft: Draft, text: str, the: str = "") -> None:
        """It and its two derivatives as outputs, where they are no coordinates."""
        draft.relative[self.name] = self
        words = "", f"rate of {the}", f"second derivative of {the}"
        for order, expression in enumerate(self.values):
            called = derivative(self.name, order)
            if called not in draft.known:
                unit = self.unit + ("", "/s", "/s^2")[order]
                draft.report(called, expression, unit, words[order] + text)

    def stop(self, draft: Draft, name: str, limits: Sequence[Any], restitution: Expr) -> None:
        """Contacts at its limits, NAME.lower and NAME.upper, as part of the joint's wrench."""
        for which, sign, value in zip(("lower", "upper"), (1, -1), limits, strict=True):
            row = f"{name}.{which}"
            end = draft.number(value, row, self.unit, f"{which} limit of {self.name}")
            text = f"{self.name} stops at its {which} limit"
            gap = sign * (self.values[0] - end)
            draft.constraints.append(Contact(row, gap, text, restitution))
            self.transmit(draft, sign * multiplier(row))

    def transmit(self, draft: Draft, effort: Expr) -> None:
        """The effort of a motor, or of a stop, as part of the joint's wrench."""
        wrench = draft.wrench(self.joint)
        acts = wrench.torque if self.unit == "rad" else wrench.force
        for k, share in enumerate(self.shares):
            acts[k] += effort * share

    def drive(self, draft: Draft, effort: Expr) -> None:
        """A torque [N.m] or force [N] along it on the second body, and its reaction on the first."""
        e = times(effort, self.along or self.first.axes[self.axis].value)
        if self.unit == "m":
            draft.pull_together(self.first, self.second, self.second.point, e)
        else:
            draft.turn(self.second.body, e)
            draft.turn(self.first.body, times(-1, e))


class Curve(NamedTuple):
    """The coordinate of a point on a curve, of a rotor: its unit, what moves along, and what it is."""

    unit: str
    mass: Expr
    text: str


class Draft:
    """All that a Model needs, in the order in which it is added; `problems` is what is wrong."""

    def __init__(self, components: str) -> None:
        self.components = components  # of a vector: "xy" in the plane
        self.problems: list[str] = []
        self.parameters: dict[Expr, Parameter] = {}
        self.inputs: list[Input] = []
        self.constraints: list[Constraint | Friction] = []
        self.outputs: list[Output] = []
        self.kinetic: list[Expr] = []
        self.potential: list[Expr] = []
        self.forces: dict[Expr, Expr] = defaultdict(lambda: sp.S.Zero)
        self.motions: dict[Any, Motion] = {}
        self.wrenches: dict[str, Wrench] = {}
        self.relative: dict[str, Relative] = {}  # by its name, angle.A
        self.driven: set[str] = set()  # of these what a motor prescribes
        self.wound: set[str] = set()  # angles that something needs over many turns
        self.unwrapped: dict[Expr, tuple[Expr, Expr]] = {}  # in space: rate, and value modulo 2 pi
        self.placed: dict[Marker, Placed] = {}
        self.curves: dict[Expr, Curve] = {}  # by the coordinate K.curve.s, K.rotor.angle
        self.readings: dict[str, Placed] = {}  # markers that are read on request, by name
        self.gravity: dict[str, Vector] = {}

    # ------------------------------------------------------------------ numbers

    def number(
        self, value: Any, name: str, unit: str, text: str = "", positive: bool = False
    ) -> Expr:
        """The symbol of a Parameter, the expression, or that of a number, which becomes one called `name`."""
        if isinstance(value, Parameter) and not isinstance(value.symbol, sp.Basic):
            self.problems.append(
                f"{name}: parameter {value.symbol!r} is no SymPy symbol: make one with sympy.symbols"
            )
            return sp.S.One
        if isinstance(value, Parameter):
            self._check_unit(value, name, unit)
            self.parameters[value.symbol] = value
            return value.symbol
        if isinstance(value, sp.Basic) and value.free_symbols:
            return value
        if not is_number(value):
            self.problems.append(
                f"{name} is {value!r}, expected a finite number in {unit}, a Parameter, or an expression of "
                "parameters"
            )
            return sp.S.One
        if positive and not float(value) > 0:
            self.problems.append(f"{name} is {value!r}, expected a positive number in {unit}")
            return sp.S.One
        if float(value) == 0:
            return sp.S.Zero
        symbol = sp.Symbol(name, positive=True) if positive else sp.Symbol(name, real=True)
        self.parameters[symbol] = Parameter(symbol, float(value), unit, text)
        return symbol

    def _check_unit(self, parameter: Parameter, name: str, unit: str) -> None:
        """What is no unit the Model tells."""
        try:
            given = parse_scaled(parameter.unit, name).unit
        except UnitError:
            return
        if not given.same_dimension(parse_unit(unit, name)):
            self.problems.append(
                f"{name}: parameter {parameter.symbol} has the unit {parameter.unit!r}, expected {unit}"
            )

    def vector(self, values: Any, name: str, unit: str, text: str = "") -> Vector:
        """Three components of as many values as the space has dimensions."""
        if values is None:
            return ZERO
        count = len(self.components)
        if isinstance(values, str) or not isinstance(values, Sequence) or len(values) != count:
            self.problems.append(
                f"{name} is {values!r}, expected {count} components ({', '.join(self.components)})"
            )
            return ZERO
        found = [
            self.number(value, f"{name}.{x}", unit, f"{text}, {x} component" if text else "")
            for value, x in zip(values, self.components, strict=True)
        ]
        return tuple([*found, sp.S.Zero][:3])  # type: ignore[return-value]

    def coefficients(self, friction: Any, name: str) -> list[Expr]:
        """One coefficient of friction, or the static and the kinetic one."""
        given = several(friction)
        words = ("friction",) if len(given) == 1 else ("static", "kinetic")
        return [
            self.number(mu, f"{name}.{word}", "1", f"coefficient of friction of {name}, {word}")
            for mu, word in zip(given, words, strict=True)
        ]

    # ------------------------------------------------------------------ places

    def place(self, marker: Marker, name: str) -> Placed:
        """A marker in the ground's axes; its numbers are called after the first that uses it, `name`."""
        if marker not in self.placed:
            point = self.vector(marker.point, name, "m", f"marker {name} on {marker.body.name}")
            self.placed[marker] = self.motions[marker.body].placed(marker, point)
        return self.placed[marker]

    def angle(self, name: str, a: Placed, b: Placed, axis: int) -> Timed:
        """The angle of b about an axis of a."""
        rate = about(a, b, axis)
        if len(self.components) == 2:
            return Timed(b.angle - a.angle, rate, sp.S.Zero)
        j, k = (axis + 1) % 3, (axis + 2) % 3
        x, y, turned = a.axes[j].value, a.axes[k].value, b.axes[j].value
        within_turn = sp.atan2(dot(turned, y), dot(turned, x))
        return self.turning(name, Timed(within_turn, rate, sp.S.Zero))

    def turning(self, name: str, f: Timed) -> Timed:
        """An angle in space: a coordinate of its own, tied to the attitude modulo 2 pi, where something needs
        it over many turns."""
        if name not in self.wound:
            return f
        angle = dynamicsymbols(name)
        self.unwrapped[angle] = f.rate, f.value
        return Timed(angle, f.rate, f.bend)

    def hold(self, name: str, f: Timed, text: str, side: Expr = 1) -> None:
        """A row f = 0, met as it is meant where `side` is positive."""
        self.constraints.append(Tie(name, f.value, text, rates=(f.rate, f.bend), side=side))

    def second(self, f: Timed) -> Expr:
        """The second derivative: the bend, and the rate, which is linear in the speeds, of accelerations."""
        moving = f.rate.atoms(sp.Derivative, AppliedUndef) & self._speeds
        return f.bend + f.rate.xreplace({v: v.diff(TIME) for v in moving})

    @cached_property
    def _speeds(self) -> set[Expr]:
        """Of all bodies."""
        own = {v for m in self.motions.values() for v in m.speeds}
        directions = (q for m in self.motions.values() for q in m.directions)
        return own | {q.diff(TIME) for q in directions if q not in own}

    @property
    def known(self) -> set[str]:
        """What the FMU tells of unwrapped angles by itself."""
        return {derivative(name_of(q), k) for q in self.unwrapped for k in (0, 1)}

    def motion_of(self, joint: Any) -> Relative:
        """The one motion of a joint, which may be given by its name; or the motion of that name."""
        name = joint if isinstance(joint, str) else joint.name
        found = (name, f"angle.{name}", f"position.{name}")
        return next(self.relative[n] for n in found if n in self.relative)

    # ------------------------------------------------------------------ forces

    def push(self, body: Body | Ground, point: Vector, force: Vector) -> None:
        """A force [N] on a body at a point, both in the ground's axes."""
        motion = self.motions[body]
        self.turn(body, cross(minus(point, motion.position), force))
        if isinstance(body, Body):
            for x, component in zip(motion.position, force, strict=True):
                if x in motion.coordinates:
                    self.forces[x] += component

    def turn(self, body: Body | Ground, torque: Vector) -> None:
        """A torque [N.m] on a body, in the ground's axes."""
        motion = self.motions[body]
        for speed, component in motion.torque_on(torque):
            self.forces[speed] += component

    def pull_together(self, a: Placed, b: Placed, point: Vector, force: Vector) -> None:
        """A force at a point on the second body, and its reaction there on the first."""
        self.push(b.body, point, force)
        self.push(a.body, point, times(-1, force))

    # ------------------------------------------------------------------ outputs

    def report(
        self, name: str, expression: Expr, unit: str, text: str, unique: bool = False
    ) -> None:
        """An output of the FMU; `unique`: with unique.NAME."""
        self.outputs.append(Output(name, expression, unit, text, unique=unique))

    def wrench(self, name: str) -> Wrench:
        """What the second body receives through that joint."""
        return self.wrenches.setdefault(name, Wrench())

    def report_wrenches(self) -> None:
        """force.A.x, ..., torque.A.z of each joint, and whether redundant rows leave them one value."""
        planar = len(self.components) == 2
        for name, wrench in self.wrenches.items():
            of = f"that the second body receives through {name}"
            for kind, values, unit, axes in (
                ("force", wrench.force, "N", self.components),
                ("torque", wrench.torque, "N.m", "z" if planar else AXES),
            ):
                parts = [values[AXES.index(x)] for x in axes]
                for x, value in zip(axes, parts, strict=True):
                    text = f"{kind} {of}, {x} axis of the first marker"
                    self.report(f"{kind}.{name}.{x}", value, unit, text, unique=True)
                if len(parts) > 1:
                    norm = sp.sqrt(sp.Add(*(p**2 for p in parts)))
                    text = f"magnitude of the {kind} {of}"
                    self.report(f"{kind}.{name}.norm", norm, unit, text, unique=True)


TURNS = ("roll", "pitch", "yaw")
LOCK = sp.Float(1e-8)  # nearer to it, roundings of R would turn roll and yaw by more than that


@dataclass(frozen=True, eq=False)
class Reading:
    """The FMU tells NAME.position.x [m], NAME.velocity.x [m/s], NAME.acceleration.x [m/s^2], ... of the
    marker, along the ground's axes, and in space how it is turned: NAME.rpy.roll, .pitch, .yaw [rad]."""

    name: str
    at: Marker

    def add(self, draft: Draft) -> None:
        """Its outputs."""
        placed = draft.readings[self.name] = draft.place(self.at, self.name)
        where = f"of {self.name} on {placed.body.name}"
        points = [Timed(*parts) for parts in zip(*placed.origin, strict=True)]
        told = (
            ("position", [p.value for p in points], "m"),
            ("velocity", [p.rate for p in points], "m/s"),
            ("acceleration", [draft.second(p) for p in points], "m/s^2"),
        )
        for what, vector, unit in told:
            text = f"{what} {where}, from the ground"
            for x, component in zip(draft.components, vector, strict=False):
                draft.report(f"{self.name}.{what}.{x}", component, unit, text)
        if len(draft.components) == len(AXES):
            self._turned(draft, placed, where)

    def _turned(self, draft: Draft, placed: Placed, where: str) -> None:
        (r11, r21, r31), (r12, r22, _), (r13, r23, _) = (axis.value for axis in placed.axes)
        h2 = r11**2 + r21**2
        k = sp.sqrt(h2 - LOCK**2)  # no number at lock, and before it a length that does not count
        roll = sp.atan2(k * (r21 * r13 - r11 * r23), k * (r11 * r22 - r21 * r12))
        found = (
            (roll, sp.atan2(-r23, r22)),
            (sp.atan2(-r31, sp.sqrt(h2)), None),
            (sp.atan2(k * r21, k * r11), sp.S.Zero),
        )
        for what, (angle, at_lock) in zip(TURNS, found, strict=True):
            name, text = f"{self.name}.rpy.{what}", f"{what} {where}, against the ground"
            draft.outputs.append(Output(name, angle, "rad", text, otherwise=at_lock))


def readings_of(read: Mapping[str, Any], planar: bool) -> list[Reading]:
    """Of markers by name; of a body its own frame."""
    origin = (0.0, 0.0) if planar else (0.0, 0.0, 0.0)
    return [Reading(n, m.at(origin) if isinstance(m, Body) else m) for n, m in read.items()]
