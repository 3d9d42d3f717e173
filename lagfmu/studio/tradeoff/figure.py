"""Work against precision: wall time over error, logarithmic, one line a method.

To the right is more accurate, down is faster.  Ringed is what won, named by its tolerance or step; the
hatched part lies below the reference's own error.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...methods import MENU
from .measure import Point, Tradeoff
from .quantities import MULTIPLIER

COLOURS = {m.name: m.colour for m in MENU if m.colour}
MARKERS = {m.name: m.marker for m in MENU if m.marker}
WORTH = 0.1  # part of the error of the last named point at which the next one is named


def draw(found: Tradeoff, out: Path) -> Path:
    """Write the figure (the ending says the format).  Raises BuildError if it cannot be."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from ...verification.figure import STYLE, plain, save

    factor = 1e3 / found.simulated
    with mpl.rc_context(STYLE | {"font.size": 10, "hatch.linewidth": 0.4}):
        figure = Figure(figsize=(6.4, 4.2), layout="constrained")
        axis = figure.subplots()
        axis.set_xscale("log")
        axis.set_yscale("log")
        for method in COLOURS:
            own = [p for p in found.points if p.setting.method == method]
            _line(axis, found, own, factor)
        _winners(axis, found, factor)
        _limits(axis, found)
        what = "λ" if found.headline == MULTIPLIER else found.headline
        axis.set_xlabel(f"largest error of {plain(what)}, relative to its largest magnitude")
        axis.set_ylabel("wall time per simulated second in ms")
        step = found.points[0].setting.communication
        axis.set_title(
            f"{plain(found.name)} ({found.target} FMU), every {step:.3g} s", fontsize=10.5
        )
        figure.legend(loc="outside right upper", frameon=False, fontsize=9)
        return save(figure, out)


def _line(axis: Any, found: Tradeoff, points: Sequence[Point], factor: float) -> None:
    """One method: wall times over errors."""
    known = [p for p in points if np.isfinite(found.error(p))]
    if known:
        method = known[0].setting.method
        axis.plot(
            [found.error(p) for p in known],
            [factor * p.cost for p in known],
            color=COLOURS[method],
            marker=MARKERS[method],
            markersize=4.5,
            linewidth=1.6,
            label=method,
        )


def _winners(axis: Any, found: Tradeoff, factor: float) -> None:
    """A ring about each, and the tolerance or step below it where it is much better than the one before."""
    xs = [found.error(p) for p in found.front]
    ys = [factor * p.cost for p in found.front]
    ring = {"markerfacecolor": "none", "color": "#222222", "linewidth": 0}
    axis.plot(xs, ys, "o", markersize=10, label="won", **ring)
    last = float("inf")
    for point, x, y in zip(found.front, xs, ys, strict=True):
        if x > WORTH * last:
            continue
        last = x
        axis.annotate(
            point.setting.dial,
            (x, y),
            (0, -10),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=8,
            fontweight="bold",
            color=COLOURS[point.setting.method],
        )


def _limits(axis: Any, found: Tradeoff) -> None:
    """More accurate to the right; hatched what the reference does not know."""
    own = [found.reference.own[q.name] for q in found.reference.known if q.group == found.headline]
    errors = [e for e in map(found.error, found.points) if np.isfinite(e)]
    lowest, edge = min([*errors, *own]), max(own)
    axis.axvspan(edge, edge * 1e-9, facecolor="none", edgecolor="#999999", hatch="///")
    axis.set_xlim(max([*errors, 1e3 * lowest]) * 4, lowest / 6)
    axis.margins(y=0.15)
