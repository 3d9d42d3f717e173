"""What a fit found, as numbers, in words and for machines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table

from ...model.units import for_reading
from ...page.table import as_text, new_table
from .certainty import LEVEL, Certainty, Combination
from .problem import Problem

Floats = NDArray[np.float64]
TIED = 0.95  # a correlation that is told
# parts of the chi-squared distribution between which residuals are as expected
EXPLAINED = (0.01, 0.99)


@dataclass(frozen=True)
class Fit:
    """`x` (free,) in SI units and the `certainty` of it; `deviations` of each measured output, given or
    estimated; `predicted` and `measured` (points,), `of` which output each is; `cost` half the sum of squares
    in deviations (with its loss); `runs` of the FMU, and the relative `difference` for derivatives, but by
    those that are its `own`, unless these `ended` within a run."""

    name: str
    problem: Problem
    x: Floats
    certainty: Certainty
    deviations: dict[str, float]
    predicted: Floats
    measured: Floats
    of: NDArray[Any]
    converged: bool
    cost: float
    runs: int
    difference: float
    own: frozenset[str] = frozenset()
    ended: bool = False

    @property
    def values(self) -> dict[str, float]:
        """What was found, by name, in SI units."""
        return {f.name: float(v) for f, v in zip(self.problem.free, self.x, strict=True)}

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors: infinite where the data say nothing, NaN at a bound."""
        return dict(zip(self.values, map(float, self.certainty.errors), strict=True))

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Where the true values lie in 95 of 100 such fits."""
        half = self.certainty.half
        return {
            n: (v - float(h), v + float(h))
            for (n, v), h in zip(self.values.items(), half, strict=True)
        }

    @property
    def correlation(self) -> Floats:
        """(free, free), in the order of `values`."""
        return self.certainty.correlation

    @property
    def undetermined(self) -> tuple[Combination, ...]:
        """Combinations of values that the data do not determine."""
        return self.certainty.loose

    @property
    def freedom(self) -> int:
        """Measured numbers less what is free."""
        return len(self.measured) - len(self.x)

    def table(self) -> Table:
        """A row a value: name, value, standard error, interval of 95 %, unit."""
        interval = f"{100 * LEVEL:.0f} % interval"
        head = ("value", "found", "standard error", interval, "unit")
        drawn = new_table("", *head, text=["value", "unit"])
        for f, error in zip(self.problem.free, self.certainty.errors, strict=True):
            value, (low, high) = self.values[f.name], self.intervals[f.name]
            known = np.isfinite(error)
            plain = "at its bound" if np.isnan(error) else "not determined"
            digits = _digits(value, error)
            drawn.add_row(
                escape(f.name),
                f"{value:.{digits}g}",
                f"{error:.2g}" if known else plain,
                f"{low:.{digits}g} ... {high:.{digits}g}" if known else "",
                for_reading(f.unit),
            )
        return drawn

    def remarks(self) -> list[str]:
        """What a reader of the numbers must know."""
        told = [] if self.converged else [self._unfinished()]
        for f, side in zip(self.problem.free, self.certainty.bounds, strict=True):
            if side:
                bound, word = (f.low, "less") if side < 0 else (f.high, "more")
                told.append(
                    f"{f.name} stands at its bound {bound:.6g}: the data ask for {word}, and the other "
                    "errors hold for this value only"
                )
        for one in self.undetermined:
            parts = [f"{n} by {c:+.2g} %" for n, c in one.changes.items()]
            told.append(
                f"not determined by the data: a change of {' with '.join(parts)} is felt by "
                f"{one.felt:.1g} standard deviations in all: measure another output, or fix "
                f"{'it' if len(parts) == 1 else 'one of them'}"
            )
        if self.ended:
            told.append(
                "the derivatives of the FMU end within a run (sensitivity.valid; its log names the event), "
                "and differences of runs took their place"
            )
        names, loose = list(self.values), {n for c in self.undetermined for n in c.changes}
        for i, a in enumerate(names):
            for j in range(i):
                r = self.correlation[i, j]
                if abs(r) > TIED and not loose & {a, names[j]}:
                    told.append(f"{names[j]} and {a} are known together only: correlation {r:+.3f}")
        told += [
            f"{s.name}: not used: {', '.join(s.unused)}" for s in self.problem.series if s.unused
        ]
        return told + self._explained()

    def _unfinished(self) -> str:
        return (
            "the search did not converge: start nearer to the solution (NAME=LOW:HIGH:START), set narrower "
            "bounds, or free fewer values"
        )

    def _explained(self) -> list[str]:
        """Whether residuals are as large as the deviations that were given."""
        from scipy import stats

        given = [n for n, d in self.problem.deviations.items() if d is not None]
        if len(given) < len(self.problem.deviations) or self.freedom < 1:
            return []
        chi = float(np.sum(((self.predicted - self.measured) / self._weights) ** 2))
        part = float(stats.chi2.cdf(chi, self.freedom))
        if EXPLAINED[0] <= part <= EXPLAINED[1]:
            return []
        times = np.sqrt(chi / self.freedom)
        word = "larger" if times > 1 else "smaller"
        return [
            f"the residuals are {word} than the standard deviations that were given, {times:.3g} times: the "
            f"model, or these deviations, do not fit, and errors and intervals are not to be relied on"
        ]

    @property
    def _weights(self) -> Floats:
        return np.array([self.deviations[n] for n in self.of])

    def residuals(self) -> dict[str, dict[str, tuple[Floats, Floats, Floats]]]:
        """Of each experiment and output: times [s], measured and fitted values."""
        found: dict[str, dict[str, tuple[Floats, Floats, Floats]]] = {}
        begin = 0
        for s in self.problem.series:
            found[s.name] = {}
            for n, column in s.measured.items():
                known = np.isfinite(column)
                end = begin + int(known.sum())
                own = slice(begin, end)
                found[s.name][n] = (s.time[known], self.measured[own], self.predicted[own])
                begin = end
        return found

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON."""
        return {
            "fmu": self.name,
            "converged": self.converged,
            "values": [
                {
                    "name": f.name,
                    "value": self.values[f.name],
                    "standard_error": self.errors[f.name],
                    "interval_95": self.intervals[f.name],
                    "unit": f.unit,
                    "start": f.start,
                    "low": f.low,
                    "high": f.high,
                    "at_bound": bool(side),
                }
                for f, side in zip(self.problem.free, self.certainty.bounds, strict=True)
            ],
            "correlation": self.correlation.tolist(),
            "undetermined": [
                {"changes": c.changes, "felt_by_one_percent": c.felt} for c in self.undetermined
            ],
            "measured": [
                {"output": n, "deviation": d, "estimated": self.problem.deviations[n] is None}
                for n, d in self.deviations.items()
            ],
            "points": len(self.measured),
            "degrees_of_freedom": self.freedom,
            "cost": self.cost,
            "runs": self.runs,
            "difference": self.difference,
            "derivatives_of_the_fmu": sorted(self.own),
            "remarks": self.remarks(),
            "residuals": {
                e: {
                    n: {"time": t.tolist(), "measured": m.tolist(), "fitted": p.tolist()}
                    for n, (t, m, p) in outputs.items()
                }
                for e, outputs in self.residuals().items()
            },
        }

    def plot(self, out: Any = None) -> Any:
        """Measured and fitted values with residuals below, as a matplotlib Figure or, with `out`, a file."""
        from .plot import draw

        units = self.problem.units
        return draw(self.residuals(), self.deviations, units, self.name, out)

    def __repr__(self) -> str:
        return "\n".join([self.summary(), as_text(self.table()), *self.remarks()])

    def summary(self) -> str:
        """One line: of what, from how much, with how many runs."""
        count = len(self.problem.series)
        return (
            f"{self.name}: {len(self.measured)} measured numbers of {count} experiment{'s' * (count > 1)}, "
            f"{self.runs} runs, {self._derivatives()}"
        )

    def _derivatives(self) -> str:
        by = f"differences of {self.difference:.1g}"
        if not self.own:
            return by
        return "derivatives of the FMU" + ("" if len(self.own) == len(self.x) else f", else {by}")


def _digits(value: float, error: float) -> int:
    """Significant digits that show two of the error."""
    if not (np.isfinite(error) and error > 0 and value):
        return 6
    return int(np.clip(np.ceil(np.log10(abs(value) / error)) + 2, 2, 15))
