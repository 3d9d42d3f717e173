"""What is alike up to the names of its symbols is computed by one function: bodies and joints of a kind.

The values of one owner (a joint A with the rows A.x, A.y, ...; a body) are written in symbols that are
numbered by their places in the arguments, with vectors that are fixed on bodies as data (model/attitude.py).
Owners whose values are then the same expressions share a function, which is called in a loop over tables of
places and data.  Expressions are so eliminated and printed once a kind, and code grows by a line of table
for each further joint.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

from ..model.attitude import pattern
from ..model.elements import Expr
from ..names import read
from .parts import Arguments, Value

SMALL = 12  # different nodes of the values of one owner that are not worth a function
DATA = "data"
OF_JOINTS = frozenset(("angle", "position", "force", "torque"))  # what outputs and coordinates tell


@dataclass
class Kind:
    """`values` in the symbols `inputs`; of each owner of that kind, the places of what it reads and writes:
    `reads` and `writes` name the arrays, in this order.  Sources in the array DATA are numbers, or
    expressions of parameters."""

    inputs: tuple[Expr, ...]
    values: tuple[Expr, ...]
    reads: tuple[str, ...]
    writes: tuple[str, ...]
    owners: list[str] = field(default_factory=list)
    sources: list[tuple[Any, ...]] = field(default_factory=list)
    targets: list[tuple[int, ...]] = field(default_factory=list)

    @property
    def told(self) -> set[tuple[str, int]]:
        """The array and the place of each value that it writes."""
        return {pair for target in self.targets for pair in zip(self.writes, target, strict=True)}


def kinds(
    arguments: Arguments,
    results: Mapping[str, Sequence[Value]],
    costly: Callable[[Expr], bool],
) -> list[Kind]:
    """Those of which there are two or more; none of values with calls of functions that others share."""
    place = {s: (a, k) for a, group in arguments.items() for k, s in enumerate(group)}
    nodes: dict[str, dict[Expr, None]] = {}
    owners = _owners(results)
    for owner, own in owners.items():
        found = nodes[owner] = {}
        for _, _, value in own:
            found |= nodes_of(value.expression, found)
    uses = Counter(e for found in nodes.values() for e in found if costly(e))
    kinds: dict[object, Kind] = {}
    for owner, own in owners.items():
        if len(nodes[owner]) < SMALL or any(uses[e] > 1 for e in nodes[owner]):
            continue
        alike = pattern([value.expression for _, _, value in own], place.get, "p")
        if alike is None:
            continue
        reads = tuple(group or DATA for group in alike.groups)
        writes = tuple(array for array, _, _ in own)
        kind = kinds.setdefault(
            (alike.kind, writes), Kind(alike.symbols, alike.values, reads, writes)
        )
        kind.owners.append(owner)
        pairs = zip(alike.inputs, alike.groups, strict=True)
        kind.sources.append(tuple(place[s][1] if group else s for s, group in pairs))
        kind.targets.append(tuple(k for _, k, _ in own))
    return [_with_numbers(kind) for kind in kinds.values() if len(kind.owners) > 1]


def _with_numbers(kind: Kind) -> Kind:
    """The same with the data put in that are one number for all owners."""
    columns = list(zip(*kind.sources, strict=True))
    same = [
        array == DATA and len(set(column)) == 1 and column[0].is_number
        for array, column in zip(kind.reads, columns, strict=True)
    ]
    kept = [j for j, is_same in enumerate(same) if not is_same]
    table = {kind.inputs[j]: columns[j][0] for j, is_same in enumerate(same) if is_same}
    return replace(
        kind,
        inputs=tuple(kind.inputs[j] for j in kept),
        values=tuple(e.xreplace(table) for e in kind.values),
        reads=tuple(kind.reads[j] for j in kept),
        sources=[tuple(source[j] for j in kept) for source in kind.sources],
    )


def data_of(found: Sequence[Kind]) -> Iterator[Expr]:
    """The sources in DATA."""
    for kind in found:
        for source in kind.sources:
            yield from (x for x, a in zip(source, kind.reads, strict=True) if a == DATA)


def runs(arrays: Sequence[str]) -> Iterator[tuple[str, int, int]]:
    """Each array with the first place of its run and the one after its last."""
    for array, group in groupby(enumerate(arrays), key=lambda pair: pair[1]):
        places = [k for k, _ in group]
        yield array, places[0], places[-1] + 1


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
                found.setdefault(_owner(value.place), []).append((array, k, value))
    return found


def _owner(place: str) -> str:
    """A of "A.rx, b.omega.x", of "force.A.x [N]" and of "der(angle.A)"; b of "b.omega.x, b.omega.x"."""
    first, *rest = read(place.partition(" [")[0].partition(", ")[0]).coordinate.split(".")
    return rest[0] if rest and first in OF_JOINTS else first
