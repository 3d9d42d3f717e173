"""What is alike up to the names of its symbols is computed by one C function: bodies and joints of a kind.

The values of one owner (a joint A with the rows A.x, A.y, ...; a body) are written in symbols that are
numbered by their places in the arguments.  Owners whose values are then the same expressions share a
function, which is called in a loop over tables of places.  Expressions are so eliminated and printed once a
kind, and code grows by a line of table for each further joint.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import sympy as sp

from ...model.elements import Expr
from ..parts import Arguments, Value

SMALL = 60  # different nodes of one owner's values that are not worth a function


@dataclass
class Kind:
    """`values` in the symbols `inputs`; of each owner of that kind, the places of what it reads and writes:
    `reads` and `writes` name the arrays, in this order."""

    inputs: tuple[Expr, ...]
    values: tuple[Expr, ...]
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    owners: list[str] = field(default_factory=list)
    sources: list[tuple[int, ...]] = field(default_factory=list)
    targets: list[tuple[int, ...]] = field(default_factory=list)


def kinds(
    arguments: Arguments,
    results: Mapping[str, Sequence[Value]],
    costly: Callable[[Expr], bool],
) -> list[Kind]:
    """Those of which there are two or more; none of values with calls of functions, which others share."""
    place = {s: (a, k) for a, group in arguments.items() for k, s in enumerate(group)}
    order = {s: k for k, s in enumerate(place)}
    found: dict[tuple[object, ...], Kind] = {}
    for owner, own in _owners(results).items():
        values = [value.expression for _, _, value in own]
        nodes: dict[Expr, None] = {}
        for e in values:
            nodes |= nodes_of(e, nodes)
        symbols = {node for node in nodes if node.is_Symbol}
        if len(nodes) < SMALL or any(map(costly, nodes)) or not symbols <= order.keys():
            continue
        ordered = sorted(symbols, key=order.__getitem__)
        inputs = tuple(sp.Symbol(f"a{k}", real=True) for k in range(len(ordered)))
        table = dict(zip(ordered, inputs, strict=True))
        canonical = tuple(e.xreplace(table) for e in values)
        reads = tuple(place[s][0] for s in ordered)
        writes = tuple(array for array, _, _ in own)
        key = (canonical, reads, writes)
        kind = found.setdefault(key, Kind(inputs, canonical, reads, writes))
        kind.owners.append(owner)
        kind.sources.append(tuple(place[s][1] for s in ordered))
        kind.targets.append(tuple(k for _, k, _ in own))
    return [kind for kind in found.values() if len(kind.owners) > 1]


def nodes_of(e: Expr, seen: Mapping[Expr, None]) -> dict[Expr, None]:
    """The nodes of an expression that are not among those seen, in a fixed order."""
    stack: list[Expr] = [e]
    found: dict[Expr, None] = {}
    while stack:
        node = stack.pop()
        if node not in seen and node not in found:
            found[node] = None
            stack.extend(node.args)
    return found


def _owners(results: Mapping[str, Sequence[Value]]) -> dict[str, list[tuple[str, int, Value]]]:
    """(array, place in it, value) of each owner; of what is 0 or a number nothing."""
    found: dict[str, list[tuple[str, int, Value]]] = {}
    for array, group in results.items():
        for k, value in enumerate(group):
            if value.expression.free_symbols:
                owner = value.place.partition(",")[0].partition(".")[0]
                found.setdefault(owner, []).append((array, k, value))
    return found
