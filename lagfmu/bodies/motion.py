"""How a body moves, as joints and loads ask for it: one interface for the plane and for space.

For a point p = r + s that is fixed on a body with angular velocity w, in the ground's axes,

    p' = r' + w x s ,    p'' = r'' + w' x s + w x (w x s)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from ..model.elements import Expr
from .body import Marker
from .vectors import Vector, cross, dot, length, minus, plus, times


@dataclass(frozen=True, eq=False)
class Placed:
    """A marker in the ground's axes: its `point` and the unit vectors of its `axes`.  In the plane `angle`
    [rad] is that of its x axis, and grows over many turns."""

    motion: Motion
    point: Vector
    axes: tuple[Vector, Vector, Vector]
    angle: Expr

    @property
    def body(self) -> Any:
        """What the marker is on."""
        return self.motion.body

    @cached_property
    def _arm(self) -> Vector:
        return minus(self.point, self.motion.position)

    @cached_property
    def velocity(self) -> Vector:
        """p' [m/s]."""
        return plus(self.motion.velocity, cross(self.motion.omega, self._arm))

    @cached_property
    def acceleration(self) -> Vector:
        """p'' [m/s^2]."""
        w = self.motion.omega
        turning = plus(cross(self.motion.alpha, self._arm), cross(w, cross(w, self._arm)))
        return plus(self.motion.acceleration, turning)


class Motion(ABC):
    """Position, velocity and acceleration of a body's centre of mass, its angular velocity `omega` and
    `alpha`, all in the ground's axes.  `velocity_speeds`: the speeds that forces act on."""

    body: Any
    position: Vector
    velocity: Vector
    acceleration: Vector
    omega: Vector
    alpha: Vector
    velocity_speeds: tuple[Expr, ...]
    mass: Expr
    masses: tuple[Expr, ...]  # of each coordinate, as the assembly weighs its movement
    coordinates: dict[Expr, str]
    descriptions: dict[Expr, str]

    @abstractmethod
    def placed(self, marker: Marker, point: Vector) -> Placed:
        """The marker, whose point [m] is given in the body's own frame."""

    @abstractmethod
    def torque_on(self, torque: Vector) -> Iterator[tuple[Expr, Expr]]:
        """(speed, generalized force) of a torque [N.m] in the ground's axes."""


def along(a: Placed, b: Placed, axis: int) -> tuple[Expr, Expr, Expr]:
    """How far b is from a along an axis of a [m], with the first and the second derivative."""
    e, w = a.axes[axis], a.motion.omega
    turned = cross(w, e)
    d, rate = minus(b.point, a.point), minus(b.velocity, a.velocity)
    bent = plus(cross(a.motion.alpha, e), cross(w, turned))
    second = dot(e, minus(b.acceleration, a.acceleration)) + 2 * dot(turned, rate) + dot(bent, d)
    return dot(e, d), dot(e, rate) + dot(turned, d), second


def about(a: Placed, b: Placed, axis: int) -> tuple[Expr, Expr]:
    """The rate [rad/s] at which b turns about an axis of a, and its derivative."""
    e = a.axes[axis]
    w = minus(b.motion.omega, a.motion.omega)
    return dot(e, w), dot(e, minus(b.motion.alpha, a.motion.alpha)) + dot(
        cross(a.motion.omega, e), w
    )


def distance(a: Placed, b: Placed) -> tuple[Expr, Vector, Expr]:
    """|d| [m], the unit vector from a to b in the ground's axes, and the rate of |d| [m/s]."""
    d = minus(b.point, a.point)
    size = length(d)
    direction = times(1 / size, d)
    return size, direction, dot(direction, minus(b.velocity, a.velocity))
