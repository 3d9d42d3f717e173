"""A consistent start: projection of start values onto the constraints, contact modes, magnitudes.

Order: positions are projected (afar.py, precedence.py) onto the constraints that always act and onto
contacts that are penetrated (f < -gap); then velocities onto G v = nu; then the contacts that touch are
closed if their multiplier is positive.  Every value that was moved is reported.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..names import motion
from ..numeric.failure import StartFailureError, StepFailureError
from ..numeric.start_priority import GIVEN, Moved
from ..numeric.system import Matrix, System, Vector
from ..numeric.thresholds import LARGEST_ANGLE, TOUCH
from . import optional_contacts, optional_slides
from .afar import project_from_afar, velocities_from_afar
from .instant import Instant
from .jumps import levels_at, settled
from .magnitudes import complete, motion_speeds, sizes
from .motion import EPS, project
from .state import Departure, Settings, State

SMALLEST_MASS = float(np.finfo(float).tiny)  # below it a double has fewer digits


@dataclass(frozen=True)
class Start:
    """A consistent state, and each value that had to be moved."""

    state: State
    moved: tuple[Moved, ...]


def start(
    system: System,
    settings: Settings,
    t: float,
    q0: Sequence[float],
    v0: Sequence[float],
    u: Sequence[float],
    p: Sequence[float],
    rank: Sequence[int] | None = None,
) -> Start:
    """The consistent state nearest to the start values.  Raises StartFailureError with the cause.

    `rank` (2 n), of the coordinates and then of the velocities, as in precedence.py: which of them move
    first; without it they are all alike.
    """
    try:
        with np.errstate(all="ignore"):
            inputs = system.inputs_at(u, 0.0)
            levels = levels_at(system, t, np.array(q0, float), inputs, p)
            at = Instant(system, t, [*inputs, *levels], p)
            if system.contacts:
                optional_contacts.check_restitution(system, p)
            ranks = [GIVEN] * (2 * system.n) if rank is None else list(rank)
            return _start(at, settings, np.array(q0, float), np.array(v0, float), ranks)
    except StartFailureError:
        raise
    except StepFailureError as error:
        raise StartFailureError(f"the start is refused: {error}") from error


def _start(at: Instant, settings: Settings, q0: Vector, v0: Vector, rank: list[int]) -> Start:
    system = at.system
    n = system.n
    size = sizes(system, q0, at.p, np.zeros(system.n))
    none = np.zeros(system.m)
    q = project_from_afar(at, q0, v0, list(system.permanent), size, rank[:n])
    gap = np.array([])
    for _ in range(len(system.contacts) + 1):
        _, _, G, _, _ = at.evaluate(q, v0)
        gap = TOUCH * (np.abs(G) @ np.maximum(np.abs(q), size))[list(system.contacts)]
        f = at.residual(q)[list(system.contacts)]
        closed = [bool(a <= g) for a, g in zip(f, gap, strict=True)]
        rows = system.active(closed)
        moved = project_from_afar(at, q, v0, rows, size, rank[:n])
        if (np.abs(moved - q) <= 4 * EPS * size).all():
            break
        q = moved
    _check_angles(system, q)
    if system.floors:
        at = settled(at, q)
    size = sizes(system, q, at.p, size)
    q, v, closed = _velocities(at, q, v0, closed, size, gap, rank[n:])
    modes: tuple[bool, ...] = ()
    touching: list[int] = []
    if system.contacts:
        touching = [c for c, shut in enumerate(closed) if shut]
        modes = optional_contacts.complementary_modes(at, q, v, closed, touching)
    offset = none
    if system.frictions:

        def contacts_at(at: Instant, shut: Sequence[bool]) -> tuple[bool, ...]:
            if not system.contacts:
                return ()
            return optional_contacts.complementary_modes(at, q, v, shut, touching)

        at = replace(at, slides=optional_slides.begun(at, q, v, size))
        contacts = optional_slides.Contacts(contacts_at, contacts_at, touching)
        at, modes = optional_slides.settle(at, q, v, modes, contacts)
        limited = [row.friction is not None for row in system.rows]
        offset = np.where(limited, at.residual(q), 0.0)
    q, v = project(at, q, v, system.active(modes), offset, size, dependent=True)
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
        hits=(0,) * len(system.contacts),
        hit_times=(0.0,) * len(system.contacts),
        impulses=(0.0,) * len(system.contacts),
        slides=at.slides,
        slippings=(nothing,) * len(system.frictions),
        levels=tuple(at.u[len(at.u) - len(system.floors) :]),
    )
    # a start value is its own scale: a start at theta0 = 1e-6 is resolved
    state = complete(at, settings, state, 0.0)
    return Start(state, _moved(system, q0, v0, state, rank))


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


def _velocities(
    at: Instant,
    q: Vector,
    v0: Vector,
    closed: Sequence[bool],
    size: Vector,
    gap: Vector,
    rank: Sequence[int],
) -> tuple[Vector, Vector, list[bool]]:
    """Velocities on G v = nu; a contact that is already parting (df/dt > 0) is open, unless it parts so
    slowly that it would not rise above the gap within which contacts touch: as after an impact."""
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
    here, none = q, np.zeros(system.m)
    while True:
        rows = system.active(shut)
        v = velocities_from_afar(at, here, v0, rows, rank, natural)
        q, v = project(at, here, v, rows, none, size, dependent=True)
        parting = [c for c, touches in enumerate(closed) if touches and not shut[c]]
        low = optional_contacts.low(at, q, v, shut, parting, gap) if parting else []
        if not low:
            break
        shut = [s or c in low for c, s in enumerate(shut)]
    M, _, G, nu, _ = at.evaluate(q, v)
    fastest = np.maximum(np.maximum(np.abs(v0), np.abs(v)), natural)
    unit = np.abs(G) @ motion_speeds(system, M, fastest) + np.abs(nu)
    missed = [k for k in rows if abs(G[k] @ v - nu[k]) > TOUCH * unit[k]]
    if missed:
        names = ", ".join(repr(system.rows[k].name) for k in missed)
        raise StartFailureError(
            f"no velocities satisfy the constraints {names} at the start: they contradict each "
            "other, or the configuration is singular"
        )
    return q, v, shut


def _moved(
    system: System, q0: Vector, v0: Vector, state: State, rank: Sequence[int]
) -> tuple[Moved, ...]:
    n = system.n
    states = motion(system.coordinates)
    given, used = np.concatenate([q0, v0]), np.array(state.q + state.v)
    unit = np.maximum(np.array(state.size + state.scale[n:]), np.abs(given))
    size = np.array(state.size)
    whole = np.maximum(np.concatenate([size, size * state.rate]), np.abs(given))
    return tuple(
        Moved(states[i], float(given[i]), float(used[i]), rank[i], float(whole[i]))
        for i in range(2 * n)
        # a velocity that is rounding of the motion's own has not moved
        if abs(given[i] - used[i]) > max(1e-12 * unit[i], 4 * EPS * whole[i])
    )
