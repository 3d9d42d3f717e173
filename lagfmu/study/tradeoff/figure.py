"""Work against precision: wall time over error, logarithmic, one line a method.

One column of panels a communication step, one row a group of quantities.  To the right is more
accurate, down is faster.  The grey staircase is the Pareto front, its points are ringed and named by
their tolerance or step; bars are quartiles; the hatched part lies below the reference's own error, the
dotted line is the time that fmpy's own calls take.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...model.units import for_reading
from .measure import Tradeoff, Weighed
from .quantities import EVENT, FORCE, MULTIPLIER, OWN

COLOURS = {
    "dop853": "#0b6e99",
    "radau5": "#6940a5",
    "rk4": "#0f7b6c",
    "rattle": "#ad1a72",
}
MARKERS = {"dop853": "o", "radau5": "^", "rk4": "D", "rattle": "v"}
WORTH = 0.1  # part of the error of the last named point at which the next one is named
FAR = 8.0  # times fmpy's own calls: what is slower has them below its panel
UNITS = ((1.0, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns"))


def draw(found: Tradeoff, outs: Sequence[str | os.PathLike[str]]) -> None:
    """Write the figure to each of `outs` (the ending says the format).

    Raises BuildError if a file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from ...verification.figure import STYLE, save

    groups = [g for g in found.groups if g != FORCE or MULTIPLIER not in found.groups]
    steps = list(dict.fromkeys(r.setting.communication for r in found.rows))
    factor, unit = time_unit(found.rows, found.simulated)
    with plt.rc_context(STYLE | {"font.size": 10, "hatch.linewidth": 0.4}):
        figure, axes = plt.subplots(
            len(groups),
            len(steps),
            sharex="row",
            sharey=True,
            squeeze=False,
            figsize=(1.2 + 4.3 * len(steps), 1.1 + 3.1 * len(groups)),
            layout="constrained",
        )
        for j, h in enumerate(steps):
            for i, group in enumerate(groups):
                axis = axes[i, j]
                panel(axis, found, h, group, factor)
                if i == 0:
                    points = round(found.simulated / h)
                    axis.set_title(f"{points} communication steps of {h:.3g} s", fontsize=10.5)
                axis.set_xlabel(_error_label(found, group))
                if j == 0:
                    axis.set_ylabel(f"wall time per simulated second in {unit}")
        for i in range(len(groups)):
            _limit(axes[i, 0], found, groups[i])
        _limit_time(axes[0, 0], found, factor)
        figure.canvas.draw()
        for j, h in enumerate(steps):
            for i, group in enumerate(groups):
                name_front(axes[i, j], found, h, group, factor)
        handles = _legend(found)
        figure.legend(
            handles=handles,
            loc="outside lower center",
            ncols=min(len(handles), 4 if len(steps) < 3 else 8),
            frameon=False,
            fontsize=9.5,
        )
        figure.suptitle(f"{found.name} ({found.target} FMU): speed against accuracy", fontsize=12.5)
        try:
            for out in outs:
                save(figure, Path(out))
        finally:
            plt.close(figure)


def panel(axis: Any, found: Tradeoff, h: float, group: str, factor: float) -> None:
    """One panel: lines, quartiles, front, floor; times multiplied by `factor`."""
    rows = [r for r in found.rows if r.setting.communication == h]
    axis.set_xscale("log")
    axis.set_yscale("log")
    chosen = found.front(h, group)
    xs = [found.worst(r, group) for r in chosen]
    ys = [factor * r.median for r in chosen]
    if chosen:
        axis.step(xs, ys, where="pre", color="#b9b9b9", linewidth=5, solid_capstyle="round")
    for method in COLOURS:
        own = [r for r in rows if r.setting.method == method and np.isfinite(found.worst(r, group))]
        curve(axis, [found.worst(r, group) for r in own], own, factor)
    axis.plot(xs, ys, "o", markersize=10, markerfacecolor="none", color="#222222", linewidth=0)
    axis.axhline(factor * found.floor[h], color="#777777", linewidth=1.2, linestyle=":")
    if not _near(found):
        axis.annotate(
            f"fmpy's own calls: {factor * found.floor[h]:.2g}",
            (0.01, 0.985),  # the cheap and coarse points are below
            xycoords="axes fraction",
            verticalalignment="top",
            fontsize=8,
            color="#777777",
        )
    own_error = _own(found, group)
    axis.axvspan(own_error, own_error * 1e-9, facecolor="none", edgecolor="#999999", hatch="///")
    axis.margins(0.08)


def curve(
    axis: Any, errors: Sequence[float], rows: Sequence[Weighed], factor: float, line: str = "-"
) -> None:
    """One method: wall times over errors, with quartiles."""
    if not rows:
        return
    method = rows[0].setting.method
    y, low, high = (
        factor * np.array(x) for x in zip(*((r.median, *r.quartiles) for r in rows), strict=True)
    )
    axis.errorbar(
        errors,
        y,
        yerr=[y - low, high - y],
        color=COLOURS[method],
        marker=MARKERS[method],
        linestyle=line,
        markersize=4.5,
        linewidth=1.6,
        elinewidth=1,
        alpha=0.95,
    )


