"""Rigid bodies and joints by Newton and Euler, written by hand: what lagfmu's joint forces are held against.

    m r'' = f ,   I w' + w x I w = tau      each body: r its centre of mass, w and I = R J R^T in space
    [M  -G^T] [a  ]   [F    ]
    [G   0  ] [lam] = [gamma]               G and gamma of each joint, of velocities in space

A state is, for each body, r [m], a unit quaternion (w, x, y, z), v [m/s] and w [rad/s] in space; the ground
is body -1.  A joint is a function of a `Look` that returns rows (joints.py).  The integration is SciPy's
DOP853 at 1e-13; nothing holds the constraints, and at that tolerance nothing needs to.
None of lagfmu is used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

Vector = NDArray[np.float64]
GROUND = -1


@dataclass(frozen=True)
class Mass:
    """A body: its mass [kg] and its inertia [kg m2] about the centre of mass, in its own axes."""

    m: float
    J: Vector

    @staticmethod
    def of(m: float, *J: float) -> Mass:
        """Of the moments xx, yy, zz, or of these and the elements xy, xz, yz of the tensor."""
        xx, yy, zz, xy, xz, yz = (*J, 0.0, 0.0, 0.0)[:6]
        return Mass(m, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))


@dataclass(frozen=True)
class Row:
    """One equation J1 (v1, w1)' + J2 (v2, w2)' = gamma; J2 lam is the wrench on the second body."""

    first: int
    J1: Vector
    second: int
    J2: Vector
    gamma: float


def rotation(p: Vector) -> Vector:
    """R of a quaternion (w, x, y, z)."""
    w, u = p[0], p[1:]
    return (w * w - u @ u) * np.eye(3) + 2 * np.outer(u, u) + 2 * w * cross(u)


def cross(u: Vector) -> Vector:
    """The matrix of u x."""
    return np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])


def quaternion(R: Vector) -> Vector:
    """(w, x, y, z) of a rotation by less than half a turn."""
    w = np.sqrt(1 + np.trace(R)) / 2
    skew = R - R.T
    return np.array([w, *(np.array([skew[2, 1], skew[0, 2], skew[1, 0]]) / (4 * w))])


class Look:
    """A state, body by body."""

    def __init__(self, t: float, y: Vector, n: int) -> None:
        self.t = t
        parts = y.reshape(n, 13)
        still = np.array([0.0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0])
        self.parts = [*parts, still]
        self.r = [p[:3] for p in self.parts]
        self.R = [rotation(p[3:7]) for p in self.parts]
        self.v = [p[7:10] for p in self.parts]
        self.w = [p[10:] for p in self.parts]

    def arm(self, body: int, s: Sequence[float]) -> Vector:
        """From the centre of mass to a point of the body, in space."""
        return self.R[body] @ np.asarray(s, dtype=float)

    def point(self, body: int, s: Sequence[float]) -> Vector:
        """Where that point is."""
        return self.r[body] + self.arm(body, s)

    def rate(self, body: int, s: Sequence[float]) -> Vector:
        """Its velocity."""
        return self.v[body] + np.cross(self.w[body], self.arm(body, s))

    def bend(self, body: int, s: Sequence[float]) -> Vector:
        """w x (w x s): its acceleration where the body's is zero."""
        w = self.w[body]
        return np.cross(w, np.cross(w, self.arm(body, s)))


Joint = Callable[[Look], list[Row]]
Load = Callable[[Look], Mapping[int, Vector]]  # the wrench about the centre of mass, in space


