"""Bobs on massless rods that hang from each other, and their tensions: what others.py asks of everybody.

Reference, in the angles a_k of the rods from the downward vertical (M. Wells, or any book on the n-fold
pendulum), w = a':
    sum_j (n - max(j, k)) m l^2 cos(a_k - a_j) w_j' = - sum_j (n - max(j, k)) m l^2 sin(a_k - a_j) w_j^2
                                                      - (n - k) m g l sin a_k ,    j, k = 0 ... n - 1,
integrated to 1e-13; the tensions from the bobs' accelerations, from the lowest bob up.  One pendulum has
its closed form.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from programs import STEP
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

GRAVITY = 9.81  # m/s^2
array = np.array


@dataclass(frozen=True)
class Rods:
    """`count` bobs of `mass` [kg] on rods of `length` [m], let go at `angle` [rad], for `stop` [s]."""

    name: str
    count: int
    mass: float
    length: float
    angle: float
    stop: float
    exact: Any  # tensions [N] (samples, count)
    step: float = STEP  # s, between samples

    @property
    def times(self) -> list[float]:
        """The samples [s]."""
        return times(self.stop)

    @property
    def start(self) -> list[tuple[float, float]]:
        """(x, y) of each bob at the start, y upwards."""
        way = [(k + 1) * self.length for k in range(self.count)]
        return [(d * np.sin(self.angle), -d * np.cos(self.angle)) for d in way]


def times(stop: float) -> list[float]:
    points = round(stop / STEP)
    return [stop * k / points for k in range(1, points + 1)]


def closed_form(
    t: Any, theta0: float = 1.0, m: float = 1.0, g: float = 9.81, L: float = 1.0
) -> Any:
    """lambda = -T/(2L), T = m g (3 cos theta - 2 cos theta0), sin(theta/2) = k sn(w t + K)."""
    k = np.sin(theta0 / 2)
    sn = ellipj(np.sqrt(g / L) * t + ellipk(k**2), k**2)[0]
    cosine = 1 - 2 * (k * sn) ** 2
    return -m * g * (3 * cosine - 2 * np.cos(theta0)) / (2 * L)


def pendulum() -> Rods:
    """models/pendulum.py: lambda = -tension/(2 l)."""
    exact = -2 * closed_form(np.array(times(10.0)))[:, None]
    return Rods("pendulum", 1, 1.0, 1.0, 1.0, 10.0, exact)


def horizontal() -> Rods:
    """A01 of the IFToMM library: from rest, horizontal."""
    stop, angle = 10.0, np.pi / 2
    return Rods("horizontal", 1, 1.0, 1.0, angle, stop, reference(1, 1.0, 1.0, angle, stop))


def chain() -> Rods:
    """models/chain.py, four links, while errors have not yet grown by its chaos."""
    n, m, length, angle, stop = 4, 0.1, 0.25, 1.0, 2.0
    return Rods("chain", n, m, length, angle, stop, reference(n, m, length, angle, stop))


PROBLEMS = {"pendulum": pendulum, "horizontal": horizontal, "chain": chain}


def spins(a: Any, w: Any, length: float) -> Any:
    """w' of the equation above, divided by m l^2."""
    n = len(a)
    below = n - np.maximum.outer(np.arange(n), np.arange(n))
    between = a[:, None] - a[None, :]
    pull = (n - np.arange(n)) * GRAVITY / length * np.sin(a)
    return np.linalg.solve(below * np.cos(between), -(below * np.sin(between)) @ w**2 - pull)


def reference(n: int, m: float, length: float, angle: float, stop: float) -> Any:
    """Tensions (samples, n)."""
    y0 = np.array([angle] * n + [0.0] * n)
    found = solve_ivp(
        lambda _t, y: np.concatenate([y[n:], spins(y[:n], y[n:], length)]),
        (0, stop),
        y0,
        "DOP853",
        t_eval=times(stop),
        rtol=3e-14,
        atol=1e-14,
        max_step=0.005,
    )
    rows = []
    for y in found.y.T:
        a, w = y[:n], y[n:]
        dw = spins(a, w, length)
        along, across = array([np.sin(a), -np.cos(a)]).T, array([np.cos(a), np.sin(a)]).T
        bends = length * (dw[:, None] * across - (w**2)[:, None] * along)
        rows.append(tensions(np.cumsum(bends, axis=0), along, m))
    return array(rows)


def tensions(accelerations: Any, along: Any, m: float) -> Any:
    """From the bobs' accelerations (n, 2) and the rods' directions (n, 2), downward: what hangs on a rod."""
    pulls = m * (accelerations + array([0.0, GRAVITY]))
    carried = np.cumsum(pulls[::-1], axis=0)[::-1]
    return -np.sum(carried * along, axis=1)
