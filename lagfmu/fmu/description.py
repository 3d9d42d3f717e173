"""Variable table -> modelDescription.xml (FMI 2.0.4, sections 2.2 and 4.3).  Both targets share it."""

from __future__ import annotations

import datetime
import hashlib
import os
import uuid
from collections.abc import Collection, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, fromstring, indent, tostring

from ..interface.variables import Value, Variable, VariableTable
from ..model.scene import Scene
from ..model.units import Unit

LOG_CATEGORIES = {
    "logStatusWarning": "start values that were moved, settings that were adjusted",
    "logStatusDiscard": "communication steps that could not be done, and why",
    "logStatusError": "illegal calls and values that were refused",
    "logStatusFatal": "errors after which the instance cannot be used",
    "logEvents": "contacts that open or close, with time; a change of the integrator",
    "logAll": "all messages",
}


def model_description(
    table: VariableTable,
    scene: Scene,
    description: str,
    tool: str,
    interfaces: Mapping[str, Mapping[str, str]],
    content: bytes,
    sources: Sequence[str] = (),
    event_indicators: int = 0,
    reinitialized: Collection[str] = (),
) -> bytes:
    """The XML text.  The GUID is made from `content` and the text itself, not from time or chance.

    `interfaces` maps ModelExchange and CoSimulation, in this order, to their attributes; `sources` are
    the files that a recompilation needs; `reinitialized` the states that an event may change.
    """
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": scene.name,
            "guid": "",
            "description": description,
            "generationTool": tool,
            **_generation_date(),
            "variableNamingConvention": "structured",
            "numberOfEventIndicators": str(event_indicators),
        },
    )
    for name, attributes in interfaces.items():
        interface = SubElement(root, name, dict(attributes))
        if sources:
            listed = SubElement(interface, "SourceFiles")
            for file in sources:
                SubElement(listed, "File", {"name": file})
    _units(root, table)
    categories = SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", {"name": name, "description": text})
    SubElement(
        root,
        "DefaultExperiment",
        {
            "startTime": "0",
            "stopTime": number(scene.stop_time),
            "tolerance": number(scene.tolerance),
            "stepSize": number(scene.step_size),
        },
    )
    index = {v.name: k + 1 for k, v in enumerate(table.variables)}
    variables = SubElement(root, "ModelVariables")
    for k, v in enumerate(table.variables):
        _variable(variables, k, v, index, v.name in reinitialized)
    _structure(root, table, index)
    indent(root, "  ")
    digest = hashlib.sha256(content + tostring(root, "utf-8")).hexdigest()
    root.set("guid", f"{{{uuid.UUID(digest[:32])}}}")
    body: bytes = tostring(root, "utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + body + b"\n"


def guid_of(description: bytes) -> str:
    """The GUID in a text that `model_description` made."""
    return str(fromstring(description).get("guid"))


def number(value: float) -> str:
    """A decimal text that reads back as the same double."""
    return repr(float(value))


def _generation_date() -> dict[str, str]:
    """The date of SOURCE_DATE_EPOCH; none without it, so that two builds are the same bytes."""
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return {}
    moment = datetime.datetime.fromtimestamp(int(epoch), datetime.UTC)
    return {"generationDateAndTime": moment.strftime("%Y-%m-%dT%H:%M:%SZ")}


def _units(root: Element, table: VariableTable) -> None:
    units: dict[str, Unit] = {}
    for v in table.variables:
        if v.unit is not None:
            units.setdefault(v.unit.name, v.unit)
    definitions = SubElement(root, "UnitDefinitions")
    for name, unit in sorted(units.items()):
        element = SubElement(definitions, "Unit", {"name": name})
        SubElement(element, "BaseUnit", {k: str(e) for k, e in unit.base.items()})


def _variable(
    parent: Element,
    reference: int,
    v: Variable,
    index: Mapping[str, int],
    reinitialized: bool,
) -> None:
    attributes = {
        "name": v.name,
        "valueReference": str(reference),
        "description": v.description,
        "causality": v.causality,
        "variability": v.variability,
    }
    if v.initial is not None:
        attributes["initial"] = v.initial
    element = SubElement(parent, "ScalarVariable", attributes)
    typed = {}
    if v.unit is not None:
        typed["unit"] = v.unit.name
    if v.minimum is not None:
        typed["min"] = number(v.minimum)
    if v.maximum is not None:
        typed["max"] = number(v.maximum)
    if v.start is not None and v.initial != "calculated":
        typed["start"] = _start(v.start)
    if v.derivative_of is not None:
        typed["derivative"] = str(index[v.derivative_of])
    if reinitialized:
        typed["reinit"] = "true"
    SubElement(element, v.kind, typed)


def _start(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return number(value) if isinstance(value, float) else str(value)


def _structure(root: Element, table: VariableTable, index: Mapping[str, int]) -> None:
    structure = SubElement(root, "ModelStructure")

    def unknown(parent: Element, name: str, depends: tuple[str, ...]) -> None:
        known = " ".join(str(i) for i in sorted(index[d] for d in depends))
        SubElement(parent, "Unknown", {"index": str(index[name]), "dependencies": known})

    outputs = SubElement(structure, "Outputs")
    for v in table.outputs:
        unknown(outputs, v.name, v.depends)
    if table.derivatives:
        derivatives = SubElement(structure, "Derivatives")
        for name in table.derivatives:
            unknown(derivatives, name, table[name].depends)
    moving = {*table.states, *table.derivatives}  # listed even where they are local
    found = [
        v
        for v in table.variables
        if (v.causality == "output" or v.name in moving) and v.initial in ("approx", "calculated")
    ]
    initial = SubElement(structure, "InitialUnknowns") if found else structure
    for v in found:
        unknown(initial, v.name, v.depends_initially)
