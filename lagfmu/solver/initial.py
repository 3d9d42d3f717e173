"""A consistent start: scales, projection of start values onto the constraints, contact modes.

Order: positions are projected, weighted by M, onto the constraints that always act and onto contacts
that are penetrated (f < -gap); then velocities onto G v = nu; then the contacts that touch are closed
if their multiplier is positive.  Every value that was moved is reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .contacts import complementary_modes
from .failure import StartFailureError, StepFailureError
from .instant import Instant
from .linear import solve
from .motion import EPS, motion, project
from .state import Departure, Settings, State
from .system import NONHOLONOMIC, System, Vector

ITERATIONS = 60
TOUCH = 1e-9  # |f| below this, in units of the constraint's own size, counts as touching


@dataclass(frozen=True)
class Start:
    """A consistent state, and (name, given, used) for each value that had to be moved."""

    state: State
    moved: tuple[tuple[str, float, float], ...]


def start(
    system: System,
    settings: Settings,
    t: float,
    q0: Sequence[float],
    v0: Sequence[float],
    u: Sequence[float],
    p: Sequence[float],
) -> Start:
    """The consistent state nearest to the start values.  Raises StartFailureError with the cause."""
    try:
        with np.errstate(all="ignore"):
            at = Instant(system, t, system.inputs_at(u, 0.0), p)
            return _start(at, settings, np.array(q0, float), np.array(v0, float))
    except StartFailureError:
        raise
    except StepFailureError as error:
        raise StartFailureError(f"the start is refused: {error}") from error


def _start(at: Instant, settings: Settings, q0: Vector, v0: Vector) -> Start:
    system = at.system
    size = _sizes(system, q0, at.p)
    none = np.zeros(system.m)
    q = project_from_afar(at, q0, v0, list(system.permanent), size)
    gap = np.array([])
    for _ in range(len(system.contacts) + 1):
        _, _, G, _, _ = at.evaluate(q, v0)
        gap = TOUCH * (np.abs(G) @ np.maximum(np.abs(q), size))[list(system.contacts)]
        f = at.residual(q)[list(system.contacts)]
        closed = [bool(a <= g) for a, g in zip(f, gap, strict=True)]
        rows = system.active(closed)
        moved = project_from_afar(at, q, v0, rows, size)
        if (np.abs(moved - q) <= 4 * EPS * size).all():
            break
        q = moved
    q, v, closed = _velocities(at, q, v0, closed, size)
    touching = [c for c, shut in enumerate(closed) if shut]
    modes = complementary_modes(at, q, v, closed, touching)
    q, v = project(at, q, v, system.active(modes), none, size)
    vdot = motion(at, q, v, system.active(modes)).vdot
    scale, rate = _scales(settings, size, q, v, vdot)
    nothing = Departure(0, 0.0, (0.0,) * system.n, (0.0,) * system.n)
    state = State(
        t=at.t,
        q=tuple(q.tolist()),
        v=tuple(v.tolist()),
        closed=modes,
        armed=tuple(not c for c in modes),
        offset=tuple(none.tolist()),
        scale=tuple(scale.tolist()),
        size=tuple(size.tolist()),
        gap=tuple(gap.tolist()),
        rate=rate,
        step=0.0,
        steps=0,
        departures=(nothing,) * len(system.contacts),
    )
    return Start(state, _moved(system, q0, v0, q, v, size, scale))


def project_from_afar(
    at: Instant,
    q0: Vector,
    v0: Vector,
    rows: Sequence[int],
    size: Vector,
) -> Vector:
    """Damped Newton's method for f = 0 on the rows, weighted by M, from anywhere.

    Raises StartFailureError naming the constraints that remain violated and by how much.
    """
    fixed = [k for k in rows if at.system.rows[k].kind != NONHOLONOMIC]
    q = q0
    if not fixed:
        return q
    M, _, G, _, _ = at.evaluate(q, v0)
    f = at.residual(q)[fixed]
    for _ in range(ITERATIONS):
        unit = np.abs(G[fixed]) @ np.maximum(np.abs(q), size)
        if (np.abs(f) <= 4 * EPS * unit).all():
            return q
        try:
            step = solve(M, np.zeros(at.system.n), G[fixed], -f, nearest=True).x
        except StepFailureError:
            break
        for damping in 2.0 ** -np.arange(25):
            trial = q + damping * step
            try:
                f_trial = at.residual(trial)[fixed]
            except StepFailureError:
                continue
            if np.linalg.norm(f_trial / unit) < (1 - 0.1 * damping) * np.linalg.norm(f / unit):
                break
        else:
            break
        q, f = trial, f_trial
        M, _, G, _, _ = at.evaluate(q, v0)
    unit = np.abs(G[fixed]) @ np.maximum(np.abs(q), size)
    if (np.abs(f) <= 1e3 * EPS * unit).all():
        return q
    missed = ", ".join(
        f"{at.system.rows[k].name!r} by {a:.3g}"
        for k, a, s in zip(fixed, f, unit, strict=True)
        if abs(a) > 1e3 * EPS * s
    )
    values = ", ".join(
        f"{n} = {x!r}" for n, x in zip(at.system.coordinates, q0.tolist(), strict=True)
    )
    raise StartFailureError(
        f"the start values {values} cannot be projected onto the constraints (missed: {missed}): "
        "choose start values near a configuration that satisfies them, or other parameters"
    )


def _velocities(
    at: Instant,
    q: Vector,
    v0: Vector,
    closed: Sequence[bool],
    size: Vector,
) -> tuple[Vector, Vector, list[bool]]:
    """Velocities on G v = nu; a contact that is already parting (df/dt > 0) is open."""
    system = at.system
    M, F, G, nu, _ = at.evaluate(q, v0)
    natural = np.sqrt(size * np.abs(F) / np.where(M.diagonal() > 0, M.diagonal(), np.inf))
    unit = np.abs(G) @ np.maximum(np.abs(v0), natural)
    speed = G @ v0 - nu
    shut = [
        c and not speed[k] > TOUCH * unit[k] for c, k in zip(closed, system.contacts, strict=True)
    ]
    rows = system.active(shut)
    q, v = project(at, q, v0, rows, np.zeros(system.m), size)
    _, _, G, nu, _ = at.evaluate(q, v)
    fastest = np.maximum(np.maximum(np.abs(v0), np.abs(v)), natural)
    unit = np.abs(G) @ fastest + np.abs(nu)
    missed = [k for k in rows if abs(G[k] @ v - nu[k]) > 1e-9 * unit[k]]
    if missed:
        names = ", ".join(repr(system.rows[k].name) for k in missed)
        raise StartFailureError(
            f"no velocities satisfy the constraints {names} at the start: they contradict each "
            "other, or the configuration is singular"
        )
    return q, v, shut


def _sizes(system: System, q0: Vector, p: Sequence[float]) -> Vector:
    """For each coordinate the largest magnitude of its dimension among start values and parameters.

    1 (in the coordinate's own unit) where there is none, as for an angle that starts at zero.
    """
    sizes = []
    for j in range(system.n):
        same = system.like[j] if system.like else (j,)
        values = [abs(q0[i]) for i in same]
        values += [abs(p[i]) for i in (system.extent[j] if system.extent else ())]
        sizes.append(max(values) or 1.0)
    return np.array(sizes)


def _scales(
    settings: Settings, size: Vector, q: Vector, v: Vector, vdot: Vector
) -> tuple[Vector, float]:
    """Error scales of q and v (2 n), and the motion's natural rate [1/s].

    A start value is its own scale, so that a start at theta0 = 1e-6 is resolved, but no smaller than
    what rounding in values of the coordinate's size allows at this tolerance.
    """
    rates = np.maximum(np.abs(v) / size, np.sqrt(np.abs(vdot) / size))
    rate = float(rates.max(initial=0.0)) or 1.0
    floor = max(1e-8, 10 * EPS / settings.tolerance)
    scale = np.concatenate(
        [np.maximum(np.abs(q), floor * size), np.maximum(np.abs(v), floor * size * rate)]
    )
    return scale, rate


def _moved(
    system: System, q0: Vector, v0: Vector, q: Vector, v: Vector, size: Vector, scale: Vector
) -> tuple[tuple[str, float, float], ...]:
    names = [*system.coordinates, *(f"der({c})" for c in system.coordinates)]
    given, used = np.concatenate([q0, v0]), np.concatenate([q, v])
    unit = np.maximum(np.concatenate([size, scale[system.n :]]), np.abs(given))
    return tuple(
        (name, float(a), float(b))
        for name, a, b, s in zip(names, given, used, unit, strict=True)
        if abs(a - b) > 1e-12 * s
    )
