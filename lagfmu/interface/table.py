"""(form, scene) -> the FMU's variable table.

Names, order, references, causality, units, start values and dependencies are decided here only.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from functools import cached_property

import sympy as sp

from .. import names
from ..errors import ModelError
from ..mechanics.coupling import coupled
from ..mechanics.equations import symbols_of
from ..mechanics.form import Form
from ..methods import FIXED_STEP, described
from ..model.elements import Expr
from ..model.model import Contact, Nonholonomic, name_of
from ..model.scene import Scene
from ..model.selection import select
from ..model.units import (
    ENERGY,
    FORCE,
    METRE,
    ONE,
    POWER,
    SECOND,
    DisplayUnit,
    Unit,
    dimension_of,
    generalized_force_unit,
    multiplier_unit,
    parse_scaled,
    parse_unit,
)
from ..names import Subject, derivative
from ..numeric.thresholds import LARGEST_TOLERANCE
from ..numeric.tolerance import MAXIMUM_STEPS
from .variables import Value, Variable, VariableTable

SPEED = METRE / SECOND
BARRED = (  # what has an error bar, besides coordinates, velocities and outputs of one word
    *(names.MULTIPLIER, names.FORCE, names.OWN, *names.COUNT_OF),
)


def variable_table(form: Form, scene: Scene) -> VariableTable:
    """All variables of the FMU.  Raises ModelError if names collide or a unit cannot be written."""
    builder = _Builder(form, scene)
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
        raise ModelError(form.equations.model.name, problems)
    return table


def _collisions(known: Sequence[str]) -> list[str]:
    problems = []
    seen = set()
    for name in known:
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
    def __init__(self, form: Form, scene: Scene) -> None:
        eom, reduction = form.equations, form.reduction
        self.eom, self.reduction, self.scene = eom, reduction, scene
        self.model = eom.model
        self.units = eom.units
        self.stepped = form.stepped
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
        self.given = eom.starts()
        self.starts = {name: self.given.get(name, sp.S.Zero) for name in self.state_names}

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

    def at_start(self, symbols: Iterable[str]) -> tuple[str, ...]:
        """Inputs, parameters and exact start values behind a value at the start."""
        found = set(symbols)
        for own, behind in self.stepped_groups:
            if found & own & self.movable:
                found |= behind
        parameters = {str(p) for p in self.eom.p}
        formulas = {name for name, e in self.starts.items() if e.free_symbols}
        found |= self.symbols(*(self.starts[name] for name in found & formulas))
        exact = set(self.state_names) - self.movable - formulas
        return self.sorted(found & (parameters | exact | set(self.inputs)))

    def sorted(self, symbols: Iterable[str]) -> tuple[str, ...]:
        order = [*(str(p) for p in self.eom.p), *self.inputs, *self.state_names]
        wanted = set(symbols)
        return tuple(n for n in order if n in wanted)

    # ------------------------------------------------------------------ variables

    def output(
        self,
        of: Subject,
        description: str,
        unit: Unit | None,
        symbols: Iterable[str],
        kind: str = "Real",
        derivative_of: str | None = None,
        discrete: bool = False,
    ) -> Variable:
        behind = set(symbols)
        return Variable(
            of=of,
            kind=kind,
            role="output",
            causality="output",
            variability="discrete" if discrete or kind != "Real" else "continuous",
            initial="calculated",
            description=description,
            unit=unit,
            derivative_of=derivative_of,
            depends=self.sorted(behind & self.known),
            depends_initially=self.at_start(behind),
        )

    def state(self, of: Subject, description: str, derivative_of: str | None) -> Variable:
        name = of.name
        start = self.starts[name]
        approx = name in self.movable or bool(start.free_symbols)
        if start.free_symbols:
            description += f"; starts at {start} {names.FOLLOWS}"
        return Variable(
            of=of,
            kind="Real",
            role="start",
            causality="output",
            variability="continuous",
            initial="approx" if approx else "exact",
            description=description,
            start=self.eom.at_parameters(start),
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
            *self.losses(),
            self.output(Subject(names.STEPS), "internal steps taken so far", None, (), "Integer"),
        ]
        if self.scene.error_bars:
            variables += self.error_bars(variables)
        variables += self.peaks(VariableTable(tuple(variables), (), ()).measurable)
        variables = [dataclasses.replace(v, display=self.displayed(v)) for v in variables]
        n = len(self.state_names) // 2
        q = self.state_names[:n]
        derivatives = [derivative(c, k) for c in q for k in (1, 2)]
        states = [derivative(c, k) for c in q for k in (0, 1)]
        if self.lost:
            states.append(names.DISSIPATED)
            derivatives.append(names.DISSIPATION)
        return VariableTable(tuple(variables), tuple(states), tuple(derivatives))

    @property
    def lost(self) -> bool:
        """The energy dissipated is a state: there are frictions, and an importer may integrate."""
        return bool(self.eom.frictions) and not self.scene.error_bars and not self.eom.estimated

    def displayed(self, v: Variable) -> DisplayUnit | None:
        """The unit in which the model gives what the variable is of."""
        text = self.model.display_units.get(v.of.coordinate)
        if text is None or v.unit is None:
            return None
        shown: DisplayUnit | None = parse_scaled(text, v.name)
        for _ in range(v.of.order):
            shown = None if shown is None else shown.per_second()
        return shown if shown is not None and shown.unit.same_dimension(v.unit) else None

    def parameters(self) -> list[Variable]:
        return [
            Variable(
                of=_value(name_of(p.symbol)),
                kind="Real",
                role="parameter",
                causality="parameter",
                variability="fixed",
                initial="exact",
                description=p.description,
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
                of=Subject(name),
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
        choice = setting(names.METHOD, self.scene.method, None, described(methods))
        choice = dataclasses.replace(choice, items=tuple(methods))
        step = setting(
            names.STEP,
            self.scene.step,
            SECOND,
            "largest fixed step of rk4; 0: chosen from the start",
        )
        return [
            *([choice] if len(methods) > 1 else []),
            setting(
                names.TOLERANCE,
                0.0,
                ONE,
                "relative tolerance of each step; 0: the one of the experiment, else "
                f"{self.scene.tolerance!r}",
                float(LARGEST_TOLERANCE),
            ),
            *([step] if set(FIXED_STEP).intersection(methods) else []),
            setting(names.MAXIMUM_STEP, 0.0, SECOND, "largest adaptive step; 0: no limit"),
            setting(
                names.MAXIMUM_STEPS,
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
            text = i.description or f"input {name}"
            orders = (3 if i in self.model.prescribed else 1) + (1 if estimated else 0)
            heads = ("", "rate of: ", "second derivative of: ", "third derivative of: ")
            starts = (float(i.start), float(i.rate), 0.0, 0.0)
            unit = self.units[name]
            for order in range(orders):
                given = order == 0 or not estimated
                tail = "" if given else ", estimated from its values at the communication points"
                variables.append(
                    Variable(
                        of=_value(name, order),
                        kind="Real",
                        role="input" if given else "estimate",
                        causality="input" if given else "local",
                        variability="continuous",
                        initial=None if given else "calculated",
                        description=f"{heads[order]}{text}{tail}",
                        start=starts[order],
                        unit=unit,
                        derivative_of=derivative(name, order - 1) if order and given else None,
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
            for order, (s, of) in enumerate(((q, None), (v, str(q)))):
                what, text = _value(str(q), order), texts[order]
                if what.name in states:
                    variables.append(self.state(what, text, of))
                else:
                    unit = self.units[what.name]
                    variables.append(self.output(what, text, unit, self.symbols(s), "Real", of))
            if self.eom.bare and str(q) not in states:
                continue
            symbols = self.motion_of_stepped if self.eom.bare else self.group(coordinate=j)
            variables.append(self._acceleration(q, v, symbols))
        own = {str(q) for q in self.eom.q}
        for q, v in zip(self.stepped.q, self.stepped.v, strict=True):
            if str(q) in own:
                continue
            texts = self._texts(str(q))
            variables.append(self.state(_value(str(q)), texts[0], None))
            variables.append(self.state(_value(str(q), 1), texts[1], str(q)))
            variables.append(self._acceleration(q, v, self.motion_of_stepped))
        return sorted(variables, key=self._place) if self.eom.bare else variables

    def _acceleration(self, q: Expr, v: Expr, symbols: Iterable[str]) -> Variable:
        of, text = _value(str(q), 2), self._texts(str(q))[2]
        return self.output(of, text, self.units[of.name], symbols, "Real", str(v))

    def _place(self, v: Variable) -> int:
        """Where the coordinate stands in the model; those of an embedding come last."""
        order = [str(self.eom.symbols[c]) for c in self.model.coordinates]
        q = v.of.coordinate
        return order.index(q) if q in order else len(order)

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
            of = Subject(names.MULTIPLIER, c.name)
            variables.append(self.output(of, f"multiplier of {what}", lam, row))
            if isinstance(c, Nonholonomic) or c.name in self.eom.limited:
                text = f"velocity residual of {what}"
                behind = self._rates(k)
            else:
                kind = "gap, zero while closed," if isinstance(c, Contact) else "position residual"
                text = f"{kind} of {what}"
                behind = self.symbols(self.eom.f[k])
            if c.name in self.eom.limited and not isinstance(c, Nonholonomic):
                unit = unit.per_second()
            variables.append(self.output(Subject(names.RESIDUAL, c.name), text, unit, behind))
            text = f"true where {of.name} is determined uniquely"
            of = Subject(names.UNIQUE, c.name)
            variables.append(self.output(of, text, None, entries, "Boolean"))
        for j, q in enumerate(() if self.eom.bare else self.eom.q):
            unit = generalized_force_unit(self.units[str(q)])
            touching = [k for k in range(self.eom.m) if (k, j) in jacobian]
            symbols = self.group(coordinate=j) if touching else set()
            text = f"generalized force of all constraints on {q}"
            variables.append(self.output(Subject(names.FORCE, "", str(q)), text, unit, symbols))
            for k in touching:
                of = Subject(names.FORCE, self.eom.constraints[k].name, str(q))
                if not names.shared(of.constraint, of.coordinate):
                    continue
                text = f"generalized force of constraint {of.constraint} on {q}"
                variables.append(self.output(of, text, unit, symbols))
        return variables

    def energies(self) -> list[Variable]:
        T, V = self.eom.kinetic, self.eom.potential
        kinetic, potential = self.symbols(T), self.symbols(V)
        both = "kinetic plus potential energy", kinetic | potential
        found = {} if T is None else {names.KINETIC: ("kinetic energy", kinetic)}
        found |= {} if V is None else {names.POTENTIAL: ("potential energy", potential)}
        found |= {} if T is None or V is None else {names.TOTAL: both}
        return [
            self.output(Subject(name), text, ENERGY, behind)
            for name, (text, behind) in found.items()
        ]

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
            unit = parse_unit(o.unit, o.name)
            variables.append(self.output(Subject(names.OWN, "", o.name), text, unit, behind))
        return variables

    def contact_outputs(self) -> list[Variable]:
        variables = []
        constraints = self.eom.constraints
        if self.eom.bare and self.reduction is not None:
            constraints = self.reduction.constraints
        for k, c in enumerate(constraints):
            if not isinstance(c, Contact):
                continue
            behind = self.motion_of_stepped if self.eom.bare else self.group(row=k)
            behind = self.known | behind  # it opens and closes by f, its rate and lambda
            of, text = Subject(names.CONTACT, c.name), f"true while {c.name} is closed"
            variables.append(self.output(of, text, None, behind, "Boolean"))
            what = f"departure{{}} from {c.name}"
            variables += self._event(names.DEPARTURE, c.name, what)
            variables += self._closing(c)
        return variables

    def friction_outputs(self) -> list[Variable]:
        variables = []
        row = {c.name: k for k, c in enumerate(self.eom.constraints)}
        for law in self.eom.frictions:
            what = f"friction {law.name}" + (f": {law.description}" if law.description else "")
            behind = self.group(row=row[law.of[0]]) | self.symbols(*law.expressions)
            behind = self.known | behind
            text = f"true while {what} sticks (and its normal contact is closed)"
            of = Subject(names.STICKS, law.name)
            variables.append(self.output(of, text, None, behind, "Boolean"))
            for name in law.of:
                text, of = f"slip velocity G v - nu of {name}", Subject(names.SLIP, name)
                variables.append(self.output(of, text, SPEED, self._rates(row[name])))
            text = f"static coefficient times normal force less |lambda| of {what}"
            variables.append(self.output(Subject(names.MARGIN, law.name), text, FORCE, behind))
            text = f"power of {what}, lambda times slip velocity, never positive"
            variables.append(self.output(Subject(names.POWER, law.name), text, POWER, behind))
            for events in (names.SLIPPING, names.STICKING):
                what = f"start{{}} of {events} of {law.name}"
                variables += self._event(events, law.name, what)
        return variables

    def losses(self) -> list[Variable]:
        """What frictions and impacts dissipate; with frictions a continuous state of model exchange."""
        constraints = self.stepped.constraints
        slips, of = bool(self.eom.frictions), Subject(names.DISSIPATED)
        if not slips and not any(isinstance(c, Contact) for c in constraints):
            return []
        both = "frictions and impacts" if slips else "impacts"
        text = f"energy that {both} dissipated so far"
        lost = self.output(of, text, ENERGY, (), discrete=not slips)
        if not self.lost:
            return [lost]
        behind = self.known.union(*(self.symbols(*law.expressions) for law in self.eom.frictions))
        behind |= set().union(*(symbols for *_, symbols in self.groups))
        what, text = Subject(names.DISSIPATION), "power that frictions dissipate"
        power = self.output(what, text, POWER, behind, derivative_of=lost.name)
        return [
            dataclasses.replace(lost, depends=(lost.name,)),
            dataclasses.replace(power, causality="local"),
        ]

    def error_bars(self, variables: Iterable[Variable]) -> list[Variable]:
        """One for each lambda, Q, coordinate, velocity, own output, and time of an event."""
        text = (
            "error bar of {}: an estimate of how far it may be off, by a run at a coarser tolerance"
        )
        return [
            self.output(
                Subject(names.ERROR, "", v.name), text.format(v.name), v.unit, (), discrete=True
            )
            for v in variables
            if v.of.quantity in BARRED
            or (v.of.quantity == names.VALUE and v.of.order < 2 and v.role in ("output", "start"))
        ]

    def peaks(self, measurable: Sequence[Variable]) -> list[Variable]:
        """The extremes that the model asks for, of what is there."""
        known = {v.name: v for v in measurable}
        chosen = select([peak.of for peak in self.model.peaks], list(known), "", [])
        return [self._peak(known[name], quantity) for name in chosen for quantity in names.PEAKS]

    def _peak(self, v: Variable, quantity: str) -> Variable:
        extreme = "largest" if "max" in quantity else "smallest"
        text = f"{extreme} {v.name} so far, between communication points too"
        text += " (model exchange: passed by the latest event, as exact as the importer's steps)"
        made = self.output(Subject(quantity, "", v.name), text, v.unit, (), discrete=True)
        if quantity.endswith("_time"):
            text = f"time of {made.name.removesuffix('_time')}"
            made = dataclasses.replace(made, description=text, unit=SECOND)
        else:
            made = dataclasses.replace(made, display=v.display)
        return dataclasses.replace(made, measured=v, depends_initially=v.depends_initially)

    def _closing(self, c: Contact) -> list[Variable]:
        """Its impacts, those that bounce too, and where it closes without one; just before them."""
        found = self._event(names.CLOSING, c.name, f"closing{{0}} or impact{{0}} of {c.name}")
        unit = dimension_of(sp.sympify(c.expression), self.model.units, c.name) or ONE
        blow = multiplier_unit(unit, False) * SECOND
        text = f"impulse of {c.name} in its latest impact: the integral of its multiplier over time"
        impulse = self.output(Subject(names.IMPULSE, c.name), text, blow, (), discrete=True)
        return [*found[:2], impulse, *found[2:]]

    def _event(self, quantity: str, of: str, what: str) -> list[Variable]:
        """How often it happened; time, coordinates and velocities when it did so last."""
        tail = f"the latest {what.format('')}, 0 before the first"
        count, moment = Subject(f"{quantity}.count", of), Subject(f"{quantity}.time", of)
        found = [
            self.output(count, what.format("s"), None, (), "Integer"),
            self.output(moment, f"time of {tail}", SECOND, (), discrete=True),
        ]
        for q, v in zip(self.eom.q, self.eom.v, strict=True):
            if not names.shared(of, str(q)):
                continue
            for order, s in enumerate((str(q), str(v))):
                at = Subject(quantity, of, str(q), order)
                found.append(self.output(at, f"{s} at {tail}", self.units[s], (), discrete=True))
        return found

    def _rates(self, k: int) -> set[str]:
        """The symbols behind G v - nu of a row."""
        own = {j: a for (i, j), a in self.eom.G.todok().items() if i == k}
        return self.symbols(*own.values(), self.eom.nu[k], *(self.eom.v[j] for j in own))


def _value(coordinate: str, order: int = 0) -> Subject:
    return Subject(names.VALUE, "", coordinate, order)
