"""Conditions on a mechanism as numbers: their values, and their rates, which are affine in the speeds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import sympy as sp
from numpy.typing import NDArray
from sympy.core.function import AppliedUndef
from sympy.physics.vector import dynamicsymbols

from ..model.attitude import Attitude, written_out
from ..model.elements import Constraint, Expr, Nonholonomic, Tie
from ..model.model import Model

TIME = dynamicsymbols._t
Array = NDArray[np.float64]


class Rows:
    """m pairs of e(q, t) and its rate a(q) v + a0(q), at t = 0 and at what parameters and inputs start with.

    A condition on velocities alone has the value 0.
    """

    def __init__(self, model: Model, pairs: Sequence[tuple[Expr, Expr]]) -> None:
        q = sp.symbols(f"q:{len(model.coordinates)}")
        v = sp.symbols(f"v:{len(model.directions)}")
        known = dict(zip(model.states, (*q, *v), strict=True))
        known |= {p.symbol: sp.Float(p.value, 17) for p in model.parameters}
        known |= {i.symbol: sp.Float(i.start, 17) for i in model.inputs}
        known |= {i.symbol.diff(TIME): sp.Float(i.rate, 17) for i in model.prescribed}
        place, rest = {s: j for j, s in enumerate(v)}, dict.fromkeys(v, sp.S.Zero)
        self.shape = len(pairs), len(v)
        self._at: list[tuple[int, int]] = []
        slopes, values, drifts = [], [], []
        for i, pair in enumerate(pairs):
            value, rate = (sp.sympify(e).xreplace(known).xreplace({TIME: sp.S.Zero}) for e in pair)
            for s in sorted(rate.free_symbols & place.keys(), key=place.__getitem__):
                self._at.append((i, place[s]))
                slopes.append(rate.diff(s))
            values.append(value)
            drifts.append(rate.xreplace(rest))
        elements = sorted({a for e in (*slopes, *values) for a in e.atoms(Attitude)}, key=str)
        R = sp.symbols(f"R:{len(elements)}")
        closed = dict(zip(elements, R, strict=True))
        self._elements = sp.lambdify([q], [written_out(a) for a in elements], "numpy")
        self._values, self._drifts, self._slopes = (
            sp.lambdify([q, R], [e.xreplace(closed) for e in part], "numpy")
            for part in (values, drifts, slopes)
        )

    def values(self, q: Array) -> Array:
        """e(q) (m)."""
        return np.array(self._values(q, self._elements(q)), dtype=float)

    def rates(self, q: Array, v: Array) -> Array:
        """Their rates (m)."""
        return self.slopes(q) @ v + self.drifts(q)

    def drifts(self, q: Array) -> Array:
        """Their rates while the speeds are 0 (m)."""
        return np.array(self._drifts(q, self._elements(q)), dtype=float)

    def slopes(self, q: Array) -> Array:
        """Their slopes by the speeds (m, n_v)."""
        found = np.zeros(self.shape)
        if self._at:
            i, j = zip(*self._at, strict=True)
            found[i, j] = self._slopes(q, self._elements(q))
        return found


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
