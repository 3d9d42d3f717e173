"""Figures of matplotlib, without pyplot and whatever the backend: their style, and how they are written."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from ..errors import UsageError
from ..files import write_whole

STYLE: dict[str, Any] = {
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.axisbelow": True,
}


class Drawn(Figure):
    """A Figure; a notebook shows it as a picture."""

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        self.savefig(picture, format="png", dpi=110)
        return picture.getvalue()


def save(figure: Figure, path: Path) -> Path:
    """Write it, the same bytes each time; the ending says the format.  Raises BuildError; UsageError for
    another ending."""
    ending, drawn = path.suffix[1:], io.BytesIO()
    metadata = {"Date": None} if ending == "svg" else {}
    try:
        with matplotlib.rc_context({"svg.hashsalt": "lagfmu"}):
            figure.savefig(drawn, format=ending or "png", metadata=metadata, dpi=150)
    except ValueError as error:
        raise UsageError(f"cannot write the figure {str(path)!r}: {error}") from None
    write_whole(path, drawn.getvalue())
    return path


def plain(text: str) -> str:
    """A name or a unit as a label shows it: what stands between two dollars is no mathematics."""
    return text.replace("$", r"\$")
