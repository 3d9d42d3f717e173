"""Conditions on a mechanism as numbers: their values, and their rates, which are affine in the speeds.

Those that are alike are evaluated together, by the function of one of them over arrays.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from scipy.sparse import csr_array
from sympy.core.function import AppliedUndef

from ..model.attitude import Closing, Pattern, Place, computed, pattern
from ..model.differential import Differential
from ..model.elements import TIME, Constraint, Expr, Nonholonomic, Tie
from ..model.model import Model
from ..numeric.system import Sparse

Array = NDArray[np.float64]


class Rows:
    """m pairs of e(q, t) and its rate a(q) v + a0(q), at t = 0 and at what parameters and inputs start with.

    A condition on velocities alone has the value 0.
    """

    def __init__(self, model: Model, pairs: Sequence[tuple[Expr, Expr]]) -> None:
        names = model.states
        n, known = len(model.coordinates), _numbers(model)
        place: dict[Expr, Place] = {s: ("qv"[j >= n], j) for j, s in enumerate(names)}
        place |= {s: ("known", j) for j, s in enumerate(known, len(names))}
        self.shape = len(pairs), len(names) - n
        kinds: dict[object, _Kind] = {}
        for i, pair in enumerate(pairs):
            found = pattern([*map(sp.sympify, pair)], place.get, "known")
            assert found is not None  # checked with the model
            kind = kinds.setdefault(found.kind, _Kind(found))
            kind.rows.append(i)
            read = zip(found.inputs, found.groups, strict=True)
            kind.inputs.append([place[s][1] if g else float(s.xreplace(known)) for s, g in read])
        names = sp.numbered_symbols()  # no dummies: lambdify would replace them one by one
        self._kinds = [_Function(kind, n, names) for kind in kinds.values()]
        everything = [s for f in self._kinds for s in f.symbols]
        parts = [f.parts for f in self._kinds]
        self._made = sp.lambdify(everything, parts, "numpy") if parts else lambda: []
        self._known = np.array([*map(float, known.values())])

    def _at(self, q: Array) -> Iterator[tuple[_Function, Array]]:
        """Of each kind (value, rate without speeds, slopes by the speeds that it reads), of all its rows."""
        x = np.concatenate([q, np.zeros(self.shape[1]), self._known])
        found = self._made(*(value for f in self._kinds for value in f.read(x)))
        for f, parts in zip(self._kinds, found, strict=True):
            yield f, np.array([np.broadcast_to(part, f.rows.shape) for part in parts])

    def values(self, q: Array) -> Array:
        """e(q) (m)."""
        found = np.zeros(self.shape[0])
        for f, parts in self._at(q):
            found[f.rows] = parts[0]
        return found

    def values_and_slopes(self, q: Array) -> tuple[Array, Array]:
        """e(q) (m), and the slopes of its rate by the speeds (m, n_v)."""
        found, slopes = np.zeros(self.shape[0]), np.zeros(self.shape)
        for f, parts in self._at(q):
            found[f.rows] = parts[0]
            slopes[f.rows[:, None], f.speeds] = parts[2:].T
        return found, slopes

    def rates(self, q: Array, v: Array) -> Array:
        """Their rates (m)."""
        return self.slopes(q) @ v + self.drifts(q)

    def drifts(self, q: Array) -> Array:
        """Their rates while the speeds are 0 (m)."""
        found = np.zeros(self.shape[0])
        for f, parts in self._at(q):
            found[f.rows] = parts[1]
        return found

    def slopes(self, q: Array) -> Array:
        """Their slopes by the speeds (m, n_v)."""
        return self.values_and_slopes(q)[1]

    def sparse_slopes(self, q: Array) -> Sparse:
        """The same, sparse."""
        found = [(np.zeros(0), np.zeros(0, dtype=int), np.zeros(0, dtype=int))]
        for f, parts in self._at(q):
            rows = np.broadcast_to(f.rows[:, None], f.speeds.shape)
            found.append((parts[2:].T.ravel(), rows.ravel(), f.speeds.ravel()))
        values, row, speed = map(np.concatenate, zip(*found, strict=True))
        return csr_array((values, (row, speed)), self.shape)


@dataclass
class _Kind:
    """Rows of one pattern, and what each reads: a place in q, v and the known numbers, or a number."""

    pattern: Pattern
    rows: list[int] = field(default_factory=list)
    inputs: list[list[Any]] = field(default_factory=list)


class _Function:
    """The `rows` of a kind and the `speeds` that each reads; `parts` are their value, their rate without
    speeds and its slopes, in `symbols`."""

    def __init__(self, kind: _Kind, n: int, names: Iterator[Expr]) -> None:
        symbols, groups = kind.pattern.symbols, kind.pattern.groups
        value, rate = kind.pattern.values
        v = [s for s, group in zip(symbols, groups, strict=True) if group == "v"]
        parts = [
            value,
            rate.xreplace(dict.fromkeys(v, sp.S.Zero)),
            *(Differential({s: sp.S.One})(rate) for s in v),
        ]
        numbers = count()
        self._closing = Closing(lambda letter: f"{letter}{next(numbers)}")
        self.parts, places = self._closing.opened(parts)
        self._inputs = symbols
        used = set().union(*(e.free_symbols for e in self.parts))
        self._closed = [(s, place) for s, place in places.items() if s in used]
        self._plain = [k for k, s in enumerate(symbols) if s in used]
        read = [*(symbols[k] for k in self._plain), *(s for s, _ in self._closed)]
        table = {s: next(names) for s in read}
        self.parts = [e.xreplace(table) for e in self.parts]
        self.symbols = [*table.values()]
        self.rows = np.array(kind.rows)
        columns = [np.array(column) for column in zip(*kind.inputs, strict=True)]
        self._columns = [(c, group) for c, group in zip(columns, groups, strict=True)]
        speeds = [c - n for c, group in self._columns if group == "v"]
        self.speeds = np.array(speeds, dtype=int).reshape(len(v), len(self.rows)).T

    def read(self, x: Array) -> Iterator[Array]:
        """What stands for the symbols, an array each."""
        inputs = [x[c] if group else c for c, group in self._columns]
        yield from (inputs[k] for k in self._plain)
        known = dict(zip(self._inputs, inputs, strict=True))
        found = computed(self._closing.steps, known)
        for _, (name, k) in self._closed:
            yield found[name][k]


def _numbers(model: Model) -> dict[Expr, Expr]:
    """What is known at the start besides the motion."""
    found = {p.symbol: sp.Float(p.value, 17) for p in model.parameters}
    found |= {i.symbol: sp.Float(i.start, 17) for i in model.inputs}
    found |= {i.symbol.diff(TIME): sp.Float(i.rate, 17) for i in model.prescribed}
    return found | {TIME: sp.S.Zero}


def condition(model: Model, c: Constraint) -> tuple[Expr, Expr]:
    """The value and the rate of a constraint."""
    if isinstance(c, Nonholonomic):
        return sp.S.Zero, c.expression
    if isinstance(c, Tie):
        return c.expression, c.rates[0]
    f = sp.sympify(c.expression)
    moving = sorted(f.atoms(AppliedUndef), key=str)
    rate = sp.Add(*(f.diff(s) * model.kinematics.get(s, s.diff(TIME)) for s in moving))
    still = {s: sp.Dummy(str(s)) for s in moving}
    partial = f.xreplace(still).diff(TIME).xreplace({d: s for s, d in still.items()})
    return f, rate + partial


def numbers_of(model: Model, expressions: Sequence[Expr]) -> Array:
    """Expressions that hold parameters alone."""
    return Rows(model, [(e, sp.S.Zero) for e in expressions]).values(
        np.zeros(len(model.coordinates))
    )
