"""Multipliers as formulas, where the system is small:

    (G M^-1 G^T) lambda = gamma - G M^-1 F          (Ascher & Petzold 1998, sect. 10.2)

with all constraints acting, contacts closed.  In a large system the formula would be no help, and its
derivation no end.
"""

from __future__ import annotations

import sympy as sp

from ...errors import DerivationError
from ...model.elements import Expr
from ..equations import TIME, EquationsOfMotion

MOST, OPERATIONS = 6, 400  # coordinates and constraints together; operations of M, G, F and gamma


def multipliers(eom: EquationsOfMotion) -> dict[str, Expr]:
    """Constraint -> lambda in q, v, t and parameters [J/[f]; W/[expression] if nonholonomic].

    Raises DerivationError where the system is too large, or M or G M^-1 G^T has no inverse.
    """
    size = eom.n + eom.m
    entries = [*eom.M.todok().values(), *eom.G.todok().values(), *eom.F, *eom.gamma]
    work = int(sum(sp.count_ops(e) for e in entries))
    if size > MOST or work > OPERATIONS:
        raise DerivationError(
            f"{eom.model.name}: lambda as a formula is for small systems, expected at most {MOST} "
            f"coordinates and constraints together (here {size}) and {OPERATIONS} operations (here {work}); "
            "simulate it, or read the equations G vdot = gamma and M vdot = F + G^T lambda"
        )
    if not eom.m:
        return {}
    M, G = eom.M.as_explicit().as_mutable(), eom.G.as_explicit().as_mutable()
    F, gamma = sp.Matrix(eom.F), sp.Matrix(eom.gamma)
    try:
        solved = M.LUsolve(G.T.row_join(F))
        schur = (G * solved[:, : eom.m]).applyfunc(sp.simplify)
        right = (gamma - G * solved[:, eom.m :]).applyfunc(sp.simplify)
        found = schur.LUsolve(right)
    except (sp.matrices.exceptions.NonInvertibleMatrixError, ValueError, ZeroDivisionError):
        raise DerivationError(
            f"{eom.model.name}: M or G M^-1 G^T has no inverse (a coordinate without mass, or redundant "
            "constraints): lambda has no formula of its own"
        ) from None
    back = {plain: model for model, plain in eom.symbols.items()} | {TIME: sp.Symbol("t")}
    return {
        c.name: sp.simplify(lam).xreplace(back)
        for c, lam in zip(eom.constraints, found, strict=True)
    }
