"""What modelDescription.xml says of types, variables and structure, in both versions of FMI alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..interface.variables import Value, Variable, VariableTable
from ..methods import MENU, NUMBERS

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
