"""A body in the plane: three coordinates, position of the centre of mass x, y [m] and an angle [rad].

T = m (x'^2 + y'^2)/2 + J phi'^2/2
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import sympy as sp
from sympy.physics.vector import dynamicsymbols

from ..model.elements import TIME, Expr, is_number
from .body import Body, Ground, Marker
from .draft import Draft
from .motion import ZERO, Motion, Placed, Vector, minus

EXACT = 12  # parts of pi that an angle may be of, and have a sine without rounding


class PlaneMotion(Motion):
    """The motion of a body, or the rest of the ground, in the plane."""

    def __init__(self, draft: Draft, body: Body | Ground) -> None:
        self.body, self._draft = body, draft
        self.coordinates, self.descriptions = {}, {}
        self.speeds, self.kinematics = {}, {}
        self.mass, self.masses = sp.S.Zero, ()
        self.angle: Expr = sp.S.Zero
        self._center = ZERO
        self.position = self.velocity = self.spin = ZERO
        if isinstance(body, Body):
            self._moving(body)

    def _moving(self, body: Body) -> None:
        draft, name = self._draft, body.name
        x, y = (dynamicsymbols(f"{name}.position.{axis}") for axis in "xy")
        self.angle = dynamicsymbols(f"{name}.orientation.z")
        self.coordinates = {x: "m", y: "m", self.angle: "rad"}
        self.position = (x, y, sp.S.Zero)
        self.velocity = (x.diff(TIME), y.diff(TIME), sp.S.Zero)
        self.spin = (sp.S.Zero, sp.S.Zero, self.angle.diff(TIME))
        self._center = draft.vector(body.center, f"{name}.center", "m", "centre of mass")
        m = draft.number(
            body.mass, f"{name}.mass", "kg", f"mass of {name}", positive=body.mass != 0
        )
        text = f"moment of inertia of {name} about its centre of mass"
        J = draft.number(
            body.inertia, f"{name}.inertia", "kg.m^2", text, positive=body.inertia != 0
        )
        self.mass, self.masses = m, (m, m, J)
        self.descriptions = {
            **{s: f"{a} of the centre of mass of {name}" for s, a in ((x, "x"), (y, "y"))},
            self.angle: f"angle of {name} against the ground",
        }
        draft.kinetic += [m * v.diff(TIME) ** 2 / 2 for v in (x, y)]
        draft.kinetic.append(J * self.angle.diff(TIME) ** 2 / 2)
        for axis, v in zip("xy", self.velocity, strict=False):
            text = f"velocity of the centre of mass of {name}"
            draft.report(f"{name}.velocity.{axis}", v, "m/s", text)
        draft.report(f"{name}.omega.z", self.spin[2], "rad/s", f"angular velocity of {name}")

    def turned(self, vector: Vector) -> Vector:
        """Components in the body's frame -> along the ground's axes."""
        (x, y, z), c, s = vector, sp.cos(self.angle), sp.sin(self.angle)
        return c * x - s * y, s * x + c * y, z

    def placed(self, marker: Marker, point: Vector) -> Placed:
        """The marker, whose point [m] is given in the body's own frame."""
        angle = _exact(marker.rotation)
        c, s = sp.cos(angle), sp.sin(angle)
        axes = ((c, s, sp.S.Zero), (-s, c, sp.S.Zero), (sp.S.Zero, sp.S.Zero, sp.S.One))
        return Placed(self, minus(point, self._center), axes, self.angle + angle)

    def torque_on(self, torque: Vector) -> Iterator[tuple[Expr, Expr]]:
        """(coordinate, generalized force) of a torque [N.m]."""
        if self.coordinates:
            yield self.angle, torque[2]


def _exact(rotation: Any) -> Expr:
    """An angle; a number that is a simple part of pi is that, so that cos(pi/2) is 0."""
    if rotation is None:
        return sp.S.Zero
    if isinstance(rotation, sp.Basic) or not is_number(rotation):
        return sp.sympify(rotation)
    parts = float(rotation) / math.pi * EXACT
    if abs(parts - round(parts)) < 1e-12:
        return sp.pi * round(parts) / EXACT
    return sp.Float(float(rotation), 17)
