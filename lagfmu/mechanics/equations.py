"""Lagrange's equations with undetermined multipliers, and the one place where lambda gets its sign.

    d/dt dL/dv_j - dL/dq_j = Q_nc,j + sum_k lambda_k a_kj      (Marion & Thornton sect. 7.5, eq. 7.66
                                                               with forces; ME 6590 eqs. 2 and 3)
is brought to the numeric form

    M(q,t) vdot = F(q,v,t,u) + G^T lambda ,   G v = nu(q,t,u) ,   G vdot = gamma(q,v,t,u)

by differentiation alone: nothing is inverted, and every term of L is differentiated only by the
symbols that stand in it, so that a chain of n links costs n times as much as one link.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import itemgetter

import sympy as sp
from sympy.physics.vector import dynamicsymbols

from ..errors import ModelError
from ..model.differential import Differential
from ..model.display import Displayed
from ..model.elements import Expr, Tie
from ..model.model import Constraint, Friction, Model, Nonholonomic, Output, Parameter, name_of
from ..model.norms import norm, norms_of
from ..model.reactions import force_of_constraint, multiplier, reactions_in
from ..model.speeds import quaternions
from ..model.spline import Spline, SplineBase
from ..model.units import Unit
from ..names import derivative, rate_of, read
from .attitudes import attitudes
from .formulations.multipliers import multipliers
from .joint_coordinates import JointCoordinate, joint_coordinates
from .kinematics import Kinematics

TIME = dynamicsymbols._t


@dataclass(frozen=True)
class NormalPart:
    """load + sum_k c[k] lambda_k, with names of constraints: a normal force, or one of its components."""

    load: Expr
    c: Mapping[str, Expr]

    @property
    def force(self) -> Expr:
        """In the multipliers' symbols."""
        return sp.Add(self.load, *(c * multiplier(k) for k, c in self.c.items()))


@dataclass(frozen=True)
class FrictionLaw:
    """|lambda| of the rows `of` is at most static * N, and kinetic * N while they slip.

    N is the sum of `norms`, each of one component or several; in plain symbols.
    """

    name: str
    of: tuple[str, ...]
    norms: tuple[tuple[NormalPart, ...], ...]
    static: Expr
    kinetic: Expr
    description: str = ""

    @property
    def parts(self) -> tuple[NormalPart, ...]:
        """The components of all norms."""
        return tuple(part for parts in self.norms for part in parts)

    @property
    def normal(self) -> Expr:
        """The normal force; where it is of one component, that with its sign."""
        if len(self.parts) == 1:
            return self.parts[0].force
        return sp.Add(*(norm(*(part.force for part in parts)) for parts in self.norms))

    @property
    def normal_rows(self) -> tuple[str, ...]:
        """The constraints whose multipliers make up the normal force, as often as they stand in it."""
        return tuple(name for part in self.parts for name in part.c)

    @property
    def expressions(self) -> tuple[Expr, ...]:
        """All of its expressions."""
        of_parts = (e for part in self.parts for e in (part.load, *part.c.values()))
        return (self.static, self.kinetic, *of_parts)

    def mapped(self, change: Callable[[Expr], Expr]) -> FrictionLaw:
        """The same with `change` done to every expression."""

        def moved(part: NormalPart) -> NormalPart:
            return NormalPart(change(part.load), {k: change(c) for k, c in part.c.items()})

        return replace(
            self,
            norms=tuple(tuple(map(moved, parts)) for parts in self.norms),
            static=change(self.static),
            kinetic=change(self.kinetic),
        )


