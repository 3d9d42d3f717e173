"""A body in space: position of the centre of mass [m], unit quaternion (w, x, y, z), angular velocity.

    T = m r'^2/2 + w . J w/2 ,   e0' = -e . w/2 ,   e' = (e0 w + e x w)/2

with w [rad/s] in the body's own frame, in which J is constant, and with it M.  R turns components in that
frame into those along the ground's axes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import sympy as sp
from sympy.physics.vector import dynamicsymbols

from ..model.attitude import carried, quaternion_rates, rotation_matrix
from ..model.elements import TIME, Expr
from .body import Body, Ground, Marker, Rotation, rotation_of
from .draft import Draft
from .motion import AXES, ZERO, Motion, Placed, TimedVector, Vector, dot, minus

STILL: Rotation = tuple(tuple(sp.Integer(i == j) for j in range(3)) for i in range(3))  # type: ignore[assignment]
PAIRS = ("xx", "yy", "zz", "xy", "xz", "yz")


class SpaceMotion(Motion):
    """The motion of a body, or the rest of the ground, in space."""

    def __init__(self, draft: Draft, body: Body | Ground) -> None:
        self.body = body
        self.coordinates, self.speeds, self.kinematics, self.descriptions = {}, {}, {}, {}
        self.mass, self.masses = sp.S.Zero, ()
        self.rotation = STILL
        self._quaternion: tuple[Expr, ...] = ()
        self._center = ZERO
        self.position = self.velocity = self.spin = ZERO
        if isinstance(body, Body):
            self._moving(draft, body)

    def _moving(self, draft: Draft, body: Body) -> None:
        name = body.name
        r, w = (
            (
                dynamicsymbols(f"{name}.{what}.x"),
                dynamicsymbols(f"{name}.{what}.y"),
                dynamicsymbols(f"{name}.{what}.z"),
            )
            for what in ("position", "omega")
        )
        e = tuple(dynamicsymbols(f"{name}.orientation.{x}") for x in "wxyz")
        self.coordinates = {**dict.fromkeys(r, "m"), **dict.fromkeys(e, "1")}
        self.speeds = dict.fromkeys(w, "rad/s")
        self.kinematics = dict(zip(e, quaternion_rates(e, w), strict=True))
        self.descriptions = {
            **{s: f"{x} of the centre of mass of {name}" for s, x in zip(r, AXES, strict=True)},
            **{s: f"{x} of the unit quaternion of {name}" for s, x in zip(e, "wxyz", strict=True)},
            **{
                s: f"{x} of the angular velocity of {name} in its frame"
                for s, x in zip(w, AXES, strict=True)
            },
        }
        self.rotation, self._quaternion = _matrix(e), e
        self.position, self.spin = r, w
        self.velocity = (r[0].diff(TIME), r[1].diff(TIME), r[2].diff(TIME))
        self._center = draft.vector(body.center, f"{name}.center", "m", "centre of mass")
        self._inertia(draft, body, w)

    def _inertia(self, draft: Draft, body: Body, w: Vector) -> None:
        name = body.name
        m = draft.number(
            body.mass, f"{name}.mass", "kg", f"mass of {name}", positive=body.mass != 0
        )
        J = [
            draft.number(
                value,
                f"{name}.inertia.{pair}",
                "kg.m^2",
                f"inertia of {name}, {pair}",
                value != 0 and pair[0] == pair[1],
            )
            for pair, value in zip(PAIRS, body.inertia, strict=False)
        ]
        self.mass, self.masses = m, (m, m, m, *J[:3])
        draft.kinetic += [m * v**2 / 2 for v in self.velocity]
        for pair, value in zip(PAIRS, J, strict=False):
            i, j = map(AXES.index, pair)
            if value != 0:
                draft.kinetic.append(value * w[i] * w[j] / (2 if i == j else 1))
        for x, v in zip(AXES, self.velocity, strict=True):
            draft.report(
                f"{name}.velocity.{x}", v, "m/s", f"velocity of the centre of mass of {name}"
            )

    def turned(self, v: Vector) -> Vector:
        """Components in the body's frame -> along the ground's axes."""
        return dot(self.rotation[0], v), dot(self.rotation[1], v), dot(self.rotation[2], v)

    def fixed(self, vector: Vector) -> TimedVector:
        """A vector that is fixed on the body, closed: joints of a kind are alike, whatever it is."""
        if not self.coordinates or vector == ZERO:
            return TimedVector(vector, ZERO, ZERO)
        return TimedVector(*(carried(k, self._quaternion, vector, self.spin) for k in range(3)))

    @cached_property
    def omega(self) -> Vector:
        """Closed as well."""
        return carried(0, self._quaternion, self.spin, ZERO) if self.coordinates else ZERO

    def placed(self, marker: Marker, point: Vector) -> Placed:
        """The marker, whose point [m] is given in the body's own frame."""
        R = rotation_of(marker)
        x, y, z = ((R[0][k], R[1][k], R[2][k]) for k in range(3))
        return Placed(self, minus(point, self._center), (x, y, z), sp.S.Zero)

    def torque_on(self, torque: Vector) -> Iterator[tuple[Expr, Expr]]:
        """(speed, generalized force) of a torque [N.m] in the ground's axes: its component in the body's."""
        for k, speed in enumerate(self.speeds):
            column = (self.rotation[0][k], self.rotation[1][k], self.rotation[2][k])
            yield speed, dot(column, torque)


def _matrix(e: Sequence[Any]) -> Rotation:
    """R of a quaternion of norm 1, its elements closed: R' = R [w x] is short (mechanics/kinematics.py)."""
    R = rotation_matrix(e)
    return tuple(tuple(R[i, j] for j in range(3)) for i in range(3))  # type: ignore[return-value]
