"""The manifest of the layered standard for differential-algebraic equations, and of what it cannot be had.

FMI-LS-DAE, a draft, as it stands in modelica/fmi-ls-dae at 888556f (April 2026), chapter "Layered Standard
Manifest File": its text describes `AlgebraicVariables` and `ModelStructure` with `Residual` and
`Formulation`, its schema nothing but an empty element of another name.  What is written here follows the
text.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from .. import names
from ..errors import ModelError
from ..interface.algebraic import known_with_multipliers
from ..interface.variables import VariableTable
from ..prepare.consistency import posed
from ..prepare.prepare import Prepared
from .capabilities import offers_exchange
from .described import Unknown, as_text, structure_of

STANDARD = "org.fmi-standard.fmi-ls-dae"
MANIFEST = f"extra/{STANDARD}/fmi-ls-manifest.xml"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
HEAD = {
    "xmlns": NAMESPACE,
    "xmlns:fmi-ls": NAMESPACE,
    "fmi-ls:fmi-ls-name": STANDARD,
    "fmi-ls:fmi-ls-version": "0.0.1",
    "fmi-ls:fmi-ls-description": "Layered standard for DAE support in FMI",
}
SINGULAR = 1e-12  # of masses that are scaled to 1: the least eigenvalue that is none


def check_dae(prepared: Prepared) -> None:
    """Raises ModelError with all that stands against an importer that solves for the multipliers."""
    system, found = prepared.system, prepared.structure
    problems = []
    if not offers_exchange(prepared):
        problems.append(
            "--dae is for model exchange, which an FMU with error bars, sensitivities or estimated rates of "
            "inputs has not: build it without them"
        )
    if prepared.formulation != "multipliers":
        problems.append(
            f"--dae: the formulation {prepared.formulation!r} has no multipliers to solve for: take "
            "'multipliers'"
        )
    elif not system.rows:
        problems.append("--dae: there is no constraint, and no multiplier to solve for")
    contacts = [system.rows[k].name for k in system.contacts]
    for kind, known, remedy in (
        ("contact", contacts, "hold it closed (--contacts) or leave it out"),
        ("friction", [f.name for f in system.frictions], "leave it out"),
    ):
        for name in known:
            problems.append(
                f"--dae: the {kind} {name!r} switches its equations, and an importer that solves for their "
                f"multipliers does not know when: {remedy}"
            )
    for name in found.redundant:
        problems.append(
            f"--dae: the constraint {name!r} follows from others, so that G M^-1 G^T is singular and the "
            "multipliers have no one value: leave it out"
        )
    problems += _massless(prepared)
    problems += [
        f"--dae: {name!r} is not among the outputs of the scene: ask for it too (--outputs)"
        for row in system.rows
        for quantity in (names.MULTIPLIER, names.RESIDUAL)
        if (name := names.name(quantity, row.name)) not in prepared.table
    ]
    if problems:
        raise ModelError(prepared.model.name, problems)


def _massless(prepared: Prepared) -> list[str]:
    """What has no mass of its own where it begins."""
    system, begun = prepared.examined, prepared.structure.start
    if prepared.formulation != "multipliers":
        return []
    u, p = posed(prepared).values
    M, *_ = system.assemble(0.0, begun.q, begun.v, [*u, *begun.switch_states], p)
    scale = np.sqrt(np.maximum(np.diag(M), 0.0))
    bare = [name for name, size in zip(system.speeds, scale, strict=True) if not size > 0]
    if not bare and np.linalg.eigvalsh(M / np.outer(scale, scale))[0] <= SINGULAR:
        bare = list(system.speeds)
    return [
        f"--dae: M is singular ({', '.join(bare)}), and M^-1 (F + G^T lambda) does not exist: give every "
        "coordinate a mass of its own"
    ] * bool(bare)


def manifest(prepared: Prepared) -> bytes:
    """The bytes of MANIFEST, of what as_built() has made with `dae`."""
    table = prepared.table
    root = Element("fmiLayeredStandardManifest", HEAD)
    listed = SubElement(root, "AlgebraicVariables")
    for row in prepared.system.rows:
        name = names.name(names.MULTIPLIER, row.name)
        SubElement(listed, "AlgebraicVariable", {"valueReference": str(table.position[name])})
    _structure(root, table, known_with_multipliers(prepared.coded, table))
    return as_text(root)


def _structure(root: Element, table: VariableTable, known: Mapping[str, Sequence[str]]) -> None:
    """That of modelDescription.xml where the multipliers are known, with the residuals."""
    parent, found, places = SubElement(root, "ModelStructure"), structure_of(table), table.position

    def put(element: Element, kind: str, u: Unknown, **more: str) -> None:
        reference = {"valueReference": str(places[u.name])}
        SubElement(element, kind, reference | more | u.attributes(places))

    told = found.entries > 0  # of large mechanisms they are left out

    def of(name: str) -> Unknown:
        return Unknown(name, known[name] if told and name in known else None)

    for u in found.outputs:
        put(parent, "Output", of(u.name))
    for u in found.derivatives:
        put(parent, "ContinuousStateDerivative", of(u.name))
    for u in found.initial:
        put(parent, "InitialUnknown", u)
    for v in table.those(names.INDICATOR):
        put(parent, "EventIndicator", Unknown(v.name, v.depends))
    for v in table.those(names.RESIDUAL):
        if v.members:
            continue
        rates = [u for u in table.those(names.RESIDUAL_RATE) if u.of.constraint == v.of.constraint]
        residual = SubElement(parent, "Residual")
        for index, one in zip(range(len(rates) + 1, 0, -1), (v, *rates), strict=True):
            put(residual, "Formulation", of(one.name), index=str(index))
