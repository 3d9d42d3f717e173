"""What is closed (attitude.py) -> steps that compute it: matrices, then vectors, each once.

rotation           R of e                          across             x = w x s
rotation_change    dR of e and de                  across_change      dw x s + w x ds
turned             u = R s                         levers             R (e_k x s) of the three axes k
turned_change      u = dR s + R ds
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import sympy as sp

from ..numeric.closed import OPERATIONS
from .attitude import Attitude, AttitudeChange, Carried, CarriedChange, ClosedFunction
from .elements import Expr

Place = tuple[str, int]  # of an array, and in it
VECTOR = "vector"
SIZES = {"rotation": 9, "rotation_change": 9, "levers": 9}  # of what a step computes; of others 3
AXES = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass(frozen=True)
class Step:
    """`name` = operation(arguments), names of other steps; a "vector" consists of `numbers`."""

    name: str
    operation: str
    arguments: tuple[str, ...] = ()
    numbers: tuple[Expr, ...] = ()

    @property
    def size(self) -> int:
        """How many numbers it holds."""
        return len(self.numbers) or SIZES.get(self.operation, 3)


@dataclass
class Closing:
    """Collects the steps; `fresh` makes the name of an array from its first letter."""

    fresh: Callable[[str], str]
    _steps: dict[object, Step] = field(default_factory=dict)

    @property
    def steps(self) -> list[Step]:
        """In the order in which they are needed."""
        return list(self._steps.values())

    def opened(self, values: Sequence[Expr]) -> tuple[list[Expr], dict[Expr, Place]]:
        """The values with symbols for what is closed, and where each of these stands."""
        while flat := {a: a.opened() for a in _closed(values) if _flat(a)}:
            values = [e.xreplace(flat) for e in values]
        table = {a: sp.Symbol(f"closed {k:05}", real=True) for k, a in enumerate(_closed(values))}
        places = {s: self._place(a) for a, s in table.items()}
        return [e.xreplace(table) for e in values], places

    def _place(self, a: ClosedFunction) -> Place:
        if isinstance(a, Attitude | AttitudeChange):
            e, de = a.args[2:6], a.args[6:]
            matrix = self._matrix_change(e, de) if de else self._matrix(e)
            return matrix, 3 * int(a.args[0]) + int(a.args[1])
        order, i = map(int, a.args[:2])
        e, s, w, de, dw = (
            tuple(a.args[j:k]) for j, k in ((2, 6), (6, 9), (9, 12), (12, 16), (16, 19))
        )
        at = self._vector(s)
        if w in AXES and not any(dw):
            R = self._matrix_change(e, de) if de else self._matrix(e)
            return self._step("L", "levers", R, at), 3 * AXES.index(w) + i
        change = ""
        for _ in range(order):
            by = self._vector(w)
            if de:
                dby = self._vector(dw)
                before = change or self._vector((sp.S.Zero,) * 3)
                change = self._step("x", "across_change", by, dby, at, before)
            at = self._step("x", "across", by, at)
        if not de:
            return self._step("u", "turned", self._matrix(e), at), i
        dR = self._matrix_change(e, de)
        if not change:
            return self._step("u", "turned", dR, at), i
        return self._step("u", "turned_change", self._matrix(e), dR, at, change), i

    def _matrix(self, e: tuple[Expr, ...]) -> str:
        return self._step("R", "rotation", self._vector(e))

    def _matrix_change(self, e: tuple[Expr, ...], de: tuple[Expr, ...]) -> str:
        return self._step("R", "rotation_change", self._vector(e), self._vector(de))

    def _vector(self, numbers: tuple[Expr, ...]) -> str:
        if numbers not in self._steps:
            self._steps[numbers] = Step(self.fresh("s"), VECTOR, (), numbers)
        return self._steps[numbers].name

    def _step(self, letter: str, operation: str, *arguments: str) -> str:
        key = operation, arguments
        if key not in self._steps:
            self._steps[key] = Step(self.fresh(letter), operation, arguments)
        return self._steps[key].name


def _closed(values: Sequence[Expr]) -> Iterator[ClosedFunction]:
    """Each once, in a fixed order."""
    seen: set[Expr] = set()
    for e in values:
        stack = [e]
        while stack:
            node = stack.pop()
            if node in seen:
                continue
            seen.add(node)
            if isinstance(node, ClosedFunction):
                yield node
            else:
                stack.extend(node.args)


def _flat(a: ClosedFunction) -> bool:
    """A direction along an axis of the body: columns of R, which are there."""
    if not isinstance(a, Carried | CarriedChange) or (a.args[12:] and a.args[0] != 0):
        return False
    return all(x.is_number for x in a.vector) and sum(x != 0 for x in a.vector) == 1


def computed(steps: Sequence[Step], known: Mapping[Expr, Any]) -> dict[str, list[Any]]:
    """The arrays of steps without changes; `known`: what stands for the symbols, of which each number is
    one, or it is a number."""
    found: dict[str, list[Any]] = {}
    for step in steps:
        if step.operation == VECTOR:
            found[step.name] = [known[x] if x in known else float(x) for x in step.numbers]
        else:
            found[step.name] = OPERATIONS[step.operation](*map(found.__getitem__, step.arguments))
    return found
