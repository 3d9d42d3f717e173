"""A run as a film: the mechanism of the model's picture, forces of constraint as arrows.

A .gif or .mp4 file is drawn here; a .html file is the live page with the run in it (live/recording.py).
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import BuildError, UsageError
from ..fmu.described import Trajectory
from ..fmu.write import write_whole
from ..live.playable import Told
from ..live.recording import recorded
from ..live.render import render
from ..page.picture import values

RATE, MOST = 25, 300  # frames per second, and of a film
ENDINGS = (".gif", ".mp4", ".html")
INK, FORCE, FILL, BOB = "#48525e", "#c2410c", "#dbe3ec", "#1f5fa8"
LONGEST = 0.2  # of the view: the arrow of the largest force
AZIMUTH, ELEVATION = -1.05, 0.42  # rad, from which a picture in space is seen, as on the page
Array = NDArray[np.float64]


def film(told: Told, run: Trajectory, given: Mapping[str, Any], out: Path, title: str) -> Path:
    """Write the film of a run, in its own time if it is no longer than 12 s, else faster.

    Raises UsageError for another ending, BuildError without a picture, or for .mp4 without ffmpeg.
    """
    ending = out.suffix.lower()
    if ending not in ENDINGS:
        raise UsageError(f"--animate {str(out)!r}: expected a file {', '.join(ENDINGS)}")
    if told.picture is None:
        raise BuildError(
            f"{title} has no picture to animate: give the model picture=[Line(...), Disk(...), ...]"
        )
    if ending == ".html":
        write_whole(out, render(recorded(told, run, given)).encode())
        return out
    known = {v["name"]: v["start"] for v in recorded(told, run, given).facts["variables"]}
    _draw(told.picture, run, known, out, title)
    return out


def _draw(
    picture: Mapping[str, Any], run: Trajectory, known: Mapping[str, Any], out: Path, title: str
) -> None:
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.animation import FFMpegWriter, PillowWriter

    end = float(run["time"][-1])
    count = int(min(max(np.ceil(end * RATE), 2), MOST))
    times = np.linspace(0.0, end, count + 1)

    def look(name: str) -> Any:
        if name == "time":
            return times
        if name in (run.dtype.names or ()):
            return np.interp(times, run["time"], run[name].astype(float))
        return known.get(name, np.nan)

    shapes = [_Moving(s, look, len(times)) for s in picture["shapes"]]
    view = _View(shapes)
    speed = end * RATE / count
    note = "" if abs(speed - 1) < 0.05 else f", {speed:.3g} times as fast"
    writer: Any = PillowWriter(fps=RATE)
    if out.suffix.lower() == ".mp4":
        matplotlib.rcParams["animation.ffmpeg_path"] = _ffmpeg()
        writer = FFMpegWriter(fps=RATE, codec="libx264", extra_args=["-pix_fmt", "yuv420p"])
    figure, axes = plt.subplots(figsize=(6.4, 4.8), dpi=100)
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        with writer.saving(figure, str(out), dpi=100):
            for k, t in enumerate(times):
                axes.clear()
                view.set(axes)
                for shape in shapes:
                    shape.draw(axes, k, view)
                axes.set_title(f"{title}, t = {t:.2f} s{note}", fontsize=11, color=INK)
                writer.grab_frame()
    except OSError as error:
        raise BuildError(f"cannot write the film {str(out)!r}: {error}") from None
    finally:
        plt.close(figure)


def _ffmpeg() -> str:
    """The program that writes .mp4: on the path, or from PyPI's imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found is None:
        try:
            import imageio_ffmpeg

            found = str(imageio_ffmpeg.get_ffmpeg_exe())
        except (ImportError, RuntimeError):
            raise BuildError(
                "an .mp4 film needs ffmpeg, which was not found: pip install lagfmu[video], or write a "
                ".gif or .html"
            ) from None
    return found


class _Moving:
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
        return [self._seen(list(point))[0] for point in _hung(a, b, low, part)]

    def _all(self, value: Any) -> Array:
        return np.broadcast_to(np.asarray(value, dtype=float), (self.frames,))

    def _point(self, point: Any, look: Callable[[str], Any]) -> tuple[Array, Array]:
        """(frames, 2) in the plane that is seen, and (frames) the length of what was projected."""
        return self._seen([self._all(values(e, look)) for e in point])

    def _seen(self, parts: list[Array]) -> tuple[Array, Array]:
        length = np.sqrt(sum(p**2 for p in parts))
        if len(parts) == 2:
            return np.stack(parts, axis=1), length
        x, y, z = parts
        depth = x * np.cos(AZIMUTH) + y * np.sin(AZIMUTH)
        right = -x * np.sin(AZIMUTH) + y * np.cos(AZIMUTH)
        up = z * np.cos(ELEVATION) - depth * np.sin(ELEVATION)
        return np.stack([right, up], axis=1), length

    def draw(self, axes: Any, k: int, view: _View) -> None:
        from matplotlib.patches import Circle

        path = np.array([p[k] for p in self.points])
        if self.kind in ("line", "path"):
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

    def _arrow(self, axes: Any, at: Array, force: Array, size: float, view: _View) -> None:
        tip = at + force * LONGEST * view.size / view.strongest
        if not np.isfinite(tip).all() or np.hypot(*(tip - at)) < 0.004 * view.size:
            return
        style = {"arrowstyle": "-|>", "color": FORCE, "lw": 2, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", tip, at, arrowprops=style, annotation_clip=False)
        axes.annotate(f" {self.shape['name']} {size:.3g} N", tip, color=FORCE, fontsize=8)


def _hung(a: Array, b: Array, sag: Array, part: Array) -> Array:
    """(points, dimensions, frames): from a to b, the last dimension lowered by `sag` in the middle."""
    points: Array = a + part * (b - a)
    points[:, -1] -= 4 * sag * part[:, 0] * (1 - part[:, 0])
    return points


def _with(look: Callable[[str], Any], name: str, value: Any) -> Callable[[str], Any]:
    """The same look-up, with one name of its own."""
    return lambda n: value if n == name else look(n)


class _View:
    """What is seen: all points of all frames, and the largest force but for spikes."""

    def __init__(self, shapes: list[_Moving]) -> None:
        reach = []
        for s in shapes:
            r = 0 if s.radius is None else np.abs(s.radius)[:, None]
            reach += [side for p in s.points for side in (p - r, p + r)]
        points = np.concatenate(reach)
        points = points[np.isfinite(points).all(axis=1)]
        low, high = points.min(axis=0), points.max(axis=0)
        self.size = float(max(*(high - low), 1e-9))
        middle, half = (low + high) / 2, np.maximum((high - low) / 2, 0.2 * self.size)
        self.low, self.high = middle - half - 0.16 * self.size, middle + half + 0.16 * self.size
        sizes = [np.asarray(s.length) for s in shapes if s.force is not None]
        found = np.concatenate(sizes) if sizes else np.ones(1)
        found = found[np.isfinite(found) & (found > 0)]
        self.strongest = float(np.quantile(found, 0.98)) if found.size else 1.0

    def set(self, axes: Any) -> None:
        axes.set_xlim(self.low[0], self.high[0])
        axes.set_ylim(self.low[1], self.high[1])
        axes.set_aspect("equal")
        axes.set_axis_off()


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
