"""A picture of a study: one varied quantity a curve, two a map, samples scatter plots and histograms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...errors import SimulationError
from ...model.units import for_reading
from .results import INFINITE, happened, numbers, one_by_one, varied

FIGURES = (".svg", ".png", ".pdf")
FAILED, NOTHING = "#c0392b", "#e8e8e8"
INK = "#1f5fa8"


def plot(found: Any, path: Path) -> Path:
    """Draw the numbers that were kept.  Raises BuildError if the file cannot be written."""
    from ...verification.plot import save

    return save(figure_of(found), path)


def figure_of(found: Any) -> Any:
    """The same as a matplotlib Figure.  Raises SimulationError where no numbers were kept."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from ...verification.plot import STYLE

    names = numbers(found)
    if not names:
        raise SimulationError("there is nothing to plot: keep numbers of each run")
    dims = [d for d in found["status"].dims if d != "run"]
    with mpl.rc_context(STYLE | {"font.size": 9}):
        if "run" in found.dims or len(dims) > 2:
            return _scatter(found, names, Figure)
        return _grid(found, names, dims, Figure)


def _drawn(found: Any, name: str) -> Any:
    """The values; nothing where an event did not happen, or a bar is infinite."""
    values = happened(found, name)
    return np.where(np.abs(values) < INFINITE, values, np.nan)


def _label(found: Any, name: str) -> str:
    from ...verification.plot import plain

    unit = for_reading(found[name].attrs.get("units", ""))
    return plain(f"{name} [{unit}]" if unit else name)


def _grid(found: Any, names: list[str], dims: list[str], Figure: Any) -> Any:
    """A panel a kept quantity: a curve over one axis, a map over two."""
    from matplotlib.patches import Patch
    from matplotlib.ticker import MaxNLocator

    width, height = (7.0, 2.4) if len(dims) == 1 else (6.0, 4.2)
    figure = Figure(figsize=(width, height * len(names)), layout="constrained")
    panels = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    bad = found["status"].values != "ok"
    for panel, name in zip(panels, names, strict=True):
        x = found[dims[0]].values
        if len(dims) == 1:
            panel.plot(x, _drawn(found, name), color=INK, marker="." if len(x) < 60 else None)
            if bad.any():
                panel.plot(x[bad], np.zeros(bad.sum()), "x", color=FAILED, clip_on=False,
                           transform=panel.get_xaxis_transform(), label="refused")  # fmt: skip
                panel.legend(frameon=False)
            panel.set_ylabel(_label(found, name))
        else:
            y = found[dims[1]].values
            z = _drawn(found, name).T
            drawn = panel.pcolormesh(x, y, z, shading="nearest", cmap="viridis")
            bar = figure.colorbar(drawn, ax=panel, label=_label(found, name))
            if (z[np.isfinite(z)] % 1 == 0).all():
                bar.locator = MaxNLocator(integer=True)
            panel.set_facecolor(NOTHING)
            signs = [Patch(color=NOTHING, label="never")] if (np.isnan(z) & ~bad.T).any() else []
            if bad.any():
                i, j = np.nonzero(bad)
                signs += panel.plot(x[i], y[j], "x", color=FAILED, label="refused")
            if signs:
                panel.legend(handles=signs, frameon=True)
            panel.set_ylabel(_label(found, dims[1]))
            panel.grid(visible=False)
        for axis, values in (("x", x), *((("y", found[dims[1]].values),) if len(dims) > 1 else ())):
            if _logarithmic(values):
                getattr(panel, f"set_{axis}scale")("log")
    panels[-1].set_xlabel(_label(found, dims[0]))
    return figure


def _logarithmic(values: Any) -> bool:
    """True if the values are spaced evenly in the logarithm."""
    if len(values) < 3 or not (values > 0).all():
        return False
    steps = np.diff(np.log(values))
    return bool(
        np.allclose(steps, steps[0]) and not np.allclose(np.diff(values), values[1] - values[0])
    )


def _scatter(found: Any, names: list[str], Figure: Any) -> Any:
    """What varied across, what was kept down; histograms of each on the edges."""
    causes, stacked = varied(found), one_by_one(found)
    good = stacked["status"].values == "ok"
    columns, rows = len(causes) + 1, len(names) + 1
    figure = Figure(figsize=(2.4 * columns, 2.1 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False)
    for column in panels.T[:-1]:
        for panel in column[1:]:
            panel.sharex(column[0])
    bins = min(50, max(8, int(np.sqrt(good.sum()))))
    for i, name in enumerate(names):
        y = _drawn(stacked, name)
        for j, cause in enumerate(causes):
            panel = panels[i][j]
            panel.plot(stacked[cause].values[good], y[good], ".", ms=2, color=INK, alpha=0.4,
                       rasterized=True)  # fmt: skip
            if i == 0 and (~good).any():
                panel.plot(stacked[cause].values[~good], np.zeros((~good).sum()), "x", ms=3,
                           color=FAILED, transform=panel.get_xaxis_transform(), clip_on=False)  # fmt: skip
            if j == 0:
                panel.set_ylabel(_label(found, name))
        panels[i][-1].hist(y[np.isfinite(y)], bins=bins, orientation="horizontal", color=INK)
        panels[i][-1].sharey(panels[i][0])
    for j, cause in enumerate(causes):
        panels[-1][j].hist(stacked[cause].values[good], bins=bins, color=INK)
        panels[-1][j].set_xlabel(_label(found, cause))
    corner = panels[-1][-1]
    corner.axis("off")
    refused = int((~good).sum())
    corner.text(0.5, 0.5, f"{good.sum()} runs" + (f"\n{refused} refused (x)" if refused else ""),
                ha="center", va="center")  # fmt: skip
    return figure
