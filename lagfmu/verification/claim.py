"""One statement on an FMU's outputs, in formulas of its variables, and what comes of it in a run.

A run of deviation d is right where d <= absolute + within * scale; d is of the unit of `of`, and the scale
the largest magnitude of `of` along the run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import names
from ..fmu.read import Trajectory
from ..model.elements import Expr
from .check import Check
from .closed_forms import measured
from .evaluate import evaluate

# of the formula of a key, at the points of a statement
Values = Callable[[str], NDArray[np.float64]]


@dataclass(frozen=True)
class Claim:
    """One statement; `formulas` by their keys, errors allowed up to `absolute` + `within` * scale."""

    kind: str
    name: str
    formulas: Mapping[str, Expr]
    within: float
    absolute: float
    direction: float = 1.0
    occurrence: int = 1
    stop_time: float | None = None

    @property
    def variables(self) -> set[str]:
        """The FMU's variables and parameters that it needs."""
        found = {str(s) for e in self.formulas.values() for s in e.free_symbols}
        return {names.initially(n) or n for n in found}

    def checks(self, result: Trajectory, values: Mapping[str, float]) -> list[Check]:
        """What came of it."""
        chosen = np.ones(len(result), dtype=bool)
        if "when" in self.formulas:
            when = evaluate(self.formulas["when"], result, result, values, self.name)
            chosen = (when != 0) & ~np.isnan(when)
        rows = result[chosen]
        if not len(rows):
            return [Check(self.name, 0.0, self.within, 0)]

        def of(key: str) -> NDArray[np.float64]:
            return evaluate(self.formulas[key], rows, result, values, self.name)

        if self.kind == "event":
            return [self._event(of, rows["time"])]
        actual, nearest = of("of"), self._nearest(of)
        scale = of("scale") if "scale" in self.formulas else actual
        found = (self.name, self.within, result, chosen, actual, nearest, scale, self.absolute)
        return [measured(*found)]

    def _nearest(self, of: Values) -> NDArray[np.float64]:
        """What `of` would have to be at each point, as near as possible to what it is."""
        actual = of("of")
        if self.kind == "equal":
            return of("to")
        if self.kind == "conserved":
            return np.full_like(actual, actual[0])
        if self.kind == "monotone":
            highest = np.maximum.accumulate(self.direction * actual)
            return np.asarray(self.direction * highest)
        if "at_least" in self.formulas:
            actual = np.maximum(actual, of("at_least"))
        if "at_most" in self.formulas:
            actual = np.minimum(actual, of("at_most"))
        return actual

    def _event(self, of: Values, times: NDArray[np.float64]) -> Check:
        """A condition becomes true between two points of a run: no error where the time that is said lies
        between these."""
        holds = of("becomes") != 0
        begins = np.flatnonzero(holds[1:] & ~holds[:-1]) + 1
        if len(begins) < self.occurrence:
            expected = float(of("at")[-1])
            if expected > times[-1]:
                return Check(self.name, 0.0, self.within, 0)
            told = f"came {len(begins)} times until t = {times[-1]:.9g} s"
            return Check(self.name, np.inf, self.within, len(times), told)
        k = int(begins[self.occurrence - 1])
        expected, before, after = float(of("at")[k]), float(times[k - 1]), float(times[k])
        beyond = max(before - expected, expected - after, 0.0)
        scale = abs(float(of("scale")[k])) if "scale" in self.formulas else abs(expected)
        error = max(beyond - self.absolute, 0.0) / (scale or 1.0)
        if not np.isfinite(error):
            return Check(self.name, np.inf, self.within, len(times), "not a finite number")
        told = f"came between {before:.9g} and {after:.9g} s, expected at {expected:.9g} s"
        return Check(self.name, error, self.within, len(times), told if error else "")
