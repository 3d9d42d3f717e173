"""What one linear solve ties together."""

from __future__ import annotations

from sympy.utilities.iterables import connected_components

from .equations import EquationsOfMotion

Group = tuple[frozenset[int], frozenset[int]]  # speeds, rows


def coupled(eom: EquationsOfMotion) -> list[Group]:
    """What one linear solve ties together, by the sparsity of M, G and frictions."""
    position = {c.name: eom.nv + k for k, c in enumerate(eom.constraints)}
    pairs = list(eom.M.todok())
    for law in eom.frictions:
        first, *others = (position[name] for name in (*law.of, *law.normal_rows))
        pairs += [(first, i) for i in others]
    return _tied(eom, pairs)


def constrained_together(eom: EquationsOfMotion) -> list[Group]:
    """What the constraints alone tie together; rows that hold nothing are left out."""
    return [group for group in _tied(eom, []) if group[0]]


def sharing_inertia(eom: EquationsOfMotion) -> list[frozenset[int]]:
    """The speeds that the mass matrix alone ties together."""
    return [frozenset(g) for g in connected_components((range(eom.nv), list(eom.M.todok())))]


def _tied(eom: EquationsOfMotion, pairs: list[tuple[int, int]]) -> list[Group]:
    pairs = [*pairs, *((eom.nv + k, j) for k, j in eom.G.todok())]
    groups = connected_components((range(eom.nv + eom.m), pairs))
    return [
        (frozenset(i for i in g if i < eom.nv), frozenset(i - eom.nv for i in g if i >= eom.nv))
        for g in sorted(groups, key=min)
    ]
