"""Rigid bodies in the plane on pins by Newton and Euler, in complex numbers; none of lagfmu is used.

    m z'' = f ,   J phi'' = tau ,   a point s of a body is at z + s exp(i phi)
    [M  -G^T] [a  ]   [F    ]
    [G   0  ] [lam] = [gamma]

A state is z.real, z.imag, phi of each body, then their rates; the ground is body -1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Vector = NDArray[np.float64]
GROUND = -1


class Look:
    """Places, arms and rates in a state."""

    def __init__(self, y: Vector) -> None:
        q, v = y.reshape(2, -1, 3)
        self.z = [*(q[:, 0] + 1j * q[:, 1]), 0j]
        self.turn = [*np.exp(1j * q[:, 2]), 1 + 0j]
        self.v = [*(v[:, 0] + 1j * v[:, 1]), 0j]
        self.w = [*v[:, 2], 0.0]

    def point(self, body: int, s: complex) -> complex:
        """Where a point of the body is."""
        return self.z[body] + self.turn[body] * s

    def rate(self, body: int, s: complex) -> complex:
        """Its velocity."""
        return self.v[body] + 1j * self.w[body] * self.turn[body] * s


@dataclass(frozen=True)
class Pin:
    """Two points coincide; lam is the force on the second body, x and y of the ground."""

    first: int
    s1: complex
    second: int
    s2: complex

    def rows(self, look: Look) -> list[tuple[dict[int, Vector], float]]:
        """(direction on each body, gamma), twice."""
        a, b = look.turn[self.first] * self.s1, look.turn[self.second] * self.s2
        gamma = look.w[self.second] ** 2 * b - look.w[self.first] ** 2 * a
        found = []
        for e in (1, 1j):
            one = {self.first: -unit(e, a), self.second: unit(e, b)}
            found.append((one, dot(gamma, e)))
        return found


def dot(a: complex, b: complex) -> float:
    """As vectors."""
    return float((a * np.conj(b)).real)


def unit(e: complex, arm: complex) -> Vector:
    """What a force e at the end of an arm does: x, y and the moment."""
    return np.array([e.real, e.imag, (np.conj(arm) * e).imag])


@dataclass(frozen=True)
class Mechanism:
    """Masses [kg] and moments of inertia [kg m2], joints, and the loads (n, 3) in a state."""

    masses: Sequence[tuple[float, float]]
    joints: Sequence[Pin]
    load: Callable[[Look], Vector]

    def solve(self, y: Vector) -> tuple[Vector, Vector]:
        """Accelerations (n, 3) and multipliers, two a joint."""
        look, n = Look(y), len(self.masses)
        rows = [row for joint in self.joints for row in joint.rows(look)]
        k = 3 * n
        system = np.zeros((k + len(rows), k + len(rows)))
        system[:k, :k] = np.diag([x for m, J in self.masses for x in (m, m, J)])
        for number, (row, _) in enumerate(rows, k):
            for body, direction in row.items():
                if body != GROUND:
                    place = slice(3 * body, 3 * body + 3)
                    system[number, place] += direction
                    system[place, number] -= direction
        right = [*self.load(look).ravel(), *(gamma for _, gamma in rows)]
        found = np.linalg.solve(system, right)
        return found[:k].reshape(n, 3), found[k:]

    def moved(self, y: Vector, stop: float, longest: float) -> Vector:
        """The state after `stop` [s], in steps of at most `longest` [s]."""

        def rate(_: float, y: Vector) -> Vector:
            return np.array([*y[len(y) // 2 :], *self.solve(y)[0].ravel()])

        options = {"rtol": 1e-13, "atol": 1e-15, "max_step": longest}
        found = solve_ivp(rate, (0, stop), y, "DOP853", **options)
        assert found.success, found.message
        return np.asarray(found.y[:, -1])