@dataclass(frozen=True)
class Mechanism:
    """Bodies, joints by name, gravity [m/s2], and what else acts."""

    masses: Sequence[Mass]
    joints: Mapping[str, Sequence[Joint]]
    gravity: Sequence[float] = (0.0, 0.0, 0.0)
    loads: Sequence[Load] = ()

    def rows(self, look: Look) -> dict[str, list[Row]]:
        """The rows of each joint."""
        return {name: [row for f in fs for row in f(look)] for name, fs in self.joints.items()}

    def solve(self, t: float, y: Vector) -> tuple[Vector, Vector, dict[str, Vector]]:
        """Accelerations (n, 6), all constraint forces on each body (n, 6), and the force and torque that the
        second body of each joint receives, about its centre of mass: least in norm where not unique."""
        n = len(self.masses)
        look = Look(t, y, n)
        inverse, F = [], np.zeros((n, 6))
        for k, mass in enumerate(self.masses):
            R, w = look.R[k], look.w[k]
            inertia = R @ mass.J @ R.T
            inverse.append((1 / mass.m, np.linalg.inv(inertia)))
            F[k] = [*(mass.m * np.asarray(self.gravity)), *-np.cross(w, inertia @ w)]
        for load in self.loads:
            for k, wrench in load(look).items():
                if k != GROUND:
                    F[k] += wrench
        named = self.rows(look)
        rows = [row for each in named.values() for row in each]
        G = matrix(rows, n)
        weighed = G.reshape(len(rows), n, 6).copy()
        free = F.copy()
        for k, (light, easy) in enumerate(inverse):
            weighed[:, k, :3] *= light
            weighed[:, k, 3:] = weighed[:, k, 3:] @ easy
            free[k] = [*(light * F[k, :3]), *(easy @ F[k, 3:])]
        A = weighed.reshape(len(rows), 6 * n) @ G.T
        gamma = np.array([row.gamma for row in rows])
        lam = np.linalg.lstsq(A, gamma - G @ free.ravel(), rcond=1e-11)[0]
        a = free + (lam @ weighed.reshape(len(rows), 6 * n)).reshape(n, 6)
        received, k = {}, 0
        for name, each in named.items():
            received[name] = sum(
                (x * row.J2 for x, row in zip(lam[k:], each, strict=False)), np.zeros(6)
            )
            k += len(each)
        return a, (lam @ G).reshape(n, 6), received

    def rate(self, t: float, y: Vector) -> Vector:
        """y'."""
        n = len(self.masses)
        parts, found = y.reshape(n, 13), np.zeros((n, 13))
        found[:, :3] = parts[:, 7:10]
        for k, (p, w) in enumerate(zip(parts[:, 3:7], parts[:, 10:], strict=True)):
            found[k, 3] = -p[1:] @ w / 2
            found[k, 4:7] = (p[0] * w + np.cross(w, p[1:])) / 2
        found[:, 7:] = self.solve(t, y)[0]
        return found.ravel()

    def moved(self, y: Vector, points: Sequence[float], longest: float = np.inf) -> Vector:
        """The states at these times [s], from y at the first of them, in steps of at most `longest` [s]."""
        span = points[0], points[-1]
        options = {"rtol": 1e-13, "atol": 1e-14, "max_step": longest}
        found = solve_ivp(self.rate, span, y, "DOP853", points, **options)
        assert found.success, found.message
        return np.asarray(found.y.T)

    def speeds(self, y: Vector, wanted: Mapping[int, Sequence[float]]) -> Vector:
        """y with velocities that the joints allow, least in norm, in which each body of `wanted` has that
        angular velocity, or misses it least."""
        n = len(self.masses)
        G = matrix([row for each in self.rows(Look(0.0, y, n)).values() for row in each], n)
        _, sizes, V = np.linalg.svd(G)
        free = V[np.count_nonzero(sizes > 1e-9 * sizes[0]) :]
        picked = np.concatenate([free.T[6 * k + 3 : 6 * k + 6] for k in wanted])
        amounts = np.linalg.lstsq(picked, np.concatenate([*map(np.asarray, wanted.values())]))[0]
        parts = y.reshape(n, 13).copy()
        parts[:, 7:] = (free.T @ amounts).reshape(n, 6)
        return parts.ravel()

    def doubts(self, t: float, y: Vector) -> dict[str, Vector]:
        """Of each joint the wrenches (6, k) that the others could take instead: G^T lam = 0."""
        n = len(self.masses)
        named = self.rows(Look(t, y, n))
        U, sizes, _ = np.linalg.svd(matrix([row for each in named.values() for row in each], n))
        null = U[:, np.count_nonzero(sizes > 1e-9 * sizes.max(initial=1.0)) :]
        found, k = {}, 0
        for name, each in named.items():
            J2 = np.array([row.J2 for row in each]).reshape(-1, 6)
            found[name] = J2.T @ null[k : k + len(each)]
            k += len(each)
        return found

    def rank(self, y: Vector) -> tuple[int, int]:
        """How many rows there are, and how many are independent."""
        n = len(self.masses)
        G = matrix([row for each in self.rows(Look(0.0, y, n)).values() for row in each], n)
        return len(G), int(np.linalg.matrix_rank(G, 1e-9 * np.linalg.norm(G, 2)))


def matrix(rows: Sequence[Row], n: int) -> Vector:
    """G (m, 6 n)."""
    G = np.zeros((len(rows), 6 * n))
    for k, row in enumerate(rows):
        for body, J in ((row.first, row.J1), (row.second, row.J2)):
            if body != GROUND:
                G[k, 6 * body : 6 * body + 6] += J
    return G


def state(*bodies: tuple[Sequence[float], Vector]) -> Vector:
    """A state at rest from the place and the rotation of each body."""
    return np.concatenate([[*r, *quaternion(R), *[0.0] * 6] for r, R in bodies])
