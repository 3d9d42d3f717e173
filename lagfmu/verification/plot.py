"""A picture of a simulation: multipliers on top, the motion below, events marked.

Figures of matplotlib, here and elsewhere, are without pyplot and whatever the backend.
"""

from __future__ import annotations

import contextlib
import io
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from .. import names
from ..errors import SettingError, UsageError
from ..files import write_whole
from ..fmu.read import Trajectory
from ..model.units import for_reading
from ..names import of_interest

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


COLOURS = (
    *("#0b6e99", "#d9730d", "#0f7b6c", "#ad1a72"),
    *("#6940a5", "#8a6d00", "#c0392b", "#5b6570"),
)
DASHES = ("-", (0, (5, 2)), (0, (1.5, 1.5)), (0, (6, 2, 1.5, 2)))  # four curves each
SAID = {  # what is free from then on, dashed; what is held, dotted
    names.DEPARTURES: ("leaves {}", "--"),
    names.SLIPS: ("{} slips", "--"),
    names.CLOSINGS: ("meets {}", ":"),
    names.STICKINGS: ("{} sticks", ":"),
}
TIMES = {count: time for time, count in names.COUNT_OF.items()}
LETTER = 0.075  # in, the width of one in the name of an event
PER_COLUMN = 8  # curves in one column of a legend, which stands beside its panel


def plot(
    result: Trajectory,
    units: Mapping[str, str],
    out: str | os.PathLike[str],
    names: Sequence[str] = (),
    title: str = "",
) -> Path:
    """Write a figure (the ending of `out` says the format), one panel a unit.

    Raises SettingError if a name is unknown or the file cannot be written.
    """

    chosen = _chosen(result, names)
    with panels(result, units, chosen) as (figure, _):
        if title:
            figure.suptitle(plain(title), fontsize=12)
        return save(figure, Path(out))


def figure_of(
    result: Trajectory, units: Mapping[str, str], names: Sequence[str] = (), title: str = ""
) -> Any:
    """The same as a matplotlib Figure.  Raises SettingError if a name is unknown."""

    with panels(result, units, _chosen(result, names)) as (figure, _):
        if title:
            figure.suptitle(plain(title), fontsize=12)
    return figure


def _chosen(result: Trajectory, names: Sequence[str]) -> list[str]:
    known = list(result.dtype.names or ())
    chosen = list(names) or of_interest(known)
    unknown = [n for n in chosen if n not in known]
    if unknown or not chosen:
        raise SettingError(
            f"cannot plot {', '.join(unknown) or 'nothing'}: expected names among {', '.join(known)}"
        )
    return chosen


