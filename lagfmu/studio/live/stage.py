"""A picture at the instants of a run, drawn by matplotlib: frames of a film, or a sketch."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from .moving import BETWEEN, Array, Moving, in_order
from .view import View

WIDE, HIGH = 4.2, 3.2  # in, of a sketch at most


class Stage:
    """The shapes of a picture at `times` (frames,) [s] of a run, a structured array; `known`: values of what
    the run does not tell, by name."""

    def __init__(
        self,
        picture: Mapping[str, Any],
        run: Any,
        known: Mapping[str, Any],
        times: Array,
        labels: bool,
    ) -> None:
        self.run, self.known, self.times = run, known, times
        told = [s for s in picture["shapes"] if s["kind"] != "direction"]
        self.shapes = [Moving(s, self.look, len(times)) for s in told]
        all_points = np.arange(BETWEEN * (len(times) - 1) + 1) / BETWEEN
        fine = np.interp(all_points, np.arange(len(times)), times)
        for shape in self.shapes:
            shape.leave_behind(partial(self.look, times=fine))
        self.in_space = picture["dimensions"] == 3
        self.view = View(self.shapes, labels=labels)

    def look(self, name: str, times: Array | None = None) -> Any:
        """A variable at all frames, or at these times, or its one value."""
        times = self.times if times is None else times
        if name == "time":
            return times
        if name in (self.run.dtype.names or ()):
            return np.interp(times, self.run["time"], self.run[name].astype(float))
        return self.known.get(name, np.nan)

    def draw(self, axes: Any, k: int) -> None:
        """Frame k, what is nearer over what is behind it."""
        self.view.set(axes, np.concatenate([s.covers(k) for s in self.shapes]))
        for shape in in_order(self.shapes, k):
            self.view.draw(axes, shape, k)
        if self.in_space:
            self.view.axes_of_space(axes, self.shapes[0].seen)


def sketch(picture: Mapping[str, Any], run: Any, known: Mapping[str, Any]) -> Any:
    """The picture where a run begins, as a matplotlib Figure; see Stage."""
    from matplotlib.figure import Figure

    stage = Stage(picture, run, known, np.array([float(run["time"][0])]), labels=True)
    width = min(WIDE, max(HIGH / stage.view.aspect, WIDE / 2))
    figure = Figure(figsize=(width, min(HIGH, max(width * stage.view.aspect, 0.5))))
    stage.draw(figure.add_axes((0, 0, 1, 1)), 0)
    return figure
