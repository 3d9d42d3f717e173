"""Variable table -> modelDescription.xml (FMI 2.0.4, sections 2.2 and 4.3).  Both targets share it."""

from __future__ import annotations

import datetime
import hashlib
import math
import os
import uuid
from collections.abc import Collection, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, fromstring, indent, tostring

from ..interface.variables import Value, Variable, VariableTable
from ..methods import MENU, NUMBERS
from ..model.model import Model
from ..model.scene import Scene
from ..model.units import Unit

DISPLAYED = {  # unit -> type and what it is shown in, times 180/pi
    "rad": ("Angle", "deg"),
    "rad/s": ("AngularVelocity", "deg/s"),
    "rad/s2": ("AngularAcceleration", "deg/s2"),
}
METHOD = "Method"
LOG_CATEGORIES = {
    "logStatusWarning": "start values that were moved, settings that were adjusted",
    "logStatusDiscard": "communication steps that could not be done, and why",
    "logStatusError": "illegal calls and values that were refused",
    "logStatusFatal": "errors after which the instance cannot be used",
    "logEvents": "contacts that open or close, frictions that slip or stick; a change of the integrator",
    "logAll": "all messages",
}


def model_description(
    table: VariableTable,
    scene: Scene,
    model: Model,
    tool: str,
    interfaces: Mapping[str, Mapping[str, str]],
    content: bytes,
    sources: Sequence[str] = (),
    event_indicators: int = 0,
    reinitialized: Collection[str] = (),
) -> bytes:
    """The XML text.  The GUID is made from `content` and the text itself, not from time or chance.

    The author, version, copyright and licence are those that the model gives.  `interfaces` maps
    ModelExchange and CoSimulation, in this order, to their attributes; `sources` are the files that a
    recompilation needs; `reinitialized` the states that an event may change.
    """
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": scene.name,
            "guid": "",
            "description": model.description or f"{model.name}: forces of constraint as outputs",
            **{
                k: text
                for k in ("author", "version", "copyright", "license")
                if (text := getattr(model, k))
            },
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
    _types(root, table)
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
        _variable(variables, k, v, index, v.name in reinitialized, v.name in table.derivatives)
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
    shown: dict[str, dict[str, float]] = {}
    for v in table.variables:
        if v.unit is None:
            continue
        units.setdefault(v.unit.name, v.unit)
        names = shown.setdefault(v.unit.name, {})
        if v.unit.name in DISPLAYED:
            names.setdefault(DISPLAYED[v.unit.name][1], 180 / math.pi)
        if v.display is not None:
            names.setdefault(v.display.name, v.display.from_si(1.0))
    definitions = SubElement(root, "UnitDefinitions")
    for name, unit in sorted(units.items()):
        element = SubElement(definitions, "Unit", {"name": name})
        SubElement(element, "BaseUnit", {k: str(e) for k, e in unit.base.items()})
        for display, factor in shown[name].items():
            SubElement(element, "DisplayUnit", {"name": display, "factor": number(factor)})


def _types(root: Element, table: VariableTable) -> None:
    """Angles are shown in degrees; the methods have numbers, one each for ever."""
    definitions = Element("TypeDefinitions")
    present = {v.unit.name for v in table.variables if v.unit is not None}
    for unit, (name, shown) in DISPLAYED.items():
        if unit in present:
            simple = SubElement(definitions, "SimpleType", {"name": name})
            SubElement(simple, "Real", {"quantity": name, "unit": unit, "displayUnit": shown})
    for v in table.variables:
        if v.kind == "Enumeration":
            text = "How the equations of motion are integrated"
            simple = SubElement(definitions, "SimpleType", {"name": METHOD, "description": text})
            items = SubElement(simple, "Enumeration")
            for m in MENU:
                if m.name in v.items:
                    item = {"name": m.name, "value": str(m.number)}
                    SubElement(
                        items, "Item", item | ({"description": m.remark} if m.remark else {})
                    )
    if len(definitions):
        root.append(definitions)


def _variable(
    parent: Element,
    reference: int,
    v: Variable,
    index: Mapping[str, int],
    reinitialized: bool,
    is_derivative: bool,
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
    if v.kind == "Enumeration":
        typed["declaredType"] = METHOD
    if v.unit is not None and v.unit.name in DISPLAYED:
        typed["declaredType"] = DISPLAYED[v.unit.name][0]
    if v.unit is not None:
        typed["unit"] = v.unit.name
    if v.display is not None:
        typed["displayUnit"] = v.display.name
    if v.minimum is not None or v.positive:
        typed["min"] = number(v.minimum or 0.0)
    elif v.kind == "Integer":
        typed["min"] = "0"
    if v.maximum is not None:
        typed["max"] = number(v.maximum)
    if v.nominal is not None:
        typed["nominal"] = number(v.nominal)
    if v.start is not None and v.initial != "calculated":
        typed["start"] = _start(v.start)
    if v.derivative_of is not None and is_derivative:  # importers count states by this attribute
        typed["derivative"] = str(index[v.derivative_of])
    if reinitialized:
        typed["reinit"] = "true"
    SubElement(element, v.kind, typed)


def _start(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return str(NUMBERS[value])
    return number(value) if isinstance(value, float) else str(value)


def _structure(root: Element, table: VariableTable, index: Mapping[str, int]) -> None:
    structure = SubElement(root, "ModelStructure")

    def unknown(parent: Element, name: str, depends: tuple[str, ...]) -> None:
        known = sorted((index[d], "constant" if d == name else "dependent") for d in depends)
        attributes = {"index": str(index[name]), "dependencies": " ".join(str(i) for i, _ in known)}
        if known:
            attributes["dependenciesKind"] = " ".join(kind for _, kind in known)
        SubElement(parent, "Unknown", attributes)

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
