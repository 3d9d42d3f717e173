"""The shapes of a picture at all frames of a film: where they are, and how matplotlib draws them."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..page.picture import values
from .solids import SQUARE, ball, box, cylinder, shade

INK, FORCE, FILL, BOB = "#48525e", "#c2410c", "#dbe3ec", "#1f5fa8"
SOLID = "#c3d2e2"
LONGEST = 0.2  # of what moves: the arrow of the largest force
LETTER, LINE = 7.5, 15  # pixels at 100 a inch, of a label
TINY = 1e-300  # N
AZIMUTH, ELEVATION = -1.05, 0.42  # rad, from which a picture in space is seen, as on the page
TOWARDS = np.array(
    [
        np.cos(AZIMUTH) * np.cos(ELEVATION),
        np.sin(AZIMUTH) * np.cos(ELEVATION),
        np.sin(ELEVATION),
    ]
)
PIVOT = 0.025  # of what moves: half the length of a joint's axis
Array = NDArray[np.float64]


class Moving:
    """A shape with its points at all frames."""

    def __init__(self, shape: Mapping[str, Any], look: Callable[[str], Any], frames: int) -> None:
        self.shape, self.kind = shape, shape["kind"]
        self.frames = frames
        self.points: list[Array] = []
        if self.kind == "path":
            first, last = (self._all(values(e, look)) for e in shape["range"])
            for part in np.linspace(0.0, 1.0, 121):
                along = _with(look, shape["over"], first + part * (last - first))
                self.points.append(self._point(shape["point"], along)[0])
        else:
            keys = shape.get("points") or [shape.get("center") or shape["at"]]
            self.points = [self._point(p, look)[0] for p in keys]
            if "length" in shape:
                self.points = self._hanging(keys, self._all(values(shape["length"], look)), look)
        single = {k: self._all(values(shape[k], look)) for k in ("radius", "angle") if k in shape}
        self.radius, self.angle = single.get("radius"), single.get("angle")
        self.axis = self._point(shape["axis"], look)[0] if "axis" in shape else None
        self.facets = self._facets(look)
        if self.facets:
            flat = [f.transpose(1, 2, 0) for f in self.facets]  # corners, components, frames
            self.points = [self.seen(list(corner))[0] for f in flat for corner in f]
        self.force: Array | None = None
        if self.kind == "arrow":
            self.force, self.length = self._point(shape["vector"], look)

    def _hanging(self, ends: Any, length: Array, look: Callable[[str], Any]) -> list[Array]:
        """Points of a string, a parabola that is as long as it, or straight: as web/picture.js has them."""
        a, b = (np.stack([self._all(values(e, look)) for e in end]) for end in ends)
        part = np.linspace(0.0, 1.0, 25)[:, None, None]
        low, high = np.zeros(self.frames), length.copy()
        for _ in range(20):
            sag = (low + high) / 2
            points = _hung(a, b, sag, part)
            short = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).sum(axis=0) < length
            low, high = np.where(short, sag, low), np.where(short, high, sag)
        return [self.seen(list(point))[0] for point in _hung(a, b, low, part)]

    def _facets(self, look: Callable[[str], Any]) -> list[Array]:
        """Of a solid: its faces (frames, corners, 2 or 3)."""

        def vector(point: Any) -> Array:
            return np.stack([self._all(values(e, look)) for e in point], axis=1)

        if self.kind == "box":
            axes = [vector(axis) for axis in self.shape["axes"]]
            center, size = vector(self.shape["center"]), vector(self.shape["size"])
            if len(axes) == 3:
                return box(center, size, axes)
            u, v = (a * size[:, [k]] / 2 for k, a in enumerate(axes))
            return [np.stack([center + i * u + j * v for i, j in SQUARE], axis=1)]
        if self.kind == "rod" and self.radius is not None:
            start, end = map(vector, self.shape["points"])
            if start.shape[1] == 3:
                return cylinder(start, end, np.abs(self.radius))
            way = end - start
            across = np.stack([-way[:, 1], way[:, 0]], axis=1)
            size = np.linalg.norm(way, axis=1)
            across *= (np.abs(self.radius) / np.where(size > 0, size, 1.0))[:, None]
            corners = [start + across, start - across, end - across, end + across]
            return [np.stack(corners, axis=1)]
        if self.kind == "disk" and self.radius is not None and len(self.shape["center"]) == 3:
            return ball(vector(self.shape["center"]), np.abs(self.radius))
        return []

    def depth(self, k: int) -> float:
        """How near a solid is to the reader in frame k."""
        middle = np.mean([f[k].mean(axis=0) for f in self.facets], axis=0)
        return float(middle @ TOWARDS[: len(middle)]) if len(middle) == 3 else 0.0

    def _all(self, value: Any) -> Array:
        return np.broadcast_to(np.asarray(value, dtype=float), (self.frames,))

    def _point(self, point: Any, look: Callable[[str], Any]) -> tuple[Array, Array]:
        """(frames, 2) in the plane that is seen, and (frames) the length of what was projected."""
        return self.seen([self._all(values(e, look)) for e in point])

    def seen(self, parts: list[Array]) -> tuple[Array, Array]:
        """Coordinates (frames each) as they are seen (frames, 2), and their length."""
        length = np.sqrt(sum(p**2 for p in parts))
        if len(parts) == 2:
            return np.stack(parts, axis=1), length
        x, y, z = parts
        depth = x * np.cos(AZIMUTH) + y * np.sin(AZIMUTH)
        right = -x * np.sin(AZIMUTH) + y * np.cos(AZIMUTH)
        up = z * np.cos(ELEVATION) - depth * np.sin(ELEVATION)
        return np.stack([right, up], axis=1), length

    @property
    def moves(self) -> bool:
        """Whether it is anywhere else at another time."""
        return any(np.ptp(p, axis=0).max() > 0 for p in self.points)

    def covers(self, k: int) -> Array:
        """Circles (x, y, radius) of the picture that it covers (n, 3), where no label shall stand."""
        path = np.array([p[k] for p in self.points])
        if self.facets or self.kind == "pivot":
            return np.hstack([path, np.zeros_like(path[:, :1])])
        if self.kind == "disk":
            radius = 0.0 if self.radius is None else abs(self.radius[k])
            return np.array([[*path[0], radius]])
        if self.kind == "arrow":
            return np.empty((0, 3))
        part = np.linspace(0.0, 1.0, 12)[:, None]
        along = [a + part * (b - a) for a, b in itertools.pairwise(path)]
        return np.concatenate([np.hstack([way, np.zeros_like(way[:, :1])]) for way in along])

    def draw(self, axes: Any, k: int, view: View) -> None:
        """Its frame k."""
        from matplotlib.patches import Circle

        path = np.array([p[k] for p in self.points])
        if self.facets:
            self._solid(axes, k)
            if self.shape.get("trace"):
                center = np.mean([f.mean(axis=1) for f in self.facets], axis=0)[: k + 1]
                axes.plot(*self.seen(list(center.T))[0].T, color=BOB, lw=0.9, alpha=0.6)
        elif self.kind == "pivot":
            way = np.zeros(2) if self.axis is None else PIVOT * view.size * self.axis[k]
            ends = np.array([path[0] - way, path[0] + way])
            axes.plot(*ends.T, color=BOB, lw=4, solid_capstyle="round")
        elif self.kind in ("line", "path"):
            axes.plot(*path.T, color=INK, lw=1.3)
        elif self.kind == "rod":
            axes.plot(*path.T, color=INK, lw=4.5, solid_capstyle="round")
            axes.plot(*path.T, "o", color="white", mec=INK, ms=5)
        elif self.kind == "spring":
            axes.plot(
                *_coil(path[0], path[1], self.shape["coils"], 0.02 * view.size).T, color=INK, lw=1.3
            )
        elif self.kind == "ground":
            axes.plot(*path.T, color=INK, lw=1.8)
            axes.plot(*_hatch(path[0], path[1], 0.025 * view.size), color=INK, lw=0.7)
        elif self.kind == "disk":
            if self.shape.get("trace"):
                axes.plot(*self.points[0][: k + 1].T, color=BOB, lw=0.9, alpha=0.6)
            if self.radius is None:
                axes.plot(*path.T, "o", color=BOB, ms=9)
            else:
                axes.add_patch(Circle(path[0], abs(self.radius[k]), fc=FILL, ec=INK, lw=1.3))
                if self.angle is not None:
                    a, r = self.angle[k], self.radius[k]
                    spoke = path[0] + r * np.array([np.cos(a), np.sin(a)])
                    axes.plot(*np.array([path[0], spoke]).T, color=INK, lw=1.3)
        elif self.force is not None:
            self._arrow(axes, path[0], self.force[k], float(self.length[k]), view)

    def _solid(self, axes: Any, k: int) -> None:
        """Those of its facets that are seen, lit from above."""
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import to_rgb

        polygons, colours = [], []
        for facet in (f[k] for f in self.facets):
            flat = facet.shape[1] == 2
            light = 1.0 if flat else shade(facet, TOWARDS)
            if light is not None:
                polygons.append(self.seen(list(facet.T))[0])
                colours.append(light * np.array(to_rgb(FILL if flat else SOLID)))
        edges = INK if len(self.facets) < 7 else colours
        axes.add_collection(PolyCollection(polygons, facecolors=colours, edgecolors=edges, lw=0.7))

    def _arrow(self, axes: Any, at: Array, force: Array, size: float, view: View) -> None:
        tip = at + view.long(force)
        if not np.isfinite(tip).all() or np.hypot(*(tip - at)) < 0.004 * view.size:
            return
        style = {"arrowstyle": "-|>", "color": FORCE, "lw": 2, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", tip, at, arrowprops=style, annotation_clip=False)
        if view.labels:
            view.name(axes, f"{self.shape['name']} {size:.3g} N", at, tip)


def _hung(a: Array, b: Array, sag: Array, part: Array) -> Array:
    """(points, dimensions, frames): from a to b, the last dimension lowered by `sag` in the middle."""
    points: Array = a + part * (b - a)
    points[:, -1] -= 4 * sag * part[:, 0] * (1 - part[:, 0])
    return points


def _with(look: Callable[[str], Any], name: str, value: Any) -> Callable[[str], Any]:
    """The same look-up, with one name of its own."""
    return lambda n: value if n == name else look(n)


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
    sides = [0, *(1 if k % 2 else -1 for k in range(1, 2 * coils)), 0]
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
