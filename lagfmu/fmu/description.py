"""Variable table -> modelDescription.xml, of either version of FMI.  Both targets share it."""

from __future__ import annotations

import datetime
import hashlib
import math
import os
import uuid
from collections.abc import Collection, Mapping, Sequence
from xml.etree.ElementTree import Element, SubElement, fromstring

from ..interface.variables import VariableTable
from ..model.model import Model
from ..model.scene import Scene
from ..model.units import Unit
from . import description2, description3
from .described import DISPLAYED, as_text, number

WRITERS = {2: description2, 3: description3}  # by version of FMI
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
    fmi: int = 2,
) -> bytes:
    """The XML text.  The GUID is made from `content` and the text itself, not from time or chance.

    The author, version, copyright and licence are those that the model gives.  `interfaces` maps
    ModelExchange and CoSimulation, in this order, to their attributes; `sources` are the files that a
    recompilation needs; `reinitialized` the states that an event may change.
    """
    writer = WRITERS[fmi]
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": writer.VERSION,
            "modelName": scene.name,
            writer.TOKEN: "",
            "description": model.description or f"{model.name}: forces of constraint as outputs",
            **{
                k: text
                for k in ("author", "version", "copyright", "license")
                if (text := getattr(model, k))
            },
            "generationTool": tool,
            **_generation_date(),
            "variableNamingConvention": "structured",
        },
    )
    writer.interfaces(root, interfaces, sources, event_indicators)
    _units(root, table)
    writer.types(root, table)
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
    writer.variables(root, table, reinitialized)
    writer.structure(root, table)
    digest = hashlib.sha256(content + as_text(root)).hexdigest()
    root.set(writer.TOKEN, f"{{{uuid.UUID(digest[:32])}}}")
    return as_text(root)


def guid_of(description: bytes) -> str:
    """The GUID, or instantiation token, in a text that `model_description` made."""
    root = fromstring(description)
    return str(root.get(description2.TOKEN) or root.get(description3.TOKEN))


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
