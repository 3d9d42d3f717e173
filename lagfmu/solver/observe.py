"""What can be read at a state: motion, accelerations, multipliers, generalized forces, energies, events.

lambda, Q and the accelerations are those of one solve at this very state.  With an embedding q = phi(s, t)
the coordinates are embedded and lambda is recovered from the equations of the model itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .. import names
from ..names import derivative, name
from ..numeric.failure import StepFailureError, evaluated
from ..numeric.system import NONHOLONOMIC, Own, System, Vector
from .contacts import as_flags, closed_rows
from .equations import Motion
from .linear import Rows
from .state import Event, State


@dataclass(frozen=True)
class _Forces:
    """Of a model at a state: accelerations (nv), lambda (m; 0 of rows that do not act), Q (nv), each row's
    share of it (m, nv), what is missed by each row (m), whether its multiplier is unique (m); the
    rows that act, decomposed."""

    vdot: Vector
    lam: Vector
    Q: Vector
    shares: Vector
    residual: Vector
    unique: list[bool]
    acting: list[int]
    decomposed: Rows


def observe(system: System, state: State, u: Sequence[float], p: Sequence[float]) -> dict[str, Any]:
    """Values by the names of the FMU's variables.  Raises StepFailureError if one is not finite."""
    motion, t = Motion(system, u, p, state.t), state.t
    with np.errstate(all="ignore"):
        q, v = np.array(state.q), np.array(state.v)
        seen = dict(zip(system.states, [*state.q, *state.v], strict=True))
        model, forces = system, None
        if system.embedding is not None:
            model = system.embedding.full
            places, rates = motion.whole(t, q, v)
            terms = motion.terms(t, q, v).of(system.active(state.closed))
            vdot, *_ = motion.accelerations(terms)
            seen |= _accelerations(system, vdot)
            q, v = np.array(places), np.array(rates)
            seen |= dict(zip(model.states, [*places, *rates], strict=True))
        if model.kinematics is not None:
            rates = motion.rate(t, q, v).tolist()
            seen |= {derivative(c): x for c, x in zip(model.coordinates, rates, strict=True)}
        if model.dynamics is not None:
            forces = _forces(Motion(model, u, p, t), state, system, q, v)
            seen |= _accelerations(model, forces.vdot) | _of_constraints(model, forces)
        seen |= _energies(model, state, q, v, u, p) | _own(model, t, q, v, u, p, forces)
    seen |= _of_contacts(system, model, state)
    seen[names.STEPS] = state.steps
    wrong = [k for k, x in seen.items() if not math.isfinite(x)]
    if wrong:
        raise StepFailureError(f"{', '.join(wrong)} is not finite at t = {t!r} s")
    return seen


def _forces(motion: Motion, state: State, stepped: System, q: Vector, v: Vector) -> _Forces:
    model, t = motion.system, state.t
    closed = {stepped.rows[k].name for k in closed_rows(stepped, state.closed)}
    rows = model.active(
        as_flags(model, [k for k in model.contacts if model.rows[k].name in closed])
    )
    terms = motion.terms(t, q, v)
    vdot, part, decomposed = motion.accelerations(terms.of(rows))
    lam, unique = np.zeros(model.m), [True] * model.m
    lam[rows] = part
    for k, alone in zip(rows, decomposed.unique, strict=True):
        unique[k] = alone
    residual, missed = motion.residual(t, q) if model.m else np.zeros(0), terms.G @ v - terms.nu
    rolling = [k for k, row in enumerate(model.rows) if row.kind == NONHOLONOMIC]
    residual[rolling] = missed[rolling]
    shares = terms.G * lam[:, None]
    return _Forces(vdot, lam, shares.sum(axis=0), shares, residual, unique, rows, decomposed)


def _accelerations(system: System, vdot: Vector) -> dict[str, float]:
    found = zip(system.speeds, vdot.tolist(), strict=True)
    return {names.rate_of(v): a for v, a in found}


