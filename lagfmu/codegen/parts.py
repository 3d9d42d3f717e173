"""What the numeric form of a model consists of, in no language: c/ and py/ print this list.

    M(q,t) vdot = F(q,v,t,u) + G^T lambda ,  G v = nu(q,t,u) ,  G vdot = gamma(q,v,t,u) ,  f(q,t) = 0
    q' = B(q,t,u) v + b(q,t,u), or q' = v

M is listed by the non-zeros of its lower triangle, G and B by their non-zeros, sorted by row, then column.  A
tangent is the change of a function's results along a direction in t, q, v, u and p; d(x) is the change of x.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy as sp

from ..mechanics.equations import EquationsOfMotion, formulas_of
from ..mechanics.formulations import Form, Reduction
from ..mechanics.jumps import NONE, Jumps
from ..model.differential import Differential
from ..model.elements import TIME, Expr
from ..model.model import Constraint, Contact, Nonholonomic
from ..model.units import ONE, SECOND, Unit
from ..names import VALUE, read
from ..numeric.system import CONTACT, HOLONOMIC, NONHOLONOMIC, Friction, Row


def identifier(symbol: Any) -> str:
    """A word for a symbol, which may be taken."""
    text = str(symbol)
    if text.startswith("switch("):  # jumps.py
        return f"switch_{text[len('switch(') : -1]}"
    of = read(text)
    if of.quantity == VALUE and of.order:
        text = f"der{of.order if of.order > 1 else ''}_{of.coordinate}"
    return text.replace(".", "_")


Arguments = Mapping[str, Sequence[Expr]]
EMBED = "q = phi(s, t) and v = J sdot + dphi/dt."


@dataclass(frozen=True)
class Value:
    """One number to compute, and what it is of."""

    expression: Expr
    place: str


@dataclass(frozen=True)
class Function:
    """name(arguments) -> results: each argument with the symbols in it, each result with its values."""

    name: str
    doc: str
    arguments: Arguments
    results: Mapping[str, Sequence[Value]]


def _values(expressions: Sequence[Expr], places: Sequence[Any]) -> list[Value]:
    """Each expression with its place."""
    return [Value(sp.sympify(e), str(x)) for e, x in zip(expressions, places, strict=True)]


@dataclass(frozen=True)
class Dimensions:
    """The number of the dimension of each coordinate, of each speed times a second, of each parameter (-1:
    that of none of these, or none); that of angles (-1: there are none)."""

    coordinates: tuple[int, ...]
    speeds: tuple[int, ...]
    parameters: tuple[int, ...]
    angles: int


@dataclass(frozen=True)
class Parts:
    """Of one system: its coordinates, the `constraints` that are its rows, its functions and patterns.

    `prefix` begins the names of all that is defined for it; `jumps`: those of its forces.  `reduction`: what
    leads from it to `full`, the equations of all coordinates.  `tangents`: its functions have them; `by`:
    the names of parameters by which they are taken as well.
    """

    eom: EquationsOfMotion
    prefix: str
    formulation: str
    constraints: tuple[Constraint, ...]
    jumps: Jumps = NONE
    full: EquationsOfMotion | None = None
    reduction: Reduction | None = None
    tangents: bool = False
    by: frozenset[str] = frozenset()
    time: Expr = TIME

    # ------------------------------------------------------------------------ patterns

    @cached_property
    def mass(self) -> list[tuple[int, int]]:
        """(row, column) of each value of M."""
        return sorted((i, j) for i, j in self.eom.M.todok() if i >= j)

    @cached_property
    def jacobian(self) -> list[tuple[int, int]]:
        """(row, column) of each value of G."""
        return sorted(self.eom.G.todok())

    @cached_property
    def rates(self) -> list[tuple[int, int]]:
        """(row, column) of each value of B; none where q' = v."""
        return [] if self.eom.moves_plainly else sorted(self.eom.kinematics.B)

    @cached_property
    def rows(self) -> list[Row]:
        """The constraints, as they act."""
        position = {c.name: k for k, c in enumerate(self.constraints)}
        owner = {name: i for i, law in enumerate(self.eom.frictions) for name in law.of}
        found = []
        for c in self.constraints:
            kind = HOLONOMIC
            if isinstance(c, Contact):
                kind = CONTACT
            elif isinstance(c, Nonholonomic):
                kind = NONHOLONOMIC
            closed = getattr(c, "while_closed", None)
            gate = None if closed is None else position[closed]
            found.append(Row(c.name, kind, gate, owner.get(c.name)))
        return found

    @cached_property
    def frictions(self) -> list[Friction]:
        """The rows that each friction limits, and those that make up its normal force."""
        position = {c.name: k for k, c in enumerate(self.constraints)}
        found = []
        for law in self.eom.frictions:
            rows = tuple(position[name] for name in law.of)
            norms = tuple(
                tuple(tuple(position[k] for k in a.c) for a in norm) for norm in law.norms
            )
            normal = [self.constraints[position[name]] for name in law.normal_rows]
            pushed = all(isinstance(c, Contact) for c in normal) and bool(normal)
            gated = pushed and all(a.load == 0 for a in law.parts)
            found.append(Friction(law.name, rows, norms, gated))
        return found

    @cached_property
    def at_integers(self) -> tuple[bool, ...]:
        """Which of the jumps are wherever h is a whole number."""
        return tuple(s.at_integers for s in self.jumps.surfaces)

    @cached_property
    def prescribed(self) -> tuple[int, ...]:
        """Where in u a prescribed motion begins: what has a rate that has a rate."""
        rates = self.eom.rates
        return tuple(k for k, s in enumerate(self.eom.u) if rates.get(s) in rates)

    @cached_property
    def estimated(self) -> tuple[int, ...]:
        """Those of them whose rates are estimated."""
        return tuple(k for k, s in enumerate(self.eom.u) if s in self.eom.estimated)

    @cached_property
    def spans(self) -> tuple[list[Unit], list[Unit]]:
        """The units of the coordinates, and of the speeds times a second."""
        units = self.eom.units
        return [units[str(q)] for q in self.eom.q], [units[str(v)] * SECOND for v in self.eom.v]

    @cached_property
    def dimensions(self) -> Dimensions:
        """One number for each dimension of coordinates and of speeds times a second."""
        number: dict[Any, int] = {}
        places, speeds = (
            tuple(number.setdefault(u.exponents, len(number)) for u in group)
            for group in self.spans
        )
        parameters = tuple(
            -1 if u.dimensionless else number.get(u.exponents, -1)
            for u in (self.eom.units[str(p)] for p in self.eom.p)
        )
        return Dimensions(places, speeds, parameters, number.get(ONE.exponents, -1))

    @cached_property
    def speed_folded(self) -> tuple[float, ...]:
        """The largest parameter that is a number in the code, of each speed's dimension times a second."""
        return tuple(map(self.eom.folded, self.spans[1]))

    @cached_property
    def extents(self) -> tuple[tuple[tuple[int, ...], ...], tuple[float, ...]]:
        """Of each coordinate the parameters of its dimension that stand in its rows, and the largest of
        those that are numbers in the code."""
        eom, units = self.eom, self.eom.units
        place = {str(p): i for i, p in enumerate(eom.p)}
        numbers = {str(p): abs(float(x)) for p, x in eom.numbers.items()}
        own, folded = [], []
        for q, unit in zip(map(str, eom.q), self.spans[0], strict=True):
            alike = [
                name
                for name in sorted(eom.standing.get(q, ()))
                if not unit.dimensionless and units[name].exponents == unit.exponents
            ]
            own.append(tuple(place[name] for name in alike if name in place))
            folded.append(max((numbers[name] for name in alike if name in numbers), default=0.0))
        return tuple(own), tuple(folded)

    @cached_property
    def formulas(self) -> dict[int, Expr]:
        """Start values that are expressions of parameters, by their position among (q, v)."""
        return {} if self.eom.bare else formulas_of(self.eom)

    # ------------------------------------------------------------------------ functions

    @cached_property
    def state(self) -> Arguments:
        """What most functions are of."""
        eom = self.eom
        return {"t": (self.time,), "q": eom.q, "v": eom.v, "u": eom.driven, "p": eom.p}

    @cached_property
    def solved(self) -> Arguments:
        """What is solved for at a state."""
        return {"vdot": self.eom.vdot, "lambda": self.eom.lam, "Q": self.eom.Q}

    @cached_property
    def change(self) -> dict[Expr, Expr]:
        """d(x) of each symbol that changes."""
        moving = (*self.eom.q, *self.eom.v, *self.eom.u, *self.varied, self.time)
        reported = (s for group in self.solved.values() for s in group)
        return {s: sp.Symbol(f"d({s})", real=True) for s in (*moving, *reported)}

    @cached_property
    def varied(self) -> tuple[Expr, ...]:
        """The parameters, where tangents are taken by some of them."""
        return tuple(self.eom.p) if self.by else ()

    @cached_property
    def groups(self) -> dict[str, list[Value]]:
        """The numbers of the equations: M, F, G, nu, gamma, f, energy."""
        eom = self.eom
        M, G = eom.M.todok(), eom.G.todok()
        q, rows = eom.directions, [c.name for c in self.constraints]
        energy = {"kinetic": eom.kinetic, "potential": eom.potential}
        if eom.kinetic is None and eom.potential is None:
            energy = {}
        listed = {
            "M": ([M[ij] for ij in self.mass], [f"{q[i]}, {q[j]}" for i, j in self.mass]),
            "F": (eom.F, q),
            "G": (
                [G[kj] for kj in self.jacobian],
                [f"{rows[k]}, {q[j]}" for k, j in self.jacobian],
            ),
            "nu": (eom.nu, rows),
            "gamma": (eom.gamma, rows),
            "f": (_or_zero(eom.f), rows),
            "energy": (_or_zero(energy.values()), list(energy)),
        }
        return {label: _values(*pair) for label, pair in listed.items()}

    @cached_property
    def functions(self) -> list[Function]:
        """All that it needs; of coordinates that are only read, the energies and the model's outputs."""
        eom, state, groups = self.eom, self.state, self.groups
        still = {a: s for a, s in state.items() if a != "v"}
        found = []
        if not eom.bare:
            found += [
                Function(
                    "dynamics",
                    "M (lower triangle), F, G, nu, gamma of  M vdot = F + G^T lambda,  G vdot = gamma.",
                    state,
                    {a: groups[a] for a in ("M", "F", "G", "nu", "gamma")},
                ),
                Function(
                    "residual",
                    "f of each constraint f(q, t) = 0; 0 for a nonholonomic one.",
                    still,
                    {"f": groups["f"]},
                ),
            ]
        if self.rates:
            found += self._of_kinematics()
        if groups["energy"]:
            text = "Kinetic and potential energy [J]."
            found.append(Function("energies", text, state, {"energy": groups["energy"]}))
        found += self._of_contacts()
        if self.tangents and (groups["energy"] or not eom.bare):
            text = "The change of all of these along the direction (dt, dq, dv, du, dp)."
            found.append(self._tangent("tangent", text, state, groups))
        if eom.lookups:
            places = _values([x for _, x in eom.lookups], [s.name for s, _ in eom.lookups])
            found.append(
                Function("lookups", "Where tables are looked up.", state, {"places": places})
            )
        if self.formulas:
            text = "Start values that are expressions of parameters."
            names = [str(s) for s in (*eom.q, *eom.v)]
            w = _values([*self.formulas.values()], [names[j] for j in self.formulas])
            found.append(Function("starts", text, {"p": eom.p}, {"w": w}))
        if any(x.expression != 0 for x in groups["f"]) and not eom.bare:
            text = "The largest magnitude among the terms of each f: of what f is rounding."
            turns = frozenset(eom.q[j] for j in eom.unwrapped)
            terms = _values(
                [_magnitude(x.expression, turns) for x in groups["f"]],
                [x.place for x in groups["f"]],
            )
            found.append(Function("terms", text, still, {"term": terms}))
        if eom.sides and not eom.bare:
            text = "Positive where joints are not turned over: products of axes vanish at half a turn too."
            names = [self.constraints[k].name for k in eom.sides]
            found.append(
                Function("sides", text, still, {"side": _values([*eom.sides.values()], names)})
            )
        if self.jumps.surfaces:
            text = "h of each jump of the forces: where it passes 0, or a whole number."
            h = _values([s.h for s in self.jumps.surfaces], eom.switch_states)
            found.append(Function("surfaces", text, still, {"h": h}))
        if eom.outputs and not self.prefix:
            found += self._of_outputs()
        return found

    def _of_kinematics(self) -> Iterator[Function]:
        """q' = B v + b, and the angles that follow from other coordinates."""
        eom, moving = self.eom, self.eom.kinematics
        still = {a: s for a, s in self.state.items() if a != "v"}
        places = [f"{eom.q[j]}, {eom.v[i]}" for j, i in self.rates]
        results = {
            "rates": _values([moving.B[ji] for ji in self.rates], places),
            "drift": _values(moving.b, eom.q),
        }
        yield Function("kinematics", "Rates B and drift b of  q' = B v + b.", still, results)
        if self.tangents:
            text = "Their change along the direction (dt, dq, du, dp)."
            yield self._tangent("kinematics_tangent", text, still, results)
        if eom.unwrapped:
            angles = _values([*eom.unwrapped.values()], [eom.q[j] for j in eom.unwrapped])
            text, told = "What angles equal modulo 2 pi.", {"angle": angles}
            yield Function("unwrapped_angles", text, still, told)
            if self.tangents:
                text = "Their change along the direction (dt, dq, du, dp)."
                yield self._tangent("unwrapped_tangent", text, still, told)

    def _of_contacts(self) -> Iterator[Function]:
        """Restitution and Coulomb's law."""
        eom, laws = self.eom, self.eom.frictions
        if any(isinstance(c, Contact) for c in self.constraints):
            e = [
                eom.plain(c.restitution) if isinstance(c, Contact) else sp.S.Zero
                for c in self.constraints
            ]
            text = "Newton's coefficient of restitution of each row; 0 for one that is no contact."
            results = {"e": _values(e, [c.name for c in self.constraints])}
            yield Function("restitution", text, {"p": eom.p}, results)
        if laws:
            mu = {f"{w} of {a.name}": getattr(a, w) for a in laws for w in ("static", "kinetic")}
            parts = [(a.name, part) for a in laws for part in a.parts]
            normal = [(f"{name}, {row}", c) for name, part in parts for row, c in part.c.items()]
            text = (
                "Coefficients, static and kinetic, and load + sum of c * lambda of each component of "
                "the normal forces."
            )
            results = {
                "coefficients": _values([*mu.values()], [*mu]),
                "load": _values([part.load for _, part in parts], [name for name, _ in parts]),
                "normal": _values([c for _, c in normal], [place for place, _ in normal]),
            }
            yield Function("coulomb", text, self.state, results)
            if self.tangents:
                text = "Their changes along the direction (dt, dq, dv, du, dp)."
                yield self._tangent("coulomb_tangent", text, self.state, results)

    def _of_outputs(self) -> Iterator[Function]:
        """The model's own outputs."""
        outputs = self.eom.outputs
        places = [f"{o.name} [{o.unit}]" for o in outputs]
        results = {
            "w": _values([o.expression for o in outputs], places),
            "other": _values(_or_zero(o.otherwise for o in outputs), places),
        }
        text = "Outputs of the model's own, and their values where these are not finite."
        arguments = {**self.state, **self.solved}
        yield Function("outputs", text, arguments, results)
        if self.tangents:
            text = "Their changes along a direction, with those of what is solved for."
            yield self._tangent("outputs_tangent", text, arguments, results)

    @cached_property
    def embedding(self) -> list[Function]:
        """What leads from its coordinates to all of them."""
        if self.reduction is None or self.full is None:
            return []
        state = dict(zip(("t", "s", "sdot", "u", "p"), self.state.values(), strict=True))
        phi, vel = self.reduction.phi, self.reduction.vel
        results = {"q": _values(phi, self.full.q), "v": _values(vel, self.full.v)}
        found = [Function("embed", EMBED, state, results)]
        if self.tangents:
            text = "The change of q and v along the direction (dt, ds, dsdot, du, dp)."
            found.append(self._tangent("embed_tangent", text, state, results))
        return found

    def _tangent(
        self, name: str, doc: str, arguments: Arguments, results: Mapping[str, Sequence[Value]]
    ) -> Function:
        kept = {p for p in self.varied if str(p) not in self.by}
        moving = {s: change for s, change in self.change.items() if s not in kept}
        d = Differential(moving, roots=bool(self.by) and not name.startswith("outputs"))
        along = {
            f"d{a}": tuple(self.change[s] for s in symbols if s in self.change)
            for a, symbols in arguments.items()
        }
        changes = {
            f"d{a}": [Value(d(x.expression), x.place) for x in group]
            for a, group in results.items()
        }
        return Function(name, doc, {**arguments, **along}, changes)


