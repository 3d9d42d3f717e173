"""Start values that miss the constraints: who said them, what they are moved to, and how that is told.

Why a model cannot start: which constraint, coordinate or value is to blame, found by trial.

Newton's method has failed when this is asked.  Each answer names the thing, its value and the remedy.
"""

from __future__ import annotations

import logging
import random
import warnings
from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ..errors import ModelError
from ..interface.variables import VariableTable
from ..numeric.failure import GIVEN, LEFT_OUT, OMITTED, Moved, StepFailureError, left_out
from ..numeric.initialization import initial_positions
from ..numeric.instant import Instant
from ..numeric.linear import blocks, massless
from ..numeric.system import Matrix, Sparse, System, Vector
from ..numeric.thresholds import RANK

LOG = logging.getLogger("lagfmu")
ALLOWED = 1e-6  # part of its coordinate's size by which a value in `start` may miss the constraints


class StartMovedWarning(UserWarning):
    """A start value is not the one that the simulation begins with."""


def priorities(system: System, table: VariableTable) -> list[int]:
    """Of each coordinate (nq) and then each speed (nv): who said its start value (numeric/failure.py)."""
    return [GIVEN if table[name].given else OMITTED for name in system.states]


def tell(moved: Iterable[Moved | str]) -> None:
    """One warning for each value that was given and is moved (as an FMU says it, or to be said); the logger
    `lagfmu` hears in one line what those are that were left out."""
    known = list(moved)
    lines = [left_out(m for m in known if isinstance(m, Moved))]
    for m in known:
        if isinstance(m, str) and m.startswith(LEFT_OUT):
            lines.append(m)
        elif isinstance(m, str) or m.priority != OMITTED:
            warnings.warn(str(m), StartMovedWarning, stacklevel=3)
    for line in filter(None, lines):
        LOG.info(line)


def check_given(model: str, moved: Iterable[Moved], missed: Sequence[str]) -> None:
    """Raises ModelError naming the values in the model's `start` that miss the constraints, all at once.

    `missed`: the constraints that they miss, and by how much.
    """
    wrong = [m for m in moved if m.priority == GIVEN and abs(m.used - m.given) > ALLOWED * m.size]
    if wrong:
        what = f"the constraints ({', '.join(missed)})"
        if not missed:
            what = "what the other values say: a quaternion has the norm 1, an angle goes with it"
        raise ModelError(
            model,
            [
                f"start gives {m.name} = {m.given!r}, which misses {what}; "
                f"the nearest start that satisfies them has {m.used!r}: correct the start, or leave it out"
                for m in wrong
            ],
        )


NEGATIVE = 1e-12  # a mass below this fraction of its neighbours' is rounding
INDEFINITE = 1e-8  # an eigenvalue of the scaled mass matrix above -this is rounding
SEARCHES = 40  # other start values that are tried before constraints are called unsatisfiable
MANY = 12  # coordinates: the values of more are not told


def cause_of_failure(at: Instant, q: Vector, v: Vector) -> str | None:
    """What is wrong with a model that the solver cannot start at (q, v); None if it cannot be told."""
    system = at.system
    named = zip(system.coordinates, q.tolist(), strict=True)
    values = ", ".join(f"{n} = {x!r}" for n, x in named)
    with np.errstate(all="ignore"):
        try:
            M, F, G, nu, gamma = at.equations(q, v)
            bad = not all(np.isfinite(a).all() for a in (M.data, F, G.data, nu, gamma))
            reason = "a value is not finite" if bad else ""
            f = at.residual(q)
        except StepFailureError as error:
            bad, reason = True, str(error.__cause__ or error)
        if bad:
            return (
                f"the equations cannot be evaluated at the start values {values} ({reason}): "
                "choose others, or other parameters"
            )
        negative = negative_energy(system, M, np.abs(M.diagonal()))
        if negative:
            return negative
        rows = list(system.permanent)
        loose = massless(M.toarray(), G[rows].toarray())
        if loose:
            moving = ", ".join(repr(system.directions[j]) for j in loose)
            remedy = "give it a mass (what turns, an inertia), or a constraint"
            aside = q + 0.1 * np.maximum(np.abs(q).max(initial=0.0), 1.0)
            M, _, G, _, _ = at.equations(aside, v)
            if not massless(M.toarray(), G[rows].toarray()):
                here = values if len(q) <= MANY else "the joints' own"
                remedy = f"elsewhere it has: start at another place than {here}, or take other coordinates"
            return (
                f"the mass matrix is singular on the constraint surface: {moving} has neither mass "
                f"nor a constraint that determines its acceleration; {remedy}"
            )
        if _projected(at, q, v, rows) is None:
            return _missed(at, q, v, rows, f, values)
        for right, what in ((nu, "velocities"), (gamma, "accelerations")):
            contrary = _first_contrary(system, G.toarray(), right, rows)
            if contrary:
                return (
                    f"constraints {contrary} contradict each other: no {what} satisfy them together at "
                    "the start; correct them, or leave one out"
                )
    return None