@dataclass(frozen=True)
class EquationsOfMotion(Displayed):
    """The equations of one model in plain symbols; nq coordinates, nv speeds, m constraints.

    q (nq), v (nv): coordinates and speeds, q' = `qdot` (nq), the same as v where the model has no speeds of
    its own; u: inputs (with derivatives where they are needed); p: parameters.  M (nv, nv) and G (m, nv)
    are sparse (and mutable: SymPy sorts the entries of immutable ones, which takes a fifth of a derivation);
    `constraints` (m) are those of the rows of G.  F (nv) holds all forces without lambda, nu and gamma (m)
    the right-hand sides of G v = nu and G vdot = gamma, f (m) the residual of a position constraint (None for
    a nonholonomic one). `symbols` maps the model's dynamicsymbols to the plain symbols, `rates` a prescribed
    motion u to der(u) and der(u) to der(u,2).  Energies in joule: `kinetic` is the part of L that is
    quadratic in v, `potential` minus the part without v; their sum is Jacobi's integral.  `outputs` are the
    model's own, in the same symbols and those of accelerations (`vdot`), lambda (`lam`) and Q (`Q`).

    A scene may need less than the model (prune.py): then some coordinates and constraints are not
    there, `numbers` are the values of the parameters and inputs that were folded in, and `bare`
    equations are of coordinates that are only read: nothing is solved for them.  `switch_states`: where
    forces jump, the symbols behind the inputs that say on which side (jumps.py).  `frictions` say which
    constraints hold only as long as their multipliers stay below a part of a normal force.
    """

    model: Model
    q: tuple[Expr, ...]
    v: tuple[Expr, ...]
    qdot: tuple[Expr, ...]
    u: tuple[Expr, ...]
    p: tuple[Expr, ...]
    M: Expr
    F: tuple[Expr, ...]
    G: Expr
    nu: tuple[Expr, ...]
    gamma: tuple[Expr, ...]
    f: tuple[Expr | None, ...]
    kinetic: Expr
    potential: Expr | None
    symbols: dict[Expr, Expr]
    rates: dict[Expr, Expr]
    constraints: tuple[Constraint, ...]
    frictions: tuple[FrictionLaw, ...] = ()
    outputs: tuple[Output, ...] = ()
    numbers: Mapping[Expr, Expr] = field(default_factory=dict)
    bare: bool = False
    switch_states: tuple[Expr, ...] = ()

    def multipliers(self) -> dict[str, Expr]:
        """Constraint -> lambda in q, v, t and parameters [J/[f]; W/[expression] if nonholonomic].

        Raises DerivationError where the system is too large, or M or G M^-1 G^T has no inverse.
        """
        found = multipliers(self.model.name, self.M, self.G, self.F, self.gamma)
        back = {plain: s for s, plain in self.symbols.items() if plain.is_Symbol}
        back |= {TIME: sp.Symbol("t")}
        return {c.name: e.xreplace(back) for c, e in zip(self.constraints, found, strict=True)}

    @property
    def driven(self) -> tuple[Expr, ...]:
        """What the argument u of numeric functions holds: the inputs, then the switch states."""
        return (*self.u, *self.switch_states)

    @property
    def nq(self) -> int:
        """Number of coordinates."""
        return len(self.q)

    @property
    def nv(self) -> int:
        """Number of speeds."""
        return len(self.v)

    @property
    def moves_plainly(self) -> bool:
        """True if q' = v: every coordinate's rate is its speed."""
        return self.qdot == self.v

    @cached_property
    def kinematics(self) -> Kinematics:
        """How the coordinates move."""
        angles = {self.symbols[s] for s in self.model.unwrapped}
        places = frozenset(j for j, s in enumerate(self.q) if s in angles)
        return Kinematics(self.q, self.v, self.qdot, TIME, self.rates, places)

    @cached_property
    def unwrapped(self) -> dict[int, Expr]:
        """The angles that equal an expression modulo 2 pi, by their place in q."""
        given = {self.symbols[s]: self.plain(e) for s, e in self.model.unwrapped.items()}
        return {j: given[s] for j, s in enumerate(self.q) if s in given}

    @cached_property
    def joint_coordinates(self) -> tuple[JointCoordinate, ...]:
        """Those by which an importer may give the start."""
        return joint_coordinates(self.model, self.q, self.outputs)

    @cached_property
    def quaternions(self) -> tuple[tuple[int, int, int, int], ...]:
        """The places in q of the unit quaternions."""
        place = {s: j for j, s in enumerate(self.q)}
        found = [[self.symbols[s] for s in four] for four in quaternions(self.model)]
        return tuple((place[a], place[b], place[c], place[d]) for a, b, c, d in found if a in place)

    @property
    def m(self) -> int:
        """Number of constraints."""
        return len(self.nu)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters in the order of p."""
        by_symbol = {p.symbol: p for p in self.model.parameters}
        return tuple(by_symbol[s] for s in self.p)

    @cached_property
    def estimated(self) -> frozenset[Expr]:
        """The prescribed motions whose rates, up to the third, are taken from communication points."""
        found = {i.symbol for i in self.model.inputs if i.rates == "estimated"}
        return frozenset(self.symbols[s] for s in found) & set(self.u)

    @cached_property
    def lookups(self) -> list[tuple[Spline, Expr]]:
        """The tables that end somewhere, each with an argument of the state by which it is looked up."""
        if not any(s.ends != "periodic" for s in self.model.splines):
            return []
        known = {*self.q, *self.v, *self.u, *self.p, TIME}
        flat = [*self.solved, *self.f, *(o.expression for o in self.outputs)]
        calls = {c for e in flat if e is not None for c in sp.sympify(e).atoms(SplineBase)}
        found = {(c.spline, c.args[0]) for c in calls if c.spline.ends != "periodic"}
        state = [pair for pair in found if pair[1].free_symbols <= known]
        return sorted(state, key=lambda pair: (pair[0].name, str(pair[1])))

    @property
    def solved(self) -> list[Expr]:
        """The expressions of the linear equations for accelerations and lambda: M, F, G, nu, gamma."""
        return [
            *self.M.todok().values(),
            *self.F,
            *self.G.todok().values(),
            *self.nu,
            *self.gamma,
        ]

    @cached_property
    def vdot(self) -> tuple[Expr, ...]:
        """The symbols of the accelerations v' (nv)."""
        return tuple(sp.Symbol(rate_of(str(v)), real=True) for v in self.v)

    @cached_property
    def lam(self) -> tuple[Expr, ...]:
        """The symbols of the multipliers (m)."""
        return tuple(multiplier(c.name) for c in self.constraints)

    @cached_property
    def Q(self) -> tuple[Expr, ...]:
        """The symbols of the generalized forces of constraint (nv)."""
        return tuple(force_of_constraint(sp.Symbol(name)) for name in self.directions)

    @cached_property
    def directions(self) -> tuple[str, ...]:
        """What the forces of constraint are on (nv): a coordinate whose rate is the speed, else the speed."""
        return tuple(read(str(v)).coordinate for v in self.v)

    @cached_property
    def units(self) -> dict[str, Unit]:
        """The unit of each quantity, by its name in the FMU."""
        return {_name_in_fmu(s): unit for s, unit in self.model.units.items()}

    def folded(self, unit: Unit) -> float:
        """The largest magnitude of that dimension among the parameters that became numbers."""
        return 0.0 if unit.dimensionless else self._folded.get(unit.exponents, 0.0)

    @cached_property
    def _folded(self) -> dict[object, float]:
        """The same, of each dimension."""
        found: dict[object, float] = {}
        for p in self.model.parameters:
            if p.symbol in self.numbers:
                dimension = self.model.units[p.symbol].exponents
                size = abs(float(self.numbers[p.symbol]))
                found[dimension] = max(found.get(dimension, 0.0), size)
        return found

    def mapped(self, change: Callable[[Expr], Expr]) -> EquationsOfMotion:
        """The same with `change` done to every expression of the equations and energies."""

        def each(group: tuple[Expr, ...]) -> tuple[Expr, ...]:
            return tuple(None if e is None else change(sp.sympify(e)) for e in group)

        def sparse(matrix: Expr) -> Expr:
            entries = matrix.todok().items()
            values = {ij: e for ij, a in entries if (e := change(a)) != 0}
            return sp.SparseMatrix(matrix.rows, matrix.cols, values)

        kinetic, potential = each((self.kinetic, self.potential))
        return replace(
            self,
            qdot=each(self.qdot),
            M=sparse(self.M),
            F=each(self.F),
            G=sparse(self.G),
            nu=each(self.nu),
            gamma=each(self.gamma),
            f=each(self.f),
            kinetic=kinetic,
            potential=potential,
            frictions=tuple(law.mapped(change) for law in self.frictions),
            outputs=tuple(_changed(o, change) for o in self.outputs),
        )

    @cached_property
    def limited(self) -> dict[str, FrictionLaw]:
        """The constraints that hold by friction alone, by name."""
        return {name: law for law in self.frictions for name in law.of}

    def starts(self, embedded: bool = True) -> dict[str, Expr]:
        """The start values that the model gives, by the name of the coordinate or velocity: numbers, or
        expressions of parameters; those of its embedding too if `embedded`."""
        own = self.model.embedding.start if embedded and self.model.embedding else {}
        given = {**self.model.start, **own}
        return {str(self.symbols[s]): self.plain(e) for s, e in given.items()}

    def at_parameters(self, expression: Expr, numbers: Mapping[Expr, Expr] | None = None) -> float:
        """An expression of parameters at `numbers`, else at their values, in doubles as the FMU finds it."""
        expression = expression.xreplace(numbers or {})
        wanted = sorted(expression.free_symbols, key=str)
        if not wanted:
            return float(expression)
        values = {name_of(p.symbol): float(p.value) for p in self.model.parameters}
        return float(sp.lambdify(wanted, expression, "math")(*(values[str(s)] for s in wanted)))

    def plain(self, expression: Expr) -> Expr:
        """An expression of the model's dynamicsymbols in this object's plain symbols and numbers."""
        return sp.sympify(expression).xreplace(self.symbols).xreplace(self.numbers)


