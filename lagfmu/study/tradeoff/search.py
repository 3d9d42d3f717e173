"""The coarsest dial of one method that holds an error, found in a few runs instead of a whole grid.

Tolerances are walked from one near the error that is asked for, towards coarser ones while they hold it
and towards finer ones while they do not, at the wider communication step, at which a run costs little.
A fixed step is halved as often as its order says.  What takes several times as long as the fastest
setting that holds is broken off: it will not be chosen.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from ...errors import SimulationError
from ...methods import FIXED_STEP
from .importer import TooSlowError
from .measure import Weighed
from .setting import ORDERS, Setting

SLOW = 2.5  # times the fastest that holds the error: what takes longer is not chosen


@dataclass
class Clock:
    """The shortest run of a setting that held the error, of all methods and formulations [s]."""

    fastest: float = math.inf

    @property
    def limit(self) -> float:
        """How long a run may take [s]."""
        return SLOW * self.fastest


class Bench(Protocol):
    """What can be measured of a setting; SimulationError if it cannot be run within `limit` [s]."""

    def coarse(self, setting: Setting, limit: float) -> float:
        """The error at the wider communication step, which costs little."""

    def full(self, setting: Setting, limit: float) -> tuple[Weighed, float]:
        """The row at the scene's own communication step, and the larger of both errors."""


@dataclass
class Walk:
    """What was measured along the dials of one method: (row, error, seconds) by position."""

    dials: Sequence[Setting]
    bench: Bench
    goal: float
    clock: Clock
    found: dict[int, tuple[Weighed, float, float]] = field(default_factory=dict)
    errors: dict[int, float] = field(default_factory=dict)
    slow: bool = False

    def seems(self, k: int) -> bool:
        """Whether dial k holds the error at the wider communication step."""
        if k not in self.errors:
            self.errors[k] = math.inf
            with self._refusals():
                self.errors[k] = self.bench.coarse(self.dials[k], self.clock.limit)
        return self.errors[k] <= self.goal

    def holds(self, k: int) -> bool:
        """Whether dial k holds the error at both; False as well if it cannot, or takes too long."""
        if k not in self.found:
            begun = time.perf_counter()
            with self._refusals():
                row, error = self.bench.full(self.dials[k], self.clock.limit)
                self.found[k] = row, error, time.perf_counter() - begun
        if k not in self.found:
            return False
        _, error, seconds = self.found[k]
        if error <= self.goal:
            self.clock.fastest = min(self.clock.fastest, seconds)
        return error <= self.goal

    @contextlib.contextmanager
    def _refusals(self) -> Iterator[None]:
        try:
            yield
        except TooSlowError:
            self.slow = True
        except SimulationError:
            pass


def coarsest(walk: Walk, near: int, thorough: bool) -> int | None:
    """The position of the coarsest dial that holds; the next one with a smaller error is measured beside it.

    `thorough`: all that was walked over is measured in full.
    """
    k: int | None = near
    finer = range(near + 1, len(walk.dials))
    if walk.dials[0].method in FIXED_STEP:
        k = _by_order(walk, near)
    elif walk.seems(near):
        while k and walk.seems(k - 1):
            k -= 1
    else:
        k = next((j for j in finer if not walk.slow and walk.seems(j)), None)
    if thorough:
        for j in list(walk.errors):
            walk.holds(j)
    if k is None:
        return None
    held = next((j for j in range(k, len(walk.dials)) if not walk.slow and walk.holds(j)), None)
    if held is not None:
        _better(walk, held)
    return held


def _better(walk: Walk, held: int) -> None:
    """Measures the next dial that is more accurate, in case that `held` misses on other values: the next
    finer one, unless it is the communication step that bounds the error of both."""
    for k in range(held + 1, len(walk.dials)):
        if walk.slow or (walk.holds(k) and walk.found[k][1] < walk.found[held][1]):
            return


def _by_order(walk: Walk, k: int) -> int | None:
    """The error of a method of order p falls with step^p: halvings are skipped that cannot suffice."""
    while k < len(walk.dials) and not walk.slow:
        if walk.seems(k):
            return k
        ratio = walk.errors[k] / walk.goal
        halvings = math.log2(ratio) / ORDERS[walk.dials[k].method] if math.isfinite(ratio) else 1
        k += max(1, math.ceil(halvings - 0.5))
    return None


def start(dials: Sequence[Setting], goal: float) -> int:
    """Where the walk begins: the finest tolerance that is no smaller than the error, the largest step."""
    return max((k for k, d in enumerate(dials) if d.tolerance >= goal), default=0)
