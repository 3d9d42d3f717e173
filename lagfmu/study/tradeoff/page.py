"""The section of an FMU's documentation page that says how its solver settings were chosen."""

from __future__ import annotations

from markupsafe import Markup

from ...model.goal import HELD_OUT_MARGIN, MARGIN
from ...page.template import template
from .choose import Choice
from .curve import curve
from .report import digits
from .survey import Option


def section(choice: Choice) -> str:
    """HTML: what was asked, chosen and why, the held-out cases, the measured curve."""
    measured, goal = choice.survey, choice.goal
    scale = 1e3 / measured.simulated
    return template("page/choice.html.j2").render(
        goal=goal,
        choice=choice,
        option=choice.option,
        scene=choice.scene,
        measured=measured,
        margin=f"{MARGIN:g}",
        held_out_margin=f"{HELD_OUT_MARGIN:g}",
        floor=digits(scale * measured.floor),
        rows=[_row(choice, o, scale) for o in measured.options],
        cases=[
            (
                ", ".join(f"{n} = {v:.4g}" for n, v in case.values.items()),
                f"{case.error(measured.names):.1e}",
                case.steps,
            )
            for case in choice.cases
        ],
        references=[
            (
                n,
                measured.reference.source[n],
                f"{measured.reference.own[n]:.0e}",
                f"{measured.reference.scale[n]:.3g}",
            )
            for n in measured.names
        ],
        failed=[(str(o), f"{o.error:.1e}", f"{e:.1e}") for o, e in choice.failed],
        figure=Markup(curve(choice)),
    )


def _row(choice: Choice, option: Option, scale: float) -> tuple[str, ...]:
    row = option.row
    low, high = row.quartiles
    holds = option.error <= choice.goal.on_the_scene
    return (
        option.formulation,
        row.setting.method,
        row.setting.dial,
        f"{option.error:.1e}",
        str(row.steps),
        digits(scale * row.median),
        f"{digits(scale * low)}–{digits(scale * high)}",
        "chosen" if option == choice.option else "holds" if holds else "",
    )
