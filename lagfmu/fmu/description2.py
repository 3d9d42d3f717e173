"""What is written in FMI 2.0's own words in modelDescription.xml (FMI 2.0.4, sections 2.2 and 4.3)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement

from ..interface.variables import VariableTable
from .described import HOW, METHOD, Unknown, angles, methods, named, structure_of, typed

VERSION, TOKEN = "2.0", "guid"


def interfaces(
    root: Element,
    found: Mapping[str, Mapping[str, str]],
    sources: Sequence[str],
    event_indicators: int,
) -> None:
    """ModelExchange and CoSimulation, each with what a recompilation needs."""
    root.set("numberOfEventIndicators", str(event_indicators))
    for name, attributes in found.items():
        interface = SubElement(root, name, dict(attributes))
        if sources:
            listed = SubElement(interface, "SourceFiles")
            for file in sources:
                SubElement(listed, "File", {"name": file})


def types(root: Element, table: VariableTable) -> None:
    """Angles, and the methods."""
    definitions = Element("TypeDefinitions")
    for name, attributes in angles(table):
        SubElement(SubElement(definitions, "SimpleType", {"name": name}), "Real", attributes)
    for v in table.variables:
        if v.kind == "Enumeration":
            simple = SubElement(definitions, "SimpleType", {"name": METHOD, "description": HOW})
            methods(SubElement(simple, "Enumeration"), v)
    if len(definitions):
        root.append(definitions)


def variables(root: Element, table: VariableTable, reinitialized: Collection[str]) -> None:
    """In the order of the table."""
    index, listed = _indices(table), SubElement(root, "ModelVariables")
    for k, v in enumerate(table.variables):
        attributes = typed(v)
        if v.derivative_of is not None and v.name in table.derivatives:
            attributes["derivative"] = str(index[v.derivative_of])  # by this importers count states
        if v.name in reinitialized:
            attributes["reinit"] = "true"
        SubElement(SubElement(listed, "ScalarVariable", named(v, k)), v.kind, attributes)


def structure(root: Element, table: VariableTable) -> None:
    """Outputs, derivatives, unknowns at the start."""
    index, found = _indices(table), structure_of(table)
    parent = SubElement(root, "ModelStructure")

    def listed(name: str, unknowns: Sequence[Unknown]) -> None:
        group = SubElement(parent, name)
        for u in unknowns:
            SubElement(group, "Unknown", {"index": str(index[u.name])} | u.attributes(index))

    listed("Outputs", found.outputs)
    if found.derivatives:
        listed("Derivatives", found.derivatives)
    if found.initial:
        listed("InitialUnknowns", found.initial)


def _indices(table: VariableTable) -> dict[str, int]:
    return {name: k + 1 for name, k in table.position.items()}
