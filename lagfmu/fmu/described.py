"""What modelDescription.xml says of types, variables and structure, in both versions of FMI alike.

Besides: what a native FMU can do by each interface type, and terminalsAndIcons/terminalsAndIcons.xml, which
variables belong together (FMI 3.0, section 2.4.9).

A terminal for each prescribed motion: position, velocity and acceleration, which the importer sets, and the
force that its drive gives; and one for each joint: the wrench that it transmits and the motion that it leaves
free.  Two terminals that are joined match by the names of their members.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from .. import names
from ..interface.variables import Value, Variable, VariableTable
from ..mechanics.equations import EquationsOfMotion
from ..methods import MENU, NUMBERS
from ..model.elements import symbols_in
from ..model.model import name_of
from ..names import Subject
from ..prepare.steps import Prepared
from .target import Face

COMMON: Mapping[int, Mapping[str, str]] = {  # by version of FMI
    2: {
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canNotUseMemoryManagementFunctions": "false",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    },
    3: {
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesPerElementDependencies": "true",
    },
}
CO_SIMULATION: Mapping[int, Mapping[str, str]] = {
    2: {
        "canHandleVariableCommunicationStepSize": "true",
        "canInterpolateInputs": "true",
        "canRunAsynchronuously": "false",
    },
    3: {
        "canHandleVariableCommunicationStepSize": "true",
        "providesIntermediateUpdate": "true",
        "mightReturnEarlyFromDoStep": "true",
        "canReturnEarlyAfterIntermediateUpdate": "true",
        "hasEventMode": "true",
    },
}
MODEL_EXCHANGE: Mapping[int, Mapping[str, str]] = {
    2: {"completedIntegratorStepNotNeeded": "false"},
    3: {"needsCompletedIntegratorStep": "true"},
}
DERIVATIVES = {
    2: ("providesDirectionalDerivative",),
    3: ("providesDirectionalDerivatives", "providesAdjointDerivatives"),
}


def offers_exchange(prepared: Prepared) -> bool:
    """Model exchange besides co-simulation: not where the FMU runs twice, or keeps points of an input."""
    scene = prepared.scene
    return not (prepared.system.estimated or scene.error_bars or scene.sensitivities)


def interfaces_of(prepared: Prepared, face: Face) -> dict[str, dict[str, str]]:
    """ModelExchange, where it is offered, and CoSimulation, with their attributes."""
    scene, system = prepared.scene, prepared.system
    differentiable = (scene.differentiable and not system.frictions) or face.dae
    provided = dict.fromkeys(DERIVATIVES[face.fmi], str(differentiable).lower())
    common = {"modelIdentifier": scene.name, **COMMON[face.fmi], **provided}
    order = {"maxOutputDerivativeOrder": "1" if differentiable else "0"}
    found = {"CoSimulation": {**common, **CO_SIMULATION[face.fmi], **order}}
    if offers_exchange(prepared):
        found = {"ModelExchange": {**common, **MODEL_EXCHANGE[face.fmi]}, **found}
    return found


DISPLAYED = {  # unit -> type and what it is shown in, times 180/pi
    "rad": ("Angle", "deg"),
    "rad/s": ("AngularVelocity", "deg/s"),
    "rad/s2": ("AngularAcceleration", "deg/s2"),
}
METHOD = "Method"
MOST = 100_000  # dependencies that are told: two megabytes of XML
HOW = "How the equations of motion are integrated"


def number(value: float) -> str:
    """A decimal text that reads back as the same double."""
    return repr(float(value))


def as_text(root: Element) -> bytes:
    """The bytes of a file."""
    indent(root, "  ")
    body: bytes = tostring(root, "utf-8")
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + body + b"\n"


def angles(table: VariableTable) -> Iterator[tuple[str, dict[str, str]]]:
    """The types of angles that there are, by name: shown in degrees."""
    present = {v.unit.name for v in table.variables if v.unit is not None}
    for unit, (name, shown) in DISPLAYED.items():
        if unit in present:
            yield name, {"quantity": name, "unit": unit, "displayUnit": shown}


def methods(parent: Element, v: Variable) -> None:
    """The items of `solver.method`: the methods have numbers, one each for ever."""
    for m in MENU:
        if m.name in v.items:
            item = {"name": m.name, "value": str(m.number)}
            SubElement(parent, "Item", item | ({"description": m.remark} if m.remark else {}))


def named(v: Variable, reference: int) -> dict[str, str]:
    """Of any variable."""
    attributes = {
        "name": v.name,
        "valueReference": str(reference),
        "description": v.description,
        "causality": v.causality,
        "variability": v.variability,
    }
    return attributes if v.initial is None else attributes | {"initial": v.initial}


def typed(v: Variable) -> dict[str, str]:
    """Of a variable of its type."""
    found = {}
    if v.kind == "Enumeration":
        found["declaredType"] = METHOD
    if v.unit is not None and v.unit.name in DISPLAYED:
        found["declaredType"] = DISPLAYED[v.unit.name][0]
    if v.unit is not None:
        found["unit"] = v.unit.name
    if v.display is not None:
        found["displayUnit"] = v.display.name
    if v.minimum is not None or v.positive:
        found["min"] = number(v.minimum or 0.0)
    elif v.kind == "Integer":
        found["min"] = "0"
    if v.maximum is not None:
        found["max"] = number(v.maximum)
    if v.nominal is not None:
        found["nominal"] = number(v.nominal)
    if v.start is not None and v.initial != "calculated":
        found["start"] = _start(v.start)
    return found


def _start(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return str(NUMBERS[value])
    return number(value) if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Unknown:
    """One of the structure, and what it depends on."""

    name: str
    known: Sequence[str] | None  # None: not told, which means on all

    def attributes(self, places: Mapping[str, int]) -> dict[str, str]:
        """Dependencies, by the numbers in `places`, and their kinds: "constant" or "dependent", as FMI takes
        them where nothing is said.  What is not there is not known."""
        if self.known is None:
            return {}
        known = sorted(places[n] for n in self.known if n in places)
        found = {"dependencies": " ".join(map(str, known))}
        own = places.get(self.name)
        if own not in known:
            return found
        kinds = ("constant" if k == own else "dependent" for k in known)
        return found | {"dependenciesKind": " ".join(kinds)}


@dataclass(frozen=True)
class Structure:
    """What depends on what."""

    outputs: Sequence[Unknown]
    derivatives: Sequence[Unknown]
    initial: Sequence[Unknown]

    @property
    def entries(self) -> int:
        """How many dependencies there are."""
        groups = self.outputs, self.derivatives, self.initial
        return sum(len(u.known or ()) for group in groups for u in group)

    @property
    def short(self) -> Structure:
        """Without them."""
        groups = self.outputs, self.derivatives, self.initial
        return Structure(*([Unknown(u.name, None) for u in group] for group in groups))


def structure_of(table: VariableTable) -> Structure:
    """Outputs and derivatives at communication points, and what is found at the start; of large mechanisms,
    in which all depends on all, without what they depend on."""
    found = _whole(table)
    return found if found.entries <= MOST else found.short


def _whole(table: VariableTable) -> Structure:
    moving = {*table.states, *table.derivatives}  # listed even where they are local
    return Structure(
        [Unknown(v.name, v.depends) for v in table.outputs],
        [Unknown(name, table[name].depends) for name in table.derivatives],
        [
            Unknown(v.name, v.depends_initially)
            for v in table.variables
            if (v.causality == "output" or v.name in moving)
            and v.initial in ("approx", "calculated")
        ],
    )


def untold(table: VariableTable) -> str:
    """That dependencies are left out, to be said; nothing where they stand there."""
    if (entries := _whole(table).entries) <= MOST:
        return ""
    return (
        f"modelDescription.xml leaves out `dependencies`, which would be {entries} entries, more than "
        f"{MOST}: each output may depend on all states and inputs"
    )


IN_FMU, ICON = "terminalsAndIcons/terminalsAndIcons.xml", "terminalsAndIcons/icon"
MEMBERS = ("position", "velocity", "acceleration")
SIGNAL = "signal"
WRENCH = ("force", "torque")
FREE = ("angle", "position")  # what a joint may leave


Members = Mapping[str, tuple[str, str]]  # by name: the variable, and of what kind it is


def terminals(prepared: Prepared, icon: bool = False) -> bytes | None:
    """The bytes of the file; None where there is nothing to tell.  `icon`: the FMU has one."""
    found = [
        *((f"motion {n}", n, members) for n, members in _motions(prepared)),
        *((f"joint {n}", n, members) for n, members in _joints(prepared)),
    ]
    if not found and not icon:
        return None
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    if icon:
        corner = {"x1": "-100", "y1": "-100", "x2": "100", "y2": "100"}
        shown = SubElement(root, "GraphicalRepresentation")
        SubElement(shown, "CoordinateSystem", {**corner, "suggestedScalingFactorTo_mm": "0.1"})
        SubElement(shown, "Icon", corner)
    parent = SubElement(root, "Terminals") if found else root
    for text, name, members in found:
        told = {"name": name, "matchingRule": "bus", "description": text}
        terminal = SubElement(parent, "Terminal", told)
        for member, (variable, kind) in members.items():
            told = {"variableName": variable, "memberName": member, "variableKind": kind}
            SubElement(terminal, "TerminalMemberVariable", told)
    return as_text(root)


def _motions(prepared: Prepared) -> Iterator[tuple[str, Members]]:
    """The inputs that prescribe a motion, with the forces of their drives."""
    table, eom = prepared.table, prepared.equations
    for i in eom.model.prescribed:
        name = name_of(i.symbol)
        members = {m: (names.derivative(name, k), SIGNAL) for k, m in enumerate(MEMBERS)}
        if (force := _force(eom, name)) is not None:
            members["force"] = force
        kept = {m: found for m, found in members.items() if found[0] in table}
        if MEMBERS[0] in kept:
            yield name, kept


def _force(eom: EquationsOfMotion, name: str) -> tuple[str, str] | None:
    """The force of the drive that moves u is -sum_k lambda_k df_k/du where u stands in constraints alone: the
    multiplier of f = x - u flows in, that of f = u - x is the reaction and flows out.  None where it is
    neither."""
    model = eom.model
    terms = [model.lagrangian, model.kinetic_energy, *model.forces.values()]
    if name in (name_of(s) for e in terms if e is not None for s in symbols_in(e)):
        return None
    rows = [(c.name, f) for c, f in zip(eom.constraints, eom.f, strict=True) if f is not None]
    found = [(c, f.diff(s)) for c, f in rows for s in f.free_symbols if str(s) == name]
    match found:
        case [(constraint, rate)] if abs(rate) == 1:
            return names.name(names.MULTIPLIER, constraint), "inflow" if rate < 0 else "outflow"
    return None


def _joints(prepared: Prepared) -> Iterator[tuple[str, Members]]:
    """Those of a mechanism: the components of its wrenches are told with whether they are unique."""
    table, found = prepared.table, dict[str, dict[str, tuple[str, str]]]()
    for v in table.those(names.OWN):
        kind, _, rest = v.name.partition(".")
        joint, _, component = rest.rpartition(".")
        if kind in WRENCH and joint and Subject(names.UNIQUE, v.name).name in table:
            found.setdefault(joint, {})[f"{kind}.{component}"] = v.name, SIGNAL
    for joint, members in found.items():
        for free in FREE:
            for k, member in enumerate((free, f"rate.{free}")):
                name = names.derivative(f"{free}.{joint}", k)
                if name in table:
                    members[member] = name, SIGNAL
        yield joint, members
