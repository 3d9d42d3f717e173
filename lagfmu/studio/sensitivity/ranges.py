"""Indices over ranges: which parameters an output depends on where they vary at large, by SALib on sweep().

Morris: the mean size of elementary effects (mu*), and their spread (sigma), which tells of curvature and of
interactions.  Sobol: the part of the variance that a parameter causes by itself (S1), and with others (ST).
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rich.markup import escape
from rich.table import Table

from ...errors import SettingError, SimulationError
from ...page.table import as_text, new_table
from ...prepare.starts import tell
from ..sweep.results import happened
from ..sweep.sweep import sweep

METHODS = {"morris": ("mu_star", "sigma"), "sobol": ("S1", "ST")}
CONFIDENCE = {"mu_star": "mu_star_conf", "S1": "S1_conf", "ST": "ST_conf"}
LEVELS = 4  # of Morris's grid


@dataclass(frozen=True)
class Ranges:
    """Of each output and parameter its indices by name, with the half widths of their 95 % intervals as
    NAME_conf; `runs` that were made; `without`: of each output why it has none."""

    method: str
    ranges: Mapping[str, tuple[float, float]]
    indices: Mapping[str, Mapping[str, Mapping[str, float]]]
    without: Mapping[str, str]
    runs: int

    @property
    def main(self) -> str:
        """The index by which parameters are ordered."""
        return "ST" if self.method == "sobol" else "mu_star"

    def order(self, output: str) -> list[str]:
        """Parameters, those that matter most first."""
        return sorted(self.ranges, key=lambda p: -abs(self.indices[output][p][self.main]))

    def to_dict(self) -> dict[str, Any]:
        """Everything, for JSON."""
        return {
            "method": self.method,
            "runs": self.runs,
            "ranges": {n: list(r) for n, r in self.ranges.items()},
            "indices": {
                o: {p: dict(v) for p, v in rows.items()} for o, rows in self.indices.items()
            },
            "without": dict(self.without),
        }

    def tables(self) -> list[Table]:
        """A table an output: parameter, its indices with their intervals."""
        found = []
        for output, rows in self.indices.items():
            title, head = f"{output}: {self.method}, {self.runs} runs", METHODS[self.method]
            drawn = new_table(escape(title), "parameter", *head, words=["parameter"])
            for name in self.order(output):
                halves = [rows[name].get(CONFIDENCE.get(index, "")) for index in head]
                drawn.add_row(
                    escape(name),
                    *(
                        f"{rows[name][index]:.4g}" + ("" if half is None else f" ± {half:.2g}")
                        for index, half in zip(head, halves, strict=True)
                    ),
                )
            found.append(drawn)
        return found

    def remarks(self) -> list[str]:
        """Of which outputs there are no indices, and why."""
        return [f"{output}: no indices: it {why}" for output, why in self.without.items()]

    def __repr__(self) -> str:
        return "\n".join([as_text(*self.tables()), *self.remarks()])

    def plot(self, out: Any = None) -> Any:
        """Bars of the main index, the longest on top: a matplotlib Figure or, with `out`, a file."""
        from .local import tornado

        bars = {
            o: [(p, rows[p][self.main]) for p in self.order(o)] for o, rows in self.indices.items()
        }
        errors = {
            o: {p: rows[p][CONFIDENCE[self.main]] for p in rows} for o, rows in self.indices.items()
        }
        label = (
            "part of the variance (ST)"
            if self.method == "sobol"
            else "mean elementary effect (mu*)"
        )
        return tornado(bars, label, f"{self.method}, {self.runs} runs", out, errors)


def over_ranges(
    source: str | os.PathLike[str],
    of: Sequence[str],
    ranges: Mapping[str, tuple[float, float]],
    method: str = "sobol",
    samples: int = 256,
    seed: int = 0,
    **settings: Any,
) -> Ranges:
    """Indices of the outputs `of` at the end of a run, NAME or NAME:HOW as sweep() keeps them, over `ranges`
    (low, high) of parameters and start values; `settings` are those of sweep(), `on` a Dask cluster too.

    Raises SettingError for what cannot be meant, SimulationError where runs were refused: an index over a
    part of the range would be of another range.
    """
    if method not in METHODS:
        raise SettingError(f"method {method!r}, expected one of {', '.join(METHODS)}")
    if not ranges:
        raise SettingError("there are no ranges: say where parameters vary, NAME=LOW:HIGH")
    for name, (low, high) in ranges.items():
        if not low < high:
            raise SettingError(f"{name!r}: range {low!r}:{high!r}, expected the smaller end first")
    if samples < 2:
        raise SettingError(f"{samples} samples, expected at least 2")
    analyze, plan = _salib(method)
    problem = {
        "num_vars": len(ranges),
        "names": list(ranges),
        "bounds": [list(r) for r in ranges.values()],
    }
    if method == "sobol":
        points = plan.sample(problem, samples, calc_second_order=False, seed=seed)
    else:
        points = plan.sample(problem, samples, num_levels=LEVELS, seed=seed)
    keep = [n if ":" in n else f"{n}:last" for n in of]
    runs = sweep(source, rows=dict(zip(ranges, points.T, strict=True)), keep=keep, **settings)
    refused = int((runs["status"].values != "ok").sum())
    if refused:
        reason = next(str(r) for r in runs["reason"].values if r)
        raise SimulationError(
            f"{refused} of {len(points)} runs were refused: {reason}; narrow the ranges"
        )
    tell(dict.fromkeys(str(text) for text in runs["moved"].values if text))
    indices: dict[str, dict[str, dict[str, float]]] = {}
    without = {}
    for name, column in zip(of, keep, strict=True):
        values = happened(runs, column)
        if np.isnan(values).any():
            without[name] = f"did not happen in {int(np.isnan(values).sum())} of {len(points)} runs"
        elif np.ptp(values) == 0:
            without[name] = "is the same in all runs"
        else:
            common: dict[str, Any] = {"seed": seed, "print_to_console": False}
            if method == "sobol":
                found = analyze.analyze(problem, values, calc_second_order=False, **common)
            else:
                found = analyze.analyze(problem, points, values, num_levels=LEVELS, **common)
            known = [k for k in found if k in (*METHODS[method], *CONFIDENCE.values())]
            indices[name] = {
                p: {k: float(found[k][i]) for k in known} for i, p in enumerate(ranges)
            }
    return Ranges(method, dict(ranges), indices, without, len(points))


def _salib(method: str) -> tuple[Any, Any]:
    try:
        if method == "sobol":
            from SALib.analyze import sobol as analyze
            from SALib.sample import sobol as plan
        else:
            from SALib.analyze import morris as analyze
            from SALib.sample import morris as plan
    except ImportError:
        raise SimulationError("indices over ranges need SALib: pip install SALib") from None
    return analyze, plan
