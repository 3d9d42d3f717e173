"""What a fit found, as numbers, in words and for machines.

With the residuals' Jacobian J, in standard deviations, the covariance of the values is (J^T J)^-1 (Bard,
Nonlinear Parameter Estimation, 1974, sec. 7-5).  Its singular values say which combinations are determined.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.markup import escape
from rich.table import Table
from scipy import stats

from ...model.units import for_reading
from ...page.table import as_text, new_table
from .problem import Problem

Floats = NDArray[np.float64]
Tables = Mapping[str, Mapping[str, tuple[Floats, Floats, Floats]]]


def _draw(
    tables: Tables,
    deviations: Mapping[str, float],
    units: Mapping[str, str],
    title: str,
    out: Any = None,
) -> Any:
    """A column of two panels for each measured output, a colour for each experiment, whose `tables` hold
    times [s], measured and fitted values; a Figure, or with `out` the file that it was written to.  Raises
    BuildError if it cannot be."""
    import matplotlib as mpl

    from ...verification.plot import COLOURS, STYLE, Drawn, plain, save

    outputs = list(deviations)
    with mpl.rc_context(STYLE | {"font.size": 10}):
        size = (1.0 + 5.5 * len(outputs), 5.0)
        figure = Drawn(figsize=size, layout="constrained")
        axes = figure.subplots(2, len(outputs), sharex="col", squeeze=False, height_ratios=(2, 1))
        for k, output in enumerate(outputs):
            above, below = axes[0, k], axes[1, k]
            unit = for_reading(units.get(output))
            above.set_title(
                plain(f"{output} [{unit}]" if unit else output), loc="left", fontsize=10
            )
            for colour, (name, columns) in zip(cycle(COLOURS), tables.items(), strict=False):
                if output not in columns:
                    continue
                time, measured, fitted = columns[output]
                order = np.argsort(time)
                label = plain(name) if len(tables) > 1 else "measured"
                above.plot(time, measured, "o", ms=3, color=colour, alpha=0.6, label=label)
                told = None if len(tables) > 1 else "fitted"
                above.plot(time[order], fitted[order], color=colour, lw=1.4, label=told)
                off = (measured - fitted) / deviations[output]
                below.plot(time, off, "o", ms=3, color=colour, alpha=0.6)
            below.axhline(0, color="#5b6570", lw=1)
            below.set_ylabel("residual, in\nstandard deviations" if k == 0 else "")
            below.set_xlabel("time [s]")
            above.legend(frameon=False, fontsize=9)
        figure.suptitle(plain(title), fontsize=11)
        return figure if out is None else save(figure, Path(out))


LOOSE = 1.0  # relative uncertainty from which on a combination is not determined
SMALL = 0.05  # part in a combination that is not told
LEVEL = 0.95


@dataclass(frozen=True)
class Combination:
    """Relative changes of values that hardly change the residuals: all together by one part in 100 change
    them by `felt` standard deviations."""

    changes: dict[str, float]
    felt: float


@dataclass(frozen=True)
class Certainty:
    """Standard `errors` (free,), infinite where the data say nothing and NaN at a bound; `half` (free,): the
    half widths of the intervals of 95 %; `correlation` (free, free); `loose` combinations; `bounds`: -1 or 1
    of a value at its lower or upper one."""

    errors: Floats
    half: Floats
    correlation: Floats
    loose: tuple[Combination, ...]
    bounds: tuple[int, ...]


def certainty(
    problem: Problem,
    x: Floats,
    jacobian: Floats,
    active: Sequence[int],
    dof: int | None,
    noise: float,
) -> Certainty:
    """`jacobian` (points, free) in standard deviations, and the part of its largest singular value that is
    `noise`; `active`: see Certainty.bounds; `dof`: degrees of freedom from which the deviations are
    estimated, None where they are known."""
    inside = np.asarray(active) == 0
    scale = np.array([f.scale(v) for f, v in zip(problem.free, x, strict=True)])[inside]
    names = [f.name for f, free in zip(problem.free, inside, strict=True) if free]
    _, size, directions = np.linalg.svd(jacobian[:, inside] * scale, full_matrices=False)
    told = size > noise * (size[0] if len(size) else 0.0)
    loose = []
    for s, v in zip(size, directions, strict=True):
        if s * LOOSE < 1:
            v = v / v[np.argmax(np.abs(v))]
            changes = {n: float(c) for n, c in zip(names, v, strict=True) if abs(c) > SMALL}
            loose.append(Combination(changes, float(s) / 100 * float(np.linalg.norm(v))))
    part = directions[told] / size[told][:, None]
    covariance = part.T @ part
    blind = (np.abs(directions[~told]) > SMALL).any(axis=0)
    errors = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore", divide="ignore"):
        inner = covariance / np.outer(errors, errors)
    errors = np.where(blind, np.inf, errors * scale)
    count = len(inside)
    all_errors, correlation = np.full(count, np.nan), np.full((count, count), np.nan)
    all_errors[inside] = errors
    correlation[np.ix_(inside, inside)] = inner
    quantile = stats.norm.ppf((1 + LEVEL) / 2) if dof is None else stats.t.ppf((1 + LEVEL) / 2, dof)
    return Certainty(
        all_errors, all_errors * quantile, correlation, tuple(loose), tuple(int(a) for a in active)
    )


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

        units = self.problem.units
        return _draw(self.residuals(), self.deviations, units, self.name, out)

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
