"""Giving up: what cannot be decided, and what is not found with the effort allowed.

The zero problem is undecidable for the expressions that SymPy can write down (Richardson, *Journal of
Symbolic Logic* 33, 1968): an answer may be "undecided", and every search has an end.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from sympy import PolynomialError

_SPENT: ContextVar[float] = ContextVar("spent", default=0.0)
_UNTIL: ContextVar[float] = ContextVar("until", default=math.inf)


class Undecided(Exception):  # noqa: N818 (an answer rather than an error)
    """It cannot be decided whether `expr` is zero."""

    def __init__(self, expr: Any, reason: str) -> None:
        self.expr = expr
        self.reason = reason
        super().__init__(f"{reason}: {expr}")


# what a method of the search may raise: it has then found nothing
FAILURES = (
    Undecided,
    ArithmeticError,
    NotImplementedError,
    PolynomialError,
    RecursionError,
    TypeError,
    ValueError,
)


def spend(effort: float) -> None:
    """Work that is about to be done; 1 is a product of two terms, some microseconds.

    Effort is counted from the sizes of what is worked on, never measured: what is found, and what is
    given up, is the same on every machine and under any load.
    """
    _SPENT.set(_SPENT.get() + effort)


@contextmanager
def within(effort: float) -> Iterator[None]:
    """Towers made within this block decide nothing after so much effort."""
    token = _UNTIL.set(deadline(effort))
    try:
        yield
    finally:
        _UNTIL.reset(token)


def deadline(effort: float) -> float:
    """Where so much more has been spent, or what the innermost `within` allows if that is less."""
    return min(_SPENT.get() + effort, _UNTIL.get())


def spent_beyond(limit: float) -> bool:
    """More has been spent than a `deadline` allows."""
    return _SPENT.get() > limit


def late() -> bool:
    """What the innermost `within` allows is spent."""
    return spent_beyond(_UNTIL.get())
