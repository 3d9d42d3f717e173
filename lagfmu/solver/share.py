"""Redundant sticking: which of the multipliers that hold the same motion lies within the cones.

Where rows depend on each other lambda is one of lambda + Z y, with Z the null space of G^T.  Normal forces
are those of the lambda of least norm, and Z is what leaves them as they are.  A friction sticks as long as
*some* y has |lambda_t| <= mu N in every cone.  The least reserve over all cones, min (mu N - |lambda_t|), is
a concave function of y: its maximum is found by the ellipsoid method (Shor 1977; Boyd & Vandenberghe 2008),
for one y by bisection.  What is reported is the lambda of least norm if that is within the cones, else the
nearest on the way to the maximum.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from ..numeric.system import Matrix, System, Vector
from ..numeric.thresholds import NONUNIQUE_DEPENDENT, NONUNIQUE_ROUNDS, NONUNIQUE_WIDE


def best_share(
    system: System,
    G: Matrix,
    rows: Sequence[int],
    lam: Vector,
    C: Matrix,
    load: Vector,
    static: Vector,
    stuck: Sequence[int],
) -> tuple[Vector, Vector]:
    """The multipliers (m) to report, and those of the largest reserve."""
    Z = dependencies(G, rows)
    _, grows, turned = np.linalg.svd(
        C / np.maximum(np.abs(C).max(axis=1, keepdims=True), np.finfo(float).tiny) @ Z.T
    )
    Z = turned[(grows > NONUNIQUE_DEPENDENT).sum() :] @ Z
    if not len(Z):
        return lam, lam

    def worst(y: Vector) -> tuple[float, Vector]:
        """The least reserve, and its slope in y."""
        least, slope = np.inf, np.zeros(len(Z))
        there = lam + y @ Z
        for i in stuck:
            mine = list(system.frictions[i].rows)
            N, t = load[i] + C[i] @ there, there[mine]
            force = float(np.linalg.norm(t))
            value = static[i] * abs(N) - force
            if value < least:
                least = value
                slope = static[i] * (np.sign(N) or 1.0) * (Z @ C[i])
                if force > 0:
                    slope = slope - Z[:, mine] @ (t / force)
        return least, slope

    wide = NONUNIQUE_WIDE * max(float(np.abs(lam).max()), float(np.abs(load).max(initial=0.0)))
    best = _highest(worst, len(Z), wide)
    low, high = 0.0, 1.0
    if worst(0 * best)[0] < 0:
        for _ in range(NONUNIQUE_ROUNDS):
            middle = (low + high) / 2
            low, high = (middle, high) if worst(middle * best)[0] < 0 else (low, middle)
        low = high
    return lam + (low * best) @ Z, lam + best @ Z


def dependencies(G: Matrix, rows: Sequence[int]) -> Matrix:
    """Z (dependent rows, m), orthonormal: Z G = 0, of rows that are scaled to one size first."""
    norm = np.linalg.norm(G[rows], axis=1)
    norm = np.where(norm > 0, norm, 1.0)
    found = scipy.linalg.null_space((G[rows] / norm[:, None]).T, rcond=NONUNIQUE_DEPENDENT)
    Z = np.zeros((found.shape[1], len(G)))
    Z[:, rows] = np.linalg.qr(found / norm[:, None])[0].T
    return Z


def _highest(worst: object, count: int, wide: float) -> Vector:
    """y of the largest least reserve within `wide`."""
    assert callable(worst)
    y = np.zeros(count)
    best, top = y, worst(y)[0]
    if count == 1:
        low, high = -wide, wide
        for _ in range(2 * NONUNIQUE_ROUNDS):
            y = np.array([(low + high) / 2])
            value, slope = worst(y)
            if value > top:
                best, top = y, value
            low, high = (float(y[0]), high) if slope[0] > 0 else (low, float(y[0]))
        return best
    P = np.eye(count) * wide**2
    n = float(count)
    for _ in range(NONUNIQUE_ROUNDS * count * count):
        value, slope = worst(y)
        if value > top:
            best, top = y, value
        size = float(slope @ P @ slope)
        if not size > 0:
            break
        g = P @ slope / np.sqrt(size)
        y = y + g / (n + 1)
        P = n**2 / (n**2 - 1) * (P - 2 / (n + 1) * np.outer(g, g))
    return best
