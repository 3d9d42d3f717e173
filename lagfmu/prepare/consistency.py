"""Rank, redundancy and feasibility of a model's constraints, found numerically where they hold.

Degrees of freedom N = n - rank G (ME 6590).  The rank is taken at the consistent start and at
configurations near it that satisfy the constraints, because on the constraint surface it may be smaller
than for a general q.
"""

from __future__ import annotations

import random
import warnings
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np

from ..codegen.py.equations import lower
from ..errors import CannotStartError, DerivationError, ModelError
from ..interface.table import variable_table
from ..interface.variables import VariableTable
from ..mechanics import prune
from ..mechanics.equations import EquationsOfMotion
from ..mechanics.formulations import Form
from ..model.model import Contact, name_of
from ..model.units import ONE, for_reading
from ..names import RESIDUAL, name
from ..numeric.failure import GIVEN, OmittedStartError, StepFailureError
from ..numeric.initialization import initial_positions
from ..numeric.instant import at_start, expanded
from ..numeric.motion import MISSED, friction_law, rank_of
from ..numeric.nominals import Mask, in_speeds
from ..numeric.start import Start, start
from ..numeric.system import NONHOLONOMIC, Sparse, System, Vector
from ..numeric.thresholds import RANK
from .starts import cause_of_failure, negative_energy, priorities
from .steps import Lowered, Structure

TRIALS = 5


class RedundantConstraintWarning(UserWarning):
    """Constraints that follow from others: lambda is not unique, Q is."""


@dataclass(frozen=True)
class Posed:
    """A start as it is asked for: equations, their variables, their numeric form, and the values of
    parameters and inputs (plain symbols) that are not the model's own."""

    equations: EquationsOfMotion
    table: VariableTable
    system: System
    fixed: Mapping[Any, Any]

    @property
    def values(self) -> tuple[list[float], list[float]]:
        """The inputs and the parameters."""
        return values_at_start(self.equations, self.table, self.fixed)


def posed(value: Lowered) -> Posed:
    """The start in the scene, before anything was left out of the code."""
    return Posed(value.form.equations, value.whole, value.examined, value.fixed)


def whole(value: Lowered) -> Posed:
    """The start of the model in all its coordinates, every contact free to open."""
    form = Form(value.derived)
    return Posed(value.derived, variable_table(form, value.scene), lower(form), value.fixed)


def examined_structure(value: Lowered) -> Structure:
    """That of the scene; contacts that it does not let open are closed.  Warns of redundant constraints.

    Raises ModelError for contacts that are not, CannotStartError with the cause for a start that is none.
    """
    _check_held(value)
    try:
        return structure_of(posed(value))
    except ModelError as error:
        problems = [*error.problems, *_resting_motions(value.form.equations)]
        raise CannotStartError(error.name, problems, value) from error


def _open_rank(system: System, G: Sparse, closed: int) -> int:
    """The rank of the rows that act while every contact is open; `closed`: of all."""
    held = [k for k in system.permanent if system.rows[k].friction is None]
    if not system.contacts or not held:
        return closed if held else 0
    rows = G.toarray()[held]
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    return int(
        np.linalg.matrix_rank(rows / np.where(size > 0, size, 1.0), tol=float(np.sqrt(RANK)))
    )


def structure_of(posed: Posed) -> Structure:
    """Check that the model can start, and count its degrees of freedom.

    Warns of redundant constraints.  Raises ModelError if no configuration satisfies the constraints,
    they contradict each other, the mass matrix is singular on the constraint surface, or the kinetic
    energy is negative for some velocities at the start.
    """
    eom, system, (u, p) = posed.equations, posed.system, posed.values
    begun = begin(posed)
    generator = random.Random(1)
    ranks, masses, opened = [], [], []
    for trial in range(TRIALS):
        q, v = begun.q, begun.v
        if trial:  # a nearby configuration that satisfies the constraints as well
            shift = [0.1 * s * generator.uniform(-1, 1) for s in _spans(system, begun, p)]
            try:
                shifted = at_start(system, q, u, p).moved(q, np.array(shift))
                q = _nearby(system, begun, shifted, v, u, p)
            except StepFailureError:
                continue
        at, q, v = expanded(at_start(system, q, u, p), q, v)
        full = at.system
        M, _, G, _, _ = at.equations(q, v)
        f = at.residual(q) if full.contacts else np.zeros(full.m)
        try:
            law = friction_law(at, q, v) if full.frictions else None
        except StepFailureError:
            continue
        ranks.append(rank_of(full, G, f, np.abs(G) @ full.across(np.abs(q), begun.span), law))
        masses.append(M)
        opened.append(_open_rank(full, G, ranks[-1].rank))
    size = np.abs([M.diagonal() for M in masses]).max(axis=0)
    negative = negative_energy(full, masses[0], size)
    if negative:
        raise ModelError(eom.model.name, [negative])
    found = max(ranks, key=lambda r: r.rank)
    redundant, shared, undecided = found.redundant, found.shared, found.undecided
    if redundant:
        warnings.warn(
            f"model {eom.model.name!r}: constraint{'s' if len(redundant) > 1 else ''} "
            f"{', '.join(map(repr, redundant))} follow{'' if len(redundant) > 1 else 's'} from the "
            f"others; lambda of {', '.join(map(repr, shared))} is shared with least norm and flagged by "
            f"unique.*, Q is right{remedy_of(eom)}",
            RedundantConstraintWarning,
            stacklevel=5,
        )
    several = {f.name for f in full.frictions if len([*chain(*f.norms)]) > 1}
    if refused := [name for name in undecided if name in several]:
        raise ModelError(eom.model.name, [of_norms(refused, redundant) + remedy_of(eom)])
    if undecided:
        warnings.warn(
            f"model {eom.model.name!r}: {of_undecided(undecided, redundant)}{remedy_of(eom)}",
            RedundantConstraintWarning,
            stacklevel=5,
        )
    missed = _missed(posed, begun)
    return Structure(
        eom.nv, eom.m, found.rank, redundant, shared, undecided, begun, missed, max(opened)
    )


