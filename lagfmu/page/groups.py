"""The heading under which a variable stands: in the documentation of an FMU, and on its live page."""

from __future__ import annotations

from collections.abc import Collection

from .. import names
from ..interface.further import INTERFACE

SET = {"parameter": "Parameters", "input": "Inputs", "estimate": "Inputs"}  # by role
CALCULATED = {  # by the kind of what a variable is of
    names.MULTIPLIER: "Multipliers λ",
    **dict.fromkeys(names.OF_FRICTION, "Friction"),
    names.FORCE: "Generalized forces of constraint",
    names.ENERGY: "Energies",
    names.RESIDUAL: "Residuals, zero where a constraint acts",
    names.UNIQUE: "Whether λ is determined",
    **dict.fromkeys((names.CONTACT, names.DEPARTURE, names.CLOSING), "Contacts"),
    names.ERROR: "Error bars",
    names.PEAK: "Extremes so far",
    names.SOLVER: "Solver",
}


def heading(name: str, role: str, known: Collection[str]) -> str:
    """Of a variable of that name and role; `known`: the names of all."""
    of = names.read(name)
    if role in SET:
        return SET[role]
    if role == INTERFACE:
        return "Of FMI 3.0 alone"
    if of.quantity == names.FORCE and of.constraint:
        return "Forces of each constraint"
    if of.quantity == names.RESIDUAL and names.name(names.CONTACT, of.constraint) in known:
        return "Gaps of contacts"
    if of.head in CALCULATED:
        return CALCULATED[of.head]
    if of.order:
        return "Accelerations" if of.order == 2 else "Velocities"
    return "Coordinates" if role == "start" or names.derivative(name) in known else "Outputs"
