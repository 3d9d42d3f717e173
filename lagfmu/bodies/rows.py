"""Expressions of a model as numbers: values, and slopes by the coordinates or by the velocities."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.physics.vector import dynamicsymbols

from ..model.elements import Expr
from ..model.model import Model

TIME = dynamicsymbols._t
Array = NDArray[np.float64]


class Rows:
    """m expressions of n coordinates q at the model's parameters, at t = 0 and at the starts of its inputs.

    Of positions, e(q, t): their values, de/dq (m, n) and de/dt.  `of_velocities`, e = a(q) v + a0(q):
    a (m, n) and a0.
    """

    def __init__(
        self, model: Model, expressions: Sequence[Expr], of_velocities: bool = False
    ) -> None:
        coordinates = list(model.coordinates)
        q, v = sp.symbols(f"q:{len(coordinates)}"), sp.symbols(f"v:{len(coordinates)}")
        plain = dict(zip(coordinates, q, strict=True))
        plain |= {c.diff(TIME): s for c, s in zip(coordinates, v, strict=True)}
        numbers = {p.symbol: sp.Float(p.value, 17) for p in model.parameters}
        numbers |= {i.symbol: sp.Float(i.start, 17) for i in model.inputs}
        moving = {i.symbol: sp.Float(i.rate, 17) for i in model.prescribed}
        slots = {s: j for j, s in enumerate(v if of_velocities else q)}
        rest = {**dict.fromkeys(v, sp.S.Zero), TIME: sp.S.Zero}
        self.shape = len(expressions), len(coordinates)
        self._at: list[tuple[int, int]] = []
        slopes, values = [], []
        for i, expression in enumerate(expressions):
            e = sp.sympify(expression).xreplace(plain)
            drift = sp.Add(*(e.diff(u) * r for u, r in moving.items() if e.has(u)))
            e = e.xreplace(numbers)
            for s in sorted(e.free_symbols & slots.keys(), key=slots.__getitem__):
                self._at.append((i, slots[s]))
                slopes.append(e.diff(s).xreplace(rest))
            if not of_velocities:
                drift = drift.xreplace(numbers) + e.diff(TIME)
            values += [e.xreplace(rest), (e if of_velocities else drift).xreplace(rest)]
        self._values = sp.lambdify([q], values, "numpy")
        self._slopes = sp.lambdify([q], slopes, "numpy")

    def values(self, q: Array, v: Array | None = None) -> Array:
        """e(q), or e(q, v) of velocities (m)."""
        if v is not None:
            return self.slopes(q) @ v + self.drift(q)
        return np.array(self._values(q), dtype=float).reshape(-1, 2)[:, 0]

    def drift(self, q: Array) -> Array:
        """What the rate of each holds besides the velocities (m)."""
        return np.array(self._values(q), dtype=float).reshape(-1, 2)[:, 1]

    def slopes(self, q: Array) -> Array:
        """The slopes (m, n)."""
        found = np.zeros(self.shape)
        if self._at:
            i, j = zip(*self._at, strict=True)
            found[i, j] = self._slopes(q)
        return found


def numbers_of(model: Model, expressions: Sequence[Expr]) -> Array:
    """Expressions that hold parameters alone."""
    return Rows(model, expressions).values(np.zeros(len(model.coordinates)))
