"""What bounces on a rough floor comes to rest by impulses that obey Coulomb's law, the last one too."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, Scene, multiplier, simulate

x, z, phi = dynamicsymbols("x z phi")
m, g, e, mu = symbols("m g e mu", positive=True)
X0 = symbols("X0", real=True)
t, FALL = dynamicsymbols._t, 9.81  # s, m/s^2


def puck(floor: float = 0.0, height: float = 1.0) -> Model:
    """A puck, mu = 0.3 and e = 0.5, thrown at 10 m/s above a rough floor."""
    return point_mass(
        "RoughBounce",
        "x z",
        [
            Contact("floor", z - X0, restitution=e),
            Nonholonomic("rub", x.diff(), while_closed="floor"),
            Friction("grip", of=["rub"], normal=multiplier("floor"), static=mu),
        ],
        up=z,
        gravity=FALL,
        parameters=[Parameter(e, 0.5, "1"), Parameter(mu, 0.3, "1"), Parameter(X0, floor, "m")],
        start={x: 0.0, z: floor + height, x.diff(): 10.0},
    )


@pytest.mark.parametrize(
    ("floor", "height", "tolerance"),
    [(0.0, 1.0, 1e-6), (0.0, 1.0, 1e-12), (1000.0, 1.0, 1e-10), (-1000.0, 0.1, 1e-10)],
)
def test_every_impulse_takes_its_part_along_the_floor(
    floor: float, height: float, tolerance: float
) -> None:
    """While it slips vx + mu (vz + g t) is constant, through each impact and through the last, at which it
    stays on the floor; a shift of the floor changes rounding alone."""
    run = simulate(puck(floor, height), stop_time=2.0, step_size=0.01, tolerance=tolerance)
    assert run["contact.floor"][-1]
    assert run["closing.floor.count"][-1] > 8
    kept = run["der(x)"] + 0.3 * (run["der(z)"] + FALL * run["time"])
    assert kept == pytest.approx(np.full(len(kept), 10.0), abs=1e-10)
    assert run["der(x)"][-1] == pytest.approx(10 - 0.3 * FALL * 2, abs=1e-10)


def test_how_often_it_bounces_changes_nothing_of_its_speed(built: Any) -> None:
    """d vx / d e = 0 after the bounces, for which the derivatives go through all of them; d vx / d mu is
    -(g t), and an error bar holds what the run is off."""
    scene = Scene(
        "RoughBounce",
        stop_time=2.0,
        step_size=0.05,
        sensitivities=["der(x):e,mu"],
        error_bars=True,
        tolerance=1e-9,
    )
    run = simulate(built(puck(), scene))
    assert run["sensitivity.valid"].all()
    assert run["sensitivity.velocity.x.by.e"][-1] == pytest.approx(0, abs=1e-8)
    assert run["sensitivity.velocity.x.by.mu"][-1] == pytest.approx(-FALL * 2, rel=1e-8)
    off = abs(run["der(x)"][-1] - (10 - 0.3 * FALL * 2))
    assert off <= run["error.velocity.x"][-1] + 1e-13


def test_an_eccentric_wheel_comes_to_rest_on_the_floor_by_coulombs_law() -> None:
    """Its centre of mass lies beside its axle, so that each normal impulse turns it too; the momentum along
    the floor changes by -mu times that across it, whatever the last impulses are."""
    R, d, J = symbols("R d J", positive=True)
    X, Z = x + d * sin(phi), z + d * cos(phi)
    T = m * (X.diff(t) ** 2 + Z.diff(t) ** 2) / 2 + J * phi.diff() ** 2 / 2
    model = Model(
        name="Eccentric",
        lagrangian=T - m * g * Z,
        coordinates={x: "m", z: "m", phi: "rad"},
        constraints=[
            Contact("floor", z - R, restitution=e),
            Nonholonomic("rub", x.diff() - R * phi.diff(), while_closed="floor"),
            Friction("grip", of=["rub"], normal=multiplier("floor"), static=mu),
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(g, FALL, "m/s^2"),
            Parameter(e, 0.4, "1"),
            Parameter(mu, 0.1, "1"),
            Parameter(R, 0.2, "m"),
            Parameter(d, 0.02, "m"),
            Parameter(J, 0.02, "kg.m^2"),
        ],
        start={x: 0.0, z: 0.7, phi: 0.3, x.diff(): 10.0},
    )
    run = simulate(model, stop_time=1.1, step_size=0.01, tolerance=1e-11)
    assert run["contact.floor"][-1]
    angle, w = run["phi"], run["der(phi)"]
    along = run["der(x)"] + 0.02 * np.cos(angle) * w
    across = run["der(z)"] - 0.02 * np.sin(angle) * w
    slips = ~run["sticks.grip"].astype(bool)
    kept = (along + 0.1 * (across + FALL * run["time"]))[slips]
    assert kept == pytest.approx(np.full(len(kept), kept[0]), abs=1e-9)
