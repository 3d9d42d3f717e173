"""The equations of motion of a model: M, F, G, nu, gamma with all that stands beside them.

Multipliers as formulas, where the system is small:

    (G M^-1 G^T) lambda = gamma - G M^-1 F          (Ascher & Petzold 1998, sect. 10.2)

with all constraints acting, contacts closed.  In a large system the formula would be no help, and its
derivation no end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import sympy as sp

from ..errors import DerivationError
from ..model.display import Displayed
from ..model.elements import TIME, Expr, Friction, Tie, name_of
from ..model.model import Constraint, Model, Output, Parameter
from ..model.reactions import force_of_constraint, multiplier, norm, norms_of, reactions_in
from ..model.speeds import quaternions
from ..model.spline import Spline, SplineBase
from ..model.units import Unit
from ..names import derivative, rate_of, read
from .kinematics import JointCoordinate, Kinematics, joint_coordinates


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


def friction_law(f: Friction, table: dict[Expr, Expr]) -> FrictionLaw:
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


MOST, OPERATIONS = 6, 400  # coordinates and constraints together; operations of M, G, F and gamma


def _multipliers(name: str, M: Any, G: Any, F: Sequence[Expr], gamma: Sequence[Expr]) -> list[Expr]:
    """lambda (m) of  M vdot = F + G^T lambda,  G vdot = gamma  of the model `name`.

    Raises DerivationError where the system is too large, or M or G M^-1 G^T has no inverse.
    """
    m, n = G.shape
    size = n + m
    entries = [*M.todok().values(), *G.todok().values(), *F, *gamma]
    work = int(sum(sp.count_ops(e) for e in entries))
    if size > MOST or work > OPERATIONS:
        raise DerivationError(
            f"{name}: lambda as a formula is for small systems, expected at most {MOST} "
            f"coordinates and constraints together (here {size}) and {OPERATIONS} operations (here {work}); "
            "simulate it, or read the equations G vdot = gamma and M vdot = F + G^T lambda"
        )
    if not m:
        return []
    M, G = sp.Matrix(M), sp.Matrix(G)
    try:
        solved = M.LUsolve(G.T.row_join(sp.Matrix(F)))
        schur = (G * solved[:, :m]).applyfunc(sp.simplify)
        right = (sp.Matrix(gamma) - G * solved[:, m:]).applyfunc(sp.simplify)
        return [sp.simplify(e) for e in schur.LUsolve(right)]
    except (sp.matrices.exceptions.NonInvertibleMatrixError, ValueError, ZeroDivisionError):
        raise DerivationError(
            f"{name}: M or G M^-1 G^T has no inverse (a coordinate without mass, or redundant "
            "constraints): lambda has no formula of its own"
        ) from None


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
    constraints hold only as long as their multipliers stay below a part of a normal force; `told`: `standing`
    before parameters became numbers.
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
    told: Mapping[str, frozenset[str]] | None = None

    def multipliers(self) -> dict[str, Expr]:
        """Constraint -> lambda in q, v, t and parameters [J/[f]; W/[expression] if nonholonomic].

        Raises DerivationError where the system is too large, or M or G M^-1 G^T has no inverse.
        """
        found = _multipliers(self.model.name, self.M, self.G, self.F, self.gamma)
        back = {plain: s for s, plain in self.symbols.items() if plain.is_Symbol}
        back |= {TIME: sp.Symbol("t")}
        return {c.name: e.xreplace(back) for c, e in zip(self.constraints, found, strict=True)}

    @property
    def driven(self) -> tuple[Expr, ...]:
        """What the argument u of numeric functions holds: the inputs, then the switch states."""
        return (*self.u, *self.switch_states)

    @cached_property
    def standing(self) -> Mapping[str, frozenset[str]]:
        """The parameters that stand in the rows of each coordinate: of the constraints and, where each
        rate is a speed, of M; by names, as they were before any became numbers."""
        if self.told is not None:
            return self.told
        parameters = {p: str(p) for p in self.p}
        found: dict[str, set[str]] = {str(q): set() for q in self.q}
        G = self.G.todok()
        rows: dict[int, list[Any]] = {k: [] if f is None else [f] for k, f in enumerate(self.f)}
        moved: dict[int, set[str]] = {}
        for (k, j), value in G.items():
            rows.setdefault(k, []).append(value)
            if self.moves_plainly:
                moved.setdefault(k, set()).add(str(self.q[j]))
        for k, expressions in rows.items():
            symbols = set().union(*(sp.sympify(e).free_symbols for e in expressions))
            names = {parameters[s] for s in symbols if s in parameters}
            for q in moved.get(k, set()) | {str(s) for s in symbols if str(s) in found}:
                found[q] |= names
        for (i, _), value in self.M.todok().items() if self.moves_plainly else ():
            names = {parameters[s] for s in value.free_symbols if s in parameters}
            found[str(self.q[i])] |= names
        return {q: frozenset(names) for q, names in found.items()}

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
    def sides(self) -> dict[int, Expr]:
        """By its row, what is positive where a joint holds as it is meant, not turned over."""
        ties = {k: c for k, c in enumerate(self.constraints) if isinstance(c, Tie)}
        return {} if self.bare else {k: self.plain(c.side) for k, c in ties.items() if c.side != 1}

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
            outputs=tuple(changed(o, change) for o in self.outputs),
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


def changed(output: Output, change: Callable[[Expr], Expr]) -> Output:
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
