"""Which columns of a matrix can be found at once: those of which no two stand in one row.  Of two matrices:

    b and c by (t, q, v, u) in  M dvdot = b + G^T dlambda ,  G dvdot = c     (runtime/mechanics/sensitivity.c)
    rates of joint coordinates by speeds                          (runtime/simulation/joint_coordinates.c)

The columns of a row exclude each other; each column gets the first group in which none is that it
excludes (Curtis, Powell & Reid, On the estimation of sparse Jacobian matrices, 1974).  Of a chain of
bodies there are as many groups as three neighbours have coordinates and speeds, however long it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from itertools import chain, count

import sympy as sp

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
    rows = _rows(parts, {a: [x.expression for x in g] for a, g in tangent.results.items()})
    places = ({number[s] for s in _settled(parts, row & number.keys())} for row in rows)
    group = _grouped(len(columns), places, LARGEST)
    return group if 2 * len(set(group)) < len(columns) else []


def joint_rates(parts: Parts) -> list[list[tuple[int, int]]]:
    """The speeds in the rate of each joint coordinate, ascending, each with its group."""
    eom, number = parts.eom, {s: i for i, s in enumerate(parts.eom.v)}
    rows = []
    for c in eom.joint_coordinates:
        if c.coordinate >= 0:
            rows.append([i for j, i in parts.rates if j == c.coordinate])
        else:
            held = sp.sympify(eom.outputs[c.rate].expression).free_symbols
            rows.append(sorted(number[s] for s in held & number.keys()))
    group = _grouped(eom.nv, rows, eom.nv)
    return [[(i, group[i]) for i in row] for row in rows]


def _grouped(size: int, rows: Iterable[Collection[int]], largest: int) -> list[int]:
    """The group of each column; so many are in one at most."""
    excluded: list[set[int]] = [set() for _ in range(size)]
    for row in rows:
        for k in row:
            excluded[k].update(row)
    group: list[int] = []
    members: Counter[int] = Counter()
    for others in excluded:
        taken = {group[j] for j in others if j < len(group)}
        group.append(next(g for g in count() if g not in taken and members[g] < largest))
        members[group[-1]] += 1
    return group


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
