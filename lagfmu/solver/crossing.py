"""A start next to a crossing of two branches of the motion, where the rows depend on each other.

G v = nu holds to rounding, so that speeds are known to eps / s in the direction that the rows tell least, s
being the smallest singular value of the scaled rows.  gamma is of second order in them, and lambda is gamma
over s^2: off by eps / s^3, which may be all of it, unless the speeds are those of one branch to the last.
Nothing at the start tells which; the motion a little further along the branch does.  Where that turns too
sharply to say (cranks that are nearly alike), states that the rows cannot tell from the start do: lambda has
its digits if they all have it.  In the crossing itself a row is missing that holds the first step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..numeric.failure import StartFailureError, StepFailureError
from ..numeric.system import Vector
from .equations import Motion, Terms
from .linear import Rows, rows_of
from .projection import project_positions, project_velocities
from .state import Settings, State

NEAR = 1e-2  # singular value of the scaled rows below which a crossing may be near
ROUNDING = 1e-14  # a smaller one is that of rows which depend on each other everywhere
BESIDE = 3e-3  # of the motion's size: how far along the branch lambda is looked at
OPENS = 2  # times as large is the singular value there, where it is small at a crossing only
POLYNOMIAL = 5.0, -10.0, 10.0, -5.0, 1.0  # through so many places: what it is at the start
LOST = 1e-3  # of the forces at work: lambda that differs by more has lost its digits
UNSEEN = 1e-14  # of each speed's size, over s: so far moved a state satisfies the rows just as well


class Place(NamedTuple):
    """Accelerations (nv), multipliers (m) and decomposed rows at a state on the constraints; `alike`: these
    rows whatever the masses are, each speed counting by what it moves, since a light mass between heavy ones
    is no crossing."""

    vdot: Vector
    lam: Vector
    rows: Rows
    alike: Rows

    def apart(self, rank: int) -> float:
        """The smallest singular value, as many rows being independent."""
        return float(self.alike.S[rank - 1])


def check_crossing(motion: Motion, settings: Settings, state: State) -> None:
    """Raises StartFailureError if the start lies next to a crossing, and lambda has no digits there."""
    acting, system = motion.system.active(state.closed), motion.system
    if len(acting) < 2:
        return
    q, v, t = np.array(state.q), np.array(state.v), state.t
    terms = motion.terms(t, q, v)
    mass, span = np.abs(terms.M.diagonal()), np.array(settings.span)
    alike = np.array(system.speed_dimension)
    moves = np.array([span[alike == of].max() for of in alike])
    moves[(alike == system.angle_dimension) | ~(moves > 0)] = 1.0
    way, pace = np.sqrt(mass @ span**2), np.sqrt(mass @ v**2)
    if not (way > 0 and pace > 0):
        return

    def at(terms: Terms) -> Place:
        return Place(*motion.accelerations(terms), rows_of(np.diag(1 / moves**2), terms.G))

    def moved(by: Vector) -> Place:
        there = project_positions(motion, t, q + motion.rate(t, q, by), v, acting, span)
        w = project_velocities(motion.terms(t, there, v).of(acting), v)
        return at(motion.terms(t, there, w).of(acting))

    def along(sizes: float) -> Place:
        return moved(v * (sizes * way / pace))

    here = at(terms.of(acting))
    if here.alike.S.min() >= NEAR:
        return
    try:
        ahead, behind = along(BESIDE), along(-BESIDE)
        rank = max(ahead.alike.rank, behind.alike.rank)
        sign = 1 if ahead.apart(rank) > behind.apart(rank) else -1
        near = ahead if sign > 0 else behind
        if not here.apart(rank) < min(NEAR, near.apart(rank) / OPENS):
            return
        beside = [near, *(along(sign * k * BESIDE) for k in range(2, 6))]
        lost = here.alike.rank < rank or (
            _differs(here, beside, POLYNOMIAL, rank, terms.F)
            and any(
                _differs(here, [moved(sign * UNSEEN / here.apart(rank) * e)], [1.0], rank, terms.F)
                for e in np.diag(moves)
                for sign in (-1, 1)
            )
        )
    except StepFailureError:
        small = (here.alike.S > ROUNDING) & (here.alike.S < NEAR)
        rank, lost = int(np.flatnonzero(small).max(initial=0)) + 1, bool(small.any())
    if lost:
        weakest = np.abs(here.alike.U[:, rank - 1])
        names = [system.rows[k].name for k, x in zip(acting, weakest, strict=True) if x > 0.1]
        raise StartFailureError(
            "the start is refused: next to these start values the configuration is singular: the constraints "
            f"{', '.join(map(repr, names))} depend on each other, another branch of the motion begins, and "
            "multipliers have lost their digits (the smallest singular value of the scaled rows is "
            f"{here.apart(rank):.3g}, {NEAR} is enough): start further beside it, or give the speeds of one "
            "branch"
        )


def _differs(
    here: Place, beside: Sequence[Place], weights: Sequence[float], rank: int, F: Vector
) -> bool:
    """Are accelerations or multipliers others than the sum of those at the places beside, by these weights?

    Multipliers are smooth along a branch; where something pushes out of it, which they hold by 1 / s of it,
    they are so times s.  Forces count in the metric of 1/M, accelerations in that of M, diag(1 / D^2).
    """
    D, length, s = here.rows.D, here.rows.length, here.apart(rank)
    forces = np.concatenate([beside[0].lam * length, here.lam * length, F * D])
    most = LOST * float(np.abs(forces).max())
    places = list(zip(weights, beside, strict=True))
    vdot = here.vdot - sum(w * p.vdot for w, p in places)
    lam = here.lam - sum(w * p.lam for w, p in places)
    pushed = here.lam - sum(w * p.lam * p.apart(rank) for w, p in places) / s
    return _largest(vdot / D) > most or min(_largest(x * length) for x in (lam, pushed)) > most


def _largest(x: Vector) -> float:
    return float(np.abs(x).max())
