"""Equations -> equations without what a scene does not need.  Each step leaves a full scene as it is.

A contact that cannot open is a holonomic constraint.  A speed goes, with the coordinates that it moves, if
nothing that is read depends on it: what one linear solve ties together (`coupled`) is needed as a whole,
with all that stands in its equations. Where the dependent coordinates are eliminated and no lambda is asked
for, of the full equations only the coordinates that are read remain.

Parameters that stay as they are, and inputs that nothing drives, become numbers in the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from .. import names
from ..errors import RequestError, UnitError
from ..model.elements import TIME, Expr
from ..model.model import Constraint, Contact, Holonomic, Model, Output, Parameter, name_of
from ..model.rule import Rule
from ..model.scene import Scene, select
from ..model.units import Unit, parse_quantity
from ..names import derivative
from .equations import EquationsOfMotion, symbols_of
from .formulations import Form, coupled
from .kinematics import start_names


def numbers_of(eom: EquationsOfMotion, scene: Scene, problems: list[str]) -> dict[Expr, Expr]:
    """The parameters that the scene fixes and the inputs that nothing drives, with their values."""
    values: dict[Expr, float] = {}
    parameters = {name_of(p.symbol): p for p in eom.parameters}
    for text in scene.fixed:
        name, given, number = (part.strip() for part in text.partition("="))
        for found in select([name], list(parameters), "fixed parameter", problems):
            p = parameters[found]
            unit = eom.units[found]
            value = _value(p, unit, number, problems) if given else float(p.value)
            if value is not None:
                values[p.symbol] = value
    inputs = {name_of(i.symbol): i for i in eom.model.inputs}
    driven = select(scene.inputs, list(inputs), "input", problems)
    for name, i in inputs.items():
        if name not in driven and not i.rate:  # one that moves by itself stays an input
            u = eom.symbols.get(i.symbol, i.symbol)
            rate = eom.rates.get(u)
            if u in eom.estimated:
                values[eom.u[eom.u.index(u) + 3]] = 0.0
            values |= {u: float(i.start)} | ({rate: 0.0, eom.rates[rate]: 0.0} if rate else {})
    return {symbol: _number(value) for symbol, value in values.items()}


def _value(p: Parameter, unit: Unit, text: str, problems: list[str]) -> float | None:
    name = name_of(p.symbol)
    try:
        value = parse_quantity(text, unit, f"fixed parameter {name!r}")
    except UnitError as error:
        problems.append(str(error))
        return None
    rule = Rule(name, minimum=p.min, maximum=p.max, positive=bool(p.symbol.is_positive))
    if problem := rule.problem(value):
        problems.append(f"fixed parameter {problem}")
        return None
    return value


def _number(value: float) -> Expr:
    """An integer as such, so that a factor 1 and a term 0 vanish."""
    return sp.Integer(int(value)) if value.is_integer() and abs(value) < 2**53 else sp.Float(value)


def folded(eom: EquationsOfMotion, numbers: Mapping[Expr, Expr]) -> EquationsOfMotion:
    """The equations with the numbers put in.  Raises RequestError if they divide by zero."""
    if not numbers:
        return eom

    made = replace(
        eom.mapped(lambda e: _settled(e.xreplace(numbers))),
        u=tuple(s for s in eom.u if s not in numbers),
        p=tuple(s for s in eom.p if s not in numbers),
        rates={s: r for s, r in eom.rates.items() if s not in numbers},
        numbers={**eom.numbers, **numbers},
        told=eom.standing,
    )
    flat = made.solved + [o.expression for o in made.outputs if o.otherwise is None]
    if any(e.has(sp.zoo, sp.oo, sp.nan) for e in flat):
        given = ", ".join(f"{s} = {float(n)!r}" for s, n in numbers.items())
        raise RequestError(
            eom.model.name, [f"the equations divide by zero with the fixed values {given}"]
        )
    return made


def _settled(e: Expr) -> Expr:
    """cos(2) and sqrt(2) as numbers: what holds no symbol is evaluated here, not at run time."""
    return e.replace(
        lambda x: x.is_number and not x.is_Atom and not x.is_Rational, lambda x: x.evalf(17)
    )


def folded_form(form: Form, numbers: Mapping[Expr, Expr]) -> Form:
    """The same of a form."""
    if not numbers:
        return form
    equations, reduction = folded(form.equations, numbers), form.reduction
    if reduction is None:
        return replace(form, equations=equations)
    reduction = replace(
        reduction,
        phi=tuple(_settled(e.xreplace(numbers)) for e in reduction.phi),
        vel=tuple(_settled(e.xreplace(numbers)) for e in reduction.vel),
        reduced=folded(reduction.reduced, numbers),
    )
    return replace(form, equations=equations, reduction=reduction)


def values(symbols: Iterable[Expr], model: Model) -> dict[Expr, Expr]:
    """The model's values of some of its parameters."""
    wanted = set(symbols)
    return {p.symbol: _number(float(p.value)) for p in model.parameters if p.symbol in wanted}


