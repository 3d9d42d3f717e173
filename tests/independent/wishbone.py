"""The suspension of models/double_wishbone.py by Newton and Euler, while its wheel is on the road.

Four bodies; the height of the wheel's centre is the road's, whose second derivative by time is what the row
of the contact needs.  The road is integrated from point to point, where its third derivative jumps.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import pairwise

import numpy as np
from joints import across, along, hinge, pin, rod, turns
from rigid import GROUND, Look, Mass, Mechanism, Row, Vector
from scipy.interpolate import CubicSpline

WAY = [0, 2, 3, 4, 5, 5.5, 6, 6.5, 7, 8, 9, 10, 20, 30]
HEIGHT = [0, 0, 0, 0, 0, 0.04, 0.08, 0.04, 0, 0, 0, 0, 0, 0]
ROAD, SPEED = CubicSpline(WAY, HEIGHT, bc_type="natural"), 18.0  # m/s
NAMES = ("car", "lower", "upper", "upright")
CAR, LOWER, UPPER, UPRIGHT = range(4)
MASSES = (
    Mass.of(320.0, 60, 60, 90),
    Mass.of(4.0, 0.05, 0.03, 0.07, 0.002, 0, -0.004),
    Mass.of(2.0, 0.02, 0.012, 0.027),
    Mass.of(28.0, 0.6, 0.9, 0.6, 0.01, 0.02, -0.03),
)
CENTERS = np.array([(0, 0.2, 0.5), (0.01, 0.52, 0.21), (0.02, 0.53, 0.53), (0.004, 0.73, 0.32)])
A, A_AXIS = (0.0, 0.35, 0.22), (1.0, 0.05, 0.02)
B, B_AXIS = (0.02, 0.42, 0.52), (1.0, -0.04, 0.03)
WHEEL = (0.01, 0.76, 0.31)
C, D = (0.01, 0.70, 0.20), (0.03, 0.66, 0.55)
ARM, RACK = (-0.13, 0.68, 0.26), (-0.12, 0.36, 0.27)
STRUT = (0.02, 0.45, 0.70), (0.01, 0.58, 0.22)
STIFFNESS, LENGTH, DAMPING = 42e3, 0.62, 2.5e3
Z = (0, 0, 1)


def arm(body: int, point: tuple[float, ...]) -> Vector:
    """From the centre of mass, of a point of the car at rest."""
    found: Vector = np.subtract(point, CENTERS[body])
    return found


def strut(look: Look) -> Mapping[int, Vector]:
    """Spring and damper."""
    a, b = arm(CAR, STRUT[0]), arm(LOWER, STRUT[1])
    d = look.point(LOWER, b) - look.point(CAR, a)
    size = np.linalg.norm(d)
    e = d / size
    rate = e @ (look.rate(LOWER, b) - look.rate(CAR, a))
    force = (STIFFNESS * (size - LENGTH) + DAMPING * rate) * e
    return {
        CAR: np.array([*force, *np.cross(look.arm(CAR, a), force)]),
        LOWER: -np.array([*force, *np.cross(look.arm(LOWER, b), force)]),
    }


def driven(look: Look) -> list[Row]:
    """The wheel's centre rises as the road does."""
    (row,) = along(GROUND, (0, 0, 0), Z, UPRIGHT, arm(UPRIGHT, WHEEL), look)
    return [
        Row(row.first, row.J1, row.second, row.J2, row.gamma + SPEED**2 * ROAD(SPEED * look.t, 2))
    ]


def by_hand() -> Mechanism:
    """The joints by their names in the model."""
    slide = [
        *(partial(along, GROUND, (0, 0, 0), e, CAR, -CENTERS[CAR]) for e in across(Z)),
        partial(turns, GROUND, np.eye(3), CAR),
    ]
    joints = {
        "ride": slide,
        "A": hinge(CAR, arm(CAR, A), A_AXIS, LOWER, arm(LOWER, A)),
        "B": hinge(CAR, arm(CAR, B), B_AXIS, UPPER, arm(UPPER, B)),
        "C": [partial(pin, UPRIGHT, arm(UPRIGHT, C), LOWER, arm(LOWER, C))],
        "D": [partial(pin, UPRIGHT, arm(UPRIGHT, D), UPPER, arm(UPPER, D))],
        "tie": [partial(rod, UPRIGHT, arm(UPRIGHT, ARM), CAR, arm(CAR, RACK))],
        "patch": [driven],
    }
    return Mechanism(MASSES, joints, (0, 0, -9.81), [strut])


def norms(start: Vector, stop: float) -> dict[str, float]:
    """From the state of the bodies in NAMES at 0 (rigid.py): the size [N] of each joint's force at `stop`."""
    mechanism, y = by_hand(), start
    points = [0.0, *(x / SPEED for x in WAY if 0 < x < SPEED * stop), stop]
    for a, b in pairwise(points):
        y = mechanism.moved(y, (a, b))[-1]
    received = mechanism.solve(stop, y)[2]
    return {name: float(np.linalg.norm(wrench[:3])) for name, wrench in received.items()}
