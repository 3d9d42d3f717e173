"""Equations -> equations without what a scene does not need.  Each step leaves a full scene as it is.

A contact that cannot open is a holonomic constraint.  A parameter that stays as it is, and an input that
nothing drives, are numbers.  A coordinate goes if nothing that is read depends on it: what one linear
solve ties together (variables.coupled) is needed as a whole, with all that stands in its equations.
Where the dependent coordinates are eliminated and no lambda is asked for, of the full equations only
the coordinates that are read remain.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from .equations import TIME, EquationsOfMotion
from .errors import ModelError
from .model import Constraint, Contact, Holonomic, Model, Parameter, name_of
from .reduction import Reduction
from .scene import Scene
from .selection import select
from .variables import coupled

Expr = Any
Indices = frozenset[int]
SOLVED = ("lambda.", "unique.", "residual.", "Q.")  # what needs the full equations solved


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


# ---------------------------------------------------------------------------- numbers


def numbers_of(eom: EquationsOfMotion, scene: Scene, problems: list[str]) -> dict[Expr, Expr]:
    """The parameters that the scene fixes and the inputs that nothing drives, with their values."""
    values: dict[Expr, float] = {}
    parameters = {name_of(p.symbol): p for p in eom.parameters}
    for text in scene.fixed:
        name, given, number = (part.strip() for part in text.partition("="))
        for found in select([name], list(parameters), "fixed parameter", problems):
            p = parameters[found]
            value = _value(p, number, problems) if given else float(p.value)
            if value is not None:
                values[p.symbol] = value
    inputs = {name_of(i.symbol): i for i in eom.model.inputs}
    driven = select(scene.inputs, list(inputs), "input", problems)
    for name, i in inputs.items():
        if name not in driven:
            u = eom.symbols.get(i.symbol, i.symbol)
            rate = eom.rates.get(u)
            values |= {u: float(i.start)} | ({rate: 0.0, eom.rates[rate]: 0.0} if rate else {})
    return {symbol: _number(value) for symbol, value in values.items()}


def _value(p: Parameter, text: str, problems: list[str]) -> float | None:
    name = name_of(p.symbol)
    try:
        value = float(text)
    except ValueError:
        problems.append(f"fixed parameter {name!r} = {text!r} is no number")
        return None
    low = float("-inf") if p.min is None else p.min
    high = float("inf") if p.max is None else p.max
    if not (abs(value) < float("inf") and low <= value <= high):
        problems.append(
            f"fixed parameter {name!r} = {value!r} is outside its bounds [{low}, {high}]"
        )
    elif p.symbol.is_positive and not value > 0:
        problems.append(f"fixed parameter {name!r} = {value!r}, expected a positive number")
    else:
        return value
    return None


def _number(value: float) -> Expr:
    """An integer as such, so that a factor 1 and a term 0 vanish."""
    return sp.Integer(int(value)) if value.is_integer() and abs(value) < 2**53 else sp.Float(value)


def folded(eom: EquationsOfMotion, numbers: Mapping[Expr, Expr]) -> EquationsOfMotion:
    """The equations with the numbers put in.  Raises ModelError if they divide by zero."""
    if not numbers:
        return eom

    def put(e: Expr) -> Expr:
        return None if e is None else _settled(sp.sympify(e).xreplace(numbers))

    def each(group: Iterable[Expr]) -> tuple[Expr, ...]:
        return tuple(put(e) for e in group)

    def sparse(matrix: Expr) -> Expr:
        values = {ij: put(e) for ij, e in matrix.todok().items()}
        return sp.ImmutableSparseMatrix(
            matrix.rows, matrix.cols, {ij: e for ij, e in values.items() if e != 0}
        )

    made = replace(
        eom,
        u=tuple(s for s in eom.u if s not in numbers),
        p=tuple(s for s in eom.p if s not in numbers),
        M=sparse(eom.M),
        F=each(eom.F),
        G=sparse(eom.G),
        nu=each(eom.nu),
        gamma=each(eom.gamma),
        f=each(eom.f),
        kinetic=put(eom.kinetic),
        potential=put(eom.potential),
        rates={s: r for s, r in eom.rates.items() if s not in numbers},
        numbers={**eom.numbers, **numbers},
    )
    flat = [*made.M.todok().values(), *made.F, *made.G.todok().values(), *made.nu, *made.gamma]
    if any(e.has(sp.zoo, sp.oo, sp.nan) for e in flat):
        given = ", ".join(f"{s} = {float(n)!r}" for s, n in numbers.items())
        raise ModelError(
            eom.model.name, [f"the equations divide by zero with the fixed values {given}"]
        )
    return made


def _settled(e: Expr) -> Expr:
    """cos(2) and sqrt(2) as numbers: what holds no symbol is evaluated here, not at run time."""
    return e.replace(
        lambda x: x.is_number and not x.is_Atom and not x.is_Rational, lambda x: x.evalf(17)
    )


def folded_reduction(reduction: Reduction, numbers: Mapping[Expr, Expr]) -> Reduction:
    """The same for the minimal formulation."""
    if not numbers:
        return reduction
    return replace(
        reduction,
        phi=tuple(_settled(e.xreplace(numbers)) for e in reduction.phi),
        vel=tuple(_settled(e.xreplace(numbers)) for e in reduction.vel),
        reduced=folded(reduction.reduced, numbers),
    )


def values(symbols: Iterable[Expr], model: Model) -> dict[Expr, Expr]:
    """The model's values of some of its parameters."""
    wanted = set(symbols)
    return {p.symbol: _number(float(p.value)) for p in model.parameters if p.symbol in wanted}