def idle(form: Form) -> list[Expr]:
    """Parameters on which nothing that is left depends."""
    eom, reduction = form.equations, form.reduction
    flat = _expressions(eom)
    if reduction is not None:
        flat += [*reduction.phi, *reduction.vel, *_expressions(reduction.reduced)]
    used = set().union(*(e.free_symbols for e in flat)) if flat else set()
    return [p for p in eom.p if p not in used]


def _expressions(eom: EquationsOfMotion) -> list[Expr]:
    flat = [*eom.solved, *eom.f, eom.kinetic, eom.potential]
    flat += [e for o in eom.outputs for e in (o.expression, o.otherwise)]
    flat += [eom.plain(c.restitution) for c in eom.constraints if isinstance(c, Contact)]
    flat += [e for law in eom.frictions for e in law.expressions]
    flat += [*eom.starts().values(), *eom.sides.values()]
    return [sp.sympify(e) for e in flat if e is not None]


def damped(eom: EquationsOfMotion, numbers: Mapping[Expr, Expr]) -> bool:
    """True if a force that the user gives holds a velocity.

    What the Lagrangian gives conserves Jacobi's integral: without damping no part of the motion decays
    fast, which is the stiffness that an implicit method cures.
    """
    speeds = {eom.symbols[q.diff(TIME)] for q in eom.model.coordinates}
    forces = [sp.sympify(f).xreplace(eom.symbols) for f in eom.model.forces.values()]
    return any(f.xreplace(numbers).free_symbols & speeds for f in forces)


Indices = frozenset[int]
SOLVED = {
    k.quantity for k in names.kinds(names.CONSTRAINT, names.DIRECTION)
}  # of the full equations
NONE: Indices = frozenset()


def held(eom: EquationsOfMotion, scene: Scene, problems: list[str]) -> EquationsOfMotion:
    """Contacts that the scene does not let open, as holonomic constraints."""
    contacts = [c.name for c in eom.constraints if isinstance(c, Contact)]
    shut = set(contacts) - set(select(scene.contacts, contacts, "contact", problems))
    if not shut:
        return eom

    def hold(c: Constraint) -> Constraint:
        if isinstance(c, Contact):
            return Holonomic(c.name, c.expression, c.description) if c.name in shut else c
        return replace(c, while_closed=None) if c.while_closed in shut else c

    return replace(eom, constraints=tuple(hold(c) for c in eom.constraints))


def needed(form: Form, outputs: Collection[str]) -> tuple[Indices, Indices]:
    """Speeds and constraint rows on which the outputs depend, by position.

    Raises RequestError if there are none.
    """
    eom, of = form.equations, _subjects(form)
    speeds: set[int] = set()
    rows: set[int] = set()
    for name in outputs:
        more, more_rows = of(name)
        speeds |= more
        rows |= more_rows
    groups = [(c, r, _positions(eom, _behind(eom, c, r))) for c, r in coupled(eom)]
    known = [c.name for c in eom.constraints]
    grown = True
    while grown:
        before = len(speeds), len(rows)
        for own, own_rows, others in groups:
            if own & speeds or own_rows & rows:
                speeds |= own | others
                rows |= own_rows
        rows |= {
            known.index(w) for k in rows if (w := getattr(eom.constraints[k], "while_closed", None))
        }
        grown = (len(speeds), len(rows)) != before
    if not speeds:
        raise RequestError(
            eom.model.name,
            ["the outputs of the scene depend on no coordinate: name one of the motion"],
        )
    return frozenset(speeds), frozenset(rows)


