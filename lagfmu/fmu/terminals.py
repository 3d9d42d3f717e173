"""terminalsAndIcons/terminalsAndIcons.xml: which variables belong together (FMI 3.0, section 2.4.9).

A terminal for each prescribed motion: position, velocity and acceleration, which the importer sets, and the
force that its drive gives; and one for each joint: the wrench that it transmits and the motion that it leaves
free.  Two terminals that are joined match by the names of their members.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element, SubElement

from .. import names
from ..mechanics.equations import EquationsOfMotion
from ..model.model import name_of
from ..model.symbols import symbols_in
from ..names import Subject
from ..prepare.prepare import Prepared
from .described import as_text

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
