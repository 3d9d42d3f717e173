"""A state -> everything that the FMU reports, by name."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from .. import names
from ..names import derivative
from ..numeric.failure import StepFailureError, plain
from ..numeric.system import NONHOLONOMIC, System, Vector
from . import optional_slides
from .instant import Instant
from .motion import motion
from .state import State

Values = dict[str, float | int | bool]


def observe(system: System, state: State, u: Sequence[float], p: Sequence[float]) -> Values:
    """Coordinates, velocities, accelerations, lambda, Q, residuals, energies and contact states.

    lambda, Q and the accelerations are solved for at this very state and these inputs, so that they
    are consistent with what the importer reads.  Raises StepFailureError if a value is not finite.
    """
    try:
        with np.errstate(all="ignore"):
            values = _observe(system, state, u, p)
    except (ArithmeticError, ValueError) as error:
        raise StepFailureError(
            f"the outputs cannot be evaluated at t = {state.t!r} s ({plain(error)})"
        ) from error
    bad = [name for name, value in values.items() if not math.isfinite(value)]
    if bad:
        raise StepFailureError(f"not finite at t = {state.t!r} s: {', '.join(bad)}")
    return values


def _observe(system: System, state: State, u: Sequence[float], p: Sequence[float]) -> Values:
    values: Values = {}
    u = [*u, *state.levels]
    full, q, v = expand(system, state.t, np.array(state.q), np.array(state.v), u, p)
    for name, x, xdot in zip(full.coordinates, q.tolist(), v.tolist(), strict=True):
        values[name] = x
        values[derivative(name)] = xdot
    if full.dynamics is not None:
        values |= _solved(system, full, state, q, v, u, p)
    if system.embedding is not None:
        stepped = Instant(system, state.t, u, p)
        acting = system.active(state.closed)
        reduced = motion(stepped, np.array(state.q), np.array(state.v), acting)
        for j, name in enumerate(system.coordinates):
            values.setdefault(name, state.q[j])
            values.setdefault(derivative(name), state.v[j])
            values.setdefault(derivative(name, 2), float(reduced.vdot[j]))
    if full.energies is not None:
        kinetic, potential = full.energies(state.t, q.tolist(), v.tolist(), u, p)
        values[names.KINETIC] = float(kinetic)
        values[names.POTENTIAL] = float(potential)
        values[names.TOTAL] = float(kinetic + potential)
    if full.outputs:
        values |= _own(full, state.t, values, q, v, u, p)
    for c, k in enumerate(system.contacts):
        values |= _contact(system, state, c, system.rows[k].name, u, p)
    values[names.STEPS] = state.steps
    return values


def _solved(
    system: System,
    full: System,
    state: State,
    q: Vector,
    v: Vector,
    u: Sequence[float],
    p: Sequence[float],
) -> Values:
    """Accelerations, lambda, Q and residuals of the full system."""
    values: Values = {}
    shut = {system.rows[k].name: c for k, c in zip(system.contacts, state.closed, strict=True)}
    active = full.active([shut[full.rows[k].name] for k in full.contacts])
    at = Instant(full, state.t, u, p, state.slides)
    now = motion(at, q, v, active)
    if system.frictions:
        values |= optional_slides.observed(system, state, now)
    for name, a in zip(full.coordinates, now.vdot.tolist(), strict=True):
        values[derivative(name, 2)] = a
    f, lam, unique = at.residual(q), now.lam.tolist(), now.unique.tolist()
    slip = now.G @ v - now.nu
    kept = {row.name: level for row, level in zip(system.rows, state.offset, strict=True)}
    for k, row in enumerate(full.rows):
        values[names.name(names.MULTIPLIER, row.name)] = lam[k]
        values[names.name(names.UNIQUE, row.name)] = unique[k]
        miss = (
            slip[k]
            if row.kind == NONHOLONOMIC or row.friction is not None
            else f[k] - kept.get(row.name, 0.0)
        )
        values[names.name(names.RESIDUAL, row.name)] = float(miss)
    share = now.G * now.lam[:, None]
    for name, Q in zip(full.coordinates, share.sum(axis=0).tolist(), strict=True):
        values[names.name(names.FORCE, "", name)] = Q
    for k, j in zip(*full.jacobian, strict=True):
        name = names.name(names.FORCE, full.rows[k].name, full.coordinates[j])
        values[name] = float(share[k, j])
    return values


def _own(
    full: System,
    t: float,
    values: Values,
    q: Vector,
    v: Vector,
    u: Sequence[float],
    p: Sequence[float],
) -> Values:
    """The outputs of the model's own, from what is solved for at this state."""
    lam = [values.get(names.name(names.MULTIPLIER, row.name), 0.0) for row in full.rows]
    vdot = [values.get(derivative(name, 2), 0.0) for name in full.coordinates]
    Q = [values.get(names.name(names.FORCE, "", name), 0.0) for name in full.coordinates]
    state = (t, q.tolist(), v.tolist(), vdot, u, p, lam, Q)
    found: Values = {}
    for own in full.outputs:
        value, cause = np.nan, "not finite"
        try:
            (value,) = own.value(*state)
        except (ArithmeticError, ValueError) as error:
            cause = plain(error)
        if own.otherwise is not None and not np.isfinite(value):
            (value,) = own.otherwise(*state)
        if not np.isfinite(value):
            raise StepFailureError(
                f"the output {own.name!r} has no value at t = {t!r} s ({cause}): give the model's "
                "Output an `otherwise`"
            )
        found[own.name] = float(value)
    return found


def expand(
    system: System, t: float, s: Vector, sdot: Vector, u: Sequence[float], p: Sequence[float]
) -> tuple[System, Vector, Vector]:
    """The full system with its q (n) and v (n), from the coordinates that are stepped."""
    if system.embedding is None:
        return system, s, sdot
    q, v = system.embedding.embed(t, s.tolist(), sdot.tolist(), u, p)
    return system.embedding.full, np.array(q, dtype=float), np.array(v, dtype=float)


def _contact(
    system: System, state: State, c: int, name: str, u: Sequence[float], p: Sequence[float]
) -> Values:
    latest = state.departures[c]
    values: Values = {
        names.name(names.CONTACT, name): state.closed[c],
        names.name(names.DEPARTURES, name): latest.count,
        names.name(names.DEPARTURE_TIME, name): latest.time,
    }
    q, v = np.array(latest.q), np.array(latest.v)
    full = system if system.embedding is None else system.embedding.full
    if latest.count:
        full, q, v = expand(system, latest.time, q, v, u, p)
    else:
        q = v = np.zeros(full.n)
    for j, coordinate in enumerate(full.coordinates):
        values[names.name(names.DEPARTURE, name, coordinate)] = float(q[j])
        values[names.name(names.DEPARTURE, name, coordinate, 1)] = float(v[j])
    return values