def name_front(axis: Any, found: Tradeoff, h: float, group: str, factor: float) -> None:
    """The tolerance or step beside each point of the front, where it covers nothing."""
    figure = axis.figure
    renderer = figure.canvas.get_renderer()
    own = [r for r in found.rows if r.setting.communication == h]
    taken = [
        axis.transData.transform((found.worst(r, group), factor * r.median))
        for r in own
        if np.isfinite(found.worst(r, group))
    ]
    boxes: list[Any] = []
    frame = axis.get_window_extent(renderer)
    last = float("inf")
    for row in found.front(h, group):
        if found.worst(row, group) > WORTH * last:
            continue  # hardly better than the one before
        last = found.worst(row, group)
        place = (found.worst(row, group), factor * row.median)
        for dx, dy, ha, va in (
            (0, -11, "center", "top"),
            (0, 11, "center", "bottom"),
            (-6, -11, "right", "top"),
            (-11, 0, "right", "center"),
            (11, 0, "left", "center"),
        ):
            text = axis.annotate(
                row.setting.dial,
                place,
                (dx, dy),
                textcoords="offset points",
                ha=ha,
                va=va,
                fontsize=8,
                color=COLOURS[row.setting.method],
                fontweight="bold",
                bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6, "alpha": 0.85},
            )
            box = text.get_window_extent(renderer).padded(1)
            inside = frame.contains(box.x0, box.y0) and frame.contains(box.x1, box.y1)
            free = not any(box.overlaps(b) for b in boxes)
            free = free and not any(box.padded(3).contains(*p) for p in taken)
            if inside and free:
                boxes.append(box)
                break
            text.remove()


def _own(found: Tradeoff, group: str) -> float:
    return max(found.reference.own[q.name] for q in found.known if q.group == group)


def _limit(axis: Any, found: Tradeoff, group: str) -> None:
    errors = [found.worst(r, group) for r in found.rows]
    errors = [e for e in errors if np.isfinite(e)]
    lowest = min([*errors, _own(found, group)])
    axis.set_xlim(max([*errors, 1e3 * lowest]) * 4, lowest / 6)


def _limit_time(axis: Any, found: Tradeoff, factor: float) -> None:
    times = [factor * s for r in found.rows for s in r.quartiles]
    if _near(found):
        times += [factor * f for f in found.floor.values()]
    axis.set_ylim(min(times) / 2.2, max(times) * 1.8)


def _near(found: Tradeoff) -> bool:
    """Whether fmpy's own calls are so large a part that their line stands in the panels."""
    return any(
        r.median < FAR * found.floor[r.setting.communication]
        for r in found.rows
        if r.setting.communication in found.floor
    )


def time_unit(rows: Iterable[Weighed], simulated: float) -> tuple[float, str]:
    """Factor from the seconds of a run to a unit of wall time per simulated second, and the unit."""
    fastest = min(r.median for r in rows) / simulated
    factor, unit = next((u for u in UNITS if fastest * u[0] >= 0.5), UNITS[-1])
    return factor / simulated, unit


def _error_label(found: Tradeoff, group: str) -> str:
    members = [q for q in found.known if q.group == group]
    if len(members) == 1:
        q = members[0]
        scale = f"{found.reference.scale[q.name]:.3g} {for_reading(q.unit)}".rstrip()
        return f"error of {q.name}, relative to {scale}"
    return {
        EVENT: "largest error of an event time, relative to the time",
        MULTIPLIER: "largest error of a λ, relative to its largest magnitude",
        FORCE: "largest error of a Q, relative to its largest magnitude",
        OWN: "largest error of an output of the model, relative to its largest magnitude",
    }.get(group, "largest error of a coordinate, relative to its largest magnitude")


def method_handles(present: Collection[str], own_calls: bool) -> list[Any]:
    """The methods of a legend, and the line of fmpy's own calls."""
    from matplotlib.lines import Line2D

    handles: list[Any] = [
        Line2D([], [], color=c, marker=MARKERS[m], markersize=5, linewidth=1.6, label=m)
        for m, c in COLOURS.items()
        if m in present
    ]
    if own_calls:
        handles.append(
            Line2D([], [], color="#777777", linestyle=":", linewidth=1.2, label="fmpy's own calls")
        )
    return handles


def _legend(found: Tradeoff) -> list[Any]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = method_handles({r.setting.method for r in found.rows}, _near(found))
    handles.append(
        Line2D(
            [],
            [],
            color="#b9b9b9",
            linewidth=5,
            marker="o",
            markersize=9,
            markerfacecolor="none",
            markeredgecolor="#222222",
            label="Pareto front",
        )
    )
    handles.append(
        Patch(facecolor="none", edgecolor="#999999", hatch="///", label="reference's own error")
    )
    return handles
