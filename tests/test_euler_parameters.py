"""A rigid body in Euler parameters: its mass matrix is singular along them, and their length holds it."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from sympy import Matrix, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Holonomic, Model, Parameter, Scene, simulate
from lagfmu.testing import StartMovedWarning

A, C, m, g, arm = symbols("A C m g l", positive=True)
LEAN, SPIN = 0.4, 60.0  # rad; rad/s about the axis of figure


def _parameters(size: float) -> list[Parameter]:
    return [
        Parameter(A, 2 * size, "kg*m^2"),
        Parameter(C, size, "kg*m^2"),
        Parameter(m, size / 0.01, "kg"),
        Parameter(g, 9.81, "m/s^2"),
        Parameter(arm, 0.1, "m"),
    ]


def top(size: float, twice: bool = False) -> Model:
    """A heavy symmetric top in Euler parameters (Goldstein, Classical Mechanics, sect. 4.5); `twice`: their
    length is said a second time."""
    p = dynamicsymbols("p0:4")
    rates = Matrix([x.diff() for x in p])
    local = Matrix(
        [
            [-p[1], p[0], p[3], -p[2]],
            [-p[2], -p[3], p[0], p[1]],
            [-p[3], p[2], -p[1], p[0]],
        ]
    )
    w = 2 * local * rates
    rise = p[0] ** 2 - p[1] ** 2 - p[2] ** 2 + p[3] ** 2
    length = sum(x**2 for x in p) - 1
    constraints = [Holonomic("unit", length)]
    if twice:
        constraints.append(Holonomic("again", length * (1 + p[0] ** 2)))
    half = LEAN / 2
    start = {p[0]: float(cos(half)), p[1]: float(sin(half)), p[2]: 0.0, p[3]: 0.0}
    # w = (0, 0, SPIN): p' = local^T w / 2
    start |= {p[0].diff(): 0.0, p[1].diff(): 0.0}
    start |= {p[2].diff(): -float(sin(half)) * SPIN / 2, p[3].diff(): float(cos(half)) * SPIN / 2}
    return Model(
        name="Top",
        lagrangian=(A * w[0] ** 2 + A * w[1] ** 2 + C * w[2] ** 2) / 2 - m * g * arm * rise,
        coordinates=dict.fromkeys(p, "1"),
        constraints=constraints,
        parameters=_parameters(size),
        start=start,
    )


def in_angles(size: float) -> Model:
    """The same top in Euler angles."""
    turn, lean, roll = dynamicsymbols("turn lean roll")
    kinetic = A * (lean.diff() ** 2 + (turn.diff() * sin(lean)) ** 2) / 2
    kinetic += C * (roll.diff() + turn.diff() * cos(lean)) ** 2 / 2
    return Model(
        name="TopInAngles",
        lagrangian=kinetic - m * g * arm * cos(lean),
        coordinates=dict.fromkeys((turn, lean, roll), "rad"),
        parameters=_parameters(size),
        start={lean: LEAN, roll.diff(): SPIN},
    )


@pytest.fixture
def run(built: Any) -> Any:
    """run(model, ...) of its native FMU."""

    def get(model: Model, **values: float) -> Any:
        scene = Scene(model.name, stop_time=0.5, step_size=0.025)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", StartMovedWarning)
            return simulate(built(model, scene), tolerance=1e-8, start_values=values)

    return get


def test_a_top_nutates_alike_in_parameters_and_in_angles_at_any_size(run):
    """Inertias of 1e-3 kg m^2 and of 1e-20 kg m^2, a speck of dust, with masses in proportion: the axis leans
    by the same angle at all times, as it does in Euler angles, and p keeps its length."""
    angles = run(in_angles(1e-3))
    model = top(1e-3)
    found = run(model)
    small = {"A": 2e-20, "C": 1e-20, "m": 1e-18}
    dust = run(model, **small)
    for seen in (found, dust):
        p = [seen[f"p{k}"] for k in range(4)]
        rise = p[0] ** 2 - p[1] ** 2 - p[2] ** 2 + p[3] ** 2
        np.testing.assert_allclose(rise, np.cos(angles["lean"]), atol=1e-6)
        np.testing.assert_allclose(sum(x**2 for x in p), 1, atol=1e-15)
    assert np.ptp(np.cos(angles["lean"])) > 0.01
    np.testing.assert_allclose(dust["lambda.unit"] / 1e-17, found["lambda.unit"], rtol=1e-4)


def test_the_length_said_twice_costs_no_digits(run):
    """|p| = 1 stated twice: the multipliers are shared, and the motion is the same."""
    once, twice = run(top(1e-3)), run(top(1e-3, twice=True))
    for k in range(4):
        np.testing.assert_allclose(twice[f"p{k}"], once[f"p{k}"], atol=1e-6)
        np.testing.assert_allclose(twice[f"Q.p{k}"], once[f"Q.p{k}"], atol=1e-6)
    assert not twice["unique.again"].any()
