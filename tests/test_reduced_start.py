"""A start in dependent coordinates is that of the independent ones, whichever formulation steps."""

from __future__ import annotations

import math

import numpy as np
import pytest
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Embedding, Holonomic, Model, Parameter, Scene, simulate
from lagfmu.errors import CannotStartError
from lagfmu.testing import StartMovedWarning, prepare

x, y, theta = dynamicsymbols("x y theta")
m, g, L = symbols("m g L", positive=True)
LENGTH = 2.0


def pendulum(start) -> Model:
    """A bob at x = L sin theta, y = L cos theta (down); minimal steps theta."""
    return point_mass(
        "Bob",
        "x y",
        [Holonomic("cx", x - L * sin(theta)), Holonomic("cy", y - L * cos(theta))],
        angles="theta",
        energy=m * g * y,
        parameters=[Parameter(g, 9.81, "m/s^2"), Parameter(L, LENGTH, "m")],
        start=start,
    )


STARTS = {
    "x": {x: 1.0},
    "x and y": {x: 1.0, y: math.sqrt(3.0)},
    "x and its rate": {x: 1.0, x.diff(): 0.5},
    "theta": {theta: math.pi / 6},
}


@pytest.mark.filterwarnings("ignore::lagfmu.testing.StartMovedWarning")
@pytest.mark.parametrize("named", STARTS)
def test_both_formulations_begin_alike(named):
    """The motion is that of the start given, in whichever coordinates it is given."""
    runs = [
        simulate(
            pendulum(STARTS[named]),
            scene=Scene("Bob", stop_time=1.0, formulation=formulation),
            tolerance=1e-11,
        )
        for formulation in ("multipliers", "minimal")
    ]
    assert abs(np.asarray(runs[0]["x"])[0]) == pytest.approx(1.0, rel=1e-12)
    for name in ("x", "y", "theta", "der(theta)", "lambda.cx"):
        values = [np.asarray(run[name]) for run in runs]
        assert np.abs(values[0] - values[1]).max() < 1e-8 * np.abs(values[0]).max(), name


def test_what_follows_is_told():
    """start gives x, and the FMU begins with theta: both stand in the warning."""
    with pytest.warns(StartMovedWarning, match=r"x = 1\.0.*theta = 0\.5235987755982\d"):
        prepare(pendulum(STARTS["x"]), Scene("Bob", formulation="minimal"))


def test_a_start_off_the_constraints_is_refused():
    """x = 3 m on a string of 2 m is no start of either formulation; what is known of it can be shown."""
    with pytest.raises(CannotStartError):
        prepare(pendulum({x: 3.0}), Scene("Bob", formulation="minimal"))


def test_an_embedding_has_a_start_of_its_own():
    """x = 0.5 m and theta = 1 rad do not agree: which is taken is said, with both values."""
    model = point_mass(
        "Embedded",
        "x y",
        [Holonomic("rod", x**2 + y**2 - L**2)],
        energy=m * g * y,
        parameters=[Parameter(g, 9.81, "m/s^2"), Parameter(L, LENGTH, "m")],
        start={x: 0.5, y: math.sqrt(3.75)},
        embedding=Embedding({theta: "rad"}, {x: L * sin(theta), y: L * cos(theta)}, {theta: 1.0}),
    )
    with pytest.warns(StartMovedWarning, match=r"x = 0\.5 there is 1\.68"):
        prepare(model, Scene("Embedded", formulation="minimal"))
