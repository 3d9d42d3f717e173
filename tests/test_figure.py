"""Figures of a run (lagfmu simulate --plot), and that of the first page, which is one of them."""

from __future__ import annotations

import itertools
import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import model_file
from lxml import etree
from typer.testing import CliRunner

import lagfmu
from lagfmu import Result
from lagfmu.testing import COLOURS, app, figure_of

REPOSITORY = Path(__file__).parent.parent
PAGE = (REPOSITORY / "docs" / "index.md").read_text(encoding="utf-8")
SVG = "{http://www.w3.org/2000/svg}"


def numbers(path: Any) -> Any:
    """The points of a path (n, 2), in the picture's own unit."""
    return np.array([float(x) for x in re.findall(r"-?[\d.]+", path.get("d"))]).reshape(-1, 2)


def scale(axes: Any, axis: str) -> Any:
    """From the picture's unit to the axis's: through its first and last tick and their numbers."""
    ticks = []
    for tick in axes.iter(f"{SVG}g"):
        if re.match(f"{axis}tick_", tick.get("id", "")):
            line = numbers(next(tick.iter(f"{SVG}path")))
            told = [c.text.strip().replace("−", "-") for c in tick.iter(etree.Comment)]
            ticks += [(line[0, 0 if axis == "x" else 1], float(text)) for text in told]
    (a, low), (b, high) = ticks[0], ticks[-1]
    return lambda place: low + (place - a) * (high - low) / (b - a)


def read(path: Path) -> tuple[list[str], list[Any]]:
    """The texts of a figure, and its curves (n, 2) of time [s] and value, a panel after the other."""
    root = etree.parse(str(path)).getroot()
    panels = [g for g in root.iter(f"{SVG}g") if g.get("id", "").startswith("axes_")]
    time = scale(panels[-1], "x")  # the panels share it
    curves = []
    for axes in panels:
        value = scale(axes, "y")
        for line in axes.findall(f"{SVG}g"):
            drawn = line.find(f"{SVG}path")
            if line.get("id", "").startswith("line2d") and COLOURS[0] in drawn.get("style"):
                x, y = numbers(drawn).T
                curves.append(np.stack([time(x), value(y)], axis=1))
    return sorted(c.text.strip() for c in root.iter(etree.Comment)), curves


def test_the_figure_of_the_first_page_is_drawn_by_its_command(tmp_path: Path) -> None:
    """What the command beside it draws today: the same texts, both curves to a hundredth of their range; and
    lambda = m g (3 cos theta - 2 cos theta0) until it is 0."""
    told = re.search(r"`lagfmu (simulate [^`]* --plot (\S+) [^`]*)`", PAGE)
    assert told is not None
    out = tmp_path / "anew.svg"
    words = [str(REPOSITORY / w) if w.startswith("models/") else w for w in shlex.split(told[1])]
    done = CliRunner().invoke(app, [str(out) if w == told[2] else w for w in words])
    assert done.exit_code == 0, done.output
    texts, curves = read(REPOSITORY / told[2])
    texts_anew, anew = read(out)
    assert texts == texts_anew
    assert {"lambda.surface", "theta", "leaves surface", "time [s]", "[N]", "[rad]"} <= set(texts)
    assert len(curves) == len(anew) == 2
    instants = np.linspace(0.0, 2.0, 201)
    force, angle = (np.interp(instants, *c.T) for c in curves)
    for found, again in zip((force, angle), anew, strict=True):
        assert np.interp(instants, *again.T) == pytest.approx(found, abs=0.01 * np.ptp(found))
    expected = 9.81 * (3 * np.cos(angle) - 2 * np.cos(0.01))
    before = instants < 1.6
    assert force[before] == pytest.approx(expected[before], abs=0.15)
    assert force[instants > 1.66] == pytest.approx(0.0, abs=0.05)


def test_truths_and_counts_are_steps() -> None:
    """Whether the block on the belt sticks is no or yes, how often it has slipped a whole number: no line
    leads through values between, and each has a panel of its own beside quantities without a unit."""
    run = lagfmu.simulate(model_file("belt").model, 3.0, 0.01)
    counts, truths = run.plot("slipping.grip.count", "sticks.grip").axes
    for axes in (counts, truths):
        assert {line.get_drawstyle() for line in axes.lines[:1]} == {"steps-post"}
    assert [t.get_text() for t in truths.get_yticklabels()] == ["no", "yes"]
    assert all(tick == round(tick) for tick in counts.get_yticks())
    assert len(counts.get_yticks()) > 3


def test_eight_curves_are_told_apart() -> None:
    """Each has a colour of its own, and on paper without colours half of them are dashed."""
    table = np.zeros(5, dtype=[("time", float), *((f"x{k}", float) for k in range(8))])
    table["time"] = np.arange(5)
    (axes,) = figure_of(Result(table, {}, "Eight", "native"), {}, [f"x{k}" for k in range(8)]).axes
    colours = [line.get_color() for line in axes.lines]
    assert len(set(colours)) == 8
    rgb = np.array([[int(c[i : i + 2], 16) for i in (1, 3, 5)] for c in colours])
    assert min(np.abs(a - b).sum() for a, b in itertools.combinations(rgb, 2)) > 60
    assert sum(line.is_dashed() for line in axes.lines) == 4


def test_the_names_of_events_stand_above_the_curves() -> None:
    """A wheel that leaves, another that does so 1 ms later, and one at the end: all names are there, above
    the panel, and none lies over another or beyond the figure."""
    fields = [("time", float), ("lambda.a", float)]
    for of in "abc":
        fields += [(f"departure.wheel_{of}.count", int), (f"departure.wheel_{of}.time", float)]
    table = np.zeros(101, dtype=fields)
    table["time"] = np.linspace(0.0, 1.0, 101)
    for of, moment in (("a", 0.3), ("b", 0.301), ("c", 0.995)):
        table[f"departure.wheel_{of}.count"] = table["time"] >= moment
        table[f"departure.wheel_{of}.time"] = moment
    figure = figure_of(Result(table, {}, "Wheels", "native"), {}, ["lambda.a"], title="Wheels")
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure).draw()
    (axes,) = figure.axes
    boxes = [t.get_window_extent() for t in axes.texts]
    assert len(boxes) == 3
    assert all(b.y0 >= axes.get_window_extent().y1 for b in boxes)
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))
    assert all(figure.bbox.x0 <= b.x0 and b.x1 <= figure.bbox.x1 for b in boxes)
