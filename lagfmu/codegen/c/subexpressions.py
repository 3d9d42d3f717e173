"""Common subexpressions of a list of expressions, under names that a reader of the C text understands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count

import sympy as sp
from sympy.logic.boolalg import Boolean

from ...model.elements import Expr
from .printer import POWER, TAKEN


class Names:
    """Fresh symbols, and names for them that no other symbol in `local` has."""

    def __init__(self, local: dict[Expr, str]) -> None:
        self.local = local
        self.taken = {*local.values(), *TAKEN}
        self.count = 0

    def __iter__(self) -> Iterator[Expr]:
        while True:
            yield self.fresh()

    def fresh(self) -> Expr:
        while (text := f"x{self.count}") in self.taken:
            self.count += 1
        self.count += 1
        symbol = sp.Symbol(f"common {text}", real=True)
        self.local[symbol] = text
        return symbol

    def array(self, letter: str) -> str:
        """A name for an array."""
        text = next(t for k in count() if (t := f"{letter}{k}") not in self.taken)
        self.taken.add(text)
        return text

    def describe(self, symbol: Expr, e: Expr) -> None:
        """sin(theta) is called sin_theta."""
        if len(e.args) == 1 and e.is_Function and self.local.get(e.args[0], "").isidentifier():
            text = f"{e.func.__name__}_{self.local[e.args[0]]}"
            if text not in self.taken:
                self.taken.add(text)
                self.local[symbol] = text


def common_subexpressions(
    values: Sequence[Expr], names: Names
) -> tuple[list[tuple[Expr, Expr]], list[Expr]]:
    """Common subexpressions in the order in which they are needed, and the values in their terms.

    What is printed more than once gets a name too: the base of an integer power, a square root that
    stands for x^(k/2).
    """
    found, reduced = sp.cse(values, symbols=iter(names), order="none", list=True)
    common: list[tuple[Expr, Expr]] = []
    named: dict[Expr, Expr] = {}

    def name(e: Expr) -> Expr:
        if e not in named:
            named[e] = names.fresh()
            common.append((named[e], e))
        return named[e]

    def flat(e: Expr) -> Expr:
        if not e.args or isinstance(e, Boolean):
            return e
        arguments = [flat(a) for a in e.args]
        if e.is_Pow and e.exp.is_Rational and abs(e.exp) <= POWER:
            base, exponent = arguments[0], e.exp
            if exponent.q == 2:
                return name(sp.sqrt(base)) ** exponent.p
            if exponent.q == 1 and abs(exponent) > 1 and base.args:
                return name(base) ** exponent
        if all(a is b for a, b in zip(arguments, e.args, strict=True)):
            return e
        return e.func(*arguments)

    for symbol, e in found:
        plain = e if e.is_Pow and e.exp == sp.S.Half and not e.base.args else flat(e)
        names.describe(symbol, plain)
        common.append((symbol, plain))
        named[plain] = symbol
    return common, [flat(e) for e in reduced]
