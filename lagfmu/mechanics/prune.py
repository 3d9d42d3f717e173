"""Equations -> equations without what a scene does not need.  Each step leaves a full scene as it is.

A contact that cannot open is a holonomic constraint.  A speed goes, with the coordinates that it moves, if
nothing that is read depends on it: what one linear solve ties together (coupling.py) is needed as a whole,
with all that stands in its equations. Where the dependent coordinates are eliminated and no lambda is asked
for, of the full equations only the coordinates that are read remain.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import sympy as sp

from .. import names
from ..errors import RequestError
from ..model.elements import Expr
from ..model.model import Constraint, Contact, Holonomic, Output
from ..model.scene import Scene
from ..model.selection import select
from ..names import derivative
from .coupling import coupled
from .equations import EquationsOfMotion, symbols_of
from .form import Form
from .joint_coordinates import start_names

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
    eom, of = form.equations, subjects(form)
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


def subjects(form: Form) -> Callable[[str], tuple[Indices, Indices]]:
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
    of = subjects(form)
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
