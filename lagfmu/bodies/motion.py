"""How bodies move, as joints and loads ask for it: one interface for the plane and for space.

A vector s that is fixed on a body with the angular velocity w, both by components in the body's frame, is
along the ground's axes

    u = R s ,   u' = R (w x s) ,   u'' = R (w x (w x s)) + R (w' x s)

What is differentiated in time is kept as three expressions: itself, its rate, and its bend, the part of the
second derivative that is there while the speeds do not change.  These are short, where the chain rule over
the elements of R is long.

Vectors as tuples of three SymPy expressions; a vector of the plane has no third component.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import sympy as sp

from ..model.elements import Expr
from .body import Marker

Vector = tuple[Any, Any, Any]
AXES = "xyz"
ZERO: Vector = (sp.S.Zero, sp.S.Zero, sp.S.Zero)


def plus(a: Vector, b: Vector) -> Vector:
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def times(factor: Expr, a: Vector) -> Vector:
    """factor * a."""
    return factor * a[0], factor * a[1], factor * a[2]


def minus(a: Vector, b: Vector) -> Vector:
    """a - b."""
    return plus(a, times(-1, b))


def dot(a: Vector, b: Vector) -> Expr:
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def length(a: Vector) -> Expr:
    """|a|."""
    return sp.sqrt(dot(a, a))


class Timed(NamedTuple):
    """A number with its rate and its bend."""

    value: Expr
    rate: Expr
    bend: Expr


class TimedVector(NamedTuple):
    """A vector along the ground's axes, with its rate and its bend."""

    value: Vector
    rate: Vector
    bend: Vector


def product(u: TimedVector, v: TimedVector) -> Timed:
    """u . v."""
    return Timed(
        dot(u.value, v.value),
        dot(u.rate, v.value) + dot(u.value, v.rate),
        dot(u.bend, v.value) + 2 * dot(u.rate, v.rate) + dot(u.value, v.bend),
    )


class Motion(ABC):
    """The motion of a body: `position` and `velocity` of its centre of mass along the ground's axes, and its
    angular velocity `spin` by components in its own frame.

    `coordinates` and `speeds` map what the body has of these to units, `kinematics` says how coordinates
    move whose rates are no speeds; `masses` are what resists each of the `directions`.
    """

    body: Any
    position: Vector
    velocity: Vector
    spin: Vector
    mass: Expr
    masses: tuple[Expr, ...]
    coordinates: dict[Expr, str]
    speeds: dict[Expr, str]
    kinematics: dict[Expr, Expr]
    descriptions: dict[Expr, str]

    @property
    def directions(self) -> list[Expr]:
        """What forces are on: the coordinates whose rates are speeds, then the speeds of its own."""
        return [*(q for q in self.coordinates if q not in self.kinematics), *self.speeds]

    @abstractmethod
    def turned(self, vector: Vector) -> Vector:
        """R s: components in the body's frame -> along the ground's axes."""

    @abstractmethod
    def placed(self, marker: Marker, point: Vector) -> Placed:
        """The marker, whose point [m] is given in the body's own frame."""

    @abstractmethod
    def torque_on(self, torque: Vector) -> Iterator[tuple[Expr, Expr]]:
        """(direction, generalized force) of a torque [N.m] along the ground's axes."""

    def fixed(self, vector: Vector) -> TimedVector:
        """A vector that is fixed on the body."""
        rate = cross(self.spin, vector)
        return TimedVector(*map(self.turned, (vector, rate, cross(self.spin, rate))))

    @cached_property
    def omega(self) -> Vector:
        """The angular velocity along the ground's axes."""
        return self.turned(self.spin)


@dataclass(frozen=True, eq=False)
class Placed:
    """A marker on a body in motion: `arm` from the centre of mass [m] and unit vectors, all in the body's
    frame.  In the plane `angle` [rad] is that of its x axis, and grows over many turns."""

    motion: Motion
    arm: Vector
    own_axes: tuple[Vector, Vector, Vector]
    angle: Expr

    @property
    def body(self) -> Any:
        """What the marker is on."""
        return self.motion.body

    @cached_property
    def origin(self) -> TimedVector:
        """Where it is [m]."""
        value, rate, bend = self.motion.fixed(self.arm)
        return TimedVector(
            plus(self.motion.position, value), plus(self.motion.velocity, rate), bend
        )

    @property
    def point(self) -> Vector:
        """Where it is [m], along the ground's axes."""
        return self.origin.value

    @cached_property
    def axes(self) -> tuple[TimedVector, TimedVector, TimedVector]:
        """The directions of its axes."""
        x, y, z = map(self.motion.fixed, self.own_axes)
        return x, y, z


def between(a: Placed, b: Placed) -> TimedVector:
    """From a to b [m]."""
    return TimedVector(*(minus(v, u) for u, v in zip(a.origin, b.origin, strict=True)))


def about(a: Placed, b: Placed, axis: int) -> Expr:
    """The rate at which b turns about an axis of a [rad/s].  Where a joint holds that axis on b, too, it has
    no bend: e' = w_a x e is square to w_b = w_a + rate e."""
    return dot(a.axes[axis].value, b.motion.omega) - dot(a.own_axes[axis], a.motion.spin)


def distance(a: Placed, b: Placed) -> tuple[Timed, Vector]:
    """|d| [m], and the unit vector from a to b."""
    d, rate, bend = between(a, b)
    size = length(d)
    n = times(1 / size, d)
    along = dot(n, rate)
    return Timed(size, along, (dot(rate, rate) - along**2) / size + dot(n, bend)), n
