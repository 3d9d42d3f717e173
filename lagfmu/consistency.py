"""Rank, redundancy and feasibility of a model's constraints, found numerically where they hold.

Degrees of freedom N = n - rank G (ME 6590).  The rank is taken at the consistent start and at
configurations near it that satisfy the constraints, because on the constraint surface it may be smaller
than for a general q.
"""

from __future__ import annotations

import random
import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .equations import EquationsOfMotion
from .errors import DerivationError, ModelError
from .reduction import Reduction
from .solver.failure import StepFailureError
from .solver.initial import Start, project_from_afar, start
from .solver.linear import RANK
from .solver.motion import evaluate, residual
from .solver.observe import expand, observe
from .solver.state import Settings
from .solver.system import Matrix, System, Vector
from .variables import VariableTable

TRIALS = 5
SEARCHES = 40  # other start values that are tried before constraints are called unsatisfiable


class RedundantConstraintWarning(UserWarning):
    """Constraints that follow from others: lambda is not unique, Q is."""


@dataclass(frozen=True)
class Structure:
    """n, m, rank of G with all constraints acting, degrees of freedom, redundant constraints, start."""

    n: int
    m: int
    rank: int
    redundant: tuple[str, ...]
    start: Start

    @property
    def degrees_of_freedom(self) -> int:
        """N = n - rank G."""
        return self.n - self.rank


def examine(eom: EquationsOfMotion, table: VariableTable, system: System) -> Structure:
    """Check that the model can start, and count its degrees of freedom.

    Warns of redundant constraints.  Raises ModelError if no configuration satisfies the constraints,
    they contradict each other, or the mass matrix is singular on the constraint surface.
    """
    p = [float(x.value) for x in eom.model.parameters]
    u = [float(table[str(s)].start or 0.0) for s in eom.u]
    q0 = [float(table[c].start or 0.0) for c in system.coordinates]
    v0 = [float(table[f"der({c})"].start or 0.0) for c in system.coordinates]
    try:
        begun = start(system, Settings(), 0.0, q0, v0, u, p)
        observe(system, begun.state, u, p)
    except StepFailureError as error:
        cause = _cause(system, q0, v0, u, p) or str(error)
        raise ModelError(eom.model.name, [cause]) from error
    generator = random.Random(1)
    ranks = []
    for trial in range(TRIALS):
        q, v = np.array(begun.state.q), np.array(begun.state.v)
        if trial:  # a nearby configuration that satisfies the constraints as well
            size = np.maximum(np.abs(q), np.abs(q).max(initial=0.0)) + 1e-3
            shift = [0.1 * s * generator.uniform(-1, 1) for s in size]
            try:
                moved = start(system, Settings(), 0.0, (q + shift).tolist(), v.tolist(), u, p)
            except StepFailureError:
                continue
            q, v = np.array(moved.state.q), np.array(moved.state.v)
        full, q, v = expand(system, 0.0, q, v, u, p)
        ranks.append(_rank(full, q, v, u, p))
    rank, redundant = max(ranks, key=lambda r: r[0])
    if redundant:
        warnings.warn(
            f"model {eom.model.name!r}: constraint{'s' if len(redundant) > 1 else ''} "
            f"{', '.join(map(repr, redundant))} follow{'' if len(redundant) > 1 else 's'} from the "
            "others; lambda is shared with least norm and flagged by unique.*, Q is right",
            RedundantConstraintWarning,
            stacklevel=3,
        )
    return Structure(eom.n, eom.m, rank, redundant, begun)


def check_embedding(eom: EquationsOfMotion, reduction: Reduction) -> None:
    """An embedding q = phi(s) takes away as many coordinates as it satisfies constraints.

    If it took more, it would hold the system where no constraint does, and the forces that hold it would
    be missing from lambda.  Raises DerivationError naming the constraints that it violates.
    """
    taken, satisfied = eom.n - len(reduction.s), eom.m - len(reduction.rows)
    if taken <= satisfied:
        return
    left = zip(reduction.rows, reduction.reduced.f, strict=True)
    violated = "; ".join(
        f"constraint {eom.constraints[k].name!r} becomes {f}, expected 0"
        for k, f in left
        if f is not None
    )
    raise DerivationError(
        f"the embedding of model {eom.model.name!r} takes {taken} of {eom.n} coordinates away, but "
        f"satisfies {satisfied} constraints{': ' + violated if violated else ''}; correct its "
        "relations, keep more coordinates, or add the constraint that it stands for"
    )


