"""A second way in which the joints of a loop close: an elbow up, or down.

It is looked for from other angles of the joints, drawn at random, and about a beginning from which no step
leads anywhere, as where all links lie on a line.  What a motion that is left may change tells no branches
apart: it may lead from one to the other.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import sympy as sp

from ..errors import LagfmuWarning
from ..model.elements import Contact, Expr
from ..model.model import Model
from .draft import Draft
from .rows import Array, Rows

CLOSED = 1e-9  # of the size of the mechanism: what a row may miss, and a given value be another
DRAWS, MOST = 8, 60  # beginnings; speeds of a mechanism beyond which it is not looked for
# times as far as the branch that is taken; what makes another one, of its way
NEAR, ANOTHER = 2.0, 1e-3


class SecondBranchWarning(LagfmuWarning):
    """A mechanism closes in two ways, and nothing says which is meant."""


def has_loop(draft: Draft, parts: Sequence[Any]) -> bool:
    """True if there are more ties than bodies."""
    ties = sum(hasattr(part, "relative_pose") for part in parts)
    return ties > len(draft.motions) - 1


def is_small(draft: Draft) -> bool:
    """True if there are not too many bodies to look for other branches."""
    return 6 * (len(draft.motions) - 1) <= MOST


def other_angles(measures: Iterable[str]) -> Iterator[dict[str, float]]:
    """Angles of joints, drawn at random, to begin from."""
    draws, names = np.random.default_rng(0), [n for n in measures if n.startswith("angle")]
    for _ in range(DRAWS):
        yield {n: draws.uniform(-math.pi, math.pi) for n in names}


def tell_second_branch(
    model: Model,
    measures: Mapping[str, Expr],
    closed: Iterable[tuple[Array, Array]],
    rough: Array,
    q: Array,
) -> None:
    """Warns of a branch besides q that is about as near to the rough place, by the angle or position (of
    `measures`, which are not given) that tells them apart most.  `closed` are places found from elsewhere:
    coordinates, and what each row then misses."""
    if not measures:
        return
    rows = Rows(model, [(e, sp.S.Zero) for e in measures.values()])
    stops = [c.expression for c in model.constraints if isinstance(c, Contact)]
    gaps = Rows(model, [(e, sp.S.Zero) for e in stops])
    way = float(np.linalg.norm(q - rough))
    here, nearest, apart = rows.values(q), NEAR * way, None
    for there, missed in closed:
        far = float(np.linalg.norm(there - rough))
        difference = _turned(measures, rows.values(there) - here)
        another = np.abs(difference).max() > ANOTHER * way
        if gaps.values(there).min(initial=0.0) < -CLOSED:
            continue  # beyond a limit
        if missed.max(initial=0.0) <= CLOSED and another and far < nearest:
            nearest, apart = far, difference
    if apart is None:
        return
    k = int(np.argmax(np.abs(apart)))
    name, taken = list(measures)[k], here[k].item()
    other = _turned(measures, here + apart)[k].item()
    warnings.warn(
        f"model {model.name!r}: the joints close in two ways that are about as near: taken is the one with "
        f"{name} = {taken!r}; for the other start {name!r} at {other!r}",
        SecondBranchWarning,
        stacklevel=6,
    )


def _turned(measures: Mapping[str, Expr], values: Array) -> Array:
    """Angles within half a turn."""
    angles = [n.startswith("angle") for n in measures]
    return np.where(angles, np.remainder(values + math.pi, 2 * math.pi) - math.pi, values)
