"""The page documentation/index.html inside an FMU: equations, variables, units, how to use it.

One HTML file that needs nothing else: mathematics as MathML, styles inside.  The same model gives the
same bytes.

A notebook shows models, equations of motion and classifications likewise.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from functools import cache, singledispatch
from html import escape
from importlib.resources import files
from typing import Any

import jinja2
import sympy as sp
from latex2mathml.converter import convert
from markupsafe import Markup

from .. import names
from ..interface.table import INTERFACE
from ..interface.variables import Variable, VariableTable
from ..mechanics.derive import derive
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form
from ..mechanics.integrability.classify import Classification
from ..model.model import Contact, Holonomic, Model, Nonholonomic
from ..model.units import Unit, for_reading
from ..numeric.failure import OMITTED
from ..prepare.steps import Prepared
from .savings import savings
from .typeset import typeset


@cache
def template(path: str) -> jinja2.Template:
    """The one at `path` in the package; what it is given is escaped, and what it is not given an error."""
    environment = jinja2.Environment(
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        loader=jinja2.FunctionLoader(_text),
    )
    return environment.get_template(path)


def _text(path: str) -> str:
    return files("lagfmu").joinpath(path).read_text(encoding="utf-8")


SET = {"parameter": "Parameters", "input": "Inputs", "estimate": "Inputs"}  # by role
CALCULATED = {  # by the kind of what a variable is of
    names.MULTIPLIER: "Multipliers λ",
    **dict.fromkeys(names.OF_FRICTION, "Friction"),
    names.FORCE: "Generalized forces of constraint",
    names.ENERGY: "Energies",
    names.RESIDUAL: "Residuals, zero where a constraint acts",
    names.UNIQUE: "Whether λ is determined",
    **dict.fromkeys((names.CONTACT, names.DEPARTURE, names.CLOSING), "Contacts"),
    names.ERROR: "Error bars",
    names.PEAK: "Extremes so far",
    names.SOLVER: "Solver",
}


def heading(name: str, role: str, known: Collection[str]) -> str:
    """Of a variable of that name and role; `known`: the names of all."""
    of = names.read(name)
    if role in SET:
        return SET[role]
    if role == INTERFACE:
        return "Of FMI 3.0 alone"
    if of.quantity == names.FORCE and of.constraint:
        return "Forces of each constraint"
    if of.quantity == names.RESIDUAL and names.name(names.CONTACT, of.constraint) in known:
        return "Gaps of contacts"
    if of.head in CALCULATED:
        return CALCULATED[of.head]
    if of.order:
        return "Accelerations" if of.order == 2 else "Velocities"
    return "Coordinates" if role == "start" or names.derivative(name) in known else "Outputs"


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

    `choice` is the section on how its solver settings were chosen, in HTML (tradeoff/choose.py).  `live`:
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


@singledispatch
def html(thing: Any) -> str:
    """HTML with the mathematics as MathML."""
    return f"<pre>{escape(repr(thing))}</pre>"


@singledispatch
def latex(thing: Any) -> str:
    """One display in LaTeX."""
    return f"$${sp.latex(thing)}$$"


@html.register
def _(form: Form) -> str:
    parts = [f"<h4>{escape(form.equations.model.name)}</h4>"]
    for section in typeset(form):
        if section.equations:
            rows = "".join(
                f"<tr><td>{escape(e.label)}</td><td style='text-align:left'>{mathml(e.latex)}</td></tr>"
                for e in section.equations
            )
            parts.append(f"<p><b>{escape(section.title)}</b></p><table>{rows}</table>")
    return "".join(parts)


@html.register
def _(equations: EquationsOfMotion) -> str:
    return html(Form(equations))


@latex.register
def _(equations: EquationsOfMotion) -> str:
    lines = [e.latex for section in typeset(Form(equations)) for e in section.equations]
    return "$$\\begin{gathered}" + " \\\\ ".join(lines) + "\\end{gathered}$$"


@html.register
def _(model: Model) -> str:
    rows = "".join(
        f"<tr><td>{escape(str(p.symbol))}</td><td>{p.value!r}</td><td>{escape(p.unit)}</td></tr>"
        for p in model.parameters
    )
    described = f"<p>{escape(model.description)}</p>" if model.description else ""
    head = "<tr><th>parameter</th><th>value</th><th>unit</th></tr>"
    return f"{html(derive(model))}{described}<table>{head}{rows}</table>"


@latex.register
def _(model: Model) -> str:
    return latex(derive(model))


@html.register
def _(found: Classification) -> str:
    integrals = "".join(f"<li>{mathml(sp.latex(i.f))} = const</li>" for i in found.integrals)
    return (
        f"<p><b>{escape(str(found.kind))}</b> (rank {found.rank}, holonomic {found.holonomic_rank})</p>"
        f"<ul>{integrals}</ul><p>{escape(found.certificate)}</p>"
    )


@latex.register
def _(found: Classification) -> str:
    lines = [
        f"\\text{{{found.kind}}}",
        *(f"{sp.latex(i.f)} = \\mathrm{{const}}" for i in found.integrals),
    ]
    return "$$\\begin{gathered}" + " \\\\ ".join(lines) + "\\end{gathered}$$"
