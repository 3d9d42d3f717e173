"""What a system of this folder consists of, and the hand-written integration that it is held against."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from lagfmu import Model

G = 9.81  # m/s^2
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class System:
    """A model, and what its variables are at `stop` [s] by another way, counts of events among them."""

    model: Model
    stop: float
    expected: Callable[[float], Mapping[str, float]]


def integrate(
    rate: Callable[[float, Vector], Sequence[float]],
    start: Sequence[float],
    stop: float,
    begin: float = 0.0,
) -> Vector:
    """The state at `stop`, by SciPy's DOP853 at 1e-13."""
    if not stop > begin:
        return np.array(start, dtype=float)
    return np.asarray(_solved(rate, start, begin, stop).y[:, -1])


def until(
    rate: Callable[[float, Vector], Sequence[float]],
    start: Sequence[float],
    begin: float,
    stop: float,
    event: Callable[[float, Vector], float],
    way: float = -1,
) -> tuple[float, Vector, bool]:
    """Time and state where `event` first passes zero in the direction `way`, or those at `stop`."""
    event.terminal, event.direction = True, way  # type: ignore[attr-defined]
    found = _solved(rate, start, begin, stop, event)
    return float(found.t[-1]), found.y[:, -1], found.status == 1


def _solved(rate: Any, start: Any, begin: float, stop: float, event: Any = None) -> Any:
    found = solve_ivp(
        rate, (begin, stop), start, "DOP853", rtol=1e-13, atol=1e-15, events=event, max_step=0.02
    )
    assert found.success, found.message
    return found
