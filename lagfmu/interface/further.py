"""What FMI 3.0 has variables for besides those of the table: time, event indicators, the equations of a DAE
and the parameter that switches to it, clocks, arrays.

They come last, so that all others have the same value references in both versions, and the interface
answers for them itself: in this order.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from .. import names
from ..errors import ModelError
from ..model.units import SECOND, Unit
from ..names import Subject
from ..numeric.system import System
from .table import collisions
from .variables import Variable, VariableTable

INTERFACE = "interface"  # their role
IN_ARRAYS = (names.MULTIPLIER, names.FORCE, names.RESIDUAL)


def with_further(
    table: VariableTable,
    system: System,
    model: str,
    exchanged: bool,
    clocks: bool = False,
    arrays: bool = False,
    dae: bool = False,
) -> VariableTable:
    """The table with `time`; for model exchange (`exchanged`) with the event indicators of the system; with
    `dae` an equation for each multiplier, and the parameter that leaves them to the importer; with `clocks`,
    one for each contact and friction; with `arrays`, one for each unit of IN_ARRAYS.

    Raises ModelError, of `model`, if names collide.
    """
    contacts = [system.rows[k].name for k in system.contacts]
    frictions = [law.name for law in system.frictions]
    more = [_time()]
    if exchanged:
        known = [v.name for v in table.variables if v.causality == "input"]
        known += [*table.states, names.TIME]
        more += _indicators(contacts, len(system.switches), frictions, tuple(known))
    if dae:
        more += _equations(table, system)
    if clocks:
        more += [_clock(c, f"each impact, closing and departure of {c}") for c in contacts]
        more += [_clock(c, f"each start of sliding and of sticking of {c}") for c in frictions]
    if arrays:
        more += _arrays(table)
    found = replace(table, variables=(*table.variables, *more))
    if problems := collisions([v.name for v in found.variables]):
        raise ModelError(model, problems)
    return found


def _of_interface(of: Subject, text: str, causality: str = "local", **more: object) -> Variable:
    fields: dict[str, object] = {"variability": "continuous", "initial": "calculated", **more}
    return Variable(of=of, role=INTERFACE, causality=causality, description=text, **fields)  # type: ignore[arg-type]


def _time() -> Variable:
    of = Subject(names.TIME)
    return _of_interface(of, "simulation time", "independent", initial=None, unit=SECOND)


def _indicators(
    contacts: Iterable[str], jumps: int, frictions: Iterable[str], known: tuple[str, ...]
) -> Iterator[Variable]:
    """In the order of runtime/simulation/indicators.h."""
    told = [(c, f"contact {c}: its multiplier while closed, its gap while open") for c in contacts]
    told += [(f"jump.{k + 1}", f"the surface of jump {k + 1} of the forces") for k in range(jumps)]
    for c in frictions:
        told.append((f"{c}.mode", f"friction {c}: reserve of its cone, or velocity of its slip"))
        told.append((f"{c}.normal", f"friction {c}: the normal force on which it slips"))
    for name, text in told:
        of = Subject(names.INDICATOR, name)
        yield _of_interface(of, f"event indicator of {text}", depends=known)


def _equations(table: VariableTable, system: System) -> Iterator[Variable]:
    """Of each multiplier; without a unit, which is that of an acceleration or, where the row does not act, of
    the multiplier."""
    for row in system.rows:
        of = Subject(names.EQUATION, row.name)
        text = f"what vanishes by the multiplier of {row.name}, in the continuous-time mode of DAE mode"
        yield _of_interface(of, text)
    text = "true: the importer solves for the multipliers (FMI-LS-DAE)"
    fields = {"kind": "Boolean", "variability": "fixed", "initial": None, "start": False}
    yield _of_interface(Subject(names.DAE), text, "structuralParameter", **fields)


def _clock(of: str, text: str) -> Variable:
    told = f"ticks at {text}"
    subject = Subject(names.CLOCK, of)
    return _of_interface(subject, told, "output", kind="Clock", variability="discrete")


def _arrays(table: VariableTable) -> Iterator[Variable]:
    """Outputs of one kind and unit, in the order of the table."""
    for quantity in IN_ARRAYS:
        units: dict[str, tuple[Unit, list[Variable]]] = {}
        for v in table.those(quantity):
            if (
                v.causality == "output"
                and v.unit is not None
                and not (v.of.constraint and v.of.coordinate)
            ):
                units.setdefault(v.unit.name, (v.unit, []))[1].append(v)
        for unit, members in units.values():
            of = Subject(quantity, unit.name if unit.name.isidentifier() else f"'{unit.name}'")
            text = ", ".join(v.name for v in members)
            yield _of_interface(
                of,
                f"array of {text}",
                "output",
                unit=unit,
                members=tuple(v.name for v in members),
                depends=_union(v.depends for v in members),
                depends_initially=_union(v.depends_initially for v in members),
            )


def _union(groups: Iterable[tuple[str, ...]]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(d for group in groups for d in group))
