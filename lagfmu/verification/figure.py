"""A matplotlib figure that a notebook shows by itself, without pyplot and whatever the backend."""

from __future__ import annotations

import io

from matplotlib.figure import Figure


class Drawn(Figure):
    """A Figure; a notebook shows it as a picture."""

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        self.savefig(picture, format="png", dpi=110)
        return picture.getvalue()
