"""A run as a film: the mechanism of the model's picture, forces of constraint as arrows, a curve beside.

A .gif, .webp or .mp4 file is drawn here; a .html file is the live page with the run in it
(live/play.py).
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import BuildError, UsageError
from ..files import write_whole
from ..fmu.read import Trajectory
from .live.page import render
from .live.play import Told, recorded
from .live.view import FORCE, INK, Stage, View

RATE, MOST = 25, 300  # frames per second, and of a film
ENDINGS = (".gif", ".mp4", ".html", ".webp")
CURVE = "#6940a5"
TITLE, BESIDE = 0.42, 3.0  # in: the height of the title, the width of the curve
SMALL_RATE, SMALL_MOST, SMALL_WIDTH = 12, 48, 2.4  # of a thumbnail; in


def film(told: Told, run: Trajectory, given: Mapping[str, Any], out: Path, title: str) -> Path:
    """Write the film of a run, in its own time if it is no longer than 12 s, else faster.

    Without a `title` it is a thumbnail: small, the mechanism alone, 4 s at most.
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
    facts = recorded(told, run, given).facts
    known = {v["name"]: v["start"] for v in facts["variables"]}
    _draw(told.picture, run, known, out, title, _curve(facts) if title else None)
    return out


def _curve(facts: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """The variable beside the picture: the first curve of the model's page, else the first lambda."""
    columns = [v for v in facts["variables"] if v["column"] and v["type"] == "Real"]
    chosen = facts["preset"]["curves"]
    first = [v for v in columns if v["name"] in chosen[:1]]
    return next(
        iter(first or [v for v in columns if v["group"].startswith("Multipliers")] or columns), None
    )


def _draw(
    picture: Mapping[str, Any],
    run: Trajectory,
    known: Mapping[str, Any],
    out: Path,
    title: str,
    curve: Mapping[str, Any] | None,
) -> None:
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    end = float(run["time"][-1])
    rate, most = (RATE, MOST) if title else (SMALL_RATE, SMALL_MOST)
    count = int(min(max(np.ceil(end * rate), 2), most))
    times = np.linspace(0.0, end, count + 1)
    stage = Stage(picture, run, known, times, labels=bool(title))
    figure, axes, marks = _panels(stage.view, run, curve, bool(title))
    FigureCanvasAgg(figure)
    speed = end * rate / count
    note = "" if abs(speed - 1) < 0.05 or not title else f", {speed:.3g} times as fast"
    head = figure.text(0.02, 0.985, "", fontsize=11, color=INK, va="top")
    frames = _writer(out, rate)

    def film(place: Path) -> None:
        with (
            matplotlib.rc_context({"savefig.facecolor": "white"}),
            frames.saving(figure, str(place), dpi=100),
        ):
            for k, t in enumerate(times):
                stage.draw(axes, k)
                if title:
                    head.set_text(f"{title}, t = {t:.2f} s{note}")
                if curve is not None and marks is not None:
                    value = float(stage.look(curve["name"])[k])
                    marks[0].set_data([t], [value])
                    marks[1].set_text(f"{curve['name']} = {value:.4g} {curve['unit']}")
                frames.grab_frame()

    write_whole(out, film)


def _panels(
    view: View, run: Trajectory, curve: Mapping[str, Any] | None, titled: bool
) -> tuple[Any, Any, Any]:
    """The figure, its panel for the mechanism, cut to what is seen of it, and the curve's marks of now."""
    from matplotlib.figure import Figure

    wide, high = (5.0, 4.4) if titled else (SMALL_WIDTH, SMALL_WIDTH)
    across = min(wide, max(high / view.aspect, 0.4 * wide))
    up = min(high, max(across * view.aspect, 0.34 * wide))
    beside, above = (BESIDE if curve is not None else 0.0), (TITLE if titled else 0.0)
    width, height = (2 * round(50 * x) / 100 for x in (across + beside, up + above))  # even pixels
    figure = Figure(figsize=(width, height), dpi=100)
    axes = figure.add_axes((0, 0, across / width, up / height))
    if curve is None:
        return figure, axes, None
    tall = min(up, 2.6)
    low = (up - tall) / 2
    panel = figure.add_axes(
        (
            (across + 0.62) / width,
            (low + 0.42) / height,
            (beside - 0.8) / width,
            (tall - 0.75) / height,
        )
    )
    panel.plot(run["time"], run[curve["name"]], color=CURVE, lw=1.4)
    panel.margins(x=0)
    panel.tick_params(labelsize=8, colors=INK)
    panel.set_xlabel("time [s]", fontsize=8, color=INK)
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(alpha=0.25)
    (dot,) = panel.plot([], [], "o", color=FORCE, ms=6, clip_on=False)
    return figure, axes, (dot, panel.set_title("", fontsize=9, color=INK, loc="left"))


def _writer(out: Path, rate: int) -> Any:
    import matplotlib
    from matplotlib.animation import FFMpegWriter, PillowWriter

    if out.suffix.lower() != ".mp4":
        return PillowWriter(fps=rate)
    matplotlib.rcParams["animation.ffmpeg_path"] = _ffmpeg()
    return FFMpegWriter(fps=rate, codec="libx264", extra_args=["-pix_fmt", "yuv420p"])


def _ffmpeg() -> str:
    """The program that writes .mp4: on the path, or from PyPI's imageio-ffmpeg."""
    found = shutil.which("ffmpeg")
    if found is None:
        try:
            import imageio_ffmpeg

            found = str(imageio_ffmpeg.get_ffmpeg_exe())
        except (ImportError, RuntimeError):
            raise BuildError(
                "an .mp4 film needs ffmpeg, which was not found: pip install imageio-ffmpeg, or write a "
                ".gif or .html"
            ) from None
    return found
