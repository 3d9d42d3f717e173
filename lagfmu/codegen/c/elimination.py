"""The order of the sparse elimination that the native solver follows, found when an FMU is built.

    P M P^T = L D L^T ,   W = L^-1 P G^T ,   S = G M^-1 G^T = W^T D^-1 W ,   P' S P'^T = L' D' L'^T

Both orders are of minimum degree (Rose 1972; Davis, Direct Methods for Sparse Linear Systems, 2006,
sect. 7.1).  Of equal degrees the one that has waited longest comes first: a chain burns from both
ends, and the two halves do not wait for one another.  Where coordinates couple as in a chain, work
and memory grow linearly with its length.
"""

from __future__ import annotations

import heapq
import textwrap
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from typing import Any

Pair = tuple[int, int]
Ints = tuple[int, ...]


@dataclass(frozen=True)
class Elimination:
    """A symmetric matrix in the order of its elimination, with the pattern of its factor L.

    Row p of L has non-zeros in columns column[start[p]:start[p + 1]], ascending.  overlap[p]: of the
    rows of L^-1 that enter row p, as many at most have a non-zero in one column.  The fields stand in
    the order of plan.h.
    """

    size: int
    forest: int
    widest: int
    order: Ints
    start: Ints
    column: Ints
    overlap: Ints

    def row(self, p: int) -> Ints:
        """Columns of row p of L."""
        return self.column[self.start[p] : self.start[p + 1]]


@dataclass(frozen=True)
class Plan:
    """Both eliminations and where the values of M, G, W and S go; fields in the order of plan.h."""

    diagonal: int
    massless: int
    mass: Elimination
    mass_diagonal: Ints
    mass_value: Ints
    w_start: Ints
    w_column: Ints
    w_value: Ints
    schur: Elimination
    pair_start: Ints
    pair_a: Ints
    pair_b: Ints

    def c_text(self, name: str) -> str:
        """C99: the tables, and `static const Plan NAME`."""
        tables: list[str] = []
        initializer = _initializer(self, name, tables)
        body = textwrap.fill(initializer, 96, initial_indent="    ", subsequent_indent="    ")
        return "\n".join([*tables, f"static const Plan {name} =\n{body};\n"])


def plan(n: int, m: int, mass: Sequence[Pair], jacobian: Sequence[Pair]) -> Plan:
    """The plan for n coordinates and m constraint rows.

    `mass`: the (i, j), i >= j, of M's lower triangle; `jacobian`: the (k, j) of G; both sorted.
    A coordinate without its diagonal in `mass` has no mass of its own: there is no elimination then.
    """
    empty = Elimination(0, 1, 0, (), (0,), (), ())
    where = {pair: a for a, pair in enumerate(mass)}
    if any((i, i) not in where for i in range(n)):
        return Plan(0, 1, empty, (), (), (0,), (), (), empty, (0,), (), ())
    rows: list[list[Pair]] = [[] for _ in range(m)]  # of W^T: (position, where the value is)
    masses = empty
    diagonal: Ints = ()
    values: Ints = ()
    if len(mass) == n:
        for a, (k, j) in enumerate(jacobian):
            rows[k].append((j, a))
    else:
        masses = eliminate(n, mass)
        diagonal = tuple(where[i, i] for i in masses.order)
        values = tuple(
            where.get((max(pair), min(pair)), -1)
            for p in range(n)
            for pair in ((masses.order[p], masses.order[q]) for q in masses.row(p))
        )
        rows = _reach(masses, m, jacobian)
    start = _running([len(row) for row in rows])
    shared: dict[int, list[Pair]] = defaultdict(list)  # position: (row, index in W)
    for k, row in enumerate(rows):
        for a, (j, _) in enumerate(row, start[k]):
            shared[j].append((k, a))
    pairs: dict[Pair, list[Pair]] = defaultdict(list)
    for users in shared.values():
        for s, (k, a) in enumerate(users):
            for above, b in users[:s]:
                pairs[k, above].append((a, b))
    schur = eliminate(m, pairs)
    lists = [
        pairs.get((i, k)) or [(b, a) for a, b in pairs.get((k, i), ())]
        for i, k in ((schur.order[p], schur.order[q]) for p in range(m) for q in schur.row(p))
    ]
    full = masses is not empty
    return Plan(
        diagonal=int(not full),
        massless=0,
        mass=masses,
        mass_diagonal=diagonal,
        mass_value=values,
        w_start=start if full else (0,),
        w_column=tuple(j for row in rows for j, _ in row) if full else (),
        w_value=tuple(a for row in rows for _, a in row) if full else (),
        schur=schur,
        pair_start=_running([len(some) for some in lists]),
        pair_a=tuple(a for some in lists for a, _ in some),
        pair_b=tuple(b for some in lists for _, b in some),
    )


