"""Rigid bodies in space as a Model written out: positions, unit quaternions, angular velocities as speeds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import sympy as sp
from rigid import Mass, Vector, quaternion, rotation
from sympy import Matrix
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter

AXES = "xyz"


class Parts:
    """Collects bodies, parameters and rows of a Model."""

    def __init__(self) -> None:
        self.coordinates: dict[Any, str] = {}
        self.speeds: dict[Any, str] = {}
        self.kinematics: dict[Any, Any] = {}
        self.parameters: list[Parameter] = []
        self.rows: list[Holonomic] = []
        self.kinetic: Any = sp.S.Zero
        self.start: dict[Any, float] = {}
        self.names: list[str] = []

    def number(self, name: str, value: float, unit: str) -> Any:
        """A parameter; 0 where it is 0."""
        if value == 0:
            return sp.S.Zero
        symbol = sp.Symbol(name, real=True)
        self.parameters.append(Parameter(symbol, float(value), unit))
        return symbol

    def body(self, name: str, mass: Mass, state: Vector) -> Free:
        """A body that moves freely, from its part of a state of `rigid`."""
        self.names.append(name)
        return Free(self, name, mass, state)

    def same(self, name: str, first: Matrix, second: Matrix, axes: str = AXES) -> None:
        """Two points coincide; lambda.NAME.x ... [N] is the force on the second."""
        for k in map(AXES.index, axes):
            self.rows.append(Holonomic(f"{name}.{AXES[k]}", second[k] - first[k]))

    def square(self, name: str, first: Matrix, second: Iterable[Matrix]) -> None:
        """A unit vector stays square to others."""
        self.rows += [Holonomic(f"{name}.r{k}", first.dot(e)) for k, e in enumerate(second, 1)]

    def model(self, name: str, gravity: float, heights: Mapping[Any, Any], **more: Any) -> Model:
        """With the potential m g h of each mass [kg] in `heights` [m]."""
        g = self.number("g", gravity, "m/s^2")
        return Model(
            name,
            lagrangian=self.kinetic - g * sum((m * h for m, h in heights.items()), sp.S.Zero),
            coordinates=self.coordinates,
            speeds=self.speeds,
            kinematics=self.kinematics,
            constraints=self.rows,
            parameters=self.parameters,
            start=self.start,
            **more,
        )


class Free:
    """A body: r and a quaternion, r' and the angular velocity in its own axes."""

    def __init__(self, parts: Parts, name: str, mass: Mass, state: Vector) -> None:
        self.parts, self.name = parts, name
        self.r = Matrix(dynamicsymbols(" ".join(f"{name}.position.{x}" for x in AXES)))
        self.e = dynamicsymbols(" ".join(f"{name}.quaternion.e{k}" for k in range(4)))
        self.w = Matrix(dynamicsymbols(" ".join(f"{name}.omega.{x}" for x in AXES)))
        e0, e = self.e[0], Matrix(self.e[1:])
        rates = [-e.dot(self.w) / 2, *((e0 * self.w + e.cross(self.w)) / 2)]
        parts.coordinates |= dict.fromkeys(self.r, "m") | dict.fromkeys(self.e, "1")
        parts.speeds |= dict.fromkeys(self.w, "rad/s")
        parts.kinematics |= dict(zip(self.e, rates, strict=True))
        self.m = parts.number(f"{name}.m", mass.m, "kg")
        J = sp.zeros(3)
        for i in range(3):
            for k in range(i, 3):
                label = f"{name}.J{AXES[i]}{AXES[k]}"
                J[i, k] = J[k, i] = parts.number(label, mass.J[i, k], "kg.m^2")
        v = self.r.diff(dynamicsymbols._t)
        parts.kinetic += self.m * v.dot(v) / 2 + (self.w.T * J * self.w)[0] / 2
        own = rotation(state[3:7]).T @ state[10:]
        for symbols, values in ((self.r, state[:3]), (self.e, state[3:7]), (v, state[7:10])):
            parts.start |= dict(zip(symbols, map(float, values), strict=True))
        parts.start |= dict(zip(self.w, map(float, own), strict=True))

    @property
    def R(self) -> Matrix:
        """From its own axes to those of space."""
        e0, e = self.e[0], Matrix(self.e[1:])
        skew = Matrix([[0, -e[2], e[1]], [e[2], 0, -e[0]], [-e[1], e[0], 0]])
        return (e0**2 - e.dot(e)) * sp.eye(3) + 2 * e * e.T + 2 * e0 * skew

    def at(self, label: str, s: Sequence[float]) -> Matrix:
        """A point of the body [m] in space."""
        return self.r + self.R * self.vector(label, s, "m")

    def axis(self, a: Sequence[float]) -> Matrix:
        """A direction of the body in space."""
        return self.R * Matrix([sp.Float(x, 17) if x % 1 else sp.Integer(int(x)) for x in a])

    def vector(self, label: str, s: Sequence[float], unit: str) -> Matrix:
        """Parameters NAME.LABEL.x, ..."""
        numbers = zip(AXES, s, strict=True)
        return Matrix([self.parts.number(f"{self.name}.{label}.{x}", v, unit) for x, v in numbers])


def forces_in(run: Any, names: Sequence[str], rotations: Sequence[Vector]) -> list[list[float]]:
    """All constraint forces on each body at the end of a run: force and torque about the centre, in space."""
    found = []
    for name, R in zip(names, rotations, strict=True):
        force = [float(run[f"Q.{name}.position.{x}"][-1]) for x in AXES]
        torque = [float(run[f"Q.{name}.omega.{x}"][-1]) for x in AXES]
        found.append([*force, *(R @ torque)])
    return found


__all__ = ["Free", "Parts", "forces_in", "quaternion"]
