"""What the user writes: a frozen description of a mechanical system.  No derivatives are taken here.

Two forms are accepted (the lectures' two): a Lagrangian L = T - V with non-conservative generalized
forces Q_nc (ME 6590 eq. 3), or the kinetic energy K with all generalized forces F_q (eq. 2).

Everything that is wrong with a model (`check.py`) is reported at once, in one ModelError.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

from ..errors import ModelError
from .check import declared_units, problems_of, splines_of
from .display import Displayed
from .elements import (
    NAME,
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
    name_of,
)
from .frictions import split
from .kinds import check_containers
from .scaled import in_si
from .spline import Spline
from .units import Unit

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
        for name, value in in_si(self).items():
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
