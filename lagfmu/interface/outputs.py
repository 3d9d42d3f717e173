"""Variables that are calculated: motion, forces, energies, contacts, frictions, events, error bars, peaks.

Each knows what it depends on (dependencies.py).
"""

from __future__ import annotations

import dataclasses
from collections import defaultdict
from collections.abc import Iterable, Mapping
from functools import cached_property

import sympy as sp

from .. import names
from ..mechanics.equations import symbols_of
from ..mechanics.kinematics import start_names
from ..model.dimensions import dimension_of
from ..model.elements import Constraint, Expr
from ..model.model import Contact, Nonholonomic, name_of
from ..model.scene import select
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
from ..names import Kind, Subject
from .dependencies import Dependencies, Names, one_of
from .variables import Variable

UNITS = {"J": ENERGY, "W": POWER}


class Outputs:
    """The outputs of a form; `loses`: the energy dissipated is a state (of model exchange)."""

    def __init__(self, behind: Dependencies, loses: bool) -> None:
        self.behind, self.loses = behind, loses
        self.eom, self.stepped = behind.eom, behind.stepped
        self.model, self.units = self.eom.model, self.eom.units

    def all(self) -> list[Variable]:
        """In the order of the table."""
        return [
            *self.motion(),
            *self.constraints(),
            *self.energies(),
            *self.own(),
            *self.contacts(),
            *self.frictions(),
            *self.losses(),
            self._single(names.STEPS),
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

    def _of(
        self,
        kind: Kind,
        of: Subject,
        words: Mapping[str, str],
        units: Mapping[str, Unit],
        behind: Mapping[str, Names],
    ) -> Variable:
        """One of a kind: what its row says, of an owner with these words, units, and names behind it."""
        unit = units[kind.unit] if kind.unit else None
        text, symbols = kind.text.format(**words), behind[kind.behind]
        return self.output(of, text, unit, symbols, kind.type, discrete=kind.held)

    def _single(self, quantity: str, what: str = "", behind: Names = frozenset()) -> Variable:
        """That of which there is one."""
        (kind,) = (k for k in names.kinds(names.MODEL) if k.quantity == quantity)
        return self._of(kind, Subject(quantity), {"what": what}, UNITS, {kind.behind: behind})

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
        text, what = self._text(name, "coordinate"), self._text(name)
        of = Subject(names.VALUE, "", name, 2)
        velocity, acceleration = f"{names.VELOCITY_OF} {what}", f"acceleration of {what}"
        return [
            self._moving(Subject(names.VALUE, "", name), text, q, None),
            self._moving(Subject(names.VALUE, "", name, 1), velocity, v, name),
            self.output(of, acceleration, self.units[of.name], symbols, "Real", str(v)),
        ]

    def _text(self, name: str, kind: str = "") -> str:
        """What the model says of a coordinate or speed, else its name after its kind."""
        return self._texts.get(name, f"{kind} {name}".strip())

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
                text = f"{names.VELOCITY_OF} {self._text(str(q))}"
                made = self.output(of, text, unit, behind, "Real", str(q))
                variables.append(self._startable(made))
        for i, v in enumerate(eom.v):
            of = names.read(str(v))
            what, of_what = self._text(of.coordinate), of.coordinate if of.order else None
            text = f"{names.VELOCITY_OF} {what}" if of.order else self._text(str(v), "speed")
            variables.append(self._moving(of, text, v, of_what))
            rate = dataclasses.replace(of, order=of.order + 1)
            unit, behind = self.units[rate.name], self.behind.group(speed=i)
            text = f"acceleration of {what}" if of.order else f"rate of {what}"
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
            if isinstance(c, Nonholonomic) or c.name in self.eom.limited:
                missed, found, unit = names.MISSED_VELOCITY, self.behind.rates(k), rate
            else:
                missed = (
                    "gap, zero while closed," if isinstance(c, Contact) else "position residual"
                )
                found = self.behind.symbols(self.eom.f[k])
            multiplier = names.name(names.MULTIPLIER, c.name)
            words = {"what": what, "missed": missed, "multiplier": multiplier}
            units = {"multiplier": lam, "missed": unit, "velocity": rate}
            behind = {"solved": self.behind.group(row=k), "missed": found, "entries": entries}
            for kind in names.kinds(names.CONSTRAINT):
                of = Subject(kind.quantity, c.name)
                variables.append(self._of(kind, of, words, units, behind))
        of_column: dict[int, list[int]] = defaultdict(list)
        for k, j in sorted(jacobian):
            of_column[j].append(k)
        (whole,), (share,) = names.kinds(names.DIRECTION), names.kinds(names.SHARE)
        pairs = zip(self.eom.directions, self.eom.v, strict=True)
        for j, (q, v) in enumerate(() if self.eom.bare else pairs):
            units = {"force": generalized_force_unit(self.units[str(v)] * SECOND)}
            touching = of_column[j]
            behind = {"solved": self.behind.group(speed=j) if touching else frozenset()}
            of = Subject(names.FORCE, "", q)
            variables.append(self._of(whole, of, {"what": q}, units, behind))
            for k in touching:
                of = Subject(names.FORCE, self.eom.constraints[k].name, q)
                if names.shared(of.constraint, of.coordinate):
                    words = {"what": q, "constraint": of.constraint}
                    variables.append(self._of(share, of, words, units, behind))
        return variables

    def energies(self) -> list[Variable]:
        """Kinetic, potential and total energy, as far as the model has them."""
        found = {q: [getattr(self.eom, p) for p in parts] for q, parts in names.ENERGIES.items()}
        return [
            self._single(quantity, behind=self.behind.symbols(*parts))
            for quantity, parts in found.items()
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
            closed, impulse = self._of_contact(c, solved.union(self.behind.known))
            variables.append(closed)
            what = f"departure{{}} from {c.name}"
            variables += self._event(names.DEPARTURE, c.name, what)
            told = self._event(names.CLOSING, c.name, f"closing{{0}} or impact{{0}} of {c.name}")
            variables += [*told[:2], impulse, *told[2:]]  # the state just before an impact
        return variables

    def _of_contact(self, c: Contact, modes: Names) -> list[Variable]:
        """What its rows say; `modes`: behind f, its rate and lambda, by which it opens and closes."""
        unit = dimension_of(sp.sympify(c.expression), self.model.units, c.name) or ONE
        units = {"impulse": multiplier_unit(unit, False) * SECOND}
        behind = {"modes": modes, "nothing": frozenset[str]()}
        return [
            self._of(kind, Subject(kind.quantity, c.name), {"what": c.name}, units, behind)
            for kind in names.kinds(names.OF_CONTACT)
        ]

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
            units = {"multiplier": force, "velocity": speed, **UNITS}
            for kind in names.kinds(names.FRICTION, names.ROW):
                for name in law.of if kind.each == names.ROW else [law.name]:
                    words = {"what": name if kind.each == names.ROW else what}
                    of = Subject(kind.quantity, name)
                    found = {"modes": behind, "rates": self.behind.rates(row.get(name, 0))}
                    variables.append(self._of(kind, of, words, units, found))
            for events in (names.SLIPPING, names.STICKING):
                what = f"start{{}} of {events} of {law.name}"
                variables += self._event(events, law.name, what)
        return variables

    def losses(self) -> list[Variable]:
        """What frictions and impacts dissipate; with frictions a continuous state of model exchange."""
        slips = bool(self.eom.frictions)
        if not slips and not any(isinstance(c, Contact) for c in self.stepped.constraints):
            return []
        lost = self._single(names.DISSIPATED, "frictions and impacts" if slips else "impacts")
        if not slips:
            lost = dataclasses.replace(lost, variability="discrete")
        if not self.loses:
            return [lost]
        laws = (self.behind.symbols(*law.expressions) for law in self.eom.frictions)
        solved = (symbols for *_, symbols in self.behind.groups)
        power = self._single(
            names.DISSIPATION, behind=frozenset(self.behind.known).union(*laws, *solved)
        )
        power = dataclasses.replace(power, derivative_of=lost.name)
        return [
            dataclasses.replace(lost, depends=(lost.name,)),
            dataclasses.replace(power, causality="local"),
        ]

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
            if v.of.quantity in names.BARRED
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
