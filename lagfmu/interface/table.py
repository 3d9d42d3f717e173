"""(equations, scene) -> the FMU's variable table.

Names, order, references, causality, units, start values and dependencies are decided here only.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import sympy as sp

from ..errors import ModelError
from ..mechanics.coupling import coupled
from ..mechanics.equations import EquationsOfMotion, symbols_of
from ..mechanics.formulations.minimal import Reduction
from ..methods import FIXED_STEP, described
from ..model.model import Contact, Nonholonomic, name_of
from ..model.scene import Scene
from ..model.units import (
    ENERGY,
    FORCE,
    METRE,
    ONE,
    POWER,
    SECOND,
    Unit,
    dimension_of,
    generalized_force_unit,
    multiplier_unit,
    parse_unit,
)
from ..solver.state import MAXIMUM_STEPS
from .variables import BAR, Value, Variable, VariableTable

Expr = Any
SPEED = METRE / SECOND


def variable_table(
    eom: EquationsOfMotion, reduction: Reduction | None, scene: Scene
) -> VariableTable:
    """All variables of the FMU.  Raises ModelError if names collide or a unit cannot be written."""
    builder = _Builder(eom, reduction, scene)
    table = builder.table()
    if scene.reals_only:
        table = table.as_reals()
    problems = _collisions([v.name for v in table.variables])
    for v in table.variables:
        if v.unit is not None and any(e.denominator != 1 for e in v.unit.exponents):
            problems.append(
                f"the unit {v.unit.name} of {v.name!r} has fractional exponents, which FMI cannot "
                "express: write the constraint in another power"
            )
    if problems:
        raise ModelError(eom.model.name, problems)
    return table


def _collisions(names: Sequence[str]) -> list[str]:
    problems = []
    seen = set()
    for name in names:
        if name in seen:
            problems.append(f"two variables of the FMU would be called {name!r}: rename one")
        seen.add(name)
    for name in sorted(seen):
        parts = name.split(".")
        for k in range(1, len(parts)):
            if ".".join(parts[:k]) in seen:
                problems.append(
                    f"{'.'.join(parts[:k])!r} would be a variable and a group: rename it"
                )
    return problems


class _Builder:
    def __init__(self, eom: EquationsOfMotion, reduction: Reduction | None, scene: Scene) -> None:
        self.eom, self.reduction, self.scene = eom, reduction, scene
        self.model = eom.model
        self.units = eom.units
        self.stepped = eom if reduction is None else reduction.reduced
        self.into = {}
        if reduction is not None:
            self.into = dict(zip((*eom.q, *eom.v), (*reduction.phi, *reduction.vel), strict=True))
        self.state_names = [str(s) for s in (*self.stepped.q, *self.stepped.v)]
        hidden = {eom.u[eom.u.index(u) + k]: u for u in eom.estimated for k in (1, 2, 3)}
        self.into |= hidden  # they follow from the values of the motion itself
        self.inputs = [str(s) for s in eom.u if s not in hidden]
        self.known = {*self.state_names, *self.inputs}
        self.descriptions = {name_of(s): text for s, text in self.model.descriptions.items()}
        self.movable = self._movable()
        self.given = self._given()
        self.starts = {name: self.given.get(name, 0.0) for name in self.state_names}

    # ------------------------------------------------------------------ dependencies

    def _movable(self) -> set[str]:
        """States that the projection of the start values can move."""
        moved: set[str] = set()
        eom = self.stepped
        for coordinates, group in coupled(eom):
            rows = {k for k in group if eom.constraints[k].name not in eom.limited}
            if any(eom.f[k] is not None for k in rows):
                moved |= {str(eom.q[j]) for j in coordinates}
            if rows:
                moved |= {str(eom.v[j]) for j in coordinates}
        return moved

    def _given(self) -> dict[str, float]:
        """The start values that the model says, by name."""
        model, given = self.model, {}
        for state, value in model.start.items():
            given[str(self.eom.symbols[state])] = float(value)
        if model.embedding is not None:
            for state, value in model.embedding.start.items():
                given[str(self.eom.symbols[state])] = float(value)
        return given

    def symbols(self, *expressions: Expr) -> set[str]:
        """Names of the symbols that the expressions hold, reduced coordinates put in."""
        found: set[str] = set()
        for e in expressions:
            if e is not None:
                found |= {str(s) for s in sp.sympify(e).xreplace(self.into).free_symbols}
        return found

    def group(self, *, coordinate: int | None = None, row: int | None = None) -> set[str]:
        """Symbols behind the accelerations and multipliers that are solved together."""
        for coordinates, rows, symbols in self.groups:
            if coordinate in coordinates or (row is not None and row in rows):
                return symbols
        raise KeyError((coordinate, row))

    @cached_property
    def groups(self) -> list[tuple[frozenset[int], frozenset[int], set[str]]]:
        """The groups of `coupled`, with the symbols in their equations."""
        eom, found = self.eom, []
        for coordinates, rows in coupled(eom):
            M = [m for (i, _), m in eom.M.todok().items() if i in coordinates]
            G = [a for (k, _), a in eom.G.todok().items() if k in rows]
            rest = [eom.F[j] for j in coordinates] + [eom.gamma[k] for k in rows]
            found.append((coordinates, rows, self.symbols(*M, *G, *rest)))
        return found

    @cached_property
    def stepped_groups(self) -> list[tuple[set[str], set[str]]]:
        """Of the coordinates that are stepped: the states of each group, the symbols of its start."""
        eom, found = self.stepped, []
        for coordinates, rows in coupled(eom):
            own = {str(s) for j in coordinates for s in (eom.q[j], eom.v[j])}
            behind = self.symbols(*(eom.f[k] for k in rows), *(eom.nu[k] for k in rows))
            behind |= self.symbols(*(a for (k, _), a in eom.G.todok().items() if k in rows))
            behind |= self.symbols(*(m for (i, _), m in eom.M.todok().items() if i in coordinates))
            found.append((own, own | behind))
        return found

    def at_start(self, names: Iterable[str]) -> tuple[str, ...]:
        """Inputs, parameters and exact start values behind a value at the start."""
        found = set(names)
        for own, behind in self.stepped_groups:
            if found & own & self.movable:
                found |= behind
        parameters = {str(p) for p in self.eom.p}
        exact = set(self.state_names) - self.movable
        return self.sorted(found & (parameters | exact | set(self.inputs)))

    def sorted(self, names: Iterable[str]) -> tuple[str, ...]:
        order = [*(str(p) for p in self.eom.p), *self.inputs, *self.state_names]
        wanted = set(names)
        return tuple(n for n in order if n in wanted)

    # ------------------------------------------------------------------ variables

    def output(
        self,
        name: str,
        description: str,
        unit: Unit | None,
        symbols: Iterable[str],
        kind: str = "Real",
        derivative_of: str | None = None,
        discrete: bool = False,
    ) -> Variable:
        names = set(symbols)
        return Variable(
            name=name,
            kind=kind,
            role="output",
            causality="output",
            variability="discrete" if discrete or kind != "Real" else "continuous",
            initial="calculated",
            description=description,
            unit=unit,
            derivative_of=derivative_of,
            depends=self.sorted(names & self.known),
            depends_initially=self.at_start(names),
        )

    def state(self, name: str, description: str, derivative_of: str | None) -> Variable:
        approx = name in self.movable
        return Variable(
            name=name,
            kind="Real",
            role="start",
            causality="output",
            variability="continuous",
            initial="approx" if approx else "exact",
            description=description,
            start=self.starts[name],
            given=name in self.given,
            unit=self.units[name],
            derivative_of=derivative_of,
            depends=(name,),
            depends_initially=self.at_start([name]) if approx else (),
        )

    def table(self) -> VariableTable:
        variables = [
            *self.parameters(),
            *self.solver(),
            *self.drives(),
            *self.motion(),
            *self.constraint_outputs(),
            *self.energies(),
            *self.own_outputs(),
            *self.contact_outputs(),
            *self.friction_outputs(),
            self.output("solver.steps", "internal steps taken so far", None, (), "Integer"),
        ]
        if self.scene.error_bars:
            variables += self.error_bars(variables)
        n = len(self.state_names) // 2
        q = self.state_names[:n]
        derivatives = [x for c in q for x in (f"der({c})", f"der({c},2)")]
        states = [x for c in q for x in (c, f"der({c})")]
        return VariableTable(tuple(variables), tuple(states), tuple(derivatives))

    def parameters(self) -> list[Variable]:
        return [
            Variable(
                name=name_of(p.symbol),
                kind="Real",
                role="parameter",
                causality="parameter",
                variability="fixed",
                initial="exact",
                description=p.description or f"parameter {name_of(p.symbol)}",
                start=float(p.value),
                unit=self.units[name_of(p.symbol)],
                minimum=p.min,
                maximum=p.max,
                positive=bool(p.symbol.is_positive),
            )
            for p in self.eom.parameters
        ]

    def solver(self) -> list[Variable]:
        def setting(
            name: str, start: Value, unit: Unit | None, text: str, maximum: float | None = None
        ) -> Variable:
            return Variable(
                name=f"solver.{name}",
                kind="Enumeration" if isinstance(start, str) else "Real",
                role="solver",
                causality="parameter",
                variability="fixed",
                initial="exact",
                description=text,
                start=start,
                unit=unit,
                minimum=None if isinstance(start, str) else 0.0,
                maximum=maximum,
            )

        methods = self.scene.selectable
        choice = setting("method", self.scene.method, None, described(methods))
        choice = dataclasses.replace(choice, items=tuple(methods))
        step = setting(
            "step", self.scene.step, SECOND, "largest fixed step of rk4; 0: chosen from the start"
        )
        return [
            *([choice] if len(methods) > 1 else []),
            setting(
                "tolerance",
                0.0,
                ONE,
                "relative tolerance of each step; 0: the one of fmi2SetupExperiment, else "
                f"{self.scene.tolerance!r}",
                1.0,
            ),
            *([step] if set(FIXED_STEP).intersection(methods) else []),
            setting("maximum_step", 0.0, SECOND, "largest adaptive step; 0: no limit"),
            setting(
                "maximum_steps",
                MAXIMUM_STEPS,
                ONE,
                "steps shorter than 1e-6 of the natural time that a communication step may take; "
                "0: no limit",
            ),
        ]

    def drives(self) -> list[Variable]:
        variables = []
        for i in self.model.inputs:
            name = name_of(i.symbol)
            if name not in self.inputs:
                continue  # it keeps its start value
            estimated = i.rates == "estimated"
            names, text = [name], i.description or f"input {name}"
            if i in self.model.prescribed:
                names += [f"der({name})", f"der({name},2)"]
            if estimated:
                names.append(f"der({name},3)")
            heads = ("", "rate of: ", "second derivative of: ", "third derivative of: ")
            starts = (float(i.start), float(i.rate), 0.0, 0.0)
            unit = self.units[name]
            for order, full in enumerate(names):
                given = order == 0 or not estimated
                tail = "" if given else ", estimated from its values at the communication points"
                variables.append(
                    Variable(
                        name=full,
                        kind="Real",
                        role="input" if given else "estimate",
                        causality="input" if given else "local",
                        variability="continuous",
                        initial=None if given else "calculated",
                        description=f"{heads[order]}{text}{tail}",
                        start=starts[order],
                        unit=unit,
                        derivative_of=names[order - 1] if order and given else None,
                    )
                )
                unit = unit.per_second()
        return variables

    def motion(self) -> list[Variable]:
        """Coordinates, velocities, accelerations: those of the model, then those of an embedding."""
        variables = []
        states = set(self.state_names)
        for j, (q, v) in enumerate(zip(self.eom.q, self.eom.v, strict=True)):
            texts = self._texts(str(q))
            for s, text, of in ((str(q), texts[0], None), (str(v), texts[1], str(q))):
                if s in states:
                    variables.append(self.state(s, text, of))
                else:
                    variables.append(
                        self.output(
                            s, text, self.units[s], self.symbols(q if of is None else v), "Real", of
                        )
                    )
            if self.eom.bare and str(q) not in states:
                continue
            symbols = self.motion_of_stepped if self.eom.bare else self.group(coordinate=j)
            name = f"der({q},2)"
            variables.append(self.output(name, texts[2], self.units[name], symbols, "Real", str(v)))
        own = {str(q) for q in self.eom.q}
        for q, v in zip(self.stepped.q, self.stepped.v, strict=True):
            if str(q) in own:
                continue
            texts = self._texts(str(q))
            variables.append(self.state(str(q), texts[0], None))
            variables.append(self.state(str(v), texts[1], str(q)))
            name = f"der({q},2)"
            symbols = self.motion_of_stepped
            variables.append(self.output(name, texts[2], self.units[name], symbols, "Real", str(v)))
        return sorted(variables, key=self._place) if self.eom.bare else variables

    def _place(self, v: Variable) -> int:
        """Where the coordinate stands in the model; those of an embedding come last."""
        order = [str(self.eom.symbols[c]) for c in self.model.coordinates]
        name = v.name.removeprefix("der(").removesuffix(")").removesuffix(",2")
        return order.index(name) if name in order else len(order)

    @cached_property
    def motion_of_stepped(self) -> set[str]:
        """Symbols behind the accelerations of the stepped coordinates of a reduction."""
        eom = self.stepped
        return self.symbols(*eom.M.todok().values(), *eom.F, *eom.G.todok().values(), *eom.gamma)

    def _texts(self, name: str) -> tuple[str, str, str]:
        text = self.descriptions.get(name, f"coordinate {name}")
        return text, f"velocity of: {text}", f"acceleration of: {text}"

    def constraint_outputs(self) -> list[Variable]:
        variables = []
        model, jacobian = self.model, self.eom.G.todok()
        entries = self.symbols(*jacobian.values())
        for k, c in enumerate(self.eom.constraints):
            what = f"constraint {c.name}" + (f": {c.description}" if c.description else "")
            expression = sp.sympify(c.expression)
            unit = dimension_of(expression, model.units, c.name) or ONE
            lam = multiplier_unit(unit, isinstance(c, Nonholonomic))
            row = self.group(row=k)
            variables.append(self.output(f"lambda.{c.name}", f"multiplier of {what}", lam, row))
            if isinstance(c, Nonholonomic) or c.name in self.eom.limited:
                text = f"velocity residual of {what}"
                own = {j: a for (i, j), a in jacobian.items() if i == k}
                behind = self.symbols(*own.values(), self.eom.nu[k], *(self.eom.v[j] for j in own))
            else:
                text = f"position residual of {what}"
                behind = self.symbols(self.eom.f[k])
            if c.name in self.eom.limited and not isinstance(c, Nonholonomic):
                unit = unit.per_second()
            variables.append(self.output(f"residual.{c.name}", text, unit, behind))
            text = f"true where lambda.{c.name} is determined uniquely"
            variables.append(self.output(f"unique.{c.name}", text, None, entries, "Boolean"))
        for j, q in enumerate(() if self.eom.bare else self.eom.q):
            unit = generalized_force_unit(self.units[str(q)])
            touching = [k for k in range(self.eom.m) if (k, j) in jacobian]
            symbols = self.group(coordinate=j) if touching else set()
            text = f"generalized force of all constraints on {q}"
            variables.append(self.output(f"Q.{q}", text, unit, symbols))
            for k in touching:
                name = self.eom.constraints[k].name
                text = f"generalized force of constraint {name} on {q}"
                variables.append(self.output(f"Q.{name}.{q}", text, unit, symbols))
        return variables

    def energies(self) -> list[Variable]:
        T, V = self.eom.kinetic, self.eom.potential
        kinetic, potential = self.symbols(T), self.symbols(V)
        total = kinetic | potential
        variables = []
        if T is not None:
            variables.append(self.output("energy.kinetic", "kinetic energy", ENERGY, kinetic))
        if V is not None:
            variables.append(self.output("energy.potential", "potential energy", ENERGY, potential))
        if T is not None and V is not None:
            text = "kinetic plus potential energy"
            variables.append(self.output("energy.total", text, ENERGY, total))
        return variables

    def own_outputs(self) -> list[Variable]:
        """The model's own: their dependencies are those of all that stands in them."""
        variables = []
        for o in self.eom.outputs:
            found = symbols_of(o)
            behind = self.symbols(*found)
            for j, (a, force) in enumerate(zip(self.eom.vdot, self.eom.Q, strict=True)):
                if found & {a, force}:
                    behind |= self.group(coordinate=j)
            for k, lam in enumerate(self.eom.lam):
                if lam in found:
                    behind |= self.group(row=k)
            text = o.description or f"output {o.name}"
            variables.append(self.output(o.name, text, parse_unit(o.unit, o.name), behind))
        return variables

    def contact_outputs(self) -> list[Variable]:
        variables = []
        coordinates = [(str(q), str(v)) for q, v in zip(self.eom.q, self.eom.v, strict=True)]
        constraints = self.eom.constraints
        if self.eom.bare and self.reduction is not None:
            constraints = self.reduction.constraints
        for k, c in enumerate(constraints):
            if not isinstance(c, Contact):
                continue
            behind = self.motion_of_stepped if self.eom.bare else self.group(row=k)
            names = self.known | behind  # it opens and closes by f, its rate and lambda
            head = f"departure.{c.name}"
            tail = f"the latest departure from {c.name}, 0 before the first"
            variables += [
                self.output(
                    f"contact.{c.name}", f"true while {c.name} is closed", None, names, "Boolean"
                ),
                self.output(f"{head}.count", f"departures from {c.name}", None, (), "Integer"),
                self.output(f"{head}.time", f"time of {tail}", SECOND, (), discrete=True),
            ]
            for q, v in coordinates:
                variables += [
                    self.output(f"{head}.{q}", f"{q} at {tail}", self.units[q], (), discrete=True),
                    self.output(
                        f"{head}.velocity.{q}", f"{v} at {tail}", self.units[v], (), discrete=True
                    ),
                ]
        return variables

    def friction_outputs(self) -> list[Variable]:
        variables = []
        row = {c.name: k for k, c in enumerate(self.eom.constraints)}
        for law in self.eom.frictions:
            what = f"friction {law.name}" + (f": {law.description}" if law.description else "")
            behind = self.group(row=row[law.of[0]]) | self.symbols(*law.expressions)
            names = self.known | behind
            force, head = FORCE, f"slipping.{law.name}"
            text = f"true while {what} sticks (and its normal contact is closed)"
            variables.append(self.output(f"sticks.{law.name}", text, None, names, "Boolean"))
            for name in law.of:
                text = f"slip velocity G v - nu of {name}"
                variables.append(self.output(f"slip.{name}", text, SPEED, self._rates(row[name])))
            text = f"static coefficient times normal force less |lambda| of {what}"
            variables.append(self.output(f"margin.{law.name}", text, force, names))
            text = f"power of {what}, lambda times slip velocity, never positive"
            variables.append(self.output(f"power.{law.name}", text, POWER, names))
            tail = f"the latest start of slipping of {law.name}, 0 before the first"
            variables += [
                self.output(
                    f"{head}.count", f"starts of slipping of {law.name}", None, (), "Integer"
                ),
                self.output(f"{head}.time", f"time of {tail}", SECOND, (), discrete=True),
            ]
            for q, v in zip(self.eom.q, self.eom.v, strict=True):
                for name, s in ((f"{q}", f"{q}"), (f"velocity.{q}", f"{v}")):
                    text = f"{s} at {tail}"
                    variables.append(
                        self.output(f"{head}.{name}", text, self.units[s], (), discrete=True)
                    )
        if self.eom.frictions:
            text = "energy that frictions and impacts dissipated so far (Model Exchange: impacts)"
            variables.append(self.output("energy.dissipated", text, ENERGY, ()))
        return variables

    def error_bars(self, variables: Iterable[Variable]) -> list[Variable]:
        """One for each lambda, Q, coordinate, velocity, own output, and time of an event."""
        own = {o.name for o in self.eom.outputs}
        motion = {str(s) for eom in (self.eom, self.stepped) for s in (*eom.q, *eom.v)}
        barred = [
            v
            for v in variables
            if v.name.startswith(("lambda.", "Q."))
            or v.name in own | motion
            or re.fullmatch(r"(departure|slipping)\.\w+\.time", v.name)
        ]
        text = (
            "error bar of {}: an estimate of how far it may be off, by a run at a coarser tolerance"
        )
        return [
            dataclasses.replace(
                self.output(f"{BAR}{v.name}", text.format(v.name), v.unit, (), discrete=True),
                bar_of=v.name,
            )
            for v in barred
        ]

    def _rates(self, k: int) -> set[str]:
        """The symbols behind G v - nu of a row."""
        own = {j: a for (i, j), a in self.eom.G.todok().items() if i == k}
        return self.symbols(*own.values(), self.eom.nu[k], *(self.eom.v[j] for j in own))