def eliminate(size: int, pairs: Iterable[Pair]) -> Elimination:
    """Order of minimum degree, and pattern of L, for a symmetric matrix with non-zeros at `pairs`."""
    near: list[set[int]] = [set() for _ in range(size)]
    for i, j in pairs:
        if i != j:
            near[i].add(j)
            near[j].add(i)
    widest = 1 + max(map(len, near), default=0)
    queue = [(len(near[i]), i, i) for i in range(size)]  # degree, how long it waits, which
    heapq.heapify(queue)
    waiting = size
    position = [-1] * size
    order: list[int] = []
    columns: list[set[int]] = []
    while queue:
        degree, _, i = heapq.heappop(queue)
        if position[i] >= 0 or degree != len(near[i]):
            continue  # eliminated, or its degree has changed since
        position[i] = len(order)
        order.append(i)
        columns.append(near[i])
        for j in sorted(near[i]):
            near[j] |= near[i]
            near[j] -= {i, j}
            heapq.heappush(queue, (len(near[j]), waiting, j))
            waiting += 1
    rows: list[list[int]] = [[] for _ in range(size)]
    for p, column in enumerate(columns):
        for i in column:
            rows[position[i]].append(p)
    parent = [min((position[i] for i in column), default=-1) for column in columns]
    overlap = [_height(p, row, parent) for p, row in enumerate(rows)]
    return Elimination(
        size=size,
        forest=int(all(height <= 1 for height in overlap)),
        widest=widest,
        order=tuple(order),
        start=_running([len(row) for row in rows]),
        column=tuple(q for row in rows for q in row),
        overlap=tuple(overlap),
    )


def _height(p: int, row: Sequence[int], parent: Sequence[int]) -> int:
    """Longest path of the elimination tree within the non-zeros of row p of L.

    Row q of L^-1 is non-zero at the descendants of q only: so many of them meet in one column.
    """
    height = dict.fromkeys(row, 1)
    for q in row:
        if parent[q] != p:
            height[parent[q]] = max(height[parent[q]], height[q] + 1)
    return max(height.values(), default=0)


def _reach(masses: Elimination, m: int, jacobian: Sequence[Pair]) -> list[list[Pair]]:
    """Non-zeros of W = L^-1 P G^T by rows of G: (position, index in G or -1 for fill)."""
    position = {i: p for p, i in enumerate(masses.order)}
    parent = [-1] * masses.size
    for p in reversed(range(masses.size)):
        for q in masses.row(p):
            parent[q] = p  # ends at the smallest row that holds q
    rows: list[dict[int, int]] = [{} for _ in range(m)]
    for a, (k, j) in enumerate(jacobian):
        rows[k][position[j]] = a
    for row in rows:
        for p in list(row):
            above = parent[p]
            while above >= 0 and above not in row:
                row[above] = -1
                above = parent[above]
    return [sorted(row.items()) for row in rows]


def _running(lengths: Iterable[int]) -> Ints:
    """0 and the running sums."""
    sums = [0]
    for length in lengths:
        sums.append(sums[-1] + length)
    return tuple(sums)


def _initializer(part: Any, name: str, tables: list[str]) -> str:
    """`{...}` of a Plan or Elimination; its arrays are appended to `tables`."""
    written = []
    for member in fields(part):
        value = getattr(part, member.name)
        if isinstance(value, int):
            written.append(str(value))
        elif isinstance(value, Elimination):
            written.append(_initializer(value, f"{name}_{member.name}", tables))
        else:
            table = f"{name}_{member.name}"
            numbers = ", ".join(map(str, value or (0,)))  # C99 knows no empty array
            head = f"static const int {table}[] = {{"
            if len(head) + len(numbers) > 96:
                numbers = "\n" + textwrap.indent(textwrap.fill(numbers, 92), "    ")
            tables.append(f"{head}{numbers}}};")
            written.append(table)
    return "{" + ", ".join(written) + "}"
