"""The FMU's variables, one by one and as a table.  Both targets and the documentation share it; the
table itself is made in table.py.

What the variables of a table may be set to, by one kind of rule (model/rule.py).

Python callers ask `problems_of`.  The page gets MESSAGES as data, and the columns of each variable
(studio/live/page.py).  The FMU itself checks what it is given by the same columns of the variable table:
runtime/fmi/experiment.c, and by the same kind of rule fmu/slave/instance.py, the python target.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from .. import names
from ..methods import NUMBERS, described
from ..model.rule import Rule, missing
from ..model.units import ONE, DisplayUnit, Unit
from ..names import Subject

Value = float | int | bool | str
RECORD = (names.STEPS, names.CONTACT, names.STICKS, *names.COUNTS)


@dataclass(frozen=True)
class Variable:
    """One FMI scalar variable.

    `of` says what it is of, and so its name.  `kind` is Real, Integer, Boolean or Enumeration (its
    `items` are methods, `start` one by name); `role` says what may set it: parameter, start, input,
    solver, output (nothing), or interface (`with_further`).  `depends` are the inputs and states that it is
    computed from at a communication point, `depends_initially` the inputs and exact start values at the
    start; with them `time`, where it stands in the equations.  `members`: of an array, what is in it.
    `positive`: zero, though not below the minimum, makes no sense.  `given`: of a start value, the model's
    `start` says it; otherwise it is 0 because nobody did.  `display`: the unit in which the model gives it, a
    multiple of `unit`.  `measured`: the variable whose extreme it is.
    """

    of: Subject
    role: str  # or estimate: the FMU itself, from an input's values
    causality: str
    description: str
    kind: str = "Real"
    variability: str = "continuous"
    initial: str | None = None
    start: Value | None = None
    unit: Unit | None = None
    display: DisplayUnit | None = None
    derivative_of: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    positive: bool = False
    given: bool = False
    items: tuple[str, ...] = ()
    nominal: float | None = None
    depends: tuple[str, ...] = ()
    depends_initially: tuple[str, ...] = ()
    measured: Variable | None = None
    members: tuple[str, ...] = ()

    @cached_property
    def name(self) -> str:
        """As the FMU calls it."""
        return self.of.name

    @property
    def bar_of(self) -> str:
        """The variable whose error bar it is; empty if it is none."""
        return self.of.coordinate if self.of.quantity == names.ERROR else ""


@dataclass(frozen=True)
class VariableTable:
    """The variables in the order of their value references (0, 1, ...), and the state derivatives."""

    variables: tuple[Variable, ...]
    states: tuple[str, ...]
    derivatives: tuple[str, ...]

    @cached_property
    def position(self) -> dict[str, int]:
        """Value reference by name; the index in modelDescription.xml is one more."""
        return {v.name: k for k, v in enumerate(self.variables)}

    def __getitem__(self, name: str) -> Variable:
        return self.variables[self.position[name]]

    def __contains__(self, name: str) -> bool:
        return name in self.position

    def those(self, *quantities: str) -> tuple[Variable, ...]:
        """The variables of these quantities."""
        return tuple(v for v in self.variables if v.of.quantity in quantities)

    def keeping(self, outputs: Collection[str]) -> VariableTable:
        """Without the outputs that are not among these.

        Local, if they are not among the outputs, but there are the states, so that their start values
        can be set, their derivatives for model exchange, and the record of the run: the steps that
        were taken, which contacts are closed and which frictions stick, and how often that changed, for
        that says which closed form holds.
        """
        if names.DISSIPATED in self.states and names.DISSIPATED not in outputs:
            return self.without(names.DISSIPATED, names.DISSIPATION).keeping(outputs)
        moving, outputs = {*self.states, *self.derivatives}, set(outputs)
        kept = []
        for v in self.variables:
            if v.causality == "output" and v.name not in outputs:
                if v.name not in moving and v.of.quantity not in RECORD:
                    continue
                v = replace(v, causality="local")
            kept.append(v)
        known = {v.name for v in kept}
        kept = [v if v.derivative_of in known else replace(v, derivative_of=None) for v in kept]
        return VariableTable(tuple(kept), self.states, self.derivatives)

    def without(self, *heads: str) -> VariableTable:
        """Without the variables of these kinds, and their error bars; a state goes with its derivative."""
        gone = {v.name for v in self.variables if {v.of.head, v.of.quantity}.intersection(heads)}
        kept = tuple(v for v in self.variables if v.name not in gone and v.bar_of not in gone)
        moving = [p for p in zip(self.states, self.derivatives, strict=True) if p[1] not in gone]
        states, derivatives = (tuple(p[k] for p in moving) for k in (0, 1))
        return VariableTable(kept, states, derivatives)

    @cached_property
    def varied(self) -> tuple[str, ...]:
        """The parameters and start values by which derivatives are taken."""
        return tuple(dict.fromkeys(v.of.constraint for v in self.those(names.SENSITIVITY)))

    @property
    def measurable(self) -> tuple[Variable, ...]:
        """What may have a peak: the continuous outputs."""
        return tuple(v for v in self.outputs if v.variability == "continuous")

    @cached_property
    def measured(self) -> dict[str, Variable]:
        """The variables, by name, whose extremes are among these; they may not be themselves."""
        found = (v.measured for v in self.variables)
        return {v.name: v for v in found if v is not None}

    def offering(self, methods: Collection[str]) -> VariableTable:
        """The same, where `solver.method` can only be one of these."""
        offered = {"description": described(methods), "items": tuple(methods)}
        return self._changed({v.name: offered for v in self.those(names.METHOD)})

    def calculating(self, calculated: Collection[str]) -> VariableTable:
        """The same, where these have no start, but for the states."""
        found = {n for n in calculated if n in self and n not in self.states}
        said = {"role": "output", "initial": "calculated", "start": None, "given": False}
        return self._changed(dict.fromkeys(found, said))

    def _changed(self, fields: Mapping[str, Mapping[str, Any]]) -> VariableTable:
        """The same, where variables of these names have other fields."""
        variables = (replace(v, **fields.get(v.name, {})) for v in self.variables)
        return replace(self, variables=tuple(variables))

    def as_reals(self) -> VariableTable:
        """The same with Reals for Booleans and Integers; without an Enumeration.

        The position is the value reference, so that this comes before anything refers to one.
        """
        variables = [
            v if v.kind == "Real" else replace(v, kind="Real", unit=ONE, minimum=0.0)
            for v in self.variables
            if v.kind != "Enumeration"
        ]
        return replace(self, variables=tuple(variables))

    def with_nominals(self, sizes: Mapping[str, float]) -> VariableTable:
        """The same with nominal values, SI."""
        return self._changed({name: {"nominal": size} for name, size in sizes.items()})

    def without_local_derivatives(self) -> VariableTable:
        """What co-simulation needs: derivatives that are no outputs serve model exchange only."""
        gone = {
            n for n in self.derivatives if self[n].causality == "local" and n not in self.states
        }
        return VariableTable(
            tuple(v for v in self.variables if v.name not in gone),
            self.states,
            tuple(name for name in self.derivatives if name not in gone),
        )

    @property
    def outputs(self) -> tuple[Variable, ...]:
        """The variables of causality output."""
        return tuple(v for v in self.variables if v.causality == "output")


CALCULATED = ("output", "estimate", "interface")  # roles of what nobody sets


def rules_of(table: VariableTable) -> dict[str, Rule]:
    """Of a variable table, by name."""
    return {
        v.name: Rule(
            v.name,
            v.kind,
            v.role not in CALCULATED,
            v.minimum,
            v.maximum,
            v.positive,
            {m: NUMBERS[m] for m in v.items},
            v.start if isinstance(v.start, float) else None,
            v.description.endswith(names.FOLLOWS),
        )
        for v in table.variables
    }


def problems_of(known: Mapping[str, Rule], values: Mapping[str, Any]) -> list[str]:
    """All that is wrong with values by name: variables that there are not, or that nobody sets; numbers."""
    found = []
    for name, value in values.items():
        if text := unsettable(known, name) or known[name].problem(value):
            found.append(text)
    return found


def unsettable(known: Mapping[str, Rule], name: str) -> str:
    """Why nobody sets a variable of this name; empty if it can be set."""
    if name in known and known[name].settable:
        return ""
    settable = [n for n, rule in known.items() if rule.settable]
    settable.sort(key=lambda n: names.read(n).head == names.SOLVER)  # what is physics stands first
    return missing(name, settable, "cannot be set")
