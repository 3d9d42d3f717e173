"""What is seen of moving shapes, and how matplotlib draws them: a film, an icon, a sketch."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...fmu.described import ICON
from ...numeric.instant import at_start, expanded
from ...page.picture import names_in, picture_of
from ...prepare.consistency import posed
from ...prepare.steps import Prepared
from .shapes import BETWEEN, TOWARDS, Array, Moving, in_order, shade

PAGE = Path(__file__).parent / "web" / "page.css"  # has the colours, of light paper first
INK, FORCE, FILL, BOB = (
    re.findall(rf"--{name}: (#\w+)", PAGE.read_text(encoding="utf-8"))[0]
    for name in ("metal", "force", "fill", "accent")
)
SOLID = "#c3d2e2"
FRAME = (FORCE, "#1b7a45", BOB)  # x, y, z
LONGEST = 0.2  # of what moves: the arrow of the largest force
LETTER, LINE = 7.5, 15  # pixels at 100 a inch, of a label
TINY = 1e-300  # N
SPAN = 0.08  # of what moves: an axis of a frame
PIVOT = 0.025  # of what moves: half the length of a joint's axis
LEAST = 5  # pixels: half the size of a joint of the plane

# a damper: parts of its length, and to its side (so in web/flat.js)
DASHPOT = np.array(
    [
        *([0.3, 0], [0.3, 1], [0.7, 1], [0.7, -1], [0.3, -1], [0.3, 1]),
        *([0.5, 1], [0.5, -1], [0.5, 1], [0.7, 1], [0.7, 0]),
    ]
)


class View:
    """What is seen: whatever moves, with room for arrows, and what of the rest is near; the largest force but
    for spikes."""

    def __init__(self, shapes: Sequence[Moving], labels: bool) -> None:
        self.labels = labels
        sizes = [np.asarray(s.length) for s in shapes if s.force is not None]
        found = np.concatenate(sizes) if sizes else np.ones(1)
        found = found[np.isfinite(found) & (found > 0)]
        self.strongest = float(np.quantile(found, 0.98)) if found.size else 1.0
        scenery = [s for s in shapes if s.kind in ("ground", "line") and not s.moves]
        seen = [s for s in shapes if s not in scenery]
        low, high = _box(_reached(seen or scenery))
        if not (high - low).max() > 0:  # a point: it is seen with what is around it
            low, high = _box(_reached(shapes))
        self.size = float(max(*(high - low), 1e-9))
        tips = [
            s.points[0]
            + self.long(s.force, np.minimum(1.0, self.strongest / np.maximum(s.length, TINY)))
            for s in shapes
            if s.force is not None
        ]
        low, high = _box(np.concatenate([[low, high], *tips]))
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.2 * self.size)
        room = (0.12 if labels else 0.07) * self.size
        self.low, self.high = middle - half - room, middle + half + room
        if scenery:  # ground that is just beyond
            near, far = _box(_reached(scenery))
            self.low = np.where(
                (near < self.low) & (near > self.low - room), near - room / 2, self.low
            )
            self.high = np.where(
                (far > self.high) & (far < self.high + room), far + room / 2, self.high
            )

    def long(self, force: Array, part: Any = 1.0) -> Array:
        """An arrow's way on the picture: of the largest force LONGEST of what moves."""
        size: float = LONGEST * self.size / self.strongest
        return np.asarray(force * np.asarray(part)[..., None] * size)

    @property
    def aspect(self) -> float:
        """Height over width."""
        across, up = self.high - self.low
        return float(up / across)

    def set(self, axes: Any, bodies: Array) -> None:
        """An empty frame, with what its labels shall not stand on (n, 3)."""
        axes.clear()
        axes.set_xlim(self.low[0], self.high[0])
        axes.set_ylim(self.low[1], self.high[1])
        axes.set_aspect("equal")
        axes.set_axis_off()
        self.taken = bodies

    def draw(self, axes: Any, shape: Moving, k: int) -> None:
        """Frame k of a shape."""
        from matplotlib.patches import Circle

        path = np.array([p[k] for p in shape.points])
        if len(left := shape.path_to(k)):
            axes.plot(*left.T, color=BOB, lw=0.9, alpha=0.6)
        if shape.facets:
            _solid(axes, shape, k)
        elif shape.kind == "pivot":
            self._pivot(axes, shape, k, path[0])
        elif shape.kind == "frame":
            for axis, colour in zip(shape.frame, FRAME, strict=False):
                ends = np.array([path[0], path[0] + SPAN * self.size * axis[k]])
                axes.plot(*ends.T, color=colour, lw=1.6)
        elif shape.kind in ("line", "path"):
            axes.plot(*path.T, color=INK, lw=1.3)
        elif shape.kind == "rod":
            axes.plot(*path.T, color=INK, lw=4.5, solid_capstyle="round")
            axes.plot(*path.T, "o", color="white", mec=INK, ms=5)
        elif shape.kind == "spring":
            axes.plot(
                *_coil(path[0], path[1], shape.shape["coils"], 0.02 * self.size).T,
                color=INK,
                lw=1.3,
            )
        elif shape.kind == "ground":
            axes.plot(*path.T, color=INK, lw=1.8)
            axes.plot(*_hatch(path[0], path[1], 0.025 * self.size), color=INK, lw=0.7)
        elif shape.kind == "disk":
            if shape.radius is None:
                axes.plot(*path.T, "o", color=BOB, ms=9)
            else:
                axes.add_patch(Circle(path[0], abs(shape.radius[k]), fc=FILL, ec=INK, lw=1.3))
                if shape.angle is not None:
                    a, r = shape.angle[k], shape.radius[k]
                    spoke = path[0] + r * np.array([np.cos(a), np.sin(a)])
                    axes.plot(*np.array([path[0], spoke]).T, color=INK, lw=1.3)
        elif shape.force is not None:
            self._arrow(axes, shape, k, shape.force[k])

    def _pivot(self, axes: Any, shape: Moving, k: int, at: Array) -> None:
        """A joint: a ball, its axis, or in the plane the strokes of its kind."""
        if shape.axis is None:
            axes.plot(*at, "o", color="white", mec=INK, ms=4)
        elif "strokes" in shape.shape:
            pixel = (self.high[0] - self.low[0]) / axes.bbox.width
            x, y = max(PIVOT * self.size, LEAST * pixel) * shape.axis[k]
            turn = np.array([[x, y], [-y, x]])  # rows: a half size along the axis, and to its left
            for stroke in shape.shape["strokes"]:
                axes.plot(*(at + np.array(stroke) @ turn).T, color=BOB, lw=1.3)
        else:
            way = PIVOT * self.size * shape.axis[k]
            axes.plot(*np.array([at - way, at + way]).T, color=BOB, lw=4, solid_capstyle="round")

    def _arrow(self, axes: Any, shape: Moving, k: int, force: Array) -> None:
        at = shape.points[0][k]
        tip = at + self.long(force)
        if not np.isfinite(tip).all() or np.hypot(*(tip - at)) < 0.004 * self.size:
            return
        style = {"arrowstyle": "-|>", "color": FORCE, "lw": 2, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", tip, at, arrowprops=style, annotation_clip=False)
        if self.labels:
            size = float(f"{shape.length[k]:.3g}")  # 5980, as the page has it, not 5.98e+03
            self.name(axes, f"{shape.shape['name']} {size:g} N", at, tip)

    def name(self, axes: Any, text: str, at: Array, tip: Array) -> None:
        """A text beside an arrow, where it covers least: beyond the tip, at its sides, behind the foot."""
        pixel = (self.high[0] - self.low[0]) / axes.bbox.width
        wide, high = LETTER * len(text) * pixel, LINE * pixel
        half = np.array([wide, high]) / 2
        along = (tip - at) / (np.hypot(*(tip - at)) or 1.0)
        left = np.array([-along[1], along[0]])
        places = [
            (tip, along),
            (tip, -left),
            (tip, left),
            ((at + tip) / 2, -left),
            ((at + tip) / 2, left),
        ]
        places += [(at, -along), (at, -left), (at, left)]
        best = (np.inf, at)
        for k, (place, way) in enumerate([(p, w * r) for r in (1, 4) for p, w in places]):
            side = np.where(np.abs(way) < 0.3, 0.0, np.sign(way))
            middle = place + 6 * pixel * way + side * half
            middle = np.clip(middle, self.low + half, self.high - half)
            gaps = np.maximum(np.abs(self.taken[:, :2] - middle) - half, 0.0)
            depth = np.maximum(self.taken[:, 2] + 3 * pixel - np.hypot(*gaps.T), 0.0).sum()
            best = min(best, (float(depth) + 0.2 * k * pixel, middle), key=lambda b: b[0])
        middle = best[1]
        axes.text(*middle, text, color=FORCE, fontsize=9, ha="center", va="center_baseline")
        spread = middle[0] + np.linspace(-wide / 2, wide / 2, 6)
        taken = np.stack([spread, np.full(6, middle[1]), np.full(6, high / 2)], axis=1)
        self.taken = np.concatenate([self.taken, taken])

    def axes_of_space(self, axes: Any, seen: Callable[[list[Array]], tuple[Array, Array]]) -> None:
        """The directions of x, y and z, in the corner below on the left."""
        corner = self.low + 0.08 * self.size
        for k, letter in enumerate("xyz"):
            way = seen([np.array([float(i == k)]) for i in range(3)])[0][0] * 0.07 * self.size
            axes.plot(*np.array([corner, corner + way]).T, color=INK, lw=1)
            axes.text(
                *(corner + 1.35 * way), letter, color=INK, fontsize=8, ha="center", va="center"
            )


def _solid(axes: Any, shape: Moving, k: int) -> None:
    """Those of its facets that are seen, lit from above."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb

    polygons, colours = [], []
    for facet in (f[k] for f in shape.facets):
        flat = facet.shape[1] == 2
        light = 1.0 if flat else shade(facet, TOWARDS)
        if light is not None:
            polygons.append(shape.seen(list(facet.T))[0])
            colours.append(light * np.array(to_rgb(FILL if flat else SOLID)))
    edges = INK if len(shape.facets) < 7 else colours
    axes.add_collection(PolyCollection(polygons, facecolors=colours, edgecolors=edges, lw=0.7))


def _reached(shapes: Sequence[Moving]) -> Array:
    reach = []
    for s in shapes:
        r = 0 if s.radius is None else np.abs(s.radius)[:, None]
        reach += [side for p in s.points for side in (p - r, p + r)]
    return np.concatenate(reach)


def _box(points: Array) -> tuple[Array, Array]:
    points = points[np.isfinite(points).all(axis=1)]
    return points.min(axis=0), points.max(axis=0)


def _coil(a: Array, b: Array, coils: int, width: float) -> Array:
    along = b - a
    across = np.array([-along[1], along[0]]) / (np.hypot(*along) or 1.0) * width
    parts = np.linspace(0.12, 0.88, 2 * coils + 1)
    sides: Any = [0, *(1 if k % 2 else -1 for k in range(1, 2 * coils)), 0]
    if not coils:
        parts, sides = DASHPOT.T
    middle = [a + p * along + s * across for p, s in zip(parts, sides, strict=True)]
    return np.array([a, *middle, b])


def _hatch(a: Array, b: Array, size: float) -> tuple[list[float], list[float]]:
    length = float(np.hypot(*(b - a))) or 1.0
    along = (b - a) / length
    away = size * (np.array([along[1], -along[0]]) - along) / np.sqrt(2)
    xs: list[float] = []
    ys: list[float] = []
    for d in np.arange(size / 2, length, size):
        start = a + d * along
        xs += [start[0], start[0] + away[0], np.nan]
        ys += [start[1], start[1] + away[1], np.nan]
    return xs, ys


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
