"""Giving up: what cannot be decided, and what is not found in the time allowed.

The zero problem is undecidable for the expressions that SymPy can write down (Richardson, *Journal of
Symbolic Logic* 33, 1968): an answer may be "undecided", and every search has an end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from sympy import PolynomialError

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


@contextmanager
def within(seconds: float) -> Iterator[None]:
    """Towers made within this block decide nothing after so many seconds."""
    token = _UNTIL.set(deadline(seconds))
    try:
        yield
    finally:
        _UNTIL.reset(token)


def deadline(seconds: float) -> float:
    """The moment after so many seconds, or that of the innermost `within` if it is earlier."""
    return min(time.monotonic() + seconds, _UNTIL.get())


def late() -> bool:
    """The time of the innermost `within` is over."""
    return time.monotonic() > _UNTIL.get()
