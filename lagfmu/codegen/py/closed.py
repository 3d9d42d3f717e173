"""Matrices and vectors of closed functions as Python: calls of numeric/closed.py."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from ...model.closing import VECTOR, Step
from ...model.elements import Expr


def calls(steps: Sequence[Step], printed: Callable[[Expr], str]) -> Iterator[str]:
    """Assignments, in order."""
    for step in steps:
        if step.operation == VECTOR:
            yield f"{step.name} = [{', '.join(map(printed, step.numbers))}]"
        else:
            yield f"{step.name} = {step.operation}({', '.join(step.arguments)})"
