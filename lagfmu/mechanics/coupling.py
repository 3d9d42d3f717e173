"""What one linear solve ties together."""

from __future__ import annotations

from .equations import EquationsOfMotion


def coupled(eom: EquationsOfMotion) -> list[tuple[frozenset[int], frozenset[int]]]:
    """(coordinates, rows) that one linear solve ties together, by the sparsity of M, G and frictions."""
    parent = list(range(eom.n + eom.m))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    for i, j in eom.M.todok():
        parent[root(i)] = root(j)
    for k, j in eom.G.todok():
        parent[root(eom.n + k)] = root(j)
    position = {c.name: eom.n + k for k, c in enumerate(eom.constraints)}
    for law in eom.frictions:
        first, *others = (position[name] for name in (*law.of, *law.normal))
        for i in others:
            parent[root(i)] = root(first)
    groups: dict[int, list[int]] = {}
    for i in range(eom.n + eom.m):
        groups.setdefault(root(i), []).append(i)
    return [
        (frozenset(i for i in g if i < eom.n), frozenset(i - eom.n for i in g if i >= eom.n))
        for g in groups.values()
    ]
