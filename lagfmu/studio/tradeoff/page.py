"""The section of an FMU's documentation page that says how its tolerance was chosen."""

from __future__ import annotations

from ...model.goal import HELD_OUT_MARGIN, MARGIN
from ...page.template import template
from .choose import Choice


def section(choice: Choice) -> str:
    """HTML: what was asked, what was chosen, the trials, the held-out cases."""
    return template("page/choice.html.j2").render(
        goal=choice.goal,
        choice=choice,
        reference=choice.reference,
        margin=f"{MARGIN:g}",
        held_out_margin=f"{HELD_OUT_MARGIN:g}",
        values=[
            ", ".join(f"{n} = {v:.4g}" for n, v in case.values.items()) for case, _ in choice.cases
        ],
    )
