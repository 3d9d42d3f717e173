"""The total differential of an expression along a direction, by the chain rule over its nodes.

    d e(a, b, ...) = de/da da + de/db db + ...

Each node is differentiated once, and where nothing moves no term arises: the result is as sparse as the
expression, and grows linearly with it.
"""

from __future__ import annotations

from collections.abc import Mapping

import sympy as sp

from ..errors import DerivationError
from .attitude import ClosedFunction
from .elements import Expr

# their jumps are not differentiated
CONSTANT_PIECES = (sp.sign, sp.Heaviside, sp.floor, sp.ceiling)


class Differential:
    """d e for expressions e; `direction` maps a symbol to the symbol of its change.  `roots`: sqrt(x^2 + y^2)
    changes by 0 at x = y = 0, as it does in a product with what is 0 there, the drag |v| v."""

    def __init__(self, direction: Mapping[Expr, Expr], roots: bool = False) -> None:
        self.known: dict[Expr, Expr] = dict(direction)
        self.roots = roots

    def __call__(self, e: Expr) -> Expr:
        """The change of e for the changes of the symbols in it."""
        found = self.known.get(e)
        if found is None:
            found = self._of(e) if e.args else sp.S.Zero
            self.known[e] = found
        return found

    def _of(self, e: Expr) -> Expr:
        if e.is_Add:
            return sp.Add(*(self(a) for a in e.args))
        if isinstance(e, ClosedFunction):
            return e.changed(self)
        if e.is_Mul:
            return sp.Add(
                *(
                    sp.Mul(*e.args[:k], d, *e.args[k + 1 :])
                    for k, a in enumerate(e.args)
                    if (d := self(a)) != 0
                )
            )
        if e.is_Pow and self(e.exp) == 0:
            change, slope = self(e.base), e.exp * e.base ** (e.exp - 1)
            at_rest = self.roots and _is_root(e) and change != 0
            return Share(change, slope) if at_rest else slope * change
        if isinstance(e, sp.Piecewise):
            return sp.Piecewise(*((self(case.expr), case.cond) for case in e.args))
        if isinstance(e, CONSTANT_PIECES):
            return sp.S.Zero
        if isinstance(e, sp.Mod):
            x, y = e.args
            return self(x) - self(y) * sp.floor(x / y)
        return self._by_arguments(e)

    def _by_arguments(self, e: Expr) -> Expr:
        stand_in = [sp.Symbol(f"argument {k}", real=True) for k in range(len(e.args))]
        plain = e.func(*stand_in)
        back = dict(zip(stand_in, e.args, strict=True))
        terms = []
        for x, a in zip(stand_in, e.args, strict=True):
            change = self(a)
            if change == 0:
                continue
            rate = plain.diff(x)
            if rate.has(sp.Derivative, sp.Subs):
                raise DerivationError(
                    "an expression cannot be written as numeric code: the derivative of "
                    f"{e.func.__name__} is not known; use functions that C's math.h has"
                )
            terms.append(rate.xreplace(back) * change)
        return sp.Add(*terms)


def _is_root(e: Expr) -> bool:
    """True of a root of what may be 0, where it has no slope."""
    return bool(e.exp.is_number and 0 < e.exp < 1 and not e.base.is_positive)


class Share(sp.Function):  # type: ignore[misc]
    """Share(w, e) = w e, and 0 where the change w is 0, whatever e is: a root has no slope at 0."""

    is_real = True
    nargs = 2