def _name_in_fmu(symbol: Expr) -> str:
    if isinstance(symbol, sp.Derivative):
        return derivative(name_of(symbol.expr), int(symbol.derivative_count))
    return name_of(symbol)


def _changed(output: Output, change: Callable[[Expr], Expr]) -> Output:
    """The output with `change` done to its expressions."""
    other = output.otherwise
    return replace(
        output,
        expression=change(sp.sympify(output.expression)),
        otherwise=None if other is None else change(sp.sympify(other)),
    )


def formulas_of(eom: EquationsOfMotion) -> dict[int, Expr]:
    """The start values that are expressions of parameters, by their position among (q, v)."""
    given = eom.starts()
    found = {j: given[str(s)] for j, s in enumerate((*eom.q, *eom.v)) if str(s) in given}
    return {j: e for j, e in found.items() if e.free_symbols}


def symbols_of(o: Output) -> set[Expr]:
    """The symbols in an output of the model's own, its value where it has none included."""
    other = sp.S.Zero if o.otherwise is None else sp.sympify(o.otherwise)
    return set(sp.sympify(o.expression).free_symbols | other.free_symbols)


def plain_symbols(model: Model) -> dict[Expr, Expr]:
    """dynamicsymbols and their derivatives -> plain symbols named as in the FMU."""
    table = {}
    extra = model.embedding.coordinates if model.embedding else {}
    for s in (*model.coordinates, *extra, *(i.symbol for i in model.inputs)):
        name = name_of(s)
        if s.is_Symbol:
            continue  # an input that was written as a plain symbol
        table[s] = sp.Symbol(name, real=True)
        for k in (1, 2):
            table[s.diff(TIME, k)] = sp.Symbol(derivative(name, k), real=True)
    return table | _own_speeds(model, table)


