"""Rotation matrices and vectors that are fixed on bodies, as quantities with rates of their own.

    R' = R [w]x ,   (R s)' = R (w x s) ,   (R (w x s))' = R (w x (w x s))   while w does not change

w is the angular velocity in the frame of the body, of which the kinematics of the unit quaternion are made
(Goldstein, Classical Mechanics, sect. 4.9).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import sympy as sp

from ..model.attitude import Attitude, Carried, ClosedFunction, quaternion_rates
from ..model.elements import Expr, Tie
from ..model.model import Model
from ..model.speeds import quaternions

UNITS = ((1, 0, 0), (0, 1, 0), (0, 0, 1))


@dataclass(frozen=True)
class Closed:
    """What is closed -> symbols, and the rates of these; `positions`: those of coordinates alone, whose rates
    are linear in the speeds.  `carried`: of fixed vectors these rates as one symbol, which has a
    rate itself."""

    symbols: dict[Expr, Expr] = field(default_factory=dict)
    positions: dict[Expr, Expr] = field(default_factory=dict)
    rates: dict[Expr, Expr] = field(default_factory=dict)
    carried: dict[Expr, Expr] = field(default_factory=dict)

    def matrix(self, k: int, e: tuple[Expr, ...], w: tuple[Expr, ...]) -> None:
        """R and its rate."""
        x, y, z = w
        R = [[sp.Symbol(f"R{i}{j} of {k}", real=True) for j in range(3)] for i in range(3)]
        for i, row in enumerate(R):
            self.symbols.update({Attitude(i, j, *e): s for j, s in enumerate(row)})
            turned = row[1] * z - row[2] * y, row[2] * x - row[0] * z, row[0] * y - row[1] * x
            self.positions.update(zip(row, turned, strict=True))

    def vector(self, a: Carried, w: tuple[Expr, ...]) -> None:
        """A component, its slope by each speed, its rate and its bend."""
        order, i, e, s, by = a.parts
        if s == w:  # the angular velocity along the ground's axes: R w' is its rate
            self.rates[self._symbol(a)] = sp.S.Zero
        elif not order or by == w:
            value = self._symbol(Carried(0, i, *e, *s, 0, 0, 0))
            slopes = [self._symbol(Carried(1, i, *e, *s, *unit)) for unit in UNITS]
            rate, bend = (self._symbol(Carried(k, i, *e, *s, *w)) for k in (1, 2))
            self.positions[value] = sp.Add(*map(sp.Mul, slopes, w))
            self.rates[rate], self.carried[value] = bend, rate

    def _symbol(self, a: Expr) -> Expr:
        if a == 0:
            return a
        return self.symbols.setdefault(a, sp.Symbol(f"fixed {len(self.symbols)}", real=True))


def attitudes(model: Model, table: Mapping[Expr, Expr]) -> Closed:
    """Of the unit quaternions whose kinematics are e' = e (0, w) / 2; with symbols for those whose rotation
    matrix or vector stands in the energy, a rate, or a constraint that brings no rates of its own.  `table`:
    dynamicsymbols -> plain symbols."""
    expressions = [model.energy_expression, *map(sp.sympify, model.kinematics.values())]
    expressions += [sp.sympify(c.expression) for c in model.constraints if not isinstance(c, Tie)]
    found = set().union(*(e.atoms(ClosedFunction) for e in expressions))
    fixed: dict[tuple[Expr, ...], dict[Carried, None]] = {}
    of_quaternions = {a.quaternion for a in found}
    for a in sorted((a for a in found if isinstance(a, Carried)), key=str):
        fixed.setdefault(a.quaternion, {})[a] = None
    made = Closed()
    for k, four in enumerate(quaternions(model)):
        w = angular_velocity(model, four) if four in of_quaternions else None
        if w is not None:
            e, w = tuple(table[s] for s in four), tuple(s.xreplace(table) for s in w)
            made.matrix(k, e, w)
            for a in fixed.get(four, ()):
                made.vector(a.xreplace(table), w)
    made.rates.update(made.positions)
    return made


def angular_velocity(model: Model, four: tuple[Expr, ...]) -> tuple[Expr, ...] | None:
    """w (3) in the frame of the body; None if the kinematics are others."""
    if not all(s in model.kinematics for s in four):
        return None
    given = [sp.expand(model.kinematics[s]) for s in four]
    w = tuple(2 * rate.diff(four[0]) for rate in given[1:])
    expected = quaternion_rates(four, w)
    alike = all(sp.expand(a - b) == 0 for a, b in zip(given, expected, strict=True))
    return w if alike else None
