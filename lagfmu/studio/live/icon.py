"""The icon of an FMU: the picture of its model at the start, without forces (FMI 3.0, section 2.4.9.1)."""

from __future__ import annotations

import io
import re
from typing import Any

import numpy as np

from ...fmu.terminals import ICON
from ...numeric.instant import at_start, expanded
from ...page.picture import names_in, picture_of
from ...prepare.consistency import posed
from ...prepare.prepare import Prepared
from .moving import Moving, in_order
from .view import View

SIDE, DOTS = 1.28, 100  # in, and dots an inch
# of a point: further digits of a place are seen by nobody
TENTH = re.compile(rb"(\d+\.\d)\d+")


def icon(prepared: Prepared) -> dict[str, bytes]:
    """Path in the FMU -> file: as pixels and as SVG; nothing for a model without a picture, or with one that
    has no place at the start."""
    picture = picture_of(prepared, forces=False)
    if picture is None:
        return {}
    places, shapes = _places(prepared), []
    for s in picture["shapes"]:
        if names_in(s) <= places.keys():
            shapes.append(Moving(s, places.__getitem__, 1))
    return _drawn(shapes) if shapes else {}


def _places(prepared: Prepared) -> dict[str, float]:
    """What is known of the start by name: as it is described, and consistent coordinates."""
    given = {v.name: v.start for v in prepared.table.variables if not isinstance(v.start, str)}
    known = {name: float(x) for name, x in given.items() if x is not None}
    (u, p), begun = posed(prepared).values, prepared.structure.start
    at, q, _ = expanded(at_start(prepared.examined, begun.q, u, p), begun.q, begun.v)
    return known | dict(zip(at.system.coordinates, q.tolist(), strict=True)) | {"time": 0.0}


def _drawn(shapes: list[Moving]) -> dict[str, bytes]:
    """The same bytes for the same shapes."""
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(SIDE, SIDE), dpi=DOTS)
    FigureCanvasAgg(figure)
    axes: Any = figure.add_axes((0, 0, 1, 1))
    view = View(shapes, labels=False)
    view.set(axes, np.empty((0, 3)))
    for shape in in_order(shapes, 0):
        view.draw(axes, shape, 0)
    pixels, lines = io.BytesIO(), io.BytesIO()
    untold = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    with matplotlib.rc_context({"svg.hashsalt": "lagfmu"}):
        figure.savefig(pixels, format="png", transparent=True, metadata={"Software": None})
        figure.savefig(lines, format="svg", transparent=True, metadata=untold)
    return {
        f"{ICON}.png": pixels.getvalue(),
        f"{ICON}.svg": TENTH.sub(rb"\1", lines.getvalue()),
    }