def _own_speeds(model: Model, table: Mapping[Expr, Expr]) -> dict[Expr, Expr]:
    """Speeds of the model's own, and the derivatives of the coordinates that move by them."""
    found = {}
    for w in model.speeds:
        found[w] = sp.Symbol(name_of(w), real=True)
        found[w.diff(TIME)] = sp.Symbol(derivative(name_of(w)), real=True)
    rates = {s.diff(TIME): sp.sympify(rate) for s, rate in model.kinematics.items()}
    whole = {**table, **found}
    found |= {s: rate.xreplace(whole) for s, rate in rates.items()}
    expressions = [sp.sympify(o.expression) for o in model.outputs]
    read = set().union(*(e.atoms(sp.Derivative) for e in expressions)) if expressions else set()
    for s, rate in rates.items():
        if s.diff(TIME) in read:
            found[s.diff(TIME)] = rate.diff(TIME).xreplace(rates).xreplace(whole)
    return found


def derive(model: Model) -> EquationsOfMotion:
    """Derive the equations of motion of `model`.

    Raises ModelError if the energy is not quadratic in the velocities, or a nonholonomic constraint
    is not affine in them.
    """
    table = plain_symbols(model)
    q = tuple(table[c] for c in model.coordinates)
    qdot = tuple(table[c.diff(TIME)] for c in model.coordinates)
    v = tuple(table[s] for s in model.states[len(q) :])
    u, rates = _inputs(model, table)
    angles = {table[s] for s in model.unwrapped}
    places = frozenset(j for j, s in enumerate(q) if s in angles)
    closed = attitudes(model, table)
    moving = Kinematics(q, v, tuple(r.xreplace(closed.symbols) for r in qdot), TIME, rates, places)
    moving = moving.beside(closed.positions)
    clock = _Clock(moving.q, moving.rates, {**rates, **closed.rates})
    problems: list[str] = []

    energy = model.energy_expression.xreplace(table).xreplace(closed.symbols)
    M, F = _left_hand_side(list(_terms(energy)), _opened(moving, qdot), clock, problems)
    directions = {s: i for i, s in enumerate(model.directions)}
    for direction, force in model.forces.items():
        F[directions[direction]] += sp.sympify(force).xreplace(table)

    G: dict[tuple[int, int], Expr] = {}
    nu: list[Expr] = []
    gamma: list[Expr] = []
    f: list[Expr | None] = []
    slopes = {s: (j, Differential({s: sp.S.One})) for j, s in enumerate(v)}
    opened = {s: a for a, s in closed.symbols.items()}
    along = Differential({**clock.rates, TIME: sp.S.One}) if closed.symbols else None
    twice = Differential({**clock.rates, **closed.carried, TIME: sp.S.One})
    for k, constraint in enumerate(model.constraints):
        expression, bend = sp.sympify(constraint.expression).xreplace(table), None
        if not isinstance(constraint, Tie):
            expression = expression.xreplace(closed.symbols)
        holonomic = not isinstance(constraint, Nonholonomic)
        f.append(expression if holonomic else None)
        if isinstance(constraint, Tie):
            rate, bend = (e.xreplace(table) for e in constraint.rates)
            row, drift = _pfaffian(constraint, rate, problems, slopes)
        elif along:  # by factors as they stand: products of sums stay short
            rate = along(expression) if holonomic else expression
            row, drift = _pfaffian(constraint, rate.xreplace(opened), problems, slopes)
            bend = along(twice(expression) if holonomic else rate)
        elif holonomic:
            row, drift = _along(expression, moving), moving.along_time(expression)
        else:
            row, drift = _pfaffian(constraint, expression, problems, slopes)
        G.update({(k, j): a for j, a in row.items()})
        nu.append(-drift)
        # d/dt (sum_j a_j v_j + drift) = sum_j a_j vdot_j - gamma
        if bend is None:
            bend = sp.Add(*(clock.total(a) * v[j] for j, a in row.items()), clock.total(drift))
        gamma.append(-bend)

    if problems:
        raise ModelError(model.name, problems)
    kinetic, potential = _energies(model, energy, M, v, table)
    made = EquationsOfMotion(
        model=model,
        q=q,
        v=v,
        qdot=qdot,
        u=u,
        p=tuple(p.symbol for p in model.parameters),
        M=sp.SparseMatrix(len(v), len(v), M),
        F=tuple(F),
        G=sp.SparseMatrix(len(nu), len(v), G),
        nu=tuple(nu),
        gamma=tuple(gamma),
        f=tuple(f),
        kinetic=kinetic,
        potential=potential,
        symbols=table,
        rates=rates,
        constraints=tuple(model.constraints),
        frictions=tuple(_friction(f, table) for f in model.frictions),
        outputs=tuple(_changed(o, lambda e: e.xreplace(table)) for o in model.outputs),
    )
    return made.mapped(lambda e: e.xreplace(opened)) if opened else made