@contextlib.contextmanager
def panels(
    result: Trajectory, units: Mapping[str, str], chosen: Sequence[str]
) -> Iterator[tuple[Any, list[Any]]]:
    """The figure and its panels, one a unit, multipliers first, while the style of it holds."""
    import matplotlib as mpl

    known = list(result.dtype.names or ())
    members_of: dict[tuple[bool, str, str], list[str]] = {}
    for n in chosen:
        later = names.read(n).quantity != names.MULTIPLIER
        members_of.setdefault((later, units.get(n, ""), _counts(result[n])), []).append(n)
    with mpl.rc_context(STYLE | {"font.size": 11}):
        figure = Drawn(figsize=(7.5, 1.2 + 2.1 * len(members_of)), layout="constrained")
        axes = figure.subplots(len(members_of), 1, sharex=True, squeeze=False)
        for axis, ((_, unit, counts), members) in zip(axes[:, 0], members_of.items(), strict=True):
            for k, n in enumerate(members):
                colour = COLOURS[k % len(COLOURS)]
                axis.plot(
                    result["time"],
                    _told(result, n),
                    color=colour,
                    linestyle=DASHES[k // 4 % len(DASHES)],
                    drawstyle="steps-post" if counts else "default",
                    label=plain(_label(result, n)),
                    linewidth=1.8,
                )
                _band(axis, result, n, colour)
            axis.set_ylabel(plain(f"[{for_reading(unit)}]") if for_reading(unit) else "")
            axis.margins(x=0)
            _whole_ticks(axis, counts)
            _mark_events(axis, result, known, figure if axis is axes[0, 0] else None)
            axis.legend(
                frameon=False,
                loc="upper left",
                bbox_to_anchor=(1.01, 1.0),
                fontsize=10,
                borderaxespad=0.0,
                ncols=1 + (len(members) - 1) // PER_COLUMN,
            )
        axes[-1, 0].set_xlabel("time [s]")
        yield figure, list(axes[:, 0])


def _told(result: Trajectory, name: str) -> Any:
    """A column; of a derivative along the run as long as there is one."""
    values = result[name].astype(float)
    if names.varied(name) and names.SENSITIVITY_VALID in (result.dtype.names or ()):
        values[result[names.SENSITIVITY_VALID] == 0] = np.nan
    return values


def _counts(column: Any) -> str:
    """Whether a column is of truths, of counts, or (empty) of a quantity that may take any value."""
    return {"b": "truths", "i": "counts", "u": "counts"}.get(column.dtype.kind, "")


def _whole_ticks(axis: Any, counts: str) -> None:
    """Truths stand at no and yes, counts at whole numbers."""
    from matplotlib.ticker import MaxNLocator

    if counts == "truths":
        axis.set_yticks([0, 1], ["no", "yes"])
        axis.set_ylim(-0.15, 1.15)
    elif counts:
        axis.yaxis.set_major_locator(MaxNLocator(nbins=6, integer=True))


def _label(result: Trajectory, name: str) -> str:
    """A curve's name; below it its largest bar, which as a band may be thinner than the line."""
    if names.bar(name) not in (result.dtype.names or ()):
        return name
    bar = result[names.bar(name)]
    known = bar[bar < np.finfo(float).max]
    return f"{name}\n± {known.max():.1g}" if len(known) else name


def _band(axis: Any, result: Trajectory, name: str, colour: str) -> None:
    """The error bars of a curve as a band about it; where they are infinite, hatched from bottom to top."""
    if names.bar(name) not in (result.dtype.names or ()):
        return
    time, value, bar = result["time"], result[name], result[names.bar(name)]
    known = bar < np.finfo(float).max
    bar = np.where(known, bar, 0.0)
    axis.fill_between(
        time, value - bar, value + bar, where=known, color=colour, alpha=0.25, linewidth=0
    )
    if not known.all():
        axis.fill_between(
            time,
            0,
            1,
            where=~known,
            transform=axis.get_xaxis_transform(),
            facecolor="none",
            edgecolor=colour,
            alpha=0.3,
            hatch="//",
            linewidth=0,
        )


def moments(result: Trajectory, events: str, of: str) -> list[float]:
    """The times [s] of the events of a contact or a friction that the run tells: of several within one
    communication step the latest."""
    count, when = names.name(events, of), names.name(TIMES[events], of)
    if when not in (result.dtype.names or ()):
        return []
    told = np.diff(result[count].astype(float), prepend=0.0) > 0
    return [float(x) for x in result[when][told]]


def _mark_events(axis: Any, result: Trajectory, known: Sequence[str], figure: Any) -> None:
    """A line at each event; with `figure` the first of each kind is named, above the panel, in rows
    so that no name lies over another."""

    start, end = result["time"][0], result["time"][-1]
    named = []
    for events, (words, style) in SAID.items():
        for of in names.constraints(known, events):
            found = moments(result, events, of)
            for moment in found:
                axis.axvline(moment, color="#888888", linewidth=1, linestyle=style)
            if found:
                named.append((found[0], words.format(of)))
    if figure is None:
        return
    # s, of one letter; a legend has the rest
    wide = (end - start) * LETTER / (0.62 * figure.get_figwidth())
    taken: list[float] = []  # where each row is free from
    for moment, text in sorted(named):
        width = wide * len(text)
        late = moment + width > end
        left = moment - width if late else moment
        row = next((k for k, free in enumerate(taken) if free <= left), len(taken))
        taken[row : row + 1] = [left + width + wide]
        axis.annotate(
            plain(text),
            (moment, 1.0),
            (0, 3 + 11 * row),
            xycoords=("data", "axes fraction"),
            textcoords="offset points",
            ha="right" if late else "left",
            va="bottom",
            fontsize=9,
            color="#555555",
        )
