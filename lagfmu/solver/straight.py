"""The solution of linear.py written out for one small system, where nothing can go wrong.

    S = G M^-1 G^T ,   S lambda = gamma - G M^-1 F ,   x = M^-1 (F + G^T lambda)

by L D L^T of M and of S (Golub & Van Loan, sect. 4.1.2), in straight-line Python over the entries that are
not structurally zero: for a few coordinates the calls of NumPy cost many times what they compute.

It answers only where M and S, scaled to a unit diagonal, are so well conditioned that the ladder would not
refine either.  With the determinant d of such a matrix of order k, the product of its relative pivots, its
smallest eigenvalue is at least d ((k - 1)/k)^(k - 1) > d/e (Merikoski & Virtanen 1997).  All else, a value
that is not finite among it, is left to the ladder.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ..numeric.system import System
from .schur import EXACT

LONGEST = 600  # lines, beyond which NumPy is as fast
LEAST = 1e-250  # of a pivot's diagonal: below, squares may have lost digits

Solver = Callable[..., tuple[list[float], list[float]] | None]


class _Text:
    """Lines of a function, and symmetric matrices and vectors of names in them; what is absent is zero."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def let(self, name: str, terms: Sequence[str], first: str | None = None) -> str | None:
        """name = first - terms; None, and no line, if there are no terms."""
        if not terms:
            return first
        self.lines.append(f"{name} = {' - '.join([first or '0.0', *terms])}")
        return name

    def factor(
        self, a: dict[tuple[int, int], str], n: int, name: str
    ) -> tuple[dict[tuple[int, int], str], list[str]] | None:
        """L (i > j) and D of the matrix a (lower triangle) = L D L^T, checked."""
        L: dict[tuple[int, int], str] = {}
        LD: dict[tuple[int, int], str] = {}
        D: list[str] = []
        determinant = ""
        for j in range(n):
            if (j, j) not in a:
                return None
            terms = [f"{L[j, k]} * {LD[j, k]}" for k in range(j) if (j, k) in L]
            d = self.let(f"{name}d{j}", terms, a[j, j])
            assert d is not None
            D.append(d)
            if terms:
                determinant += f" * ({d} / {a[j, j]})"
                # a negative pivot must not hide behind another
                self.lines.append(f"if not {d} > 0.0: return None")
            self.lines.append(f"if not {a[j, j]} > {LEAST!r}: return None")
            for i in range(j + 1, n):
                terms = [
                    f"{L[i, k]} * {LD[j, k]}" for k in range(j) if (i, k) in L and (j, k) in LD
                ]
                entry = self.let(f"{name}w{i}_{j}", terms, a.get((i, j)))
                if entry is not None:
                    LD[i, j] = entry
                    L[i, j] = f"{name}l{i}_{j}"
                    self.lines.append(f"{L[i, j]} = {entry} / {d}")
        if determinant:
            self.lines.append(f"if not {determinant[3:]} >= {EXACT!r}: return None")
        return L, D

    def forward(
        self, L: dict[tuple[int, int], str], b: dict[int, str], name: str
    ) -> dict[int, str]:
        """y of L y = b."""
        y: dict[int, str] = {}
        n = max([*b, *(i for i, _ in L)], default=-1) + 1
        for i in range(n):
            terms = [f"{L[i, k]} * {y[k]}" for k in range(i) if (i, k) in L and k in y]
            entry = self.let(f"{name}{i}", terms, b.get(i))
            if entry is not None:
                y[i] = entry
        return y

    def backward(self, L: dict[tuple[int, int], str], z: Sequence[str], name: str) -> list[str]:
        """x of L^T x = z."""
        x = list(z)
        for i in reversed(range(len(z))):
            terms = [f"{L[k, i]} * {x[k]}" for k in range(i + 1, len(z)) if (k, i) in L]
            entry = self.let(f"{name}{i}", terms, z[i])
            assert entry is not None
            x[i] = entry
        return x