def remedy_of(eom: EquationsOfMotion) -> str:
    """What makes the forces of the joints of a mechanism in space unique; nothing for others."""
    if not eom.model.parts or not eom.quaternions:
        return ""
    wanted = "give the mechanism its plane (plane='xy'), or make a hinge Spherical"
    return f"; to know the force of each joint, {wanted}"


def of_undecided(frictions: Sequence[str], redundant: Sequence[str]) -> str:
    """That the motion may depend on how redundant constraints share a normal force, and the remedy."""
    several = len(frictions) > 1
    return (
        f"the normal force{'s' if several else ''} of friction{'s' if several else ''} "
        f"{', '.join(map(repr, frictions))} {'are' if several else 'is'} not unique, and the motion may "
        "depend on it: taken is that of the multipliers of least norm; take as `normal` a sum of "
        f"multipliers that is unique, or leave out what is redundant ({', '.join(redundant)})"
    )


def of_norms(frictions: Sequence[str], redundant: Sequence[str]) -> str:
    """That norms of multipliers are not unique, so that no friction follows from them, and the remedy."""
    several = len(frictions) > 1
    return (
        f"friction{'s' if several else ''} {', '.join(map(repr, frictions))}: the normal "
        f"force{'s are norms' if several else ' is a norm'} of multipliers that are not unique, and the "
        "motion would depend on how redundant constraints share a force: leave out what is redundant "
        f"({', '.join(redundant)}), or take as `normal` what is unique"
    )


def _spans(system: System, begun: Start, p: Sequence[float]) -> list[float]:
    """Ten times what may be moved in each speed (nv) and still be near: the least length among the model's
    parts, if it has any. In a chain of 40 bars the places are up to 40 bars from the origin; a tenth of that
    is far."""
    numbers = system.speed_folded or (0.0,) * system.nv
    parts: dict[int, list[float]] = defaultdict(list)
    for x, dimension in zip(p, system.extent_dimension, strict=False):
        parts[dimension] += [abs(x)] if x else []
    ends = {of: [min(lengths), max(lengths)] for of, lengths in parts.items() if lengths}
    spans = []
    for dimension, number, size in zip(system.speed_dimension, numbers, begun.span, strict=True):
        lengths = [x for x in (*ends.get(dimension, ()), number) if x > 0] or [size or 1e-3]
        spans.append(max(min(lengths), 1e-3 * max(lengths)))
    return spans


def _missed(posed: Posed, begun: Start) -> tuple[str, ...]:
    """The constraints that act at the start and that the values of the model miss: by how much."""
    table, system, (u, p) = posed.table, posed.system, posed.values
    n, rows = system.nq, system.active(begun.closed)
    y = np.array([*begun.q, *begun.v])
    free = np.array([not table[state].given for state in system.states])  # they follow
    position = {name: i for i, name in enumerate(system.states)}
    for m in begun.moved:
        if m.priority == GIVEN:
            y[position[m.name]] = m.given
    q, v = y[:n], y[n:]
    at = at_start(system, q, u, p)
    _, _, G, nu, _ = at.equations(q, v)
    moves = np.array([all(free[j] for j in places) for places in system.moved_by], dtype=bool)
    places = _uncured(at.residual(q)[rows], G[rows], in_speeds(system, np.abs(q)), moves)
    rates = _uncured((G @ v - nu)[rows], G[rows], np.abs(v), free[n:])
    units = {r.name: r.unit or ONE for r in table.those(RESIDUAL)}
    found = []
    for k, place_by, rate_by in zip(rows, places.tolist(), rates.tolist(), strict=True):
        unit = units.get(name(RESIDUAL, system.rows[k].name), ONE)
        if rate_by and not place_by and system.rows[k].kind != NONHOLONOMIC:
            unit = unit.per_second()
        if by := place_by or rate_by:
            found.append(f"{system.rows[k].name!r} by {by:.3g} {for_reading(unit.name)}".rstrip())
    return tuple(found)


