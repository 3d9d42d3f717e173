"""Rotation matrices in a model's expressions, as quantities with rates of their own: R' = R [w]x.

w is the angular velocity in the frame of the body, of which the kinematics of the unit quaternion are made
(Goldstein, Classical Mechanics, sect. 4.9).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import sympy as sp

from ..model.attitude import Attitude, quaternion_rates
from ..model.elements import Expr
from ..model.model import Model
from ..model.speeds import quaternions


@dataclass(frozen=True)
class Closed:
    """Elements of rotation matrices -> symbols, and the rates of these."""

    symbols: Mapping[Expr, Expr]
    rates: Mapping[Expr, Expr]


def attitudes(model: Model, table: Mapping[Expr, Expr]) -> Closed:
    """Of the unit quaternions whose kinematics are e' = e (0, w) / 2; with symbols for those whose rotation
    matrix stands in the energy, a constraint or a rate.  `table`: dynamicsymbols -> plain symbols."""
    expressions = [model.energy_expression, *map(sp.sympify, model.kinematics.values())]
    expressions += [sp.sympify(c.expression) for c in model.constraints]
    found = {a.quaternion for e in expressions for a in e.atoms(Attitude)}
    symbols: dict[Expr, Expr] = {}
    rates: dict[Expr, Expr] = {}
    for k, four in enumerate(quaternions(model)):
        w = _angular_velocity(model, four) if four in found else None
        if w is None:
            continue
        e, x, y, z = [table[s] for s in four], *(s.xreplace(table) for s in w)
        R = [[sp.Symbol(f"R{i}{j} of {k}", real=True) for j in range(3)] for i in range(3)]
        for i, row in enumerate(R):
            symbols |= {Attitude(i, j, *e): s for j, s in enumerate(row)}
            turned = row[1] * z - row[2] * y, row[2] * x - row[0] * z, row[0] * y - row[1] * x
            rates |= dict(zip(row, turned, strict=True))
    return Closed(symbols, rates)


def _angular_velocity(model: Model, four: tuple[Expr, ...]) -> tuple[Expr, ...] | None:
    """w (3) in the frame of the body; None if the kinematics are others."""
    if not all(s in model.kinematics for s in four):
        return None
    given = [sp.expand(model.kinematics[s]) for s in four]
    w = tuple(2 * rate.diff(four[0]) for rate in given[1:])
    expected = quaternion_rates(four, w)
    alike = all(sp.expand(a - b) == 0 for a, b in zip(given, expected, strict=True))
    return w if alike else None