def _opened(moving: Kinematics, qdot: tuple[Expr, ...]) -> Kinematics:
    """With the rates of unwrapped angles as they stand: what is closed in them hides speeds."""
    rates = list(moving.rates)
    for j in moving.unwrapped & set(range(len(qdot))):
        rates[j] = qdot[j]
    return replace(moving, rates=tuple(rates))


def _friction(f: Friction, table: dict[Expr, Expr]) -> FrictionLaw:
    """A friction in plain symbols, its normal force by components."""

    def part(component: Expr) -> NormalPart:
        component = sp.sympify(component).xreplace(table)
        symbols = reactions_in(component)
        return NormalPart(
            component.xreplace(dict.fromkeys(symbols, sp.S.Zero)),
            {read(str(s)).constraint: component.diff(s) for s in symbols},
        )

    norms = norms_of(f.normal)
    assert norms is not None  # checked with the model
    return FrictionLaw(
        name=f.name,
        of=tuple(f.of),
        norms=tuple(tuple(map(part, components)) for components in norms),
        static=sp.sympify(f.static).xreplace(table),
        kinetic=sp.sympify(f.sliding).xreplace(table),
        description=f.description,
    )


class _Clock:
    """Time derivatives along a motion, by the chain rule over the symbols that occur."""

    def __init__(
        self, q: tuple[Expr, ...], qdot: tuple[Expr, ...], rates: dict[Expr, Expr]
    ) -> None:
        self.rates = {**dict(zip(q, qdot, strict=True)), **rates}

    def total(self, expression: Expr) -> Expr:
        """d/dt of an expression of q, t and prescribed inputs."""
        present = sorted(expression.free_symbols & self.rates.keys(), key=str)
        parts = [expression.diff(s) * self.rates[s] for s in present]
        if expression.has(TIME):
            parts.append(expression.diff(TIME))
        return sp.Add(*parts)


