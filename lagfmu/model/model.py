"""What the user writes: a frozen description of a mechanical system.  No derivatives are taken here.

Two forms are accepted (the lectures' two): a Lagrangian L = T - V with non-conservative generalized
forces Q_nc (ME 6590 eq. 3), or the kinetic energy K with all generalized forces F_q (eq. 2).

Everything that is wrong with a model (`check.py`) is reported at once, in one ModelError.

Numbers given in g, mm, deg or rpm, in coherent SI: what a Model keeps.

The equations know coherent SI alone.  A unit that is a multiple of one belongs to the numbers beside it:
value and bounds of a parameter, start and rate of an input, the start of a coordinate and of its velocity,
what an output is otherwise.  An expression carries its own dimension.  Importers are told of the unit as the
one in which the variable is shown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from typing import Any, TypeVar

import sympy as sp
from sympy.core.function import AppliedUndef

from ..errors import ModelError, UnitError
from .check import declared_units, problems_of, splines_of
from .display import Displayed
from .elements import (
    NAME,
    TIME,
    Constraint,
    Contact,
    Embedding,
    Expr,
    Friction,
    Holonomic,
    Input,
    ModelFields,
    Nonholonomic,
    Output,
    Parameter,
    Peak,
    is_number,
    name_of,
)
from .frictions import split
from .kinds import check_containers
from .reactions import multiplier
from .scene import select
from .spline import Spline
from .units import DisplayUnit, Unit, parse_scaled


def _in_si(model: ModelFields) -> dict[str, Any]:
    """The fields of a model that are others in coherent SI, `display_units` among them.

    What cannot be read stays as it is, for `check.py` to tell.
    """
    shown: dict[str, str] = dict(model.display_units)
    numbers = {
        "parameters": ("value", "min", "max"),
        "inputs": ("start", "rate"),
        "outputs": ("otherwise",),
    }
    found: dict[str, Any] = {
        name: tuple(_taken(one, of, shown) for one in getattr(model, name))
        for name, of in numbers.items()
    }
    found["coordinates"], found["start"] = _motion(model.coordinates, model.start, shown)
    found["speeds"], found["start"] = _motion(model.speeds, found["start"], shown)
    if model.embedding is not None:
        coordinates, start = _motion(model.embedding.coordinates, model.embedding.start, shown)
        found["embedding"] = replace(model.embedding, coordinates=coordinates, start=start)
    return {**found, "display_units": shown}


def _scaled(text: object) -> DisplayUnit | None:
    """A unit that is a multiple of a coherent one; None for any other text."""
    try:
        read = parse_scaled(text, "a value")  # type: ignore[arg-type]
    except UnitError:
        return None
    return None if read.coherent else read


def _taken(one: Any, numbers: tuple[str, ...], shown: dict[str, str]) -> Any:
    """A parameter, input or output in coherent SI; `numbers`: its fields that are in its unit."""
    if not isinstance(one, Parameter | Input | Output):
        return one
    unit = _scaled(one.unit)
    if unit is None:
        return one
    shown[one.name if isinstance(one, Output) else name_of(one.symbol)] = unit.name
    given = {k: getattr(one, k) for k in numbers}
    si: dict[str, Any] = {k: unit.to_si(float(x)) for k, x in given.items() if is_number(x)}
    return replace(one, unit=unit.unit.name, **si)


def _motion(
    coordinates: Mapping[Expr, str], start: Mapping[Expr, Any], shown: dict[str, str]
) -> tuple[dict[Expr, str], dict[Expr, Any]]:
    """Coordinates with their units, and start values, in coherent SI."""
    units, values = dict(coordinates), dict(start)
    for q, text in coordinates.items():
        unit = _scaled(text)
        if unit is None or not isinstance(q, AppliedUndef):
            continue
        units[q] = unit.unit.name
        shown[name_of(q)] = unit.name
        for state in (q, q.diff(TIME)):
            if state in values and is_number(values[state]):
                values[state] = unit.to_si(float(values[state]))
    return units, values


__all__ = [
    "NAME",
    "Constraint",
    "Contact",
    "Embedding",
    "Expr",
    "Friction",
    "Holonomic",
    "Input",
    "Model",
    "Nonholonomic",
    "Output",
    "Parameter",
    "Peak",
    "name_of",
]


@dataclass(frozen=True)
class Model(ModelFields, Displayed):
    """A mechanical system.

    Either `lagrangian` (with non-conservative `forces`) or `kinetic_energy` (with all `forces`) is given;
    `forces` maps a coordinate to its generalized force in J/[coordinate].  `coordinates` maps each
    `dynamicsymbols` coordinate to its unit, `start` coordinates and their first derivatives to numbers in
    that unit or to expressions of parameters; those of them that are `rough` move onto the constraints
    before the others, as if they were omitted.  A unit may be a multiple of an SI unit (g, mm, deg): the
    model keeps every number in SI, and in `display_units` the unit in which importers show it.
    `descriptions` may explain coordinates.  `outputs` are quantities besides those that every FMU reports,
    `picture` how it looks.  Write a `Friction` among `constraints` (it is kept in `frictions`), a `Peak`
    among `outputs` (it is kept in `peaks`).  `speeds` maps speeds of the model's own (dynamicsymbols) to
    their units, `kinematics` the coordinates that move by them to their rates, q' = B(q, t) v + b(q, t)
    [unit/s]; four that keep e0^2 + e1^2 + e2^2 + e3^2 are a unit quaternion.  `unwrapped` maps an angle to
    what it equals modulo 2 pi.  `parts`, names with a line each, tell instead of equations what it is made
    of.  Generalized forces on a speed are in W/[speed].  `author`, `version`, `license` and `copyright`
    stand in the FMU's description.

    Raises ModelError with every problem at once: names, symbols, units, dimensions, numbers.
    """

    def __post_init__(self) -> None:
        if isinstance(self.coordinates, list | tuple):  # coordinates without units
            object.__setattr__(self, "coordinates", dict.fromkeys(self.coordinates, ""))
        problems = check_containers(self)
        if problems:
            raise ModelError(str(self.name), problems)
        maps = ("coordinates", "forces", "start", "descriptions", "display_units")
        for name in (*maps, "speeds", "kinematics", "unwrapped"):
            object.__setattr__(self, name, dict(getattr(self, name)))
        for name in ("constraints", "parameters", "inputs", "outputs", "picture", "parts", "rough"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        constraints, frictions = split(self.constraints)
        object.__setattr__(self, "constraints", constraints)
        object.__setattr__(self, "frictions", (*self.frictions, *frictions))
        peaks = tuple(o for o in self.outputs if isinstance(o, Peak))
        own = tuple(o for o in self.outputs if not isinstance(o, Peak))
        object.__setattr__(self, "outputs", own)
        object.__setattr__(self, "peaks", tuple(dict.fromkeys((*self.peaks, *peaks))))
        for name, value in _in_si(self).items():
            object.__setattr__(self, name, value)
        problems = problems_of(self)
        if problems:
            raise ModelError(str(self.name), problems)

    def started(
        self,
        start: Mapping[Expr, float],
        rough: Sequence[Expr],
        joint_starts: Mapping[str, tuple[float, bool]],
    ) -> Model:
        """The same that starts at these numbers, finite and in SI; nothing is checked again.  `joint_starts`:
        where outputs and unwrapped angles, with their rates, begin by which importers may give the start
        too, and whether `start` names them."""
        made = copy(self)
        object.__setattr__(made, "joint_starts", dict(joint_starts))
        object.__setattr__(made, "start", dict(start))
        object.__setattr__(made, "rough", tuple(rough))
        return made

    @cached_property
    def units(self) -> dict[Expr, Unit]:
        """Unit of every symbol that may stand in an expression."""
        return declared_units(self, [])

    @cached_property
    def splines(self) -> tuple[Spline, ...]:
        """The tables that stand in it, by name."""
        return tuple(splines_of(self))

    @cached_property
    def limited(self) -> dict[str, Friction]:
        """The constraints that hold by friction alone, by name."""
        return {name: f for f in self.frictions for name in f.of}

    def constraint(self, name: str) -> Constraint:
        """The constraint called `name`; KeyError if there is none."""
        return next(c for c in self.constraints if c.name == name)


Fields = TypeVar("Fields", bound=ModelFields)


def stuck(model: Fields, slipping: Sequence[str], problems: list[str]) -> Fields:
    """The model in which only the frictions `slipping` (names or patterns) may slip.

    What the others limit holds always, or while the one contact of its normal force is closed; parameters
    that stand in those frictions alone go with them.
    """
    may = select(slipping, [f.name for f in model.frictions], "friction", problems)
    gone = [f for f in model.frictions if f.name not in may]
    if not gone:
        return model
    gates: dict[str, str] = {}
    contacts = {multiplier(c.name): c.name for c in model.constraints if isinstance(c, Contact)}
    for f in gone:
        normal = sp.sympify(f.normal)
        normals = [name for symbol, name in contacts.items() if normal.has(symbol)]
        gates |= {name: normals[0] for name in f.of if normals}
        rough = [name for name in f.of if not isinstance(_row(model, name), Nonholonomic)]
        if len(normals) > 1 or (normals and rough):
            problems.append(
                f"the friction {f.name!r} shall not slip, but {', '.join(map(repr, f.of))} acts with "
                f"{' and '.join(map(repr, normals))}: that can be said of a Nonholonomic constraint and "
                f"one contact alone (while_closed); name it in `frictions`"
            )
    if problems:
        return model
    kept = tuple(f for f in model.frictions if f.name in may)
    rest = {f.name: getattr(model, f.name) for f in fields(model)} | {"frictions": kept}
    used = _symbols([v for name, v in rest.items() if name != "parameters"])
    idle = _symbols(gone) - used
    return replace(
        model,
        frictions=kept,
        constraints=tuple(
            replace(c, while_closed=gates[c.name])
            if c.name in gates and isinstance(c, Nonholonomic)
            else c
            for c in model.constraints
        ),
        parameters=tuple(p for p in model.parameters if p.symbol not in idle),
    )


def _row(model: ModelFields, name: str) -> object:
    return next(c for c in model.constraints if c.name == name)


def _symbols(x: Any) -> set[Expr]:
    """The symbols in everything that a model holds."""
    if isinstance(x, sp.Basic):
        return set(x.free_symbols)
    if isinstance(x, Mapping):
        return _symbols([*x.keys(), *x.values()])
    if is_dataclass(x) and not isinstance(x, type):
        return _symbols([getattr(x, f.name) for f in fields(x)])
    if isinstance(x, list | tuple):
        return set().union(*map(_symbols, x)) if x else set()
    return set()
