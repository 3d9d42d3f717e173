"""Which constraints follow from others, and what that leaves undetermined.

lambda_k is unique only if component k of the null space of G^T vanishes (Wojtyra 2005).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .linear import norms, stand_apart
from .motion import FrictionLaw
from .system import Matrix, Sparse, System, Vector
from .thresholds import RANK

ALONE = 1e-6  # part of a unit vector of multipliers that push nothing, up to which one has no part in it
MISSED = 1e-9  # part of a constraint's terms by which it is missed


@dataclass(frozen=True)
class Rank:
    """The rank of G with all constraints acting, the rows that add nothing to those before them, all whose
    multipliers are not unique, and the frictions whose normal forces are not, by name."""

    rank: int
    redundant: tuple[str, ...]
    shared: tuple[str, ...]
    undecided: tuple[str, ...]


def rank_of(
    system: System, G: Sparse, f: Vector, size: Vector, law: FrictionLaw | None = None
) -> Rank:
    """Rows are scaled to unit norm; what is left of each beside the span of those before it by Gram and
    Schmidt, twice.  Those of frictions do not count, which hold as long as they stick.  Contacts come last:
    one that cannot be closed while those on which it depends are (a wall on either side) is no redundancy.
    f (m) are the residuals, `size` (m) the magnitudes of their terms; `law` gives the normal forces of the
    frictions, if there are any."""
    C = np.zeros((0, system.m)) if law is None else law.C
    norm = norms(G)
    norm = np.where(norm > 0, norm, 1.0)
    G, f, size, C = G / norm[:, None], f / norm, size / norm, C / norm
    held = [k for k, row in enumerate(system.rows) if row.friction is None]
    if stand_apart(G.tocsr()[held]):
        return Rank(len(held), (), (), ())
    G = G.toarray()
    span = np.zeros((0, system.nv))
    redundant: list[str] = []
    rows: list[int] = []
    for k in sorted(held, key=lambda k: k in system.contacts):
        rest = G[k].copy()
        for _ in range(2):
            rest -= span.T @ (span @ rest)
        length = float(np.linalg.norm(rest))
        if len(span) < system.nv and length > np.sqrt(RANK):
            span = np.vstack([span, rest / length])
        elif k in system.contacts and _apart(k, rows, G, f, size):
            continue
        else:
            redundant.append(system.rows[k].name)
        rows.append(k)
    rows.sort()
    left = _left_null_space(G[rows], len(redundant))
    shared = np.linalg.norm(left, axis=1) > ALONE
    grows = np.linalg.norm(C[:, rows] @ left, axis=1) > ALONE * np.linalg.norm(C[:, rows], axis=1)
    names = tuple(system.rows[k].name for k, part in zip(rows, shared, strict=True) if part)
    places = [] if law is None else law.places
    undecided = [any(grows[list(norm)].any() for norm in of) for of in places]
    frictions = tuple(x.name for x, part in zip(system.frictions, undecided, strict=True) if part)
    return Rank(len(span), tuple(redundant), names, frictions)


def _apart(k: int, rows: Sequence[int], G: Matrix, f: Vector, size: Vector) -> bool:
    """Whether row k, as it follows from `rows`, still has a gap when all of those have none."""
    share = np.linalg.lstsq(G[rows].T, G[k], rcond=RANK)[0]
    return bool(abs(f[k] - share @ f[rows]) > MISSED * (size[k] + np.abs(share) @ size[rows]))


def _left_null_space(G: Matrix, count: int) -> Matrix:
    """(rows, count), orthonormal: the multipliers that push nothing."""
    if not count or not len(G):
        return np.zeros((len(G), 0))
    return np.linalg.svd(G)[0][:, len(G) - count :]