def negative_energy(system: System, M: Sparse, size: Vector) -> str:
    """Motions with kinetic energy v.M v/2 < 0, in words; empty if M (n, n) is positive semidefinite.

    `size` (n) >= 0: the masses' magnitudes here and nearby, which tell a negative mass from the rounding
    of one that vanishes at this place.
    """
    remedy = (
        "at the start, expected no negative kinetic energy: check the sign of T in L = T - V, and the "
        "parameters in it"
    )
    masses = dict(zip(system.directions, M.diagonal().tolist(), strict=True))
    below = (M.diagonal() < -NEGATIVE * size).tolist()
    wrong = [
        f"{name!r} is {mass:.6g}"
        for (name, mass), b in zip(masses.items(), below, strict=True)
        if b
    ]
    if wrong:
        return f"the kinetic energy is negative: the mass of {', of '.join(wrong)} {remedy}"
    unit = np.sqrt(np.where(size > 0, size, np.abs(M.data).max(initial=0.0) or 1.0))
    least, moving = -INDEFINITE, ""
    for rows, block in blocks(M):
        values, vectors = np.linalg.eigh(block / unit[rows][:, None] / unit[rows])
        if values[0] < least:
            names = zip(rows.tolist(), vectors[:, 0].tolist(), strict=True)
            own = [repr(system.directions[i]) for i, part in names if abs(part) > 1e-2]
            least, moving = values[0], ", ".join(own)
    if not moving:
        return ""
    return (
        f"the kinetic energy is negative where {moving} move together: the mass matrix, scaled to a "
        f"diagonal of 1, has the eigenvalue {least:.6g} {remedy}"
    )


def _projected(at: Instant, q: Vector, v: Vector, rows: list[int]) -> Vector | None:
    size = np.maximum(np.abs(q), np.abs(q).max(initial=0.0) or 1.0)
    try:
        return initial_positions(at, q, v, rows, size)
    except StepFailureError:
        return None


def _missed(at: Instant, q: Vector, v: Vector, rows: list[int], f: Vector, values: str) -> str:
    """Constraints on position that the start values cannot be projected onto: are there others?"""
    system = at.system
    generator = random.Random(1)
    reach = 2 * max([*np.abs(q), *(abs(x) for x in at.p), 1.0])
    tried = [q] + [
        np.array([generator.choice((0.01, 0.1, 1.0)) * generator.uniform(-reach, reach) for _ in q])
        for _ in range(SEARCHES)
    ]

    def found(chosen: list[int]) -> Iterator[Vector]:
        projected = (_projected(at, trial, v, chosen) for trial in tried)
        return (x for x in projected if x is not None)

    def satisfiable(chosen: list[int]) -> bool:
        return next(found(chosen), None) is not None

    others = list(found(rows))
    if others:
        best = min(others, key=lambda x: float(np.abs(x - q).max()))
        good = ", ".join(f"{n} = {x:.6g}" for n, x in zip(system.coordinates, best, strict=True))
        missed = ", ".join(f"{system.rows[k].name!r} by {f[k]:.3g}" for k in rows if f[k] != 0)
        return (
            f"the start values {values} cannot be projected onto the constraints (missed: {missed}): "
            f"choose others, for example {good}"
        )
    for k in rows:
        if len(rows) == 1 or not satisfiable([k]):
            return (
                f"constraint {system.rows[k].name!r}: no configuration was found that satisfies it; "
                f"at the start values {values} it is {f[k]:.3g}, expected 0: correct its expression "
                "or the parameters in it"
            )
    kept = list(rows)
    for k in rows:  # what can be left out while the rest still fails is not to blame
        if not satisfiable([r for r in kept if r != k]):
            kept.remove(k)
    names = ", ".join(repr(system.rows[k].name) for k in kept)
    return (
        f"constraints {names} contradict each other: each can be satisfied, but no configuration was "
        "found that satisfies all; correct them, or leave one out"
    )


def _first_contrary(system: System, G: Matrix, nu: Vector, rows: list[int]) -> str:
    """Names of rows of G v = nu that no v satisfies, or of G vdot = gamma that no vdot does."""

    def solvable(chosen: list[int]) -> bool:
        if not chosen:
            return True
        norm = np.linalg.norm(G[chosen], axis=1)
        scaled = G[chosen] / np.where(norm > 0, norm, 1.0)[:, None]
        right = nu[chosen] / np.where(norm > 0, norm, 1.0)
        speeds = np.linalg.lstsq(scaled, right, rcond=RANK)[0]
        return bool(np.abs(scaled @ speeds - right).max() <= 1e-9 * (np.abs(right).max() or 1.0))

    if solvable(rows):
        return ""
    kept = list(rows)
    for k in rows:
        if not solvable([r for r in kept if r != k]):
            kept.remove(k)
    return ", ".join(repr(system.rows[k].name) for k in kept)
