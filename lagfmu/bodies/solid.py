"""The uniform solid that has the mass and the inertia of a body: what is drawn of one without a shape.

    sphere    J = 2/5 m r^2
    cylinder  J along its axis m r^2/2, across it m (3 r^2 + h^2)/12
    box       J about x m (b^2 + c^2)/12, and so on

All three principal moments equal make it a sphere, two of them a cylinder.  The triangle inequality, which
every tensor of inertia satisfies, is that h^2, a^2, b^2, c^2 >= 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..model.picture import Box, Rod, Sphere

EQUAL = 1e-6  # relative, of two principal moments
THIN = 0.02  # of its largest side: the least that is drawn of another

NEXT = 1.1  # times its size: what is next to a solid


def solid(
    mass: float, inertia: Sequence[float], center: Any, reach: float
) -> Box | Rod | Sphere | None:
    """The solid about `center` [m] of a body of `mass` [kg] with the inertia xx, yy, zz, xy, xz, yz [kg.m^2].

    One that is larger than `reach` [m], which the mechanism's dimensions suggest, is drawn smaller in
    proportion; 0 says nothing.  A mass without inertia is a small sphere; without mass there is none.
    """
    xx, yy, zz, xy, xz, yz = inertia
    J, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    J = np.maximum(J, 0.0)  # of a line one is rounding
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    center = np.array(center, dtype=float)
    if not mass > 0 or not J[2] > 0:
        return Sphere(tuple(center), THIN * reach) if mass > 0 and reach > 0 else None
    near = EQUAL * J[2]
    if J[2] - J[0] < near:
        return Sphere(tuple(center), _within(np.sqrt(10 * J / mass), reach)[0] / 2)
    if min(J[1] - J[0], J[2] - J[1]) < near:
        odd = 2 if J[1] - J[0] < near else 0
        h = np.sqrt(max(12 * J[1] - 6 * J[odd], 0.0) / mass)
        h, width = _within(np.array([h, np.sqrt(8 * J[odd] / mass)]), reach)
        half = axes[:, odd] * h / 2
        return Rod(tuple(center - half), tuple(center + half), width / 2)
    size = np.sqrt(np.maximum(6 / mass * (J.sum() - 2 * J), 0.0))
    return Box(tuple(center), tuple(_within(size, reach)), axes.tolist())


def holds(found: Box | Rod | Sphere, point: Any) -> bool:
    """Whether a point of the body is in that solid, or next to it."""
    if isinstance(found, Box):
        arm = np.array(found.rotation).T @ (np.array(point) - found.center)
        return bool((np.abs(arm) <= NEXT * np.array(found.size) / 2).all())
    if isinstance(found, Sphere):
        return bool(np.linalg.norm(np.array(point) - found.center) <= NEXT * found.radius)
    start, end, r = np.array(found.start), np.array(found.end), float(found.radius or 0)
    half = (end - start) / 2
    arm = np.array(point) - (start + end) / 2
    along = float(arm @ half) / float(np.linalg.norm(half))
    across = np.sqrt(max(float(arm @ arm) - along**2, 0.0))
    return bool(abs(along) <= NEXT * np.linalg.norm(half) and across <= NEXT * r)


def _within(sizes: Any, reach: float) -> list[float]:
    """Numbers of which none is much smaller than the largest, nor that one larger than the reach."""
    largest = float(sizes.max())
    shrunk = min(1.0, reach / largest) if reach > 0 else 1.0
    found: list[float] = (shrunk * np.maximum(sizes, THIN * largest)).tolist()
    return found