def _uncured(miss: Vector, G: Sparse, size: Vector, free: Mask) -> Vector:
    """What is left of a miss (rows) once the free values (n) have followed; 0 for rounding."""
    rounding = MISSED * (np.abs(G) @ size)
    if (np.abs(miss) <= rounding).all():
        return np.zeros(len(miss))
    loose = G[:, np.flatnonzero(free)].toarray()
    left = miss - loose @ np.linalg.lstsq(loose, miss, rcond=RANK)[0]
    return np.where(np.abs(left) > rounding, left, 0.0)


def values_at_start(
    eom: EquationsOfMotion, table: VariableTable, numbers: Mapping[Any, Any]
) -> tuple[list[float], list[float]]:
    """The inputs and the parameters at the start: `numbers`, else the table's and the model's values."""
    p = [float(numbers.get(x.symbol, x.value)) for x in eom.parameters]
    return [float(numbers.get(s, table[str(s)].start or 0.0)) for s in eom.u], p


def begin(posed: Posed) -> Start:
    """The start with the values of the table and those that are fixed.  Raises ModelError with the cause."""
    eom, system, (u, p) = posed.equations, posed.system, posed.values
    given = {name: eom.at_parameters(e, posed.fixed) for name, e in eom.starts().items()}
    q0 = [given.get(c, 0.0) for c in system.coordinates]
    v0 = [given.get(s, 0.0) for s in system.speeds]
    try:
        return start(system, q0, v0, u, p, priorities(system, posed.table))
    except OmittedStartError as error:
        raise ModelError(eom.model.name, [str(error)]) from error
    except StepFailureError as error:
        at = at_start(system, np.array(q0), u, p)
        cause = cause_of_failure(at, np.array(q0), np.array(v0)) or str(error)
        raise ModelError(eom.model.name, [cause]) from error


def _check_held(value: Lowered) -> None:
    """Contacts that the scene does not let open are closed at the start.  Raises ModelError naming others."""
    acting = prune.held(value.derived, value.asked, [])
    if acting is value.derived:
        return
    kept = {c.name for c in acting.constraints if isinstance(c, Contact)}
    posed = whole(value)
    names = [posed.system.rows[k].name for k in posed.system.contacts]
    shut = dict(zip(names, begin(posed).closed, strict=True))
    away = [name for name in names if name not in kept and not shut[name]]
    if away:
        raise ModelError(
            value.model.name,
            [
                f"contact {name!r} is open at the start, but the scene says that it cannot open: name "
                "it in `contacts`, or start on it"
                for name in away
            ],
        )


def check_embedding(form: Form) -> None:
    """An embedding q = phi(s) takes away as many coordinates as it satisfies constraints.

    If it took more, it would hold the system where no constraint does, and the forces that hold it would
    be missing from lambda.  Raises DerivationError naming the constraints that it violates.
    """
    eom, reduction = form.equations, form.reduction
    if reduction is None:
        return
    taken, satisfied = eom.nq - len(reduction.s), eom.m - len(reduction.rows)
    if taken <= satisfied:
        return
    left = zip(reduction.rows, reduction.reduced.f, strict=True)
    violated = "; ".join(
        f"constraint {eom.constraints[k].name!r} becomes {f}, expected 0"
        for k, f in left
        if f is not None
    )
    raise DerivationError(
        f"the embedding of model {eom.model.name!r} takes {taken} of {eom.nq} coordinates away, but "
        f"satisfies {satisfied} constraints{': ' + violated if violated else ''}; correct its "
        "relations, keep more coordinates, or add the constraint that it stands for"
    )


def _nearby(
    system: System, begun: Start, q: Vector, v: Vector, u: Sequence[float], p: Sequence[float]
) -> Vector:
    """The configuration near q that satisfies the constraints that act at the start."""
    with np.errstate(all="ignore"):
        rows = system.active(begun.closed)
        return initial_positions(at_start(system, q, u, p), q, v, rows, begun.size)


def _resting_motions(eom: EquationsOfMotion) -> list[str]:
    """Prescribed motions that start at 0 because nobody said otherwise: a likely cause."""
    return [
        f"the prescribed motion {name_of(i.symbol)!r} starts at 0 {i.unit}, as no start is given: if the "
        f"constraints need another value, write Input({name_of(i.symbol)}, {i.unit!r}, start=...)"
        for i in eom.model.prescribed
        if float(i.start) == 0
    ]
