"""The solution of  M x = b + G^T lambda ,  G x = c  written out as C for a small system.

    S lambda = c - G M^-1 b ,   S = G M^-1 G^T = L D L^T ,   x = M^-1 (b + G^T lambda)

It is what the runtime's schur.c and ldlt.c do by the plan's index lists (elimination.py), term by term,
for a diagonal M and all rows acting, under the same bound of the condition number: a loop over lists
costs several times the arithmetic of a system this small.
"""

from __future__ import annotations

from collections.abc import Sequence

from .elimination import Plan

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
