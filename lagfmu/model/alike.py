"""Expressions that are alike up to the names of their symbols, and to the vectors that are fixed on bodies.

The rows of two hinges differ in which bodies they tie, and in points and directions on these.  Written in
symbols that are numbered by their places, with the vectors of closed functions (attitude.py) as data, they
are the same expressions: one of each kind is differentiated, printed and compiled.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from .attitude import ClosedFunction
from .elements import Expr

Place = tuple[str, int]  # a group of symbols, and which of it


@dataclass(frozen=True)
class Pattern:
    """`values` in the symbols `symbols`, which stand for `inputs`: symbols of the `groups`, then components
    of vectors ("": numbers, or expressions of parameters)."""

    values: tuple[Expr, ...]
    symbols: tuple[Expr, ...]
    groups: tuple[str, ...]
    inputs: tuple[Expr, ...]

    @property
    def kind(self) -> object:
        """What those have in common that are alike."""
        return self.values, self.groups


@lru_cache(maxsize=1024)
def text_of(number: Expr) -> str:
    """A number as text: few are many times."""
    return str(number)


def pattern(
    values: Sequence[Expr], place_of: Callable[[Expr], Place | None], data: str
) -> Pattern | None:
    """That of expressions in symbols that have a place; None where another symbol stands in them.  Vectors
    are data if their symbols are of the group `data`."""

    def known(x: Expr) -> bool:
        """A number, or of parameters."""
        symbols = [x] if place_of(x) else x.free_symbols
        return all((place := place_of(s)) is not None and place[0] == data for s in symbols)

    places: dict[Expr, Place] = {}
    spots: dict[tuple[Expr, ...], list[tuple[str, ...]]] = {}
    closed: dict[ClosedFunction, None] = {}
    made: dict[Expr, Expr] = {}
    for k, value in enumerate(values):
        stack, seen = [value], set[Expr]()
        while stack:
            e = stack.pop()
            if e in seen:
                continue
            seen.add(e)
            if (place := place_of(e)) is not None:
                places[e] = place
            elif isinstance(e, ClosedFunction):
                closed[e] = None
                is_data = e.vector and all(map(known, e.vector))
                stack.extend((*e.args[:6], *e.args[9:]) if is_data else e.args)
                if is_data:
                    numbers = (text_of(x) for x in (*e.args[:2], *e.args[9:]) if x.is_number)
                    spots.setdefault(e.args[2:9], []).append((f"{k:6}", str(e.func), *numbers))
            elif e.is_Symbol:
                return None
            else:
                stack.extend(e.args)
    ordered = sorted(places, key=places.__getitem__)
    vectors = sorted(spots, key=lambda e: (places.get(e[0], ("", 0)), sorted(spots[e])))
    inputs = (*ordered, *(x for e in vectors for x in e[4:]))
    symbols = sp.symbols(f"a:{len(inputs)}", real=True)
    table: dict[Expr, Expr] = dict(zip(ordered, symbols, strict=False))
    vector_of = {e: symbols[len(ordered) + 3 * k :][:3] for k, e in enumerate(vectors)}
    for e in closed:
        args = [table[a] if a in table else a.xreplace(table) if a.args else a for a in e.args]
        if e.args[2:9] in vector_of:
            args[6:9] = vector_of[e.args[2:9]]
        made[e] = e.func(*args)
    table |= made
    groups = (*(places[s][0] for s in ordered), *("" for _ in range(3 * len(vectors))))
    return Pattern(tuple(v.xreplace(table) for v in values), symbols, groups, inputs)