def _inputs(model: Model, table: dict[Expr, Expr]) -> tuple[tuple[Expr, ...], dict[Expr, Expr]]:
    """The plain input symbols, and the rate of each that is differentiated."""
    u: list[Expr] = []
    rates: dict[Expr, Expr] = {}
    for i in model.inputs:
        u.append(table.get(i.symbol, i.symbol))
        if i in model.prescribed:
            first, second = table[i.symbol.diff(TIME)], table[i.symbol.diff(TIME, 2)]
            rates |= {u[-1]: first, first: second}
            u += [first, second]
            if i.rates == "estimated":
                u.append(sp.Symbol(derivative(name_of(i.symbol), 3), real=True))
    return tuple(u), rates


def _terms(expression: Expr) -> Iterator[Expr]:
    """The summands of an expression, c*(a + b) split into c*a and c*b, nothing else expanded."""
    stack = [expression]
    while stack:
        e = stack.pop()
        if e.is_Add:
            stack.extend(reversed(e.args))
            continue
        sums = [a for a in e.args if a.is_Add] if e.is_Mul else []
        if len(sums) == 1:
            rest = sp.Mul(*(a for a in e.args if a is not sums[0]))
            stack.extend(rest * a for a in reversed(sums[0].args))
        else:
            yield e


def _gradient(expression: Expr, place: Mapping[Expr, int]) -> Iterator[tuple[int, Expr]]:
    """(place, derivative) for the symbols that occur in the expression, by their places."""
    for s in sorted(expression.free_symbols & place.keys(), key=place.__getitem__):
        d = expression.diff(s)
        if d != 0:
            yield place[s], d


def _along(expression: Expr, moving: Kinematics) -> dict[int, Expr]:
    """Its derivative along each speed that moves it: sum_j d/dq_j B_ji."""
    found: dict[int, list[Expr]] = defaultdict(list)
    for j, slope in _gradient(expression, moving.place):
        for i, a in moving.rows[j].items():
            found[i].append(slope * a)
    along = {i: sp.Add(*parts) for i, parts in sorted(found.items())}
    return {i: a for i, a in along.items() if a != 0}