def _rank(
    full: System, q: Vector, v: Vector, u: list[float], p: list[float]
) -> tuple[int, tuple[str, ...]]:
    """Rank of G with rows scaled to unit norm, and the rows that add nothing to those before them."""
    _, _, G, _, _ = evaluate(full, 0.0, q, v, u, p)
    norm = np.linalg.norm(G, axis=1)
    G = G / np.where(norm > 0, norm, 1.0)[:, None]
    kept: list[int] = []
    redundant = []
    for k in range(full.m):
        trial = [*kept, k]
        if np.linalg.svd(G[trial], compute_uv=False).min(initial=np.inf) > np.sqrt(RANK) and (
            len(trial) <= full.n
        ):
            kept = trial
        else:
            redundant.append(full.rows[k].name)
    return len(kept), tuple(redundant)


# ----------------------------------------------------------------- why a model cannot start


def _cause(
    system: System, q0: Sequence[float], v0: Sequence[float], u: list[float], p: list[float]
) -> str | None:
    """What is wrong with a model that the solver cannot start, as far as it can be told."""
    q, v, w = np.array(q0), np.array(v0), system.inputs_at(u, 0.0)
    values = ", ".join(f"{n} = {x!r}" for n, x in zip(system.coordinates, q0, strict=True))
    with np.errstate(all="ignore"):
        try:
            M, F, G, nu, _ = evaluate(system, 0.0, q, v, w, p)
            bad = not all(np.isfinite(a).all() for a in (M, F, G, nu))
            reason = "a value is not finite" if bad else ""
            f = residual(system, 0.0, q, w, p)
        except StepFailureError as error:
            bad, reason = True, str(error.__cause__ or error)
        if bad:
            return (
                f"the equations cannot be evaluated at the start values {values} ({reason}): "
                "choose others, or other parameters"
            )
        rows = list(system.permanent)
        loose = _massless(system, M, G[rows])
        if loose:
            return (
                f"the mass matrix is singular on the constraint surface: {loose} has neither mass "
                "nor a constraint that determines its acceleration; give it a mass, or a constraint"
            )
        if _projected(system, q, v, w, p, rows) is None:
            return _missed(system, q, v, w, p, rows, f, values)
        contrary = _first_contrary(system, G, nu, rows)
        if contrary:
            return (
                f"constraints {contrary} contradict each other: no velocities satisfy them together "
                "at the start; correct them, or leave one out"
            )
    return None


def _massless(system: System, M: Matrix, G: Matrix) -> str:
    """Names of coordinates that can accelerate without mass and without violating a constraint."""
    rows = [a / (np.abs(a).max(initial=0.0) or 1.0) for a in (*M, *G)]
    _, sizes, V = np.linalg.svd(np.array(rows))
    free = V[len(sizes) :].tolist() + V[: len(sizes)][sizes < RANK].tolist()
    loose = sorted({j for direction in free for j, a in enumerate(direction) if abs(a) > 1e-6})
    return ", ".join(repr(system.coordinates[j]) for j in loose)


def _projected(
    system: System, q: Vector, v: Vector, w: list[float], p: list[float], rows: list[int]
) -> Vector | None:
    size = np.maximum(np.abs(q), np.abs(q).max(initial=0.0) or 1.0)
    try:
        return project_from_afar(system, 0.0, q, v, w, p, rows, size)
    except StepFailureError:
        return None


def _missed(
    system: System,
    q: Vector,
    v: Vector,
    w: list[float],
    p: list[float],
    rows: list[int],
    f: Vector,
    values: str,
) -> str:
    """Constraints on position that the start values cannot be projected onto: are there others?"""
    generator = random.Random(1)
    reach = 2 * max([*np.abs(q), *(abs(x) for x in p), 1.0])
    tried = [q] + [
        np.array([generator.choice((0.01, 0.1, 1.0)) * generator.uniform(-reach, reach) for _ in q])
        for _ in range(SEARCHES)
    ]

    def satisfiable(chosen: list[int]) -> list[Vector]:
        found = [_projected(system, trial, v, w, p, chosen) for trial in tried]
        return [x for x in found if x is not None]

    others = satisfiable(rows)
    if others:
        best = min(others, key=lambda x: float(np.abs(x - q).max()))
        good = ", ".join(f"{n} = {x:.6g}" for n, x in zip(system.coordinates, best, strict=True))
        missed = ", ".join(f"{system.rows[k].name!r} by {f[k]:.3g}" for k in rows if f[k] != 0)
        return (
            f"the start values {values} cannot be projected onto the constraints (missed: {missed}): "
            f"choose others, for example {good}"
        )
    for k in rows:
        if not satisfiable([k]):
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
    """Names of rows of G v = nu that no v satisfies."""

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
