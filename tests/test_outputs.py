"""Outputs that a model names itself: tension, height, power; from lambda, Q, accelerations and inputs."""

from __future__ import annotations

import pytest
from sympy import cos, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter, force_of_constraint, multiplier
from lagfmu.errors import ModelError

x, y = dynamicsymbols("x y")
m, g, L = symbols("m g L", positive=True)
CONSTANTS = (Parameter(m, 2.0, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1.5, "m"))


def pendulum(**changes) -> Model:
    """A bob on a rod of length L, in x and y; the rod's multiplier is -tension/(2 L)."""
    fields = {
        "name": "Pendulum",
        "lagrangian": m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
        "coordinates": {x: "m", y: "m"},
        "constraints": [Holonomic("rod", x**2 + y**2 - L**2)],
        "parameters": CONSTANTS,
        "start": {x: 0.9, y: -1.2},
    }
    return Model(**(fields | changes))


def test_reactions_have_the_unit_that_their_constraint_gives_them():
    """[lambda] = J/[f]: N/m for a squared length; Q on a length is a force."""
    units = pendulum().reactions
    assert units[multiplier("rod")].name == "N/m"
    assert units[force_of_constraint(x)].name == "N"


@pytest.mark.parametrize(
    "changes",
    [
        {"forces": {x: -multiplier("rod") * x.diff() / L}},
        {"lagrangian": m * x.diff() ** 2 - force_of_constraint(y) * x},
        {"constraints": [Holonomic("rod", x - L * cos(multiplier("rod")))]},
    ],
)
def test_what_is_solved_for_cannot_stand_in_the_equations(changes):
    """lambda in a force, in L or in a constraint is refused: Friction and Output are named."""
    with pytest.raises(ModelError) as refused:
        pendulum(**changes)
    for part in ("solved for", "Friction", "Output"):
        assert part in str(refused.value)
