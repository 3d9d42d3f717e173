"""What is written in FMI 3.0's own words in modelDescription.xml (FMI 3.0.2, sections 2.4, 3.4 and 4.4), and
sources/buildDescription.xml (section 2.5.1.5)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

from .. import names
from ..codegen.c.interface import Dependencies
from ..interface.variables import Variable, VariableTable
from .described import (
    HOW,
    METHOD,
    Unknown,
    angles,
    as_text,
    methods,
    named,
    structure_of,
    typed,
)

ROUNDS_EACH = "-ffp-contract=off"  # bits depend on it: each operation is rounded by itself
VERSION, TOKEN = "3.0", "instantiationToken"
TYPES = {"Real": "Float64", "Integer": "Int32"}  # the others are called the same


def interfaces(
    root: Element,
    found: Mapping[str, Mapping[str, str]],
    sources: Sequence[str],
    event_indicators: int,
) -> None:
    """ModelExchange and CoSimulation; sources and indicators are told elsewhere."""
    for name, attributes in found.items():
        SubElement(root, name, dict(attributes))


def types(root: Element, table: VariableTable) -> None:
    """Angles, and the methods."""
    definitions = Element("TypeDefinitions")
    for name, attributes in angles(table):
        SubElement(definitions, "Float64Type", {"name": name} | attributes)
    for v in table.variables:
        if v.kind == "Enumeration":
            told = {"name": METHOD, "description": HOW}
            methods(SubElement(definitions, "EnumerationType", told), v)
    if len(definitions):
        root.append(definitions)


def variables(root: Element, table: VariableTable, reinitialized: Collection[str]) -> None:
    """In the order of the table."""
    listed = SubElement(root, "ModelVariables")
    for k, v in enumerate(table.variables):
        attributes = named(v, k) | typed(v)
        if v.kind == "Clock":
            del attributes["initial"]  # there is none in the schema; it is an unknown all the same
            attributes["intervalVariability"] = "triggered"
        if _is_intermediate(v, table):
            attributes["intermediateUpdate"] = "true"
        if v.derivative_of is not None and v.name in table.derivatives:
            attributes["derivative"] = str(table.position[v.derivative_of])
        if v.name in reinitialized:
            attributes["reinit"] = "true"
        element = SubElement(listed, TYPES.get(v.kind, v.kind), attributes)
        if v.members:
            SubElement(element, "Dimension", {"start": str(len(v.members))})


def _is_intermediate(v: Variable, table: VariableTable) -> bool:
    """Whether it may be got, or set, in Intermediate Update."""
    if v.kind != "Real" or v.variability != "continuous" or v.of.quantity == names.INDICATOR:
        return False
    if v.causality == "input":  # not where a finer run beside is driven too
        estimated = {u.of.coordinate for u in table.variables if u.role == "estimate"}
        return v.name not in estimated and not any(u.bar_of for u in table.variables)
    return v.causality in ("output", "local") and not v.members


def structure(root: Element, table: VariableTable) -> None:
    """Outputs, derivatives, unknowns at the start, event indicators."""
    found, parent = structure_of(table), SubElement(root, "ModelStructure")
    for name, unknowns in (
        ("Output", found.outputs),
        ("ContinuousStateDerivative", found.derivatives),
        ("InitialUnknown", found.initial),
        ("EventIndicator", _indicators(table)),
    ):
        for u in unknowns:
            reference = {"valueReference": str(table.position[u.name])}
            SubElement(parent, name, reference | u.attributes(table.position))


def _indicators(table: VariableTable) -> list[Unknown]:
    return [Unknown(v.name, v.depends) for v in table.those(names.INDICATOR)]


def dependencies(table: VariableTable) -> tuple[Dependencies, Dependencies]:
    """What the structure says, by value references: of unknowns at the start, and of all others."""
    found, places = structure_of(table), table.position
    running = [*found.outputs, *found.derivatives, *_indicators(table)]
    of_start, of_running = (
        {
            places[u.name]: sorted(places[n] for n in u.known if n in places)
            for u in unknowns
            if u.known is not None
        }
        for unknowns in (found.initial, running)
    )
    return of_start, of_running


def arrays(table: VariableTable) -> Dependencies:
    """What is in each, by value references."""
    places = table.position
    return {places[v.name]: [places[n] for n in v.members] for v in table.variables if v.members}


def build_description(identifier: str, sources: Sequence[str]) -> bytes:
    """sources/buildDescription.xml: what a recompilation of the library `identifier` needs."""
    root = Element("fmiBuildDescription", {"fmiVersion": VERSION})
    parent = SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier})
    files = SubElement(parent, "SourceFileSet", {"language": "C99", "compilerOptions": ROUNDS_EACH})
    for file in sources:
        SubElement(files, "SourceFile", {"name": file})
    return as_text(root)
