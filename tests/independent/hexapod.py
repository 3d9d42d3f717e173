"""The Stewart platform of models/stewart.py by Newton and Euler: 13 bodies, 72 rows of joints, six drives.

Its motion is prescribed and known: of the plate p(t) and its roll, so of each leg d = p + R b - a, and
    L = |d| ,  u = d/L ,  u' = (d' - L' u)/L ,  L'' = (d' . d' - L'^2 + d . d'')/L ;
the universal joint keeps the leg's y axis square to the ground's x axis:  y = u x e_x/|u x e_x|.
Nothing is integrated: with places and velocities known, one linear solve gives accelerations and wrenches.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from joints import across, along, pin, square, turns
from rigid import GROUND, Look, Mass, Mechanism, Row, Vector, cross, quaternion

LOW, HIGH, HEIGHT, SWAY, RATE = 0.8, 0.4, 1.0, 0.08, 3.0  # m, m, m, m, rad/s
PLATE, CYLINDER, ROD = (
    Mass.of(50.0, 2.5, 2.0, 4.0, 0.1, -0.2, 0.15),
    Mass.of(4.0, 0.1, 0.1, 0.004),
    Mass.of(2.0, 0.06, 0.06, 0.001),
)
HINGE, END = (0, 0, -0.25), (0, 0, 0.3)  # m, from the centres of mass of cylinder and rod
X, Y, Z = np.eye(3)


def around(radius: float, off: float) -> list[Vector]:
    """Six points on a circle, in pairs."""
    angles = [2 * np.pi * k / 3 + side * off for k in range(3) for side in (-1, 1)]
    return [radius * np.array([np.cos(a), np.sin(a), 0]) for a in angles]


FEET, HEADS = around(LOW, np.pi / 12), around(HIGH, np.pi / 4)


class Legs:
    """The plate and its legs at one time, with two derivatives."""

    def __init__(self, t: float) -> None:
        rates = RATE * np.array([1, 2, 3])
        s, c = np.sin(rates * t), np.cos(rates * t)
        self.place = SWAY * s + HEIGHT * Z, SWAY * rates * c, -SWAY * rates**2 * s
        self.roll = s[0] / 5, RATE * c[0] / 5, -(RATE**2) * s[0] / 5
        cos, sin = np.cos(self.roll[0]), np.sin(self.roll[0])
        self.R = np.array([[1, 0, 0], [0, cos, -sin], [0, sin, cos]])

    def leg(self, k: int) -> tuple[Vector, Vector, float, float, float]:
        """d and d' [m, m/s], and the length with two derivatives."""
        arm, w, dw = self.R @ HEADS[k], self.roll[1] * X, self.roll[2] * X
        spin = np.cross(w, arm)
        d = self.place[0] + arm - FEET[k]
        rate = self.place[1] + spin
        bend = self.place[2] + np.cross(dw, arm) + np.cross(w, spin)
        L = np.linalg.norm(d)
        first = d @ rate / L
        return d, rate, L, first, (rate @ rate - first**2 + d @ bend) / L

    def state(self) -> Vector:
        """Of the plate, then of cylinder and rod of each leg (rigid.py)."""
        parts = [np.array([*self.place[0], *quaternion(self.R), *self.place[1], *self.roll[1] * X])]
        for k in range(6):
            d, rate, L, first, _ = self.leg(k)
            u = d / L
            du = (rate - first * u) / L
            n, dn = np.cross(u, X), np.cross(du, X)
            y = n / np.linalg.norm(n)
            x = np.cross(y, u)
            w = np.cross(u, du) - x @ dn / np.linalg.norm(n) * u
            attitude = quaternion(np.stack([x, y, u], axis=1))
            for r, v in (
                (FEET[k] - HINGE[2] * u, -HINGE[2] * du),
                (FEET[k] + d - END[2] * u, rate - END[2] * du),
            ):
                parts.append(np.array([*r, *attitude, *v, *w]))
        return np.concatenate(parts)


def driven(first: int, second: int, k: int, look: Look) -> list[Row]:
    """The rod's end is L(t) above the hinge, along the cylinder."""
    (row,) = along(first, HINGE, Z, second, END, look)
    return [Row(first, row.J1, second, row.J2, row.gamma + Legs(look.t).leg(k)[4])]


def by_hand() -> Mechanism:
    """Bodies 0: the plate, 2 k + 1 and 2 k + 2: cylinder and rod of the leg k = 0 ... 5."""
    joints = {}
    for k in range(6):
        low, high = 2 * k + 1, 2 * k + 2
        joints[f"foot{k + 1}"] = [
            partial(pin, GROUND, FEET[k], low, HINGE),
            partial(square, GROUND, X, low, Y),
        ]
        joints[f"leg{k + 1}"] = [
            *(partial(along, low, HINGE, e, high, END) for e in across(Z)),
            partial(turns, low, np.eye(3), high),
            partial(driven, low, high, k),
        ]
        joints[f"head{k + 1}"] = [partial(pin, 0, HEADS[k], high, END)]
    return Mechanism([PLATE, *[CYLINDER, ROD] * 6], joints, (0, 0, -9.81))


def wrenches(t: float) -> dict[str, Vector]:
    """Force [N] and moment [N m] that the second body of each joint receives, about its marker, in the axes
    of the first; of the legs with the drive's force."""
    mechanism, y = by_hand(), Legs(t).state()
    look, found = Look(t, y, 13), {}
    for name, received in mechanism.solve(t, y)[2].items():
        k = int(name[-1])
        first, second, s = {
            "foot": (GROUND, 2 * k - 1, HINGE),
            "leg": (2 * k - 1, 2 * k, END),
            "head": (0, 2 * k, END),
        }[name[:-1]]
        axes = look.R[first].T
        moment = received[3:] - cross(look.arm(second, s)) @ received[:3]
        found[name] = np.array([*(axes @ received[:3]), *(axes @ moment)])
    return found
