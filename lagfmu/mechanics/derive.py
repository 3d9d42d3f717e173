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
from collections.abc import Iterator, Mapping
from dataclasses import replace
from operator import itemgetter

import sympy as sp

from ..errors import ModelError
from ..model.differential import Differential
from ..model.elements import TIME, Expr, Nonholonomic, Tie, name_of
from ..model.model import Constraint, Model
from ..names import derivative
from .equations import EquationsOfMotion, changed, friction_law
from .kinematics import Kinematics, attitudes


def _plain_symbols(model: Model) -> dict[Expr, Expr]:
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


def _plain_inputs(
    model: Model, table: dict[Expr, Expr]
) -> tuple[tuple[Expr, ...], dict[Expr, Expr]]:
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


def derive(model: Model) -> EquationsOfMotion:
    """Derive the equations of motion of `model`.

    Raises ModelError if the energy is not quadratic in the velocities, or a nonholonomic constraint
    is not affine in them.
    """
    table = _plain_symbols(model)
    q = tuple(table[c] for c in model.coordinates)
    qdot = tuple(table[c.diff(TIME)] for c in model.coordinates)
    v = tuple(table[s] for s in model.states[len(q) :])
    u, rates = _plain_inputs(model, table)
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
        frictions=tuple(friction_law(f, table) for f in model.frictions),
        outputs=tuple(changed(o, lambda e: e.xreplace(table)) for o in model.outputs),
    )
    return made.mapped(lambda e: e.xreplace(opened)) if opened else made


def _opened(moving: Kinematics, qdot: tuple[Expr, ...]) -> Kinematics:
    """With the rates of unwrapped angles as they stand: what is closed in them hides speeds."""
    rates = list(moving.rates)
    for j in moving.unwrapped & set(range(len(qdot))):
        rates[j] = qdot[j]
    return replace(moving, rates=tuple(rates))


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
