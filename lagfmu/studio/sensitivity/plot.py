"""Bars that lie beside each other as in a tornado: what matters most on top."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...verification.figure import STYLE, Drawn, plain, save
from ...verification.plot import COLOURS

MOST = 12  # bars of one output


def tornado(
    bars: Mapping[str, Sequence[tuple[str, float]]],
    label: str,
    title: str,
    out: Any = None,
    errors: Mapping[str, Mapping[str, float]] | None = None,
) -> Any:
    """A panel an output with its bars (name, length), the first on top, and `errors` about their ends; a
    Figure, or with `out` the file.  Raises BuildError if it cannot be written."""
    import matplotlib as mpl

    shown = {o: [b for b in rows if np.isfinite(b[1])][:MOST] for o, rows in bars.items()}
    heights = [0.6 + 0.28 * max(len(rows), 1) for rows in shown.values()]
    with mpl.rc_context(STYLE | {"font.size": 10}):
        figure = Drawn(figsize=(7.5, 0.6 + sum(heights)), layout="constrained")
        panels = figure.subplots(len(shown), 1, squeeze=False, height_ratios=heights)[:, 0]
        for panel, (output, rows) in zip(panels, shown.items(), strict=True):
            places = np.arange(len(rows))[::-1]
            lengths = [length for _, length in rows]
            colours = [COLOURS[0] if x >= 0 else COLOURS[1] for x in lengths]
            spread = None if errors is None else [errors[output][n] for n, _ in rows]
            panel.barh(places, lengths, color=colours, xerr=spread, height=0.7)
            panel.set_yticks(places, [plain(n) for n, _ in rows])
            panel.axvline(0, color="#48525e", lw=1)
            panel.set_title(plain(output), loc="left", fontsize=10)
            panel.grid(visible=False, axis="y")
        panels[-1].set_xlabel(plain(label))
        figure.suptitle(plain(title), fontsize=11)
        return figure if out is None else save(figure, Path(out))
