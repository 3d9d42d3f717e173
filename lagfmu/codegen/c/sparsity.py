"""What the zeros of a model save: order and solution of an elimination, and columns found at once.

The order of the sparse elimination that the native solver follows, found when an FMU is built.

    P M P^T = L D L^T ,   W = L^-1 P G^T ,   S = G M^-1 G^T = W^T D^-1 W ,   P' S P'^T = L' D' L'^T

Both orders are of minimum degree (Rose 1972; Davis, Direct Methods for Sparse Linear Systems, 2006,
sect. 7.1).  Of equal degrees the one that has waited longest comes first: a chain burns from both
ends, and the two halves do not wait for one another.  Where coordinates couple as in a chain, work
and memory grow linearly with its length.

The solution of  M x = b + G^T lambda ,  G x = c  written out as C for a small system.

    S lambda = c - G M^-1 b ,   S = G M^-1 G^T = L D L^T ,   x = M^-1 (b + G^T lambda)

It is what the runtime's schur.c and ldlt.c do by the index lists of the plan, term by term,
for a diagonal M and all rows acting, under the same bound of the condition number: a loop over lists
costs several times the arithmetic of a system this small.

Which columns of a matrix can be found at once: those of which no two stand in one row.  Of two matrices:

    b and c by (t, q, v, u) in  M dvdot = b + G^T dlambda ,  G dvdot = c     (runtime/mechanics/sensitivity.c)
    rates of joint coordinates by speeds                          (runtime/simulation/joint_coordinates.c)

The columns of a row exclude each other; each column gets the first group in which none is that it
excludes (Curtis, Powell & Reid, On the estimation of sparse Jacobian matrices, 1974).  Of a chain of
bodies there are as many groups as three neighbours have coordinates and speeds, however long it is.

The order in which a square G is lower triangular in blocks, for runtime/linear/square.c.  Each row is
matched with a column in which it has an entry; a row leads to the rows with which its other columns are
matched, and rows that lead to each other are one block (Duff, Erisman & Reid, Direct Methods for Sparse
Matrices, ch. 6).
"""

from __future__ import annotations

import heapq
import textwrap
from collections import Counter, defaultdict
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields
from graphlib import TopologicalSorter
from itertools import chain, count
from typing import Any

import numpy as np
import sympy as sp
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

from ...model.elements import Expr
from ..parts import Parts

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


MOST_PRODUCTS = 1500  # beyond, the code is larger than the lists are slow
WIDTH = 100


def solve_source(name: str, n: int, entries: Sequence[tuple[int, int]], plan: Plan) -> str | None:
    """C text of the function `name` (`solve` in system.h); None if the system is not small and plain.

    `entries` are the (k, j) of G, sorted; `plan` is the one of M and G.
    """
    if not plan.diagonal or len(plan.pair_a) + len(plan.schur.column) ** 2 > MOST_PRODUCTS:
        return None
    writer = _Writer(n, entries, plan)
    lines = [*writer.factor(), *writer.judge(), *writer.substitute()]
    if writer.products > MOST_PRODUCTS:
        return None
    head = (
        "/* x, lambda of  M x = b + G^T lambda,  G x = c  with all rows acting: the elimination of the\n"
        " * plan written out; 0 where it is not safe. */\n"
        f"static inline int {name}(const double *M, const double *b, const double *G, const double *c,\n"
        f"{' ' * (len(name) + 19)}double *x, double *lambda) {{\n"
    )
    unused = "" if plan.schur.size else "    (void)G; (void)c; (void)lambda;\n"
    return head + unused + "".join(_wrapped(line) for line in lines) + "}\n"


def accelerate_source(prefix: str, sizes: Sequence[int]) -> str:
    """C text of `accelerate` in system.h: the functions `dynamics` and `solve` in one, whose values stay in
    registers between them.  `sizes` are those of M, F, G, nu and gamma."""
    names = ("M", "F", "G", "nu", "gamma", "lambda")
    values = [f"{a}[{max(1, n)}]" for a, n in zip(names, (*sizes, sizes[-1]), strict=True)]
    head = f"static int {prefix}accelerate("
    return (
        "/* vdot at a state with all rows acting; 0 where that is not safe. */\n"
        f"{head}double t, const double *q, const double *v, const double *u,\n"
        f"{' ' * len(head)}const double *p, double *vdot) {{\n"
        f"    double {', '.join(values)};\n"
        f"    {prefix}dynamics(t, q, v, u, p, M, F, G, nu, gamma);\n"
        f"    return {prefix}solve(M, F, G, gamma, vdot, lambda);\n"
        "}\n"
    )


