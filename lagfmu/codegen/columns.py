"""Which columns of the derivatives of b and c can be found at once: those of which no two stand in one row.

    M dvdot = b + G^T dlambda ,  G dvdot = c      (runtime/mechanics/sensitivity.c)

The columns of a row exclude each other; each column gets the first group in which none is that it
excludes (Curtis, Powell & Reid, On the estimation of sparse Jacobian matrices, 1974).  Of a chain of
bodies there are as many groups as three neighbours have coordinates and speeds, however long it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import chain, count

from ..model.elements import Expr
from .parts import Parts

LARGEST = 256  # columns of a group: powers of 2 tell them apart


def groups(parts: Parts) -> list[int]:
    """The group of each column (t, q, v, u); none where most would be by themselves, or lead to others."""
    tangent = next((f for f in parts.functions if f.name == "tangent"), None)
    if tangent is None or parts.full is not None:
        return []
    columns = [s for a in ("dt", "dq", "dv", "du") for s in tangent.arguments[a]]
    number = {s: k for k, s in enumerate(columns)}
    excluded: list[set[int]] = [set() for _ in columns]
    for row in _rows(parts, {a: [x.expression for x in g] for a, g in tangent.results.items()}):
        found = _settled(parts, row & number.keys())
        places = {number[s] for s in found}
        for k in places:
            excluded[k] |= places
    group: list[int] = []
    size: Counter[int] = Counter()
    for others in excluded:
        taken = {group[j] for j in others if j < len(group)}
        group.append(next(g for g in count() if g not in taken and size[g] < LARGEST))
        size[group[-1]] += 1
    return group if 2 * len(size) < len(columns) else []


def _rows(parts: Parts, changes: dict[str, Sequence[Expr]]) -> Iterator[set[Expr]]:
    """What the rows of  b = dF + dG^T lambda - dM vdot  and of  c = dgamma - dG vdot  depend on."""
    symbols = {a: [e.free_symbols for e in group] for a, group in changes.items()}
    b, c = symbols["dF"], symbols["dgamma"]
    for (i, j), of in zip(parts.mass, symbols["dM"], strict=True):
        b[i] = b[i] | of
        b[j] = b[j] | of
    for (k, j), of in zip(parts.jacobian, symbols["dG"], strict=True):
        b[j] = b[j] | of
        c[k] = c[k] | of
    yield from chain(b, c)


def _settled(parts: Parts, row: set[Expr]) -> set[Expr]:
    """The same where states are settled that are set: quaternions are normalized, and what angles equal
    changes them in the place of their own columns."""
    eom, change = parts.eom, parts.change
    for j, angle in eom.unwrapped.items():
        if change[eom.q[j]] in row:
            row = row - {change[eom.q[j]]}
            row |= {change[s] for s in angle.free_symbols if s in change}
    for places in eom.quaternions:
        four = {change[eom.q[j]] for j in places}
        row = row | four if row & four else row
    return row