class Largest(sp.Function):  # type: ignore[misc]
    """The largest of its arguments; unlike sp.Max it compares none of them, which takes SymPy seconds."""


def _magnitude(e: Expr, turns: Collection[Expr] = ()) -> Expr:
    """The largest magnitude among the terms of which e is made, those of its factors with them; a sine
    or cosine stands beside 1, and so does an angle that turns with an attitude, whose parts round it."""
    if isinstance(e, sp.Add):
        return _largest([_magnitude(a, turns) for a in e.args])
    if isinstance(e, sp.Mul):
        return sp.Mul(*(_magnitude(a, turns) for a in e.args))
    if isinstance(e, sp.Pow) and e.exp.is_positive and e.exp.is_number:
        return sp.Pow(_magnitude(e.base, turns), e.exp)
    if isinstance(e, (sp.sin, sp.cos)):
        return sp.S.One
    return _largest([sp.Abs(e), sp.S.One]) if e in turns else sp.Abs(e)


def _largest(magnitudes: Sequence[Expr]) -> Expr:
    different = list(dict.fromkeys(magnitudes))
    return different[0] if len(different) == 1 else Largest(*different)


def _or_zero(expressions: Any) -> list[Expr]:
    return [sp.S.Zero if e is None else e for e in expressions]


def parts_of(
    form: Form,
    jumps: Jumps,
    tangents: bool = False,
    time: Expr = TIME,
    by: frozenset[str] = frozenset(),
) -> tuple[Parts, ...]:
    """The system of all coordinates and, where it is reduced, the one of those that are stepped.

    `form` and `jumps` as jumps.with_switch_states gives them; `time`: the symbol in them; `by`: parameters by
    which tangents are taken as well.
    """
    eom, reduction = form.equations, form.reduction
    more: dict[str, Any] = {"tangents": tangents, "by": by, "time": time}
    if reduction is None:
        return (Parts(eom, "", form.formulation, eom.constraints, jumps, **more),)
    reduced = reduction.reduced
    return (
        Parts(eom, "", "multipliers", eom.constraints, **more),
        Parts(reduced, "reduced_", "minimal", reduction.constraints, jumps, eom, reduction, **more),
    )
