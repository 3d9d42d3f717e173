"""A picture of a fit: what was measured and fitted, and the residuals in standard deviations below."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...model.units import for_reading
from ...verification.figure import STYLE, Drawn, plain, save
from ...verification.plot import COLOURS

Floats = NDArray[np.float64]
Tables = Mapping[str, Mapping[str, tuple[Floats, Floats, Floats]]]


def draw(
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
