"""The small work-precision figure in an FMU's documentation: every option, and the one chosen."""

from __future__ import annotations

import io
from typing import Any

import numpy as np

from .choose import Choice
from .figure import COLOURS, FAR, method_handles, time_unit
from .figure import curve as curve_of

LINES = {"multipliers": "-", "nullspace": "--", "minimal": ":"}


def curve(choice: Choice) -> str:
    """An <svg> element."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    from ...verification.figure import STYLE

    measured = choice.survey
    factor, unit = time_unit((o.row for o in measured.options), measured.simulated)
    with plt.rc_context(STYLE | {"hatch.linewidth": 0.4, "svg.fonttype": "none", "font.size": 9}):
        figure, axis = plt.subplots(figsize=(6.6, 3.3), layout="constrained")
        axis.set_xscale("log")
        axis.set_yscale("log")
        for method in COLOURS:
            for formulation, line in LINES.items():
                own = [
                    o
                    for o in measured.options
                    if (o.row.setting.method, o.formulation) == (method, formulation)
                    and np.isfinite(o.error)
                ]
                curve_of(axis, [o.error for o in own], [o.row for o in own], factor, line)
        chosen = choice.option
        place = (chosen.error, factor * chosen.row.median)
        axis.plot(*place, "*", markersize=17, markerfacecolor="#f2c200", markeredgecolor="#222222")
        allowed = choice.goal.on_the_scene
        axis.axvline(allowed, color="#444444", linewidth=1)
        if _near(choice):
            axis.axhline(factor * measured.floor, color="#777777", linewidth=1.2, linestyle=":")
        axis.annotate(
            "asked, with margin ",
            (allowed, 1),
            xycoords=("data", "axes fraction"),
            ha="right",
            va="top",
            fontsize=8,
        )
        axis.set_xlabel("largest relative error on the scene")
        axis.set_ylabel(f"wall time per simulated second in {unit}")
        axis.invert_xaxis()
        figure.legend(
            handles=_legend(choice), loc="outside right center", frameon=False, fontsize=8
        )
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
        plt.close(figure)
    svg = text.getvalue()
    return svg[svg.index("<svg") :].replace(
        "<svg ", '<svg role="img" aria-label="wall time over error of each setting" ', 1
    )


def _near(choice: Choice) -> bool:
    measured = choice.survey
    return min(o.row.median for o in measured.options) < FAR * measured.floor


def _legend(choice: Choice) -> list[Any]:
    from matplotlib.lines import Line2D

    options = choice.survey.options
    methods = {o.row.setting.method for o in options}
    found = {o.formulation for o in options}
    handles = method_handles(methods, _near(choice))
    handles += [
        Line2D([], [], color="#333333", linestyle=line, label=f)
        for f, line in LINES.items()
        if f in found and len(found) > 1
    ]
    handles.append(
        Line2D(
            [],
            [],
            linewidth=0,
            marker="*",
            markersize=13,
            markerfacecolor="#f2c200",
            markeredgecolor="#222222",
            label="chosen",
        )
    )
    return handles
