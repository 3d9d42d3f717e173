"""The shapes of a picture at all frames of a film: where they are.

Boxes, cylinders and balls of a film as flat facets: which of them are seen, and how light they are.

A facet is an array (frames, corners, 3) [m], counterclockwise from outside.  Each solid is convex, so that of
its own facets those that look at the reader do not cover each other; films draw what stands still, then what
moves from the farthest to the nearest.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...page.picture import values

Array = NDArray[np.float64]
ROUND = 24  # corners of a circle
LIGHT = np.array([0.35, -0.45, 0.82])  # towards it
DARKEST = 0.55
SQUARE = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def box(center: Array, size: Array, axes: Sequence[Array]) -> list[Array]:
    """Six facets; all arguments (frames, 3), axes are unit vectors along the sides."""
    half = np.abs(size) / 2
    sides = [axis * half[:, [k]] for k, axis in enumerate(axes)]
    found = []
    for k in range(3):
        u, v, w = sides[(k + 1) % 3], sides[(k + 2) % 3], sides[k]
        for side in (1, -1):
            corners = [center + side * w + i * side * u + j * v for i, j in SQUARE]
            found.append(np.stack(corners, axis=1))
    return found


def cylinder(start: Array, end: Array, radius: Array) -> list[Array]:
    """The wall and both ends; start and end (frames, 3), radius (frames)."""
    axis = _unit(end - start)
    helper = np.where(np.abs(axis[:, [2]]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    u = _unit(np.cross(helper, axis))
    v = np.cross(axis, u)
    angles = np.linspace(0, 2 * np.pi, ROUND + 1)
    out = [radius[:, None] * (np.cos(a) * u + np.sin(a) * v) for a in angles]
    wall = [
        np.stack([start + a, start + b, end + b, end + a], axis=1)
        for a, b in itertools.pairwise(out)
    ]
    ends = [
        np.stack([start + a for a in out[:0:-1]], axis=1),
        np.stack([end + a for a in out[1:]], axis=1),
    ]
    return wall + ends


def ball(center: Array, radius: Array) -> list[Array]:
    """Rings of facets."""
    angles = np.linspace(0, 2 * np.pi, ROUND + 1)
    heights = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1)

    def point(angle: float, height: float) -> Array:
        way = [np.cos(height) * np.cos(angle), np.cos(height) * np.sin(angle), np.sin(height)]
        return np.asarray(center + radius[:, None] * np.array(way))

    return [
        np.stack([point(a, low), point(b, low), point(b, high), point(a, high)], axis=1)
        for low, high in itertools.pairwise(heights)
        for a, b in itertools.pairwise(angles)
    ]


def shade(facet: Array, towards: Array) -> float | None:
    """How light a facet (corners, 3) is, 0 to 1; None where it is not seen from `towards`."""
    normal = np.cross(facet[2] - facet[0], facet[3] - facet[1])
    size = float(np.linalg.norm(normal))
    if size == 0 or not normal @ towards > 0:
        return None
    light = float(normal @ LIGHT) / size / float(np.linalg.norm(LIGHT))
    return DARKEST + (1 - DARKEST) * max(light, 0.0)


def _unit(vector: Array) -> Array:
    size = np.linalg.norm(vector, axis=1, keepdims=True)
    return np.asarray(vector / np.where(size > 0, size, 1.0))


AZIMUTH, ELEVATION = -1.05, 0.42  # rad, from which a picture in space is seen, as on the page
TOWARDS = np.array(
    [
        np.cos(AZIMUTH) * np.cos(ELEVATION),
        np.sin(AZIMUTH) * np.cos(ELEVATION),
        np.sin(ELEVATION),
    ]
)
BETWEEN = 8  # points of the path that a shape leaves behind, from frame to frame


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
        axes = shape["axes"] if self.kind == "frame" else []
        self.frame = [self._point(axis, look)[0] for axis in axes]
        self.facets = self._facets(look)
        if self.facets:
            flat = [f.transpose(1, 2, 0) for f in self.facets]  # corners, components, frames
            self.points = [self.seen(list(corner))[0] for f in flat for corner in f]
        self.force: Array | None = None
        if self.kind == "arrow":
            self.force, self.length = self._point(shape["vector"], look)
        self.left_behind: Array | None = None

    def leave_behind(self, look: Callable[[str], Any]) -> None:
        """The path of its centre, if the picture wants it; `look` tells BETWEEN instants a frame."""
        if self.shape.get("trace"):
            way = {"kind": "line", "points": [self.shape["center"]]}
            (self.left_behind,) = Moving(way, look, BETWEEN * (self.frames - 1) + 1).points

    def path_to(self, k: int) -> Array:
        """What it has left behind at frame k (points, 2)."""
        return np.empty((0, 2)) if self.left_behind is None else self.left_behind[: BETWEEN * k + 1]

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
        if self.facets or self.kind in ("pivot", "frame"):
            return np.hstack([path, np.zeros_like(path[:, :1])])
        if self.kind == "disk":
            radius = 0.0 if self.radius is None else abs(self.radius[k])
            return np.array([[*path[0], radius]])
        if self.kind == "arrow":
            return np.empty((0, 3))
        part = np.linspace(0.0, 1.0, 12)[:, None]
        along = [a + part * (b - a) for a, b in itertools.pairwise(path)]
        return np.concatenate([np.hstack([way, np.zeros_like(way[:, :1])]) for way in along])


def _hung(a: Array, b: Array, sag: Array, part: Array) -> Array:
    """(points, dimensions, frames): from a to b, the last dimension lowered by `sag` in the middle."""
    points: Array = a + part * (b - a)
    points[:, -1] -= 4 * sag * part[:, 0] * (1 - part[:, 0])
    return points


def _with(look: Callable[[str], Any], name: str, value: Any) -> Callable[[str], Any]:
    """The same look-up, with one name of its own."""
    return lambda n: value if n == name else look(n)


def in_order(shapes: Sequence[Moving], k: int) -> list[Moving]:
    """As they are drawn in frame k: solids that stand still, those that move from the farthest to the
    nearest, and all that is flat."""
    scenery = [s for s in shapes if s.facets and not s.moves]
    bodies = sorted((s for s in shapes if s.facets and s.moves), key=lambda s: s.depth(k))
    return [*scenery, *bodies, *(s for s in shapes if not s.facets)]
