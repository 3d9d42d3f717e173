"""The figures of a report as SVG: the mechanism, curves, what a verification missed."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any

from markupsafe import Markup

from ... import names
from ...verification.check import Check
from ...verification.plot import COLOURS, figure_of
from ..live.facts import facts
from ..live.stage import sketch
from .findings import Findings
from .tables import forces

MOST = 12  # curves of one figure
FEW = 20  # points that are marked
QUIET = "#5b6570"


def svg(figure: Any, title: str) -> Markup:
    """A figure inline; what reads the page aloud says `title`."""
    import matplotlib as mpl

    text = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": title, "svg.fonttype": "none"}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    drawn = text.getvalue()[text.getvalue().index("<svg") :]
    drawn = re.sub(r'(<svg[^>]*?) width="[^"]*" height="[^"]*"', r"\1", drawn, count=1)
    width = figure.get_figwidth() * 96
    label = Markup.escape(title)
    return (
        Markup(f'<figure style="max-width:{width:.0f}px" role="img" aria-label="{label}">')
        + Markup(_own_names(drawn, title))
        + Markup("</figure>")
    )


def _own_names(drawn: str, title: str) -> str:
    """Identifiers that no other figure of the page has: matplotlib calls groups alike in each."""
    mark = re.sub(r"\W", "", title)
    drawn = re.sub(r'\bid="([^"]+)"', rf'id="{mark}-\1"', drawn)
    drawn = re.sub(r'(xlink:href="#|href="#)', rf"\g<1>{mark}-", drawn)
    return drawn.replace("url(#", f"url(#{mark}-")


def mechanism(found: Findings) -> Markup | None:
    """The model's picture where the run begins; None without one."""
    if found.told.picture is None:
        return None
    known = facts(found.told.description, found.told.picture, found.told.preset)["variables"]
    starts = {v["name"]: v["start"] for v in known} | dict(found.given)
    return svg(sketch(found.told.picture, found.run, starts), "The mechanism at its start")


def curves(found: Findings) -> list[tuple[str, Markup]]:
    """Forces, and the motion, along the run with its events."""
    known = list(found.run.dtype.names or ())
    preset = [n for n in (found.told.preset or {}).get("curves", ()) if n in known]
    held, own, drawn = forces(found), names.of_interest(known), []
    for title, push in (("Forces of constraint", True), ("Motion", False)):
        told = ([n for n in of if (n in held) == push] for of in (preset, own))
        if chosen := next(filter(None, told), held if push else []):
            figure = figure_of(found.run, found.units, chosen[:MOST])
            drawn.append((title, svg(figure, title)))
    return drawn


def misses(checks: Sequence[Check]) -> list[tuple[str, Markup]]:
    """Of each statement that fails: what was found, and what was expected."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    from ...verification.figure import STYLE

    drawn = []
    for k, check in enumerate(checks):
        if check.missed is None:
            continue
        with mpl.rc_context(STYLE | {"font.size": 10}):
            figure = Figure(figsize=(7.0, 2.4), layout="constrained")
            panel = figure.subplots()
            time, actual, expected = check.missed.time, check.missed.actual, check.missed.expected
            mark = "." if len(time) < FEW else ""
            panel.plot(time, expected, color=QUIET, lw=3, alpha=0.4, label="expected", marker=mark)
            panel.plot(time, actual, color=COLOURS[6], lw=1.4, label="found", marker=mark)
            panel.set_xlabel("time [s]")
            panel.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.01, 1.0))
            drawn.append((check.name, svg(figure, f"missed {k}")))
    return drawn
