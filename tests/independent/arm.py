"""An arm of six axes on prescribed motions: the wrench in each joint by recursive Newton and Euler.

    outward  w_i = R^T w_p + s q' ,  w_i' = R^T w_p' + s q'' + (R^T w_p) x s q'
             a_i = R^T (a_p + w_p' x p + w_p x (w_p x p)) ,  a_0 = -g
    inward   f_i = m a_c + sum R f ,  n_i = J w' + w x J w + c x m a_c + sum (R n + p x R f)

(Luh, Walker & Paul 1980; Featherstone, Rigid Body Dynamics Algorithms, sect. 5.3).  The frame of a link is
that of its joint; p and R lead to it from the frame of the one before, s is its axis, c the centre of mass in
it.  Nothing is integrated and nothing is solved for.  Pinocchio's `rnea` gives the same wrenches to 1e-15 of
the largest.  None of lagfmu is used but in `model`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Model, Parameter
from lagfmu.bodies import Body, Gravity, Ground, Motor, Revolute, mechanism

Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Link:
    """A link and the joint before it, as in URDF; `moves`: amplitude [rad], rate [rad/s], phase [rad]."""

    name: str
    xyz: Sequence[float]  # m, of the joint in the link before
    rpy: Sequence[float]  # rad
    axis: Sequence[float]
    mass: float  # kg
    center: Sequence[float]  # m
    inertia: Sequence[float]  # kg m2 about the centre: xx, yy, zz, xy, xz, yz
    moves: tuple[float, float, float]

    def angle(self, t: float) -> tuple[float, float, float]:
        """The angle and its two derivatives."""
        a, w, phase = self.moves
        s, c = np.sin(w * t + phase), np.cos(w * t + phase)
        return a * s, a * w * c, -a * w * w * s


LINKS = (
    Link(
        "base", (0, 0, 0.35), (0, 0, 0), (0, 0, 1),
        18.0, (0.02, 0.01, 0.12), (0.25, 0.24, 0.2, 0.01, -0.02, 0.015), (0.9, 1.3, 0.2),
    ),
    Link(
        "shoulder", (0.15, 0, 0.25), (-np.pi / 2, 0, 0.1), (0, 0, 1),
        14.0, (0.22, -0.03, 0.04), (0.08, 0.45, 0.42, 0.02, 0.01, -0.006), (0.5, 1.7, -0.4),
    ),
    Link(
        "elbow", (0.55, 0, 0), (0, 0.05, -np.pi / 2), (0, 0, 1),
        9.0, (0.05, 0.06, -0.02), (0.09, 0.05, 0.08, -0.004, 0.003, 0.002), (0.7, 2.1, 0.9),
    ),
    Link(
        "forearm", (0.1, 0.5, 0), (-np.pi / 2, 0, 0), (0, 0, 1),
        5.0, (0.0, 0.01, -0.15), (0.06, 0.058, 0.012, 0.0006, 0.001, -0.002), (1.1, 1.9, 1.7),
    ),
    Link(
        "wrist", (0, 0, 0.02), (np.pi / 2, 0.02, 0), (0, 0, 1),
        2.0, (0.01, 0.03, 0.005), (0.006, 0.004, 0.005, 0.0002, -0.0001, 0.0003), (0.8, 2.7, -1.1),
    ),
    Link(
        "flange", (0, 0.09, 0), (-np.pi / 2, 0, 0.03), (0, 0, 1),
        0.8, (0.02, -0.01, 0.06), (0.0012, 0.0011, 0.0007, 0.00005, 0.00002, -0.00004), (1.5, 3.1, 0.5),
    ),
)  # fmt: skip


def rpy(angles: Sequence[float]) -> Vector:
    """URDF's rotation: about x, then y, then z of the frame that stands."""
    r, p, y = angles
    return spun((0, 0, 1), y) @ spun((0, 1, 0), p) @ spun((1, 0, 0), r)


def spun(axis: Sequence[float], angle: float) -> Vector:
    """Rodrigues' rotation about an axis."""
    u = np.asarray(axis, dtype=float)
    K = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def tensor(elements: Sequence[float]) -> Vector:
    """From xx, yy, zz, xy, xz, yz."""
    xx, yy, zz, xy, xz, yz = elements
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def wrenches(t: float, links: Sequence[Link] = LINKS, gravity: float = 9.81) -> dict[str, Vector]:
    """Force [N] and moment [N m] about the joint that each link receives, in the axes of the joint before it
    turns; the drive's torque is the moment along its axis."""
    w, dw, a = np.zeros(3), np.zeros(3), np.array([0, 0, gravity])
    needed = []
    for link in links:
        p, s = np.asarray(link.xyz, dtype=float), np.asarray(link.axis, dtype=float)
        q, rate, bend = link.angle(t)
        turn = spun(s, q)
        back = (rpy(link.rpy) @ turn).T
        a = back @ (a + np.cross(dw, p) + np.cross(w, np.cross(w, p)))
        carried = back @ w
        dw = back @ dw + s * bend + np.cross(carried, s * rate)
        w = carried + s * rate
        c, J = np.asarray(link.center), tensor(link.inertia)
        force = link.mass * (a + np.cross(dw, c) + np.cross(w, np.cross(w, c)))
        moment = J @ dw + np.cross(w, J @ w) + np.cross(c, force)
        needed.append((link, p, turn, force, moment))
    found, f, n = {}, np.zeros(3), np.zeros(3)
    for link, p, turn, force, moment in reversed(needed):
        f, n = f + force, n + moment
        found[link.name] = np.array([*(turn @ f), *(turn @ n)])
        before = rpy(link.rpy) @ turn
        f, n = before @ f, before @ n
        n = n + np.cross(p, f)
    return found


def model(links: Sequence[Link] = LINKS, gravity: float = 9.81) -> Model:
    """The same of bodies and joints: joint J1 carries the first link, motor M1 moves it."""
    before: Body | Ground = Ground()
    bodies, joints, parameters = [], [], []
    loads: list[Gravity | Motor] = [Gravity((0, 0, -gravity))]
    for k, link in enumerate(links, 1):
        body = Body(link.name, link.mass, tuple(link.inertia), center=tuple(link.center))
        marker = before.at(tuple(link.xyz), rotation=("rpy", *link.rpy))
        joints.append(Revolute(f"J{k}", marker, body.at((0, 0, 0))))
        a, w, phase = link.moves
        rate = sp.Symbol(f"rate{k}")
        parameters.append(Parameter(rate, w, "rad/s"))
        motion = a * sp.sin(rate * dynamicsymbols._t + phase)
        loads.append(Motor(f"M{k}", f"J{k}", motion=motion))
        bodies.append(body)
        before = body
    return mechanism(
        f"ArmOf{len(links)}", bodies=bodies, joints=joints, loads=loads, parameters=parameters
    )
