"""The tables of Radau's method IIA in s stages, of order 2 s - 1 (Hairer & Wanner II, sect. IV.5, IV.8).

    python tests/independent/radau.py      those of lagfmu/runtime/ode/radau.c

Nodes c: the roots of d^(s-1)/dx^(s-1) x^(s-1) (x - 1)^s.  z = A p'(c) for polynomials p(x) = sum_k P_k x^k
through 0 at 0 and z_i at c_i.  A^-1 = T L T^-1 with the real eigenvalue and a block [a -b; b a] for each pair
a + i b; its eigenvectors are scaled to the norm 1, those of pairs to 1 in their last component.
"""

from __future__ import annotations

from dataclasses import dataclass

import mpmath

DIGITS, TOLD = 40, 20


@dataclass(frozen=True)
class Tableau:
    """Columns and matrices of numbers of 40 digits; L: the real eigenvalue, then a, b of each pair."""

    C: mpmath.matrix
    A: mpmath.matrix
    L: mpmath.matrix
    T: mpmath.matrix
    T_INVERSE: mpmath.matrix
    P: mpmath.matrix


@mpmath.workdps(2 * DIGITS)
def tableau(s: int) -> Tableau:
    """By polynomials and eigenvectors, at twice the digits."""
    c, V, D = _nodes(s), mpmath.matrix(s, s), mpmath.matrix(s, s)
    for i in range(s):
        for k in range(s):
            V[i, k], D[i, k] = c[i] ** (k + 1), (k + 1) * c[i] ** k
    A = V * D**-1
    values, vectors = mpmath.eig(A**-1)
    tiny = mpmath.mpf(10) ** -DIGITS
    above = [k for k in range(s) if values[k].imag > -tiny]
    L, T = mpmath.matrix(s, 1), mpmath.matrix(s, s)
    for n, k in enumerate(sorted(above, key=lambda k: (values[k].imag > tiny, -values[k].real))):
        v = vectors[:, k] / vectors[s - 1, k]
        if n == 0:
            L[0], T[:, 0] = values[k].real, v.apply(mpmath.re) / mpmath.norm(v)
        else:
            L[2 * n - 1], L[2 * n] = values[k].real, values[k].imag
            T[:, 2 * n - 1], T[:, 2 * n] = v.apply(mpmath.re), -v.apply(mpmath.im)
    return Tableau(c, A, L, T, T**-1, V**-1)


def _nodes(s: int) -> mpmath.matrix:
    powers = [mpmath.mpf(0)] * (s - 1)
    powers += [mpmath.binomial(s, k) * (-1) ** (s - k) for k in range(s + 1)]
    for _ in range(s - 1):
        powers = [k * a for k, a in enumerate(powers)][1:]
    roots = mpmath.polyroots(powers[::-1], maxsteps=500, extraprec=500)
    return mpmath.matrix(sorted(r.real for r in roots))


def printed(found: Tableau) -> str:
    """As they stand in C."""
    lines = []
    for name in ("C", "L"):
        lines.append(f"static const double {name}[] = {{{_row(getattr(found, name))}}};")
    for name in ("T", "T_INVERSE", "P"):
        m = getattr(found, name)
        rows = ",\n    ".join(f"{{{_row(m[i, :])}}}" for i in range(m.rows))
        lines.append(f"static const double {name}[{m.rows}][{m.rows}] = {{\n    {rows}}};")
    return "\n".join(lines) + "\n"


def _row(numbers: mpmath.matrix) -> str:
    return ", ".join(mpmath.nstr(mpmath.chop(x, 1e-30), TOLD) for x in numbers)


if __name__ == "__main__":
    print(printed(tableau(5)))
