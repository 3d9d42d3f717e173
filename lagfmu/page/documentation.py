"""The page documentation/index.html inside an FMU: equations, variables, units, how to use it.

One HTML file that needs nothing else: mathematics as MathML, styles inside.  The same model gives the
same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from latex2mathml.converter import convert
from markupsafe import Markup

from .. import names
from ..interface.further import INTERFACE
from ..interface.variables import Variable
from ..model.model import Contact, Holonomic, Nonholonomic
from ..model.units import Unit, for_reading
from ..numeric.start_priority import OMITTED
from ..prepare.prepare import Prepared
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
GROUPS = (
    ("Parameters", "Set them before initialization."),
    ("Inputs", "Set them between communication steps."),
    ("Motion", "Coordinates, velocities and accelerations."),
    ("Multipliers and constraints", "Residuals are zero up to rounding while a constraint acts."),
    (
        "Generalized forces of constraint",
        "Q of a coordinate is the sum of the constraints' shares.",
    ),
    ("Energies", ""),
    ("Outputs of the model", "What they are made of stands among the equations."),
    ("Contacts", ""),
    ("Extremes", "Of the continuous motion so far, between communication points too."),
    ("Friction", "Sticking, slip velocities, and what is left before a contact slips."),
    ("Solver", "Method, accuracy, and what was done."),
    ("Of FMI 3.0 alone", "Time, event indicators, residuals, clocks and arrays."),
)
# what MathML knows of a bracket: at the ends of its row it is a fence, which stretches
BRACKET = re.compile(r'<mo fence="true" form="\w+" stretchy="true">([()\[\]])</mo>')
AFTER_FACTOR = re.compile(r"(?<=[\w})]) (?=\\(?:a?(?:sin|cos|tan)h?|log|exp|operatorname)\b)")
TITLES = {  # by the kind of what a variable is of
    "energy": "Energies",
    "solver": "Solver",
    names.OWN: "Outputs of the model",
    names.PEAK: "Extremes",
    names.FORCE: "Generalized forces of constraint",
    **dict.fromkeys((names.CONTACT, names.DEPARTURE, names.CLOSING), "Contacts"),
    **dict.fromkeys(
        (names.MULTIPLIER, names.RESIDUAL, names.UNIQUE), "Multipliers and constraints"
    ),
    **dict.fromkeys(names.OF_FRICTION, "Friction"),
}


@dataclass(frozen=True)
class Line:
    """One line of the variable table."""

    name: str
    causality: str
    kind: str
    unit: str
    start: str
    description: str


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
        groups=_grouped(table.variables),
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


def _grouped(variables: Sequence[Variable]) -> list[tuple[str, str, list[Line]]]:
    rows: dict[str, list[Line]] = {title: [] for title, _ in GROUPS}
    for v in variables:
        start = "" if v.start is None else f"{v.start}{as_given(v)}"
        row = Line(v.name, v.causality, v.kind, shown(v.unit), start, v.description)
        rows[_group(v)].append(row)
    return [(title, remark, rows[title]) for title, remark in GROUPS if rows[title]]


def _group(v: Variable) -> str:
    by_role = {"parameter": "Parameters", "input": "Inputs", "start": "Motion"}
    by_role |= {"estimate": "Inputs", INTERFACE: "Of FMI 3.0 alone"}
    return by_role.get(v.role) or TITLES.get(v.of.head, "Motion")


def with_figures(text: str, figures: Sequence[tuple[str, ...]], references: str = "") -> str:
    """The page with rows (closed form, largest error, allowed, points, verdict) of a verification in their
    place, and a link to the file beside it that tells of reference results."""
    link = '<li><a href="#verification">Verification</a></li>'
    found = template("page/verification.html.j2").render(figures=figures, references=references)
    return text.replace(LINK, link).replace(FIGURES, found.rstrip())