class _Writer:
    """i: 1 / M; h: G M^-1; a: diagonal of S; y, l, p: a row of L D and of L, its pivot; d = 1 / p."""

    def __init__(self, n: int, entries: Sequence[tuple[int, int]], plan: Plan) -> None:
        self.n, self.plan, self.schur, self.entries = n, plan, plan.schur, entries
        self.rows: list[list[tuple[int, int]]] = [[] for _ in range(plan.schur.size)]
        for e, (k, j) in enumerate(entries):
            self.rows[k].append((e, j))
        self.products = 0

    def sum(self, terms: Sequence[str], start: str = "") -> str:
        self.products += len(terms)
        return " ".join(([start, "+"] if start else []) + [" + ".join(terms)]) if terms else start

    def minus(self, start: str, terms: Sequence[str]) -> str:
        self.products += len(terms)
        return start + "".join(f" - {t}" for t in terms)

    def factor(self) -> list[str]:
        """S = L D L^T row by row, and r, a bound of each row of L^-1 (ldlt.c)."""
        lines = [f"const double i{j} = 1 / M[{j}];" for j in range(self.n)]
        lines += [f"const double h{e} = G[{e}] * i{j};" for e, (_, j) in enumerate(self.entries)]
        for p, k in enumerate(self.schur.order):
            columns = self.schur.row(p)
            diagonal = self.sum([f"G[{e}] * h{e}" for e, _ in self.rows[k]]) or "0"
            lines.append(f"const double a{p} = {diagonal};")
            for at, q in enumerate(columns, self.schur.start[p]):
                pairs = range(self.plan.pair_start[at], self.plan.pair_start[at + 1])
                own = self.sum(
                    [f"G[{self.plan.pair_a[t]}] * h{self.plan.pair_b[t]}" for t in pairs]
                )
                known = [f"l{q}_{r} * y{p}_{r}" for r in self.schur.row(q) if r in columns]
                lines.append(f"const double y{p}_{q} = {self.minus(own or '0', known)};")
                lines.append(f"const double l{p}_{q} = y{p}_{q} * d{q};")
            pivot = self.minus(f"a{p}", [f"y{p}_{q} * l{p}_{q}" for q in columns])
            lines += [f"const double p{p} = {pivot};", f"const double d{p} = 1 / p{p};"]
            overlap = 1 if self.schur.forest else self.schur.overlap[p]
            size = self.sum([f"l{p}_{q} * l{p}_{q} * r{q}" for q in columns])
            factor = "" if overlap == 1 else f"{overlap} * "
            lines.append(f"const double r{p} = a{p}{f' + {factor}({size})' if columns else ''};")
        return lines

    def judge(self) -> list[str]:
        """Back to the ladder unless masses are positive, pivots keep two digits, and the bound is
        below the one at which schur.c takes a solution as it is."""
        good = [f"(M[{j}] > 0)" for j in range(self.n)]
        rows = range(self.schur.size)
        good += [f"(p{p} > 0.01 * a{p})" for p in rows]
        if rows:
            trace = " + ".join(f"r{p} * d{p}" for p in rows)
            good.append(f"({self.schur.widest} * ({trace}) <= 1e6)")
        return [f"if (!({' & '.join(good)})) return 0;"]

    def substitute(self) -> list[str]:
        """lambda and x; 1 if they are finite."""
        order = self.schur.order
        lines = [f"double x{j} = b[{j}] * i{j};" for j in range(self.n)]
        for p, k in enumerate(order):
            terms = [f"G[{e}] * x{j}" for e, j in self.rows[k]]
            terms += [f"l{p}_{q} * z{q}" for q in self.schur.row(p)]
            lines.append(f"double z{p} = {self.minus(f'c[{k}]', terms)};")
        lines += [f"z{p} *= d{p};" for p in range(len(order))]
        for p in reversed(range(len(order))):
            k = order[p]
            lines += [f"z{q} -= l{p}_{q} * z{p};" for q in self.schur.row(p)]
            lines += [f"x{j} += h{e} * z{p};" for e, j in self.rows[k]]
            lines.append(f"lambda[{k}] = z{p};")
            self.products += len(self.schur.row(p)) + len(self.rows[k])
        lines += [f"x[{j}] = x{j};" for j in range(self.n)]
        parts = [f"x{j}" for j in range(self.n)] + [f"z{p}" for p in range(len(order))]
        return [*lines, f"return 0 * ({' + '.join(parts)}) == 0;"]


def _wrapped(line: str) -> str:
    """The statement, broken at its blanks."""
    rows, room = [], "    "
    for word in line.split(" "):
        if len(room) + len(word) + 1 > WIDTH and room.strip():
            rows.append(room.rstrip())
            room = "        "
        room += word + " "
    return "\n".join([*rows, room.rstrip()]) + "\n"


def blocks(n: int, jacobian: Sequence[tuple[int, int]]) -> list[tuple[list[int], list[int]]]:
    """The rows and the columns of each block, of the n rows and columns with entries at `jacobian`, each
    behind all those whose columns stand in its rows.  [] where no matching takes all rows."""
    row, column = np.array(jacobian, dtype=np.int32).reshape(-1, 2).T
    G = csr_array((np.ones(len(row), dtype=np.int8), (row, column)), shape=(n, n))
    matched = maximum_bipartite_matching(G, perm_type="column")
    if (matched < 0).any():
        return []
    of_column = np.argsort(matched)
    leads = csr_array((np.ones(len(row)), (row, of_column[column])), shape=(n, n))
    count, label = connected_components(leads, connection="strong")
    before: dict[int, set[int]] = {k: set() for k in range(count)}
    for r, c in zip(row, column, strict=True):
        before[label[r]].add(int(label[of_column[c]]))
    order = TopologicalSorter({k: found - {k} for k, found in before.items()}).static_order()
    rows = [[r for r in range(n) if label[r] == k] for k in order]
    return [(block, [int(matched[r]) for r in block]) for block in rows]
