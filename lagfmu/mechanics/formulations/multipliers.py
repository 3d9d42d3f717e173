"""Multipliers as formulas, where the system is small:

    (G M^-1 G^T) lambda = gamma - G M^-1 F          (Ascher & Petzold 1998, sect. 10.2)

with all constraints acting, contacts closed.  In a large system the formula would be no help, and its
derivation no end.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy as sp

from ...errors import DerivationError
from ...model.elements import Expr

MOST, OPERATIONS = 6, 400  # coordinates and constraints together; operations of M, G, F and gamma


def multipliers(name: str, M: Any, G: Any, F: Sequence[Expr], gamma: Sequence[Expr]) -> list[Expr]:
    """lambda (m) of  M vdot = F + G^T lambda,  G vdot = gamma  of the model `name`.

    Raises DerivationError where the system is too large, or M or G M^-1 G^T has no inverse.
    """
    m, n = G.shape
    size = n + m
    entries = [*M.todok().values(), *G.todok().values(), *F, *gamma]
    work = int(sum(sp.count_ops(e) for e in entries))
    if size > MOST or work > OPERATIONS:
        raise DerivationError(
            f"{name}: lambda as a formula is for small systems, expected at most {MOST} "
            f"coordinates and constraints together (here {size}) and {OPERATIONS} operations (here {work}); "
            "simulate it, or read the equations G vdot = gamma and M vdot = F + G^T lambda"
        )
    if not m:
        return []
    M, G = sp.Matrix(M), sp.Matrix(G)
    try:
        solved = M.LUsolve(G.T.row_join(sp.Matrix(F)))
        schur = (G * solved[:, :m]).applyfunc(sp.simplify)
        right = (sp.Matrix(gamma) - G * solved[:, m:]).applyfunc(sp.simplify)
        return [sp.simplify(e) for e in schur.LUsolve(right)]
    except (sp.matrices.exceptions.NonInvertibleMatrixError, ValueError, ZeroDivisionError):
        raise DerivationError(
            f"{name}: M or G M^-1 G^T has no inverse (a coordinate without mass, or redundant "
            "constraints): lambda has no formula of its own"
        ) from None
