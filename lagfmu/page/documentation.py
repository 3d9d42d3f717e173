"""The page documentation/index.html inside an FMU: equations, variables, units, how to use it.

One HTML file that needs nothing else: mathematics as MathML, styles inside.  The same model gives the
same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from latex2mathml.converter import convert
from markupsafe import Markup

from .. import names
from ..interface.variables import Variable, VariableTable
from ..model.model import Contact, Holonomic, Nonholonomic
from ..model.units import Unit, for_reading
from ..numeric.start_priority import OMITTED
from ..prepare.prepare import Prepared
from .groups import heading
from .savings import savings
from .template import template
from .typeset import typeset

MEANING = {
    "multipliers": "Lagrange's equations and the constraints, differentiated to accelerations, are "
    "solved together for the accelerations and the multipliers λ (the KKT system).",
    "nullspace": "λ is eliminated: Lagrange's equations are projected onto the motions that the "
    "constraints allow, and λ is evaluated from the state afterwards.",
    "minimal": "Dependent coordinates are eliminated: only the independent ones are integrated, the "
    "constraints hold by construction, and λ is recovered from the full equations at each state.",
}
LINK, FIGURES = "<!-- link to the figures -->", "<!-- figures of a verification -->"
KINDS = {Holonomic: "holonomic", Nonholonomic: "nonholonomic (Pfaffian)", Contact: "contact"}
REMARKS = {
    "Parameters": "Set them before initialization.",
    "Inputs": "Set them between communication steps.",
    "Outputs": "Those of the model's own: what they are made of stands among the equations.",
}
# what MathML knows of a bracket: at the ends of its row it is a fence, which stretches
BRACKET = re.compile(r'<mo fence="true" form="\w+" stretchy="true">([()\[\]])</mo>')
AFTER_FACTOR = re.compile(r"(?<=[\w})]) (?=\\(?:a?(?:sin|cos|tan)h?|log|exp|operatorname)\b)")


def page(
    prepared: Prepared,
    choice: str = "",
    live: bool = False,
) -> str:
    """The HTML page of an FMU.

    `choice` is the section on how its solver settings were chosen, in HTML (tradeoff/page.py).  `live`:
    the page in which the FMU runs stands beside it.
    """
    model, structure, table = prepared.model, prepared.structure, prepared.table
    acting, whole = prepared.equations.constraints, prepared.whole
    sections = typeset(prepared.form)
    return template("page/documentation.html.j2").render(
        link=Markup(LINK),
        figures=Markup(FIGURES),
        name=prepared.scene.name,
        live=live,
        model=model,
        scene=prepared.scene,
        meaning=MEANING[prepared.formulation],
        sections=[
            (s.title, s.remark, [(e.label, mathml(e.latex), e.text) for e in s.equations])
            for s in sections
        ],
        structure=structure,
        constraints=[
            (
                c.name,
                next(words for kind, words in KINDS.items() if isinstance(c, kind)),
                c.description,
                c.while_closed if not isinstance(c, Contact) else None,
                shown(whole[names.name(names.MULTIPLIER, c.name)].unit),
            )
            for c in acting
        ],
        contacts=[c for c in acting if isinstance(c, Contact)],
        told={(v.of.quantity, v.of.constraint) for v in table.variables},
        moved=[
            (
                m.name,
                "left out" if m.priority == OMITTED else f"{m.given:.10g}",
                f"{m.used:.10g}",
                shown(whole[m.name].unit),
            )
            for m in structure.start.moved
        ],
        groups=_grouped(table),
        inputs=[v.name for v in table.variables if v.causality == "input"],
        prescribed=bool(prepared.system.prescribed),
        tolerance=f"{prepared.scene.tolerance:g}",
        saved=savings(prepared),
        choice=Markup(choice),
    )


def mathml(latex: str) -> Markup:
    """An equation as the browser shows it."""
    latex = re.sub(r"\\mathrm{([^{}]*)}", lambda m: f"\\text{{{m[1]}}}".replace("\\_", "_"), latex)
    formula = convert(AFTER_FACTOR.sub(r" \\, ", latex), display="block")
    return Markup(BRACKET.sub(r"<mo>\1</mo>", formula))


def shown(unit: Unit | None) -> str:
    """A unit for reading: kg·m² for kg.m2; nothing for a plain number."""
    return for_reading(None if unit is None else unit.name)


def as_given(v: Variable) -> str:
    """' (200 g)' behind a start value of 0.2 kg that the model gives in grams; nothing for another."""
    if v.display is None or not isinstance(v.start, float):
        return ""
    return f" ({v.display.from_si(v.start):.15g} {v.display.name})"


def _grouped(table: VariableTable) -> list[tuple[str, str, list[tuple[Variable, str, str]]]]:
    """Of each heading what it says besides, and its variables with unit and start."""
    rows: dict[str, list[tuple[Variable, str, str]]] = {}
    for v in table.variables:
        start = "" if v.start is None else f"{v.start}{as_given(v)}"
        title = heading(v.name, v.role, table.position)
        rows.setdefault(title, []).append((v, shown(v.unit), start))
    return [(title, REMARKS.get(title, ""), of) for title, of in rows.items()]


def with_figures(text: str, figures: Sequence[tuple[str, ...]], references: str = "") -> str:
    """The page with rows (closed form, largest error, allowed, points, verdict) of a verification in their
    place, and a link to the file beside it that tells of reference results."""
    link = '<li><a href="#verification">Verification</a></li>'
    found = template("page/verification.html.j2").render(figures=figures, references=references)
    return text.replace(LINK, link).replace(FIGURES, found.rstrip())
