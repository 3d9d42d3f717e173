"""What is known of a model in a scene after each step of prepare.py; each value holds the one before it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..interface.variables import VariableTable
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form
from ..model.elements import Expr
from ..model.model import Contact, Model
from ..model.scene import Scene
from ..numeric.start import Start
from ..numeric.system import System


@dataclass(frozen=True)
class Structure:
    """n, m, rank of G with all constraints acting, degrees of freedom, redundant constraints, all whose
    multipliers are not unique, frictions whose normal forces are not, start, the constraints that the given
    start values miss, in words, and the rank with no contact closed."""

    n: int
    m: int
    rank: int
    redundant: tuple[str, ...]
    shared: tuple[str, ...]
    undecided: tuple[str, ...]
    start: Start
    missed: tuple[str, ...]
    open_rank: int

    @property
    def degrees_of_freedom(self) -> int:
        """N = n - rank G."""
        return self.n - self.rank


@dataclass(frozen=True)
class Request:
    """A model and the scene that is asked for; its equations, where they are known from another scene."""

    model: Model
    asked: Scene
    known: EquationsOfMotion | None = None


@dataclass(frozen=True)
class Derived:
    """`derived`: the equations of the model, whatever the scene; `asked`: the scene as it was given."""

    model: Model
    asked: Scene
    derived: EquationsOfMotion


@dataclass(frozen=True)
class Narrowed(Derived):
    """`scene`: with its formulation; `form`: the equations in it, contacts that cannot open as constraints;
    `whole`: all variables of these; `outputs`: those that are asked for, in the order of the table; `read`:
    with those that are computed for them; `fixed`: symbols that are numbers."""

    scene: Scene
    form: Form
    whole: VariableTable
    outputs: tuple[str, ...]
    read: tuple[str, ...]
    fixed: Mapping[Expr, Expr]

    @property
    def equations(self) -> EquationsOfMotion:
        """Those of the scene."""
        return self.form.equations

    @property
    def formulation(self) -> str:
        """The formulation that the scene has in the end."""
        return self.form.formulation


@dataclass(frozen=True)
class Reduced(Narrowed):
    """`form`: what the outputs need, in symbols, for people to read; `coded`: what code is printed from,
    numbers put in, and of the full equations only what is read.  The same for a scene that asks for
    everything and fixes nothing.  `numbers`: the values that are put in, by name."""

    coded: Form
    numbers: Mapping[str, Any]

    @property
    def held(self) -> tuple[str, ...]:
        """The contacts that cannot open."""
        contacts = {c.name for c in self.model.constraints if isinstance(c, Contact)}
        acting = self.equations.constraints
        return tuple(c.name for c in acting if c.name in contacts and not isinstance(c, Contact))


@dataclass(frozen=True)
class Lowered(Reduced):
    """`table`: the variables of the FMU; `system`: the numeric form of `coded`, `examined`: that of `form`,
    before anything was left out of the code."""

    table: VariableTable
    system: System
    examined: System


@dataclass(frozen=True)
class Prepared(Lowered):
    """All that is known before anything is packaged, each thing made once."""

    structure: Structure