def solver_of(system: System, rows: Sequence[int]) -> Solver | None:
    """solve(M values, F, G values, gamma) -> x (n), lambda of `rows`, or None where the ladder must decide.

    The values are those of `system.dynamics`.  None for a system too large for it, or with a coordinate
    without mass; one that asks for the null space has its own way.
    """
    key = tuple(rows)
    if key not in system.written:
        asked = system.formulation != "nullspace" or not key
        system.written[key] = _written(system, key) if asked else None
    solver: Solver | None = system.written[key]
    return solver


def _written(system: System, rows: Sequence[int]) -> Solver | None:
    text, n, m = _Text(), system.n, system.m
    M = {(i, j): f"m{k}" for k, (i, j) in enumerate(zip(*system.mass, strict=True))}
    place = {row: a for a, row in enumerate(rows)}
    G: list[dict[int, str]] = [{} for _ in rows]
    taken = []
    for k, (row, j) in enumerate(zip(*system.jacobian, strict=True)):
        taken.append(f"g{k}" if row in place else "_")
        if row in place:
            G[place[row]][j] = f"g{k}"
    found = text.factor(M, n, "m")
    if found is None:
        return None
    L, D = found
    V = [text.forward(L, column, f"v{a}_") for a, column in enumerate(G)]
    y = text.forward(L, {i: f"f{i}" for i in range(n)}, "y")
    U = []  # D^-1 V
    for a, column in enumerate(V):
        text.lines += [f"u{a}_{i} = {entry} / {D[i]}" for i, entry in column.items()]
        U.append({i: f"u{a}_{i}" for i in column})
    S: dict[tuple[int, int], str] = {}
    for a in range(len(rows)):
        for b in range(a + 1):
            terms = [f"{V[a][i]} * {U[b][i]}" for i in V[a] if i in U[b]]
            if terms:
                S[a, b] = f"s{a}_{b}"
                text.lines.append(f"s{a}_{b} = {' + '.join(terms)}")
    found = text.factor(S, len(rows), "s")
    if found is None or len(text.lines) > LONGEST:
        return None
    C, E = found
    right = {}
    for a, row in enumerate(rows):
        terms = [f"{U[a][i]} * {y[i]}" for i in U[a]]
        right[a] = text.let(f"r{a}", terms, f"c{row}") or f"c{row}"
    z = text.forward(C, right, "z")
    text.lines += [f"e{a} = {z[a]} / {E[a]}" for a in range(len(rows))]
    lam = text.backward(C, [f"e{a}" for a in range(len(rows))], "k")
    for i in range(n):
        terms = [f"{U[a][i]} * {lam[a]}" for a in range(len(rows)) if i in U[a]]
        text.lines.append(f"p{i} = {' + '.join([f'{y[i]} / {D[i]}', *terms])}")
    x = text.backward(L, [f"p{i}" for i in range(n)], "x")
    sum_of_all = " + ".join([*x, *lam]) or "0.0"
    unpacked = [
        (", ".join(f"m{k}" for k in range(len(M))), "mass"),
        (", ".join(f"f{i}" for i in range(n)), "F"),
        (", ".join(taken), "G"),
        (", ".join(f"c{k}" if k in place else "_" for k in range(m)), "gamma"),
    ]
    lines = [
        "def solve(mass, F, G, gamma):",
        *(f"    {names}, = {whole}" for names, whole in unpacked if names),
        *(f"    {line}" for line in text.lines),
        f"    if ({sum_of_all}) * 0.0 != 0.0: return None",  # inf or NaN
        f"    return [{', '.join(x)}], [{', '.join(lam)}]",
    ]
    scope: dict[str, Any] = {}
    exec(compile("\n".join(lines) + "\n", "<lagfmu solution>", "exec"), scope)
    solver: Solver = scope["solve"]
    return solver