def _of_constraints(model: System, forces: _Forces) -> dict[str, Any]:
    seen: dict[str, Any] = {
        name(names.FORCE, "", q): x
        for q, x in zip(model.directions, forces.Q.tolist(), strict=True)
    }
    for k, row in enumerate(model.rows):
        seen[name(names.MULTIPLIER, row.name)] = float(forces.lam[k])
        seen[name(names.RESIDUAL, row.name)] = float(forces.residual[k])
        seen[name(names.UNIQUE, row.name)] = forces.unique[k]
    for k, j in zip(*model.jacobian, strict=True):
        of = name(names.FORCE, model.rows[k].name, model.directions[j])
        seen[of] = float(forces.shares[k, j])
    return seen


def _energies(
    model: System, state: State, q: Vector, v: Vector, u: Sequence[float], p: Sequence[float]
) -> dict[str, float]:
    if model.energies is None:
        return {}
    arguments = state.t, q.tolist(), v.tolist(), u, p
    kinetic, potential = map(float, evaluated("the energies", state.t, model.energies, *arguments))
    return {
        names.KINETIC: kinetic,
        names.POTENTIAL: potential,
        names.TOTAL: kinetic + potential,
    }


def _own(
    model: System,
    t: float,
    q: Vector,
    v: Vector,
    u: Sequence[float],
    p: Sequence[float],
    forces: _Forces | None,
) -> dict[str, float]:
    """The outputs of the model's own."""
    none: list[float] = []
    of = [none] * 3 if forces is None else [x.tolist() for x in (forces.vdot, forces.lam, forces.Q)]
    arguments = t, q.tolist(), v.tolist(), of[0], u, p, of[1], of[2]
    seen = {}
    for own in model.outputs:
        try:
            (value,) = own.value(*arguments)
        except (ArithmeticError, ValueError):
            value = math.nan
        if not math.isfinite(value):
            if own.otherwise is None:
                raise StepFailureError(
                    f"output {own.name!r} has no value at t = {t!r} s: `otherwise` can say what it is there"
                )
            (value,) = evaluated(own.name, t, own.otherwise, *arguments)
        seen[own.name] = float(value)
        if own.unique:
            seen[name(names.UNIQUE, own.name)] = _is_unique(own, arguments, forces)
    return seen


def _is_unique(own: Own, arguments: tuple[Any, ...], forces: _Forces | None) -> bool:
    """Has the output one value for all multipliers of the motion?  Its slope by lambda is taken at
    multipliers that nothing has chosen: that of a norm is blind at some to what changes them."""
    if forces is None:
        return True
    *before, lam, Q = arguments
    size = max(map(abs, lam), default=0.0) or 1.0
    free = np.array(lam) + size * np.random.default_rng(5).uniform(0.5, 1.5, len(lam))
    step = size * 2.0**-17
    slope = np.zeros(len(forces.acting))
    for sign in (1, -1):
        for i, k in enumerate(forces.acting):
            moved = free.copy()
            moved[k] += sign * step
            (value,) = own.value(*before, moved.tolist(), Q)
            slope[i] += sign * value / (2 * step)
    return forces.decomposed.leave_one(slope)


def _of_contacts(system: System, model: System, state: State) -> dict[str, Any]:
    seen: dict[str, Any] = {}
    for c, k in enumerate(system.contacts):
        contact = system.rows[k].name
        seen[name(names.CONTACT, contact)] = state.closed[c]
        seen[name(names.IMPULSE, contact)] = state.closings[c].impulse
        seen |= _told(model, names.DEPARTURE, contact, state.departures[c])
        seen |= _told(model, names.CLOSING, contact, state.closings[c])
    return seen | ({names.DISSIPATED: state.dissipated} if system.contacts else {})


def _told(model: System, kind: str, contact: str, event: Event) -> Mapping[str, Any]:
    y = (*event.q, *event.v) or (0.0,) * len(model.states)
    seen: dict[str, Any] = {
        name(f"{kind}.count", contact): event.count,
        name(f"{kind}.time", contact): event.time,
    }
    for state, x in zip(model.states, y, strict=True):
        of = names.read(state)
        seen[name(kind, contact, of.coordinate, of.order)] = x
    return seen