def idle(eom: EquationsOfMotion, reduction: Reduction | None) -> list[Expr]:
    """Parameters on which nothing that is left depends."""
    flat = _expressions(eom)
    if reduction is not None:
        flat += [*reduction.phi, *reduction.vel, *_expressions(reduction.reduced)]
    used = set().union(*(e.free_symbols for e in flat)) if flat else set()
    return [p for p in eom.p if p not in used]


def _expressions(eom: EquationsOfMotion) -> list[Expr]:
    flat = [*eom.M.todok().values(), *eom.F, *eom.G.todok().values(), *eom.nu, *eom.gamma]
    flat += [*eom.f, eom.kinetic, eom.potential]
    flat += [eom.plain(c.restitution) for c in eom.constraints if isinstance(c, Contact)]
    return [sp.sympify(e) for e in flat if e is not None]


def damped(eom: EquationsOfMotion, numbers: Mapping[Expr, Expr]) -> bool:
    """True if a force that the user gives holds a velocity.

    What the Lagrangian gives conserves Jacobi's integral: without damping no part of the motion decays
    fast, which is the stiffness that an implicit method cures.
    """
    speeds = {eom.symbols[q.diff(TIME)] for q in eom.model.coordinates}
    forces = [sp.sympify(f).xreplace(eom.symbols) for f in eom.model.forces.values()]
    return any(f.xreplace(numbers).free_symbols & speeds for f in forces)


# ---------------------------------------------------------------------------- coordinates


def needed(
    eom: EquationsOfMotion, reduction: Reduction | None, outputs: Collection[str]
) -> tuple[Indices, Indices]:
    """Coordinates and constraint rows on which the outputs depend, by position.

    Raises ModelError if there are none.
    """
    of = subjects(eom, reduction)
    coordinates: set[int] = set()
    rows: set[int] = set()
    for name in outputs:
        more, more_rows = of.get(name, (frozenset(), frozenset()))
        coordinates |= more
        rows |= more_rows
    groups = [(c, r, _positions(eom, _behind(eom, c, r))) for c, r in coupled(eom)]
    names = [c.name for c in eom.constraints]
    grown = True
    while grown:
        before = len(coordinates), len(rows)
        for own, own_rows, others in groups:
            if own & coordinates or own_rows & rows:
                coordinates |= own | others
                rows |= own_rows
        rows |= {names.index(w) for k in rows if (w := _gate(eom.constraints[k])) is not None}
        grown = (len(coordinates), len(rows)) != before
    if not coordinates:
        raise ModelError(
            eom.model.name,
            ["the outputs of the scene depend on no coordinate: name one of the motion"],
        )
    return frozenset(coordinates), frozenset(rows)


def subjects(
    eom: EquationsOfMotion, reduction: Reduction | None
) -> dict[str, tuple[Indices, Indices]]:
    """Name of an output -> the coordinates and rows that it is of."""
    none: Indices = frozenset()
    found: dict[str, tuple[Indices, Indices]] = {}
    for j, q in enumerate(eom.q):
        for name in (f"{q}", f"der({q})", f"der({q},2)", f"Q.{q}"):
            found[name] = frozenset({j}), none
    for k, c in enumerate(eom.constraints):
        row = frozenset({k})
        for head in ("lambda", "unique", "residual", "contact"):
            found[f"{head}.{c.name}"] = none, row
        for tail in ("count", "time"):
            found[f"departure.{c.name}.{tail}"] = none, row
        for j, q in enumerate(eom.q):
            for name in (f"{c.name}.{q}", f"{c.name}.velocity.{q}"):
                found[f"departure.{name}"] = frozenset({j}), row
            found[f"Q.{c.name}.{q}"] = frozenset({j}), row
    for name, parts in (
        ("kinetic", [eom.kinetic]),
        ("potential", [eom.potential]),
        ("total", [eom.kinetic, eom.potential]),
    ):
        symbols = set().union(*(e.free_symbols for e in parts if e is not None))
        found[f"energy.{name}"] = _positions(eom, symbols), none
    if reduction is None:
        return found
    for s in reduction.s:
        moved = frozenset(j for j, phi in enumerate(reduction.phi) if s in phi.free_symbols)
        for name in (f"{s}", f"der({s})", f"der({s},2)"):
            found.setdefault(name, (moved, none))
    return found


