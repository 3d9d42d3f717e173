"""Event search: the first instant of a step at which a contact departs or closes, on the step's dense output.

A contact that is closed departs where its lambda falls through 0; one that is open closes where its f does.
A step is looked at in LOOKS + 1 points, so seldom that the following can pass unseen:

* lambda of a closed contact dips below 0 and returns between two looks, and the parabola through three looks
  stays above half of the middle one's value: a dip far narrower than a sixth of a step, out of a clear sky;
* f of an open contact has more than one minimum between two looks.  One minimum is always found: its rate
  f' = G v - nu changes sign between them.

`solver.maximum_step` bounds the step, and so the length of what can be missed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ..numeric.system import Vector
from .contacts import closed_rows, gap_of_rounding, opened
from .equations import Motion
from .state import State

LOOKS = 6
TOGETHER = 1e-12  # of the time: roots no farther apart are one instant

Curve = Callable[[float], float]


class Found(NamedTuple):
    """When [s], and the contacts (rows) that depart and that close then."""

    t: float
    departing: frozenset[int]
    closing: frozenset[int]


class Search:
    """The root functions of one mode."""

    def __init__(self, motion: Motion, state: State, rows: Sequence[int], rank: int) -> None:
        self.motion, self.state, self.rows, self.rank = motion, state, list(rows), rank
        self.closed = sorted(closed_rows(motion.system, state.closed))
        self.open = [k for k in motion.system.contacts if k not in self.closed]

    def first(self, t0: float, t1: float, dense: Callable[[float], Vector]) -> Found | None:
        """The first event in t0 < t <= t1 of the motion y(t) = dense(t) = (q, v); None if there is
        none.
        """
        times = self.times = np.linspace(t0, t1, LOOKS + 1).tolist()
        looks = [self._look(t, dense) for t in times]
        n = self.motion.system.nq
        small = gap_of_rounding(self.motion, t1, dense(t1)[:n], self.state)
        roots: dict[int, float] = {}
        for k in self.closed:

            def pull(t: float, k: int = k) -> float:
                return self._look(t, dense)[0][k]

            root = _departure(pull, times, [values[k] for values, _ in looks])
            if root is not None:
                roots[k] = root
        for k in self.open:

            def gap(t: float, k: int = k) -> float:
                return self._look(t, dense)[0][k]

            def rate(t: float, k: int = k) -> float:
                return self._look(t, dense)[1][k]

            places = [values[k] for values, _ in looks]
            rates = [rates[k] for _, rates in looks]
            root = _closing(gap, rate, times, places, rates, float(small[k]))
            if root is not None:
                roots[k] = root
        if not roots:
            return None
        t = min(roots.values())
        now = {k for k, root in roots.items() if root - t <= TOGETHER * max(abs(t), t1 - t0)}
        return Found(t, frozenset(now & {*self.closed}), frozenset(now & {*self.open}))

    def opened(self, state: State, until: float, dense: Callable[[float], Vector]) -> State:
        """The state with how far its open contacts have been in the step just searched, until then."""
        n = self.motion.system.nq
        for t in self.times if self.open else ():
            if t <= until:
                state = opened(self.motion, t, dense(t)[:n], state)
        self.state = state
        return state

    def _look(
        self, t: float, dense: Callable[[float], Vector]
    ) -> tuple[dict[int, float], dict[int, float]]:
        """By row: lambda of a closed contact or f of an open one; f' of an open one."""
        n, y = self.motion.system.nq, dense(t)
        terms = self.motion.terms(t, y[:n], y[n:])
        values: dict[int, float] = {}
        if self.closed:
            _, lam, _ = self.motion.accelerations(terms.of(self.rows), self.rank)
            at = dict(zip(self.rows, lam.tolist(), strict=True))
            values |= {k: at[k] for k in self.closed}
        if not self.open:
            return values, {}
        f, s = self.motion.residual(t, y[:n]), terms.G @ y[n:] - terms.nu
        values |= {k: float(f[k]) for k in self.open}
        return values, {k: float(s[k]) for k in self.open}


def _departure(pull: Curve, times: Sequence[float], values: Sequence[float]) -> float | None:
    """The first root of lambda, which falls through it."""
    if values[0] < 0 and values[1] < 0:
        return times[0]  # it fell by the projection at the end of the step before
    for i in range(len(times) - 1):
        a, b = values[i], values[i + 1]
        if a >= 0 > b:
            return _root(pull, times[i], times[i + 1])
        if i and values[i - 1] > a < b and _parabola(values[i - 1], a, b) < a / 2:
            lowest = minimize_scalar(pull, bounds=(times[i - 1], times[i + 1]), method="bounded")
            if lowest.fun < 0:
                return _root(pull, times[i - 1], lowest.x)
    return None


def _root(curve: Curve, a: float, b: float) -> float:
    """A root between a and b, at which the curve has unlike signs, to rounding (Brent 1973, ch. 4)."""
    return float(brentq(curve, a, b, xtol=1e-15 * (b - a), rtol=4 * np.finfo(float).eps))


def _parabola(a: float, b: float, c: float) -> float:
    """The least value of the parabola through three equidistant points whose middle is lowest."""
    return b - (c - a) ** 2 / (8 * (a - 2 * b + c))


def _closing(
    gap: Curve,
    rate: Curve,
    times: Sequence[float],
    values: Sequence[float],
    rates: Sequence[float],
    small: float,
) -> float | None:
    """The first root of f, which falls through it.

    What touches (f <= small) is met once it is farther inside.
    """
    for i in range(len(times) - 1):
        a, b = times[i], times[i + 1]
        if values[i + 1] < -small or (values[i + 1] < 0 and values[i] > small):
            if values[i] > 0 and (values[i] > small or rates[i] <= 0):
                return _root(gap, a, b)
            if rates[i] <= 0:
                return a
            top = _root(rate, a, b)  # it had left, and is back
            if gap(top) <= 0:
                return a
            return _root(gap, top, b)
        if rates[i] < 0 < rates[i + 1]:
            lowest = _root(rate, a, b)
            if gap(lowest) < -small and values[i] > 0:
                return _root(gap, a, lowest)
    return None
