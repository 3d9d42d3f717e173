"""Variables that are calculated: motion, forces, energies, contacts, frictions, events, error bars, peaks.

Each knows what it depends on (dependencies.py).
"""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Iterable
from functools import cached_property

import sympy as sp

from .. import names
from ..mechanics.equations import symbols_of
from ..mechanics.joint_coordinates import start_names
from ..model.dimensions import dimension_of
from ..model.elements import Constraint, Expr
from ..model.model import Contact, Nonholonomic, name_of
from ..model.selection import select
from ..model.units import (
    ENERGY,
    ONE,
    POWER,
    SECOND,
    Unit,
    generalized_force_unit,
    multiplier_unit,
    parse_unit,
)
from ..names import Subject
from .dependencies import Dependencies, Names, one_of
from .variables import Variable

BARRED = (  # what has an error bar, besides coordinates, velocities and outputs of one word
    *(names.MULTIPLIER, names.FORCE, names.OWN, *names.COUNT_OF),
)


class Outputs:
    """The outputs of a form; `loses`: the energy dissipated is a state (of model exchange)."""

    def __init__(self, behind: Dependencies, loses: bool) -> None:
        self.behind, self.loses = behind, loses
        self.eom, self.stepped = behind.eom, behind.stepped
        self.model, self.units = self.eom.model, self.eom.units

    def all(self) -> list[Variable]:
        """In the order of the table."""
        steps = self.output(
            Subject(names.STEPS), "internal steps taken so far", None, (), "Integer"
        )
        return [
            *self.motion(),
            *self.constraints(),
            *self.energies(),
            *self.own(),
            *self.contacts(),
            *self.frictions(),
            *self.losses(),
            steps,
        ]

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
        """One of them; `symbols`: the names of those behind its value."""
        symbols = frozenset(symbols)
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
            depends=self.behind.at_points(symbols),
            depends_initially=self.behind.at_start(symbols),
        )

    def motion(self) -> list[Variable]:
        """Coordinates, velocities, accelerations: those of the model, then those of an embedding."""
        if not self.eom.moves_plainly:
            return self._places_and_speeds()
        variables = []
        eom, of_stepped = self.eom, self.behind.of_stepped
        for j, (q, v) in enumerate(zip(eom.q, eom.v, strict=True)):
            symbols = of_stepped if eom.bare else self.behind.group(speed=j)
            of_one = self._of_coordinate(q, v, symbols)
            stepped = str(q) in self.behind.states
            variables += of_one if stepped or not eom.bare else of_one[:2]
        known = set(eom.q)
        for q, v in zip(self.stepped.q, self.stepped.v, strict=True):
            if q not in known:
                variables += self._of_coordinate(q, v, of_stepped)
        return sorted(variables, key=self._place) if eom.bare else variables

    def _of_coordinate(self, q: Expr, v: Expr, symbols: Names) -> list[Variable]:
        """Itself, its velocity, and its acceleration, behind which are these `symbols`."""
        name = str(q)
        text = self._text(name, "coordinate")
        of = Subject(names.VALUE, "", name, 2)
        rate = f"acceleration of: {text}"
        return [
            self._moving(Subject(names.VALUE, "", name), text, q, None),
            self._moving(Subject(names.VALUE, "", name, 1), f"velocity of: {text}", v, name),
            self.output(of, rate, self.units[of.name], symbols, "Real", str(v)),
        ]

    def _text(self, name: str, kind: str) -> str:
        return self._texts.get(name, f"{kind} {name}")

    @cached_property
    def _texts(self) -> dict[str, str]:
        return {name_of(s): text for s, text in self.model.descriptions.items()}

    def _places_and_speeds(self) -> list[Variable]:
        """Coordinates with their rates, then speeds with theirs; a rate that is a speed is told there."""
        variables, eom = [], self.eom
        speeds = {str(v) for v in eom.v}
        for q, rate in zip(eom.q, eom.qdot, strict=True):
            text = self._text(str(q), "coordinate")
            variables.append(self._moving(Subject(names.VALUE, "", str(q)), text, q, None))
            of = Subject(names.VALUE, "", str(q), 1)
            if of.name not in speeds:
                unit, behind = self.units[of.name], self.behind.symbols(rate)
                text = f"velocity of: {text}"
                made = self.output(of, text, unit, behind, "Real", str(q))
                variables.append(self._startable(made))
        for i, v in enumerate(eom.v):
            of = names.read(str(v))
            kind, of_what = ("coordinate", of.coordinate) if of.order else ("speed", None)
            text = self._text(of.coordinate, kind)
            text = f"velocity of: {text}" if of.order else text
            variables.append(self._moving(of, text, v, of_what))
            rate = dataclasses.replace(of, order=of.order + 1)
            unit, behind = self.units[rate.name], self.behind.group(speed=i)
            text = f"rate of: {text}"
            variables.append(self.output(rate, text, unit, behind, "Real", str(v)))
        return variables

    def _moving(self, of: Subject, text: str, symbol: Expr, derivative_of: str | None) -> Variable:
        """A coordinate or velocity: a state with its start, or what follows from states."""
        name, unit = of.name, self.units[of.name]
        if name not in self.behind.states:
            symbols = self.behind.symbols(symbol)
            return self.output(of, text, unit, symbols, "Real", derivative_of)
        start = self.behind.starts[name]
        approx = name in self.behind.movable or bool(start.free_symbols)
        if start.free_symbols:
            text += f"; starts at {start} {names.FOLLOWS}"
        return Variable(
            of=of,
            role="start",
            causality="output",
            initial="approx" if approx else "exact",
            description=text,
            start=self.eom.at_parameters(start),
            given=name in self.behind.given,
            unit=unit,
            derivative_of=derivative_of,
            depends=self.behind.at_points({name}),
            depends_initially=self.behind.at_start([name]) if approx else (),
        )

    def _startable(self, v: Variable) -> Variable:
        """With a start, where it is a joint coordinate, or the rate of one, that an importer may set."""
        if v.name not in self._joint_starts:
            return v
        start, given = self.model.joint_starts[v.name]
        return dataclasses.replace(v, role="start", initial="approx", start=start, given=given)

    @cached_property
    def _joint_starts(self) -> set[str]:
        return {*start_names(self.behind.joint_coordinates)}

    def _place(self, v: Variable) -> int:
        """Where the coordinate stands in the model; those of an embedding come last."""
        return self._order.get(v.of.coordinate, len(self._order))

    @cached_property
    def _order(self) -> dict[str, int]:
        return {str(self.eom.symbols[c]): k for k, c in enumerate(self.model.coordinates)}

    def constraints(self) -> list[Variable]:
        """Of each its multiplier, its residual, whether the multiplier is unique; generalized forces."""
        variables = []
        jacobian = self.eom.G.todok()
        entries = self.behind.symbols(*jacobian.values())
        for k, c in enumerate(self.eom.constraints):
            what = f"constraint {c.name}" + (f": {c.description}" if c.description else "")
            unit, lam, rate = self._units_of(c)
            of = Subject(names.MULTIPLIER, c.name)
            row = self.behind.group(row=k)
            variables.append(self.output(of, f"multiplier of {what}", lam, row))
            if isinstance(c, Nonholonomic) or c.name in self.eom.limited:
                text, behind, unit = f"velocity residual of {what}", self.behind.rates(k), rate
            else:
                kind = "gap, zero while closed," if isinstance(c, Contact) else "position residual"
                text, behind = f"{kind} of {what}", self.behind.symbols(self.eom.f[k])
            variables.append(self.output(Subject(names.RESIDUAL, c.name), text, unit, behind))
            text = f"true where {of.name} is determined uniquely"
            of = Subject(names.UNIQUE, c.name)
            variables.append(self.output(of, text, None, entries, "Boolean"))
        of_column: dict[int, list[int]] = defaultdict(list)
        for k, j in sorted(jacobian):
            of_column[j].append(k)
        pairs = zip(self.eom.directions, self.eom.v, strict=True)
        for j, (q, v) in enumerate(() if self.eom.bare else pairs):
            unit = generalized_force_unit(self.units[str(v)] * SECOND)
            touching = of_column[j]
            symbols = self.behind.group(speed=j) if touching else frozenset()
            text = f"generalized force of all constraints on {q}"
            variables.append(self.output(Subject(names.FORCE, "", q), text, unit, symbols))
            for k in touching:
                of = Subject(names.FORCE, self.eom.constraints[k].name, q)
                if not names.shared(of.constraint, of.coordinate):
                    continue
                text = f"generalized force of constraint {of.constraint} on {q}"
                variables.append(self.output(of, text, unit, symbols))
        return variables

    def energies(self) -> list[Variable]:
        """Kinetic, potential and total energy, as far as the model has them."""
        T, V = self.eom.kinetic, self.eom.potential
        found = [(names.KINETIC, "kinetic energy", [T]), (names.POTENTIAL, "potential energy", [V])]
        found.append((names.TOTAL, "kinetic plus potential energy", [T, V]))
        return [
            self.output(Subject(name), text, ENERGY, self.behind.symbols(*parts))
            for name, text, parts in found
            if None not in parts
        ]

    def own(self) -> list[Variable]:
        """The model's own: their dependencies are those of all that stands in them."""
        variables, behind = [], self.behind
        solved = {s: behind.group(speed=j) for j, s in enumerate(self.eom.vdot)}
        solved |= {s: behind.group(speed=j) for j, s in enumerate(self.eom.Q)}
        solved |= {s: behind.group(row=k) for k, s in enumerate(self.eom.lam)}
        for o in self.eom.outputs:
            found = symbols_of(o)
            own = behind.symbols(*(s for s in found if s not in solved))
            symbols = one_of(own, {solved[s] for s in found & solved.keys()})
            text = o.description or f"output {o.name}"
            unit = parse_unit(o.unit, o.name)
            made = self.output(Subject(names.OWN, "", o.name), text, unit, symbols)
            variables.append(self._startable(made))
            if o.unique:
                text = f"true where the multipliers leave {o.name} one value"
                of = Subject(names.UNIQUE, o.name)
                variables.append(self.output(of, text, None, symbols, "Boolean"))
        return variables

    # ------------------------------------------------------------------ contacts, frictions, events

    def contacts(self) -> list[Variable]:
        """Whether each is closed, its departures, its closings."""
        variables = []
        constraints = self.eom.constraints
        if self.eom.bare and self.behind.reduction is not None:
            constraints = self.behind.reduction.constraints
        for k, c in enumerate(constraints):
            if not isinstance(c, Contact):
                continue
            solved = self.behind.of_stepped if self.eom.bare else self.behind.group(row=k)
            behind = self.behind.known | solved  # it opens and closes by f, its rate and lambda
            of, text = Subject(names.CONTACT, c.name), f"true while {c.name} is closed"
            variables.append(self.output(of, text, None, behind, "Boolean"))
            what = f"departure{{}} from {c.name}"
            variables += self._event(names.DEPARTURE, c.name, what)
            variables += self._closing(c)
        return variables

    def _units_of(self, c: Constraint) -> tuple[Unit, Unit, Unit]:
        """Of its expression, of its multiplier, of the velocity that it holds."""
        unit = dimension_of(sp.sympify(c.expression), self.model.units, c.name) or ONE
        moves = isinstance(c, Nonholonomic)
        return unit, multiplier_unit(unit, moves), unit if moves else unit.per_second()

    def frictions(self) -> list[Variable]:
        """Of each whether it sticks, slip velocities, margin, power, when it slipped and stuck."""
        variables = []
        row = {c.name: k for k, c in enumerate(self.eom.constraints)}
        for law in self.eom.frictions:
            _, force, speed = self._units_of(self.eom.constraints[row[law.of[0]]])
            what = f"friction {law.name}" + (f": {law.description}" if law.description else "")
            behind = self.behind.group(row=row[law.of[0]]) | self.behind.symbols(*law.expressions)
            behind |= self.behind.known
            text = f"true while {what} sticks (and its normal contact is closed)"
            of = Subject(names.STICKS, law.name)
            variables.append(self.output(of, text, None, behind, "Boolean"))
            for name in law.of:
                text, of = f"slip velocity G v - nu of {name}", Subject(names.SLIP, name)
                variables.append(self.output(of, text, speed, self.behind.rates(row[name])))
            text = f"static coefficient times normal force less |lambda| of {what}"
            variables.append(self.output(Subject(names.MARGIN, law.name), text, force, behind))
            text = f"power of {what}, lambda times slip velocity, never positive"
            variables.append(self.output(Subject(names.POWER, law.name), text, POWER, behind))
            for events in (names.SLIPPING, names.STICKING):
                what = f"start{{}} of {events} of {law.name}"
                variables += self._event(events, law.name, what)
        return variables

    def losses(self) -> list[Variable]:
        """What frictions and impacts dissipate; with frictions a continuous state of model exchange."""
        slips, of = bool(self.eom.frictions), Subject(names.DISSIPATED)
        if not slips and not any(isinstance(c, Contact) for c in self.stepped.constraints):
            return []
        both = "frictions and impacts" if slips else "impacts"
        text = f"energy that {both} dissipated so far"
        lost = self.output(of, text, ENERGY, (), discrete=not slips)
        if not self.loses:
            return [lost]
        laws = (self.behind.symbols(*law.expressions) for law in self.eom.frictions)
        solved = (symbols for *_, symbols in self.behind.groups)
        what, text = Subject(names.DISSIPATION), "power that frictions dissipate"
        behind = self.behind.known.union(*laws, *solved)
        power = self.output(what, text, POWER, behind, derivative_of=lost.name)
        return [
            dataclasses.replace(lost, depends=(lost.name,)),
            dataclasses.replace(power, causality="local"),
        ]

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
        states = [str(s) for s in (*self.eom.q, *self.eom.v)]
        if self.eom.moves_plainly:
            states = [names.derivative(str(q), k) for q in self.eom.q for k in (0, 1)]
        for s in states:
            read = names.read(s)
            if names.shared(of, read.coordinate):
                at = Subject(quantity, of, read.coordinate, read.order)
                found.append(self.output(at, f"{s} at {tail}", self.units[s], (), discrete=True))
        return found

    # ------------------------------------------------------------------ of other variables

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

    def sensitivities(self, pairs: Iterable[tuple[Variable, Variable]]) -> list[Variable]:
        """The derivative of the first by the second of each pair, and whether they exist."""
        made = [self._sensitivity(of, by) for of, by in pairs]
        text = "true while the run's derivatives exist; where it is false they are 0"
        valid = self.output(Subject(names.SENSITIVITY_VALID), text, None, (), "Boolean")
        return [*made, valid] if made else []

    def _sensitivity(self, of: Variable, by: Variable) -> Variable:
        text = f"derivative of {of.name} by {'the start of ' * (by.role == 'start')}{by.name}"
        made = self.output(
            Subject(names.SENSITIVITY, by.name, of.name),
            text + ", along the run and through its events",
            (of.unit or ONE) / (by.unit or ONE),
            (),
            discrete=of.variability == "discrete",
        )
        return dataclasses.replace(made, depends=of.depends, depends_initially=of.depends_initially)

    def peaks(self, measurable: Iterable[Variable]) -> list[Variable]:
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