def _gate(c: Constraint) -> str | None:
    return None if isinstance(c, Contact) else c.while_closed


def _behind(eom: EquationsOfMotion, coordinates: Indices, rows: Indices) -> set[Expr]:
    """The symbols in the equations of a group."""
    flat = [m for (i, _), m in eom.M.todok().items() if i in coordinates]
    flat += [a for (k, _), a in eom.G.todok().items() if k in rows]
    flat += [eom.F[j] for j in coordinates]
    for k in rows:
        flat += [eom.nu[k], eom.gamma[k], *([] if eom.f[k] is None else [eom.f[k]])]
    return set().union(*(sp.sympify(e).free_symbols for e in flat)) if flat else set()


def _positions(eom: EquationsOfMotion, symbols: set[Expr]) -> Indices:
    pairs = enumerate(zip(eom.q, eom.v, strict=True))
    return frozenset(j for j, (q, v) in pairs if q in symbols or v in symbols)


def only(
    eom: EquationsOfMotion, coordinates: Collection[int], rows: Collection[int]
) -> EquationsOfMotion:
    """The equations of some coordinates and rows; energies are left out where they hold others."""
    if len(coordinates) == eom.n and len(rows) == eom.m:
        return eom
    js, ks = sorted(coordinates), sorted(rows)

    def pick(group: Sequence[Any], which: Sequence[int]) -> tuple[Any, ...]:
        return tuple(group[i] for i in which)

    def part(matrix: Expr, of: Sequence[int]) -> Expr:
        row = {k: i for i, k in enumerate(of)}
        column = {j: i for i, j in enumerate(js)}
        values = matrix.todok().items()
        return sp.ImmutableSparseMatrix(
            len(of),
            len(js),
            {(row[i], column[j]): a for (i, j), a in values if i in row and j in column},
        )

    gone = {s for j in range(eom.n) if j not in js for s in (eom.q[j], eom.v[j])}

    def whole(energy: Expr) -> Expr:
        return None if energy is None or energy.free_symbols & gone else energy

    return replace(
        eom,
        q=pick(eom.q, js),
        v=pick(eom.v, js),
        M=part(eom.M, js),
        F=pick(eom.F, js),
        G=part(eom.G, ks),
        nu=pick(eom.nu, ks),
        gamma=pick(eom.gamma, ks),
        f=pick(eom.f, ks),
        kinetic=whole(eom.kinetic),
        potential=whole(eom.potential),
        constraints=pick(eom.constraints, ks),
    )


def silent(eom: EquationsOfMotion, outputs: Collection[str]) -> EquationsOfMotion:
    """Without the energies that are not read."""
    kinetic = bool({"energy.kinetic", "energy.total"} & set(outputs))
    potential = bool({"energy.potential", "energy.total"} & set(outputs))
    return replace(
        eom,
        kinetic=eom.kinetic if kinetic else None,
        potential=eom.potential if potential else None,
    )


def read_only(
    eom: EquationsOfMotion, reduction: Reduction, outputs: Collection[str]
) -> tuple[EquationsOfMotion, Reduction | None]:
    """Of the full equations, what is read where nothing that they are solved for is asked for.

    Unchanged if an output needs lambda, Q, a residual or a dependent acceleration.  If only the
    stepped coordinates are read, their equations are all there is.
    """
    stepped = {f"der({s},2)" for s in reduction.s}
    solved = {f"der({q},2)" for q in eom.q} - stepped
    if any(name.startswith(SOLVED) or name in solved for name in outputs):
        return eom, reduction
    of_s = {name for s in reduction.s for name in (f"{s}", f"der({s})", f"der({s},2)")}
    of = subjects(eom, reduction)
    wanted: set[int] = set()
    for name in set(outputs) - of_s:
        wanted |= of.get(name, (frozenset(), frozenset()))[0]
    js = sorted(wanted)
    if not js:
        own = replace(reduction.reduced, constraints=reduction.constraints)
        return silent(own, outputs), None
    rates = [n for n in outputs if n.startswith(("der(", "energy.")) or ".velocity." in n]
    moving = bool(set(rates) - of_s)  # of what is read, velocities are asked for
    nothing = sp.ImmutableSparseMatrix(len(js), len(js), {})
    zeros = (sp.S.Zero,) * len(js)
    return (
        replace(only(eom, js, ()), M=nothing, F=zeros, bare=True),
        replace(
            reduction,
            phi=tuple(reduction.phi[j] for j in js),
            vel=tuple(reduction.vel[j] if moving else sp.S.Zero for j in js),
        ),
    )