def _subjects(form: Form) -> Callable[[str], tuple[Indices, Indices]]:
    """Name of an output -> the speeds and rows that it is of."""
    eom, reduction = form.equations, form.reduction
    moved = dict(zip(map(str, eom.q), _moved(eom), strict=True))
    moved |= {names.read(str(v)).coordinate: frozenset({i}) for i, v in enumerate(eom.v)}
    if reduction is not None:
        for s in reduction.s:
            behind = frozenset(j for j, phi in enumerate(reduction.phi) if s in phi.free_symbols)
            moved.setdefault(str(s), behind)
    forced = {direction: frozenset({i}) for i, direction in enumerate(eom.directions)}
    rows = {c.name: frozenset({k}) for k, c in enumerate(eom.constraints)}
    slipping: dict[str, Indices] = {}  # of a friction, and of each row that it limits, all of these
    for law in eom.frictions:
        of_law = NONE.union(*(rows[name] for name in law.of))
        slipping |= dict.fromkeys((law.name, *law.of), of_law)
    losing = NONE.union(
        *slipping.values(), *(rows[c.name] for c in eom.constraints if isinstance(c, Contact))
    )
    energies = {q: [getattr(eom, part) for part in parts] for q, parts in names.ENERGIES.items()}
    outputs = {o.name: o for o in eom.outputs}

    def subject(name: str) -> tuple[Indices, Indices]:
        of = names.read(name)
        if (asked := of.constraint if of.quantity == names.UNIQUE else name) in outputs:
            return _of_output(eom, outputs[asked])
        if of.quantity in energies:
            parts = (e.free_symbols for e in energies[of.quantity] if e is not None)
            return _positions(eom, set().union(*parts)), NONE
        if of.quantity == names.DISSIPATED:
            return NONE, losing
        if of.head in names.OF_OTHERS:  # what they are of is asked for besides
            return NONE, NONE
        speeds = forced if of.quantity == names.FORCE else moved
        acting = slipping if of.head in names.OF_FRICTION else rows
        return speeds.get(of.coordinate, NONE), acting.get(of.constraint, NONE)

    return subject


def _moved(eom: EquationsOfMotion) -> list[Indices]:
    """The speeds by which each coordinate moves."""
    return [frozenset(row) for row in eom.kinematics.rows]


def _motion(q: Expr) -> list[str]:
    """A coordinate, its velocity, its acceleration."""
    return [derivative(str(q), k) for k in range(3)]


def _of_output(eom: EquationsOfMotion, o: Output) -> tuple[Indices, Indices]:
    """The speeds and rows that an output of the model's own is of."""
    symbols = symbols_of(o)
    solved = {i for group in (eom.vdot, eom.Q) for i, s in enumerate(group) if s in symbols}
    rows = frozenset(k for k, s in enumerate(eom.lam) if s in symbols)
    return _positions(eom, symbols) | solved, rows


def _behind(eom: EquationsOfMotion, speeds: Indices, rows: Indices) -> set[Expr]:
    """The symbols in the equations of a group."""
    flat = [m for (i, _), m in eom.M.todok().items() if i in speeds]
    flat += [a for (k, _), a in eom.G.todok().items() if k in rows]
    flat += [eom.F[i] for i in speeds]
    flat += [rate for rate, by in zip(eom.qdot, _moved(eom), strict=True) if by & speeds]
    for k in rows:
        flat += [eom.nu[k], eom.gamma[k], *([] if eom.f[k] is None else [eom.f[k]])]
        law = eom.limited.get(eom.constraints[k].name)
        flat += law.expressions if law is not None else ()
    return set().union(*(sp.sympify(e).free_symbols for e in flat)) if flat else set()


def _positions(eom: EquationsOfMotion, symbols: set[Expr]) -> Indices:
    moving = [by for q, by in zip(eom.q, _moved(eom), strict=True) if q in symbols]
    return frozenset(i for i, v in enumerate(eom.v) if v in symbols).union(*moving)


