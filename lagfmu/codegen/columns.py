"""Which columns of a Jacobian can be found at once: those of which no two stand in one row.

The columns of a row exclude each other; each column gets the first group in which none is that it
excludes (Curtis, Powell & Reid, On the estimation of sparse Jacobian matrices, 1974).  Of a chain of
bodies there are as many groups as two neighbours have coordinates and speeds, however long it is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from itertools import count

from .parts import Function

# as in runtime/simulation/adjoint.c
DIRECTION = ("dt", "dq", "ds", "dv", "dsdot", "du", "dvdot", "dlambda", "dQ")
OF_ALL = "denergy"  # results that depend on everything
LARGEST = 256  # columns of a group: powers of 2 tell them apart


def groups(tangents: Sequence[Function]) -> list[int]:
    """The group of each column (t, q, v, u, ...; no parameters) of tangents along one direction; none where
    most would be by themselves."""
    along = {a: g for f in tangents for a, g in f.arguments.items() if a in DIRECTION}
    columns = [s for array in DIRECTION for s in along.get(array, ())]
    number = {s: k for k, s in enumerate(columns)}
    excluded: list[set[int]] = [set() for _ in columns]
    for array, results in ((a, r) for f in tangents for a, r in f.results.items()):
        for x in results if array != OF_ALL else ():
            row = {number[s] for s in x.expression.free_symbols if s in number}
            for k in row:
                excluded[k] |= row
    found: list[int] = []
    size: Counter[int] = Counter()
    for others in excluded:
        taken = {found[j] for j in others if j < len(found)}
        group = next(g for g in count() if g not in taken and size[g] < LARGEST)
        found.append(group)
        size[group] += 1
    return found if 2 * len(size) < len(columns) else []