def _left_hand_side(
    terms: list[Expr], moving: Kinematics, clock: _Clock, problems: list[str]
) -> tuple[dict[tuple[int, int], Expr], list[Expr]]:
    """M, and F = X L + c v dL/dv - (d/dt dL/dv without its v' terms), term by term of L."""
    M: dict[tuple[int, int], list[Expr]] = defaultdict(list)
    F: list[list[Expr]] = [[] for _ in moving.v]
    speed = {s: i for i, s in enumerate(moving.v)}
    turning, found = moving.commutators
    problems += found
    for term in terms:
        for i, along in _along(term, moving).items():
            F[i].append(along)
        present = sorted(term.free_symbols & speed.keys(), key=speed.__getitem__)
        for s in present:
            momentum = term.diff(s)
            F[speed[s]].append(-clock.total(momentum))
            for i, c in turning[speed[s]]:
                F[i].append(c * momentum)
            for r in present:
                mass = momentum.diff(r)
                if mass.free_symbols & speed.keys():
                    problems.append(
                        f"the energy's term {term} is not quadratic in the velocities, expected "
                        "M(q, t): a velocity-dependent force belongs to `forces`"
                    )
                elif mass != 0:
                    M[speed[s], speed[r]].append(mass)
    return {ij: sp.Add(*m) for ij, m in M.items()}, [sp.Add(*parts) for parts in F]


def _pfaffian(
    constraint: Constraint,
    expression: Expr,
    problems: list[str],
    slopes: Mapping[Expr, tuple[int, Differential]],
) -> tuple[dict[int, Expr], Expr]:
    """Coefficients a_j and a_0 of sum_j a_j v_j + a_0; `slopes`: the place j of each speed, and the
    derivative by it."""
    present = expression.free_symbols & slopes.keys()
    found = {
        j: slope(expression) for j, slope in sorted((slopes[s] for s in present), key=itemgetter(0))
    }
    row = {j: a for j, a in found.items() if a != 0}
    nonlinear = [a for a in row.values() if a.free_symbols & slopes.keys()]
    if nonlinear:
        problems.append(
            f"constraint {constraint.name!r}: {expression} is nonlinear in the velocities, expected "
            "a Pfaffian form sum_j a_j(q, t) v_j + a_0(q, t)"
        )
    if not row:
        problems.append(
            f"constraint {constraint.name!r}: {expression} holds no velocity; a relation between "
            "coordinates is Holonomic"
        )
    drift = expression.xreplace(dict.fromkeys(present, sp.S.Zero))
    return row, drift


def _energies(
    model: Model,
    energy: Expr,
    M: dict[tuple[int, int], Expr],
    v: tuple[Expr, ...],
    table: dict[Expr, Expr],
) -> tuple[Expr, Expr | None]:
    """v^T M v / 2, and minus the part of L without velocities (or the forces' potential)."""
    kinetic = sp.Add(*(m * v[i] * v[j] / 2 for (i, j), m in sorted(M.items())))
    standing = -energy.xreplace(dict.fromkeys(v, sp.S.Zero))
    if model.lagrangian is not None:
        return kinetic, standing
    return kinetic, _potential(model, standing, table)


def _potential(model: Model, standing: Expr, table: dict[Expr, Expr]) -> Expr | None:
    """V of the forces that depend on q alone, where they are a gradient of polynomials and sines.

    Each force is split into the terms that hold coordinates and parameters only, and the rest.
    None if the first have a curl, or act on speeds: then there is no potential energy to report.
    """
    if model.forces.keys() & model.speeds.keys():
        return None
    q = tuple(table[c] for c in model.coordinates)
    allowed = set(q) | {p.symbol for p in model.parameters}
    forces = []
    for coordinate in model.coordinates:
        force = sp.expand(sp.sympify(model.forces.get(coordinate, 0)).xreplace(table))
        forces.append(sp.Add(*(a for a in sp.Add.make_args(force) if a.free_symbols <= allowed)))
    if any(
        sp.simplify(forces[i].diff(q[j]) - forces[j].diff(q[i])) != 0
        for i in range(len(q))
        for j in range(i)
    ):
        return None
    V = sp.S.Zero
    for force, s in zip(forces, q, strict=True):
        rest = sp.expand(force + V.diff(s))
        integral = sp.integrate(rest, s)
        if integral.has(sp.Integral):
            return None
        V -= integral
    if any(sp.simplify(f + V.diff(s)) != 0 for f, s in zip(forces, q, strict=True)):
        return None
    return V + standing