def only(
    eom: EquationsOfMotion, speeds: Collection[int], rows: Collection[int]
) -> EquationsOfMotion:
    """The equations of some speeds, of the coordinates that they move, and of some rows; energies are left
    out where they hold others."""
    if len(speeds) == eom.nv and len(rows) == eom.m:
        return eom
    js, ks = sorted(speeds), sorted(rows)
    stay, hold = frozenset(js), frozenset(ks)
    moved = [j for j, by in enumerate(_moved(eom)) if not by or by & stay]

    def pick(group: Sequence[Any], which: Sequence[int]) -> tuple[Any, ...]:
        return tuple(group[i] for i in which)

    def part(matrix: Expr, of: Sequence[int]) -> Expr:
        row = {k: i for i, k in enumerate(of)}
        column = {j: i for i, j in enumerate(js)}
        values = matrix.todok().items()
        return sp.SparseMatrix(
            len(of),
            len(js),
            {(row[i], column[j]): a for (i, j), a in values if i in row and j in column},
        )

    kept = {eom.constraints[k].name for k in ks}
    away = [j for j in range(eom.nv) if j not in stay]
    gone = {*eom.q}.difference(eom.q[j] for j in moved) | {eom.v[j] for j in away}
    unsolved = gone | {s for j in away for s in (eom.vdot[j], eom.Q[j])}
    unsolved |= {s for k, s in enumerate(eom.lam) if k not in hold}

    def whole(energy: Expr) -> Expr:
        return None if energy is None or energy.free_symbols & gone else energy

    return replace(
        eom,
        q=pick(eom.q, moved),
        v=pick(eom.v, js),
        qdot=pick(eom.qdot, moved),
        M=part(eom.M, js),
        F=pick(eom.F, js),
        G=part(eom.G, ks),
        nu=pick(eom.nu, ks),
        gamma=pick(eom.gamma, ks),
        f=pick(eom.f, ks),
        kinetic=whole(eom.kinetic),
        potential=whole(eom.potential),
        constraints=pick(eom.constraints, ks),
        outputs=tuple(o for o in eom.outputs if not symbols_of(o) & unsolved),
        frictions=tuple(law for law in eom.frictions if kept.issuperset(law.of)),
    )


def silent(eom: EquationsOfMotion, outputs: Collection[str]) -> EquationsOfMotion:
    """Without the energies and outputs of the model's own that are not read."""
    read = {part for name in outputs for part in names.ENERGIES.get(name, ())}
    if names.DISSIPATED in outputs:
        read = {"kinetic", "potential"}
    return replace(
        eom,
        kinetic=eom.kinetic if "kinetic" in read else None,
        potential=eom.potential if "potential" in read else None,
        outputs=own(eom, outputs),
    )


def own(eom: EquationsOfMotion, outputs: Collection[str]) -> tuple[Output, ...]:
    """The model's own outputs that are read, or of which it is read whether they are unique."""
    asked = {*outputs, *names.constraints(outputs, names.UNIQUE)}
    asked |= {
        n for c in eom.joint_coordinates if {*start_names([c])} & asked for n in start_names([c])
    }
    return tuple(o for o in eom.outputs if o.name in asked)


def read_only(form: Form, outputs: Collection[str]) -> Form:
    """Of the full equations, what is read where nothing that they are solved for is asked for.

    Unchanged if an output needs lambda, Q, a residual or a dependent acceleration.  If only the
    stepped coordinates are read, their equations are all there is.
    """
    eom, reduction = form.equations, form.reduction
    if reduction is None:
        return form
    stepped = {derivative(str(s), 2) for s in reduction.s}
    solved = {derivative(str(q), 2) for q in eom.q} - stepped
    reactions = {*eom.vdot, *eom.lam, *eom.Q}
    solved |= {o.name for o in eom.outputs if symbols_of(o) & reactions}
    if names.those(outputs, *SOLVED) or solved & set(outputs):
        return form
    of_s = {name for s in reduction.s for name in _motion(s)}
    of = _subjects(form)
    wanted: set[int] = set()
    for name in set(outputs) - of_s:
        wanted |= of(name)[0]
    js = sorted(wanted)
    if not js:
        own = replace(reduction.reduced, constraints=reduction.constraints, outputs=eom.outputs)
        return replace(form, equations=silent(own, outputs), reduction=None)
    rates = [n for n in outputs if names.read(n).order or names.read(n).quantity in names.ENERGIES]
    rates += [o.name for o in eom.outputs if o.name in outputs and symbols_of(o) & set(eom.v)]
    moving = bool(set(rates) - of_s)  # of what is read, velocities are asked for
    nothing = sp.SparseMatrix(len(js), len(js), {})
    zeros = (sp.S.Zero,) * len(js)
    return replace(
        form,
        equations=replace(only(eom, js, ()), M=nothing, F=zeros, bare=True),
        reduction=replace(
            reduction,
            phi=tuple(reduction.phi[j] for j in js),
            vel=tuple(reduction.vel[j] if moving else sp.S.Zero for j in js),
        ),
    )
