"""The joint coordinates by which an importer may give the start: angle.A, position.D, and their rates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import sympy as sp

from ..model.elements import Expr, Output
from ..model.model import Model
from ..names import derivative, read


class JointCoordinate(NamedTuple):
    """Its value and its rate are outputs of the model's own, by number; or it is a coordinate, with its rate:
    otherwise that is -1.  `within_turn`: the output is known modulo 2 pi alone."""

    name: str
    coordinate: int
    value: int
    rate: int
    within_turn: bool


def joint_coordinates(
    model: Model, q: Sequence[Expr], outputs: Sequence[Output]
) -> tuple[JointCoordinate, ...]:
    """Those of the model's joint_starts that are there, with their rates."""
    places = {str(s): j for j, s in enumerate(q)}
    own = {o.name: k for k, o in enumerate(outputs)}
    found = []
    for name in (n for n in model.joint_starts if not read(n).order):
        rate = derivative(name)
        if name in places:
            found.append(JointCoordinate(name, places[name], -1, -1, False))
        elif name in own and rate in own:
            o = outputs[own[name]]
            turns = sp.sympify(o.expression).has(sp.atan2)
            found.append(JointCoordinate(name, -1, own[name], own[rate], turns))
    return tuple(found)


def start_names(found: Sequence[JointCoordinate]) -> list[str]:
    """Of what start values are given besides coordinates and speeds: the value and the rate of each."""
    return [derivative(c.name, order) for c in found for order in (0, 1)]
