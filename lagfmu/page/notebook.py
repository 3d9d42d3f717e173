"""Models, equations of motion and classifications as a notebook shows them."""

from __future__ import annotations

from functools import singledispatch
from html import escape
from typing import Any

import sympy as sp

from ..mechanics.derive import derive
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.form import Form
from ..mechanics.integrability.classify import Classification
from ..model.model import Model
from .documentation import mathml
from .typeset import typeset


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
