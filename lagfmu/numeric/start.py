"""A consistent start: start values on the constraints, contacts that are closed, nominals.

Positions are projected onto the constraints that always act and onto contacts that are penetrated (f < -gap);
then velocities onto G v = nu; then the contacts that touch are closed if their multiplier is positive.  Every
value that was moved is reported.  Whether frictions allow the start, and outputs have values there, is asked
of the native FMU.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .contacts import closed_contacts, restitution, stays_low
from .failure import GIVEN, Moved, StartFailureError, StepFailureError
from .initialization import EPS, initial_positions, initial_velocities
from .instant import Instant, at_start
from .linear import independent
from .motion import NONE, motion, stick_slip
from .nominals import in_speeds, motion_speeds, natural, sizes
from .system import Sparse, System, Vector
from .thresholds import LARGEST_ANGLE, LOST, MOVED, ROUNDINGS, TOUCH

SMALLEST_MASS = float(np.finfo(float).tiny)  # below it a double has fewer digits


@dataclass(frozen=True)
class Start:
    """q (nq), v (nv) on the constraints; one entry a contact: is it closed; the switch states of forces
    that jump; the sizes of coordinates (nq), of displacements in speeds (nv) and of speeds (nv), the
    natural rate [1/s]; how far each contact is open, and the largest term of its f; each value that had
    to be moved."""

    q: Vector
    v: Vector
    closed: tuple[bool, ...]
    switch_states: tuple[float, ...]
    size: Vector
    span: Vector
    swift: Vector
    rate: float
    heights: Vector
    extents: Vector
    moved: tuple[Moved, ...]


def start(
    system: System,
    q0: Sequence[float],
    v0: Sequence[float],
    u: Sequence[float],
    p: Sequence[float],
    priority: Sequence[int] | None = None,
    t: float = 0.0,
) -> Start:
    """The consistent start at t [s] nearest to the start values.  Raises StartFailureError with the cause.

    `priority` (nq + nv), of the coordinates and then of the speeds: which of them move first; without it they
    are all alike.
    """
    try:
        with np.errstate(all="ignore"):
            restitution(system, p)
            q, v = np.array(q0, float), np.array(v0, float)
            order = [GIVEN] * len(system.states) if priority is None else list(priority)
            return _start(at_start(system, q, u, p, t), q, v, order)
    except StartFailureError:
        raise
    except StepFailureError as error:
        raise StartFailureError(f"the start is refused: {error}") from error


def _start(at: Instant, q0: Vector, v0: Vector, priority: list[int]) -> Start:
    system, n = at.system, at.system.nq
    q, size, gap, near = _positions(at, q0, v0, priority[:n])
    if system.switches:
        at = at_start(system, q, at.u[: len(at.u) - len(system.switches)], at.p, at.t)
    v, touching = _velocities(at, q, v0, near, size, gap, priority[n:])
    closed = closed_contacts(at, q, v, touching) if system.contacts else ()
    rows, slips = system.active(closed), NONE
    if system.frictions:
        rows, slips = stick_slip(at, q, v, rows, in_speeds(system, size))
    now = motion(at, q, v, rows, slips)
    held = [rows[i] for i in independent(now.M, now.G[rows])]
    size, rate, swift = natural(at, q, v, size, now, held)
    states = tuple(at.u[len(at.u) - len(system.switches) :])
    span = in_speeds(system, size)
    moved = _moved(system, [*q0, *v0], [*q, *v], [*size, *swift], priority)
    heights, extents = _opened(at, q, closed)
    return Start(q, v, closed, states, size, span, swift, rate, heights, extents, moved)


def _opened(at: Instant, q: Vector, closed: Sequence[bool]) -> tuple[Vector, Vector]:
    """Of each contact how far it is open, and the largest term of its f; 0 where it is closed."""
    contacts, is_open = list(at.system.contacts), ~np.array(closed, dtype=bool)
    heights = np.where(is_open, np.maximum(at.residual(q)[contacts], 0.0), 0.0)
    return heights, np.where(is_open, at.terms(q)[contacts], 0.0)


def _positions(
    at: Instant, q0: Vector, v0: Vector, priority: Sequence[int]
) -> tuple[Vector, Vector, Vector, list[bool]]:
    """q (nq) on the constraints, sizes (nq), and of each contact |f| below which it touches and if it
    does."""
    system = at.system
    contacts = list(system.contacts)
    size = sizes(at, q0, np.zeros(system.nq))
    q = initial_positions(at, q0, v0, system.permanent, size, priority)
    gap, near = np.zeros(0), [False] * len(contacts)
    for _ in range(len(contacts) + 1):
        gap = ROUNDINGS * EPS * at.terms(q)[contacts]
        near = (at.residual(q)[contacts] <= gap).tolist()
        before, q = q, initial_positions(at, q, v0, system.active(near), size, priority)
        if (np.abs(q - before) <= 4 * EPS * size).all():
            break
    for j in system.angles:
        if not abs(q[j]) <= LARGEST_ANGLE:
            raise StartFailureError(
                f"the start is refused: the angle {system.coordinates[j]} = {float(q[j])!r} rad has "
                f"no digits left for a direction, expected at most {LARGEST_ANGLE:.1e} rad either "
                "way: take off whole turns"
            )
    _check_sides(at, q)
    return q, sizes(at, q, size), gap, near


def _check_sides(at: Instant, q: Vector) -> None:
    """Raises StartFailureError where a joint is turned over by half a turn, at which its rows vanish too."""
    system = at.system
    if system.sides is None:
        return
    found = system.sides(at.t, q.tolist(), at.u, at.p)
    over = [system.rows[k].name for k, x in zip(system.sided, found, strict=True) if not x > 0]
    for name in dict.fromkeys(n.partition(".")[0] for n in over):
        raise StartFailureError(
            f"the start is refused: at the start values that were set joint {name!r} is turned over by half "
            "a turn: set attitudes of its bodies that are nearer to where its axes point the same way"
        )


def _velocities(
    at: Instant,
    q: Vector,
    v0: Vector,
    near: Sequence[bool],
    size: Vector,
    gap: Vector,
    priority: Sequence[int],
) -> tuple[Vector, list[bool]]:
    """v (nv) on G v = nu, and which contacts touch: one that is already parting (df/dt > 0) is open, unless
    it parts so slowly that it would not rise above the gap within which contacts touch, as after an
    impact."""
    system = at.system
    M, F, G, nu, _ = at.equations(q, v0)
    _check_masses(at, q, v0, M)
    mass = np.where(M.diagonal() > 0, M.diagonal(), np.inf)
    span = in_speeds(system, size)
    free = np.sqrt(span * np.abs(F) / mass)  # speeds that the forces alone would give
    own = np.maximum(np.abs(v0), free)
    least = np.maximum(TOUCH * own, LOST * motion_speeds(system, M, own))
    rising = (G @ v0 - nu > np.abs(G) @ least)[list(system.contacts)]
    shut = [touches and not rises for touches, rises in zip(near, rising, strict=True)]
    while True:
        rows = system.active(shut)
        v = initial_velocities(at, q, v0, rows, free, priority)
        parting = [c for c, touches in enumerate(near) if touches and not shut[c]]
        low = stays_low(at, q, v, shut, parting, gap)
        if not low:
            break
        shut = [s or c in low for c, s in enumerate(shut)]
    M, _, G, nu, _ = at.equations(q, v)
    fastest = np.maximum(np.maximum(np.abs(v0), np.abs(v)), free)
    unit = np.abs(G) @ motion_speeds(system, M, fastest) + np.abs(nu)
    slip = np.abs(G @ v - nu)
    missed = [k for k in rows if slip[k] > TOUCH * unit[k]]
    if missed:
        names = ", ".join(repr(system.rows[k].name) for k in missed)
        raise StartFailureError(
            f"no velocities satisfy the constraints {names} at the start: they contradict each "
            "other, or the configuration is singular"
        )
    return v, shut


def _check_masses(at: Instant, q: Vector, v0: Vector, M: Sparse) -> None:
    """Raises StartFailureError for a mass that a double holds to a few digits only, or that is 0 only because
    its factors are too small to multiply.

    Then a parameter of the order of 1 in place of a small one makes it positive, and a double does not
    hold it; one that vanishes with a parameter that is 0, or at this place, is what the model says.
    """
    names, masses = at.system.directions, M.diagonal().tolist()
    for name, mass in zip(names, masses, strict=True):
        if 0 < mass < SMALLEST_MASS:
            raise StartFailureError(
                f"the start is refused: the mass of {name} is {mass!r}, expected 0 or at least "
                f"{SMALLEST_MASS:.3g} (in SI units), below which numbers lose their digits: choose "
                "larger units of mass"
            )
    absent = [j for j, k in zip(*at.system.mass, strict=True) if j == k and masses[j] == 0]
    for i, value in enumerate(at.p if absent else ()):
        if not 0 < abs(value) < 1:
            continue
        larger = replace(at, p=[*at.p[:i], float(np.copysign(1.0, value)), *at.p[i + 1 :]])
        there = larger.equations(q, v0)[0].diagonal()
        for j in absent:
            if there[j] > 0:
                raise StartFailureError(
                    f"the start is refused: the mass of {names[j]} is too small for a double, with a "
                    f"parameter of {value!r} (in SI units): choose smaller units"
                )


def _moved(
    system: System,
    given: Sequence[float],
    used: Sequence[float],
    whole: Sequence[float],
    priority: Sequence[int],
) -> tuple[Moved, ...]:
    """The values (nq + nv) that are not the given ones, but for rounding; `whole`: their sizes."""
    return tuple(
        Moved(name, float(a), float(b), rank, float(max(unit, abs(a))))
        for name, a, b, rank, unit in zip(system.states, given, used, priority, whole, strict=True)
        if abs(a - b) > max(MOVED * max(abs(a), abs(b)), 4 * EPS * max(unit, abs(a)))
    )
