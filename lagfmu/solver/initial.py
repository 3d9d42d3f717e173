"""A consistent start: projection of start values onto the constraints, contact modes, magnitudes.

Order: positions are projected, weighted by M, onto the constraints that always act and onto contacts
that are penetrated (f < -gap); then velocities onto G v = nu; then the contacts that touch are closed
if their multiplier is positive.  Every value that was moved is reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import at_contacts, at_slides
from .failure import StartFailureError, StepFailureError
from .instant import Instant
from .linear import solve
from .magnitudes import TOUCH, complete, extents, motion_speeds, sizes
from .motion import EPS, project
from .state import Departure, Settings, State
from .system import NONHOLONOMIC, Matrix, System, Vector

ITERATIONS = 60
LARGEST_ANGLE = 1e-3 / EPS  # [rad] beyond which neighbouring numbers are more than 1e-3 rad apart
SMALLEST_MASS = float(np.finfo(float).tiny)  # below it a double has fewer digits


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
    size = sizes(system, q0, at.p, np.zeros(system.n))
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
    _check_angles(system, q)
    size = sizes(system, q, at.p, size)
    q, v, closed = _velocities(at, q, v0, closed, size)
    modes: tuple[bool, ...] = ()
    touching: list[int] = []
    if system.contacts:
        touching = [c for c, shut in enumerate(closed) if shut]
        modes = at_contacts.complementary_modes(at, q, v, closed, touching)
    offset = none
    if system.frictions:

        def settled(at: Instant, shut: Sequence[bool]) -> tuple[bool, ...]:
            if not system.contacts:
                return ()
            return at_contacts.complementary_modes(at, q, v, shut, touching)

        at = replace(at, slides=at_slides.begun(at, q, v, size))
        at, modes = at_slides.settle(at, q, v, modes, settled)
        limited = [row.friction is not None for row in system.rows]
        offset = np.where(limited, at.residual(q), 0.0)
    q, v = project(at, q, v, system.active(modes), offset, size)
    nothing = Departure(0, 0.0, (0.0,) * system.n, (0.0,) * system.n)
    state = State(
        t=at.t,
        q=tuple(q.tolist()),
        v=tuple(v.tolist()),
        closed=modes,
        armed=tuple(not c for c in modes),
        offset=tuple(offset.tolist()),
        scale=(*np.abs(q).tolist(), *np.abs(v).tolist()),
        size=tuple(size.tolist()),
        gap=tuple(gap.tolist()),
        rate=0.0,
        step=0.0,
        span=0.0,
        steps=0,
        departures=(nothing,) * len(system.contacts),
        slides=at.slides,
        slippings=(nothing,) * len(system.frictions),
    )
    # a start value is its own scale: a start at theta0 = 1e-6 is resolved
    state = complete(at, settings, state, 0.0)
    return Start(state, _moved(system, q0, v0, state))


def _check_angles(system: System, q: Vector) -> None:
    """Raises StartFailureError for an angle whose neighbouring numbers are no neighbouring directions."""
    for j in system.angles:
        if not abs(q[j]) <= LARGEST_ANGLE:
            raise StartFailureError(
                f"the start is refused: the angle {system.coordinates[j]} = {float(q[j])!r} rad has "
                f"no digits left for a direction, expected at most {LARGEST_ANGLE:.1e} rad either "
                "way: take off whole turns"
            )


def _check_masses(system: System, M: Matrix) -> None:
    """Raises StartFailureError for a mass that a double holds to a few digits only."""
    for name, mass in zip(system.coordinates, M.diagonal().tolist(), strict=True):
        if 0 < mass < SMALLEST_MASS:
            raise StartFailureError(
                f"the start is refused: the mass of {name} is {mass!r}, expected 0 or at least "
                f"{SMALLEST_MASS:.3g} (in SI units), below which numbers lose their digits: choose "
                "larger units of mass"
            )


def _check_underflow(at: Instant, q: Vector, v0: Vector, M: Matrix) -> None:
    """Raises StartFailureError for a mass that is 0 only because its factors are too small to multiply.

    Then a parameter of the order of 1 in place of a small one makes it positive, and a double does not
    hold it; one that vanishes with a parameter that is 0, or at this place, is what the model says.
    """
    entries = zip(*at.system.mass, strict=True)
    absent = [j for j, k in entries if j == k and M[j, j] == 0]
    for i, value in enumerate(at.p if absent else ()):
        if not 0 < abs(value) < 1:
            continue
        larger = replace(at, p=[*at.p[:i], float(np.copysign(1.0, value)), *at.p[i + 1 :]])
        there = larger.evaluate(q, v0)[0]
        for j in absent:
            if there[j, j] > 0:
                raise StartFailureError(
                    f"the start is refused: the mass of {at.system.coordinates[j]} is too small for a "
                    f"double, with a parameter of {value!r} (in SI units): choose smaller units"
                )


def project_from_afar(
    at: Instant,
    q0: Vector,
    v0: Vector,
    rows: Sequence[int],
    size: Vector,
) -> Vector:
    """Damped Newton's method for f = 0 on the rows, weighted by M, from anywhere.

    It has arrived where f is rounding of its terms, which are of the size of q or of a parameter; or,
    since f may hold larger ones (an input), where f falls no more and is rounding of what it was made
    of at the start (`size`).  While it falls on and on, there is nothing to arrive at.  Raises
    StartFailureError naming the constraints that remain violated and by how much.
    """
    fixed = [k for k in rows if at.system.rows[k].kind != NONHOLONOMIC]
    q = q0
    if not fixed:
        return q
    least = extents(at.system, at.p)
    M, _, G, _, _ = at.evaluate(q, v0)
    f = at.residual(q)[fixed]
    allowed = np.zeros(len(fixed))
    for _ in range(ITERATIONS):
        allowed = 4 * EPS * (np.abs(G[fixed]) @ np.maximum(np.abs(q), least))
        if (np.abs(f) <= allowed).all():
            return q
        unit = np.abs(G[fixed]) @ np.maximum(np.abs(q), size)
        unit = np.where(unit > 0, unit, np.where(f != 0, np.abs(f), 1.0))
        allowed = 1e3 * EPS * (np.abs(G[fixed]) @ np.maximum(np.abs(q), size))
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
        allowed = 4 * EPS * (np.abs(G[fixed]) @ np.maximum(np.abs(q), least))
    if (np.abs(f) <= allowed).all():
        return q
    missed = ", ".join(
        f"{at.system.rows[k].name!r} by {a:.3g}"
        for k, a, b in zip(fixed, f, allowed, strict=True)
        if not abs(a) <= b
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
    _check_masses(system, M)
    _check_underflow(at, q, v0, M)
    natural = np.sqrt(size * np.abs(F) / np.where(M.diagonal() > 0, M.diagonal(), np.inf))
    unit = np.abs(G) @ motion_speeds(system, M, np.maximum(np.abs(v0), natural))
    speed = G @ v0 - nu
    shut = [
        c and not speed[k] > TOUCH * unit[k] for c, k in zip(closed, system.contacts, strict=True)
    ]
    rows = system.active(shut)
    q, v = project(at, q, v0, rows, np.zeros(system.m), size)
    M, _, G, nu, _ = at.evaluate(q, v)
    fastest = np.maximum(np.maximum(np.abs(v0), np.abs(v)), natural)
    unit = np.abs(G) @ motion_speeds(system, M, fastest) + np.abs(nu)
    missed = [k for k in rows if abs(G[k] @ v - nu[k]) > 1e-9 * unit[k]]
    if missed:
        names = ", ".join(repr(system.rows[k].name) for k in missed)
        raise StartFailureError(
            f"no velocities satisfy the constraints {names} at the start: they contradict each "
            "other, or the configuration is singular"
        )
    return q, v, shut


def _moved(
    system: System, q0: Vector, v0: Vector, state: State
) -> tuple[tuple[str, float, float], ...]:
    names = [*system.coordinates, *(f"der({c})" for c in system.coordinates)]
    given, used = np.concatenate([q0, v0]), np.array(state.q + state.v)
    unit = np.maximum(np.array(state.size + state.scale[system.n :]), np.abs(given))
    return tuple(
        (name, float(a), float(b))
        for name, a, b, s in zip(names, given, used, unit, strict=True)
        if abs(a - b) > 1e-12 * s
    )
