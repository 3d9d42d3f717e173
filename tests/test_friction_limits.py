"""Friction of a constant limit, which no normal force makes: a seal, a gear, a robot's axis."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from sympy import exp, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Friction, Input, Model, Nonholonomic, Parameter, simulate
from lagfmu.bodies import Body, Gravity, Ground, Prismatic, Revolute, SpringDamper, mechanism
from lagfmu.errors import ModelError
from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
Build = Callable[..., Path]
x, P = dynamicsymbols("x P")
m, k, F, v_s = symbols("m k F v_s", positive=True)


def block(limit: Any, kinetic: Any = None, *speeds: Any, **more: Any) -> Model:
    """1 kg on a spring of 100 N/m, with speeds of 0.5 m/s as parameters."""
    own = [Parameter(v, 0.5, "m/s") for v in speeds]
    return Model(
        name="Block",
        lagrangian=m * x.diff() ** 2 / 2 - k * x**2 / 2,
        coordinates={x: "m"},
        constraints=[
            Nonholonomic("seal", x.diff()),
            Friction("dry", ["seal"], limit=limit, kinetic=kinetic),
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(k, 100.0, "N/m"),
            Parameter(F, 5.0, "N"),
            *own,
        ],
        start={x: 0.45},
        **more,
    )


def test_each_half_period_takes_twice_the_limit_over_the_stiffness(built: Build) -> None:
    """x = 0.45, -0.35, 0.25, -0.15, 0.05 m, where the spring pulls with no more than 5 N: it stays."""
    half = np.pi / 10
    result = simulate(built(block(F)), stop_time=5 * half, step_size=half / 8)
    found = result["x"][::8]
    np.testing.assert_allclose(found[:5], [0.45, -0.35, 0.25, -0.15, 0.05], atol=1e-9)
    np.testing.assert_allclose(result["x"][33:], 0.05, atol=1e-9)
    np.testing.assert_allclose(result["lambda.seal"][-1], 5.0, rtol=1e-7)
    lost = 50 * (0.45**2 - 0.05**2)
    np.testing.assert_allclose(result["energy.dissipated"][-1], lost, rtol=1e-8)


def test_a_limit_that_an_input_sets_holds_and_lets_go(built: Build) -> None:
    """A clamp of 50 N holds 45 N of a spring; what is a limit of 0 rubs not at all."""
    held = block(P, inputs=[Input(P, "N", 50.0)])
    result = simulate(built(held), stop_time=0.3, step_size=0.1)
    np.testing.assert_array_equal(result["x"], 0.45)
    np.testing.assert_allclose(result["lambda.seal"], 45.0)
    free = simulate(built(held), stop_time=0.3, step_size=0.1, start_values={"P": 0.0})
    np.testing.assert_allclose(free["x"], 0.45 * np.cos(10 * free["time"]), atol=1e-8)


def test_a_pendulum_turns_back_where_its_energy_and_the_torque_of_its_hinge_say(
    built: Build,
) -> None:
    """m g l (cos a_1 - cos a_0) = tau (a_0 + a_1) for one swing, and it rests where m g l sin a < tau."""
    ground, bob = Ground(), Body("bob", 1.0, 0.05)
    tau = 0.4
    hinge = Revolute("A", ground.at((0, 0)), bob.at((0, 0.5)), friction_torque=tau)
    gravity = Gravity((0, -9.81))
    model = mechanism(
        "Hinge", bodies=[bob], joints=[hinge], loads=[gravity], plane="xy", start={"angle.A": 1.2}
    )
    result = simulate(built(model), stop_time=12.0, step_size=0.005)
    angle = result["angle.A"]
    turns = [1.2]
    while 0.5 * 9.81 * np.sin(turns[-1]) > tau:
        a = turns[-1]

        def energy(b: float, a: float = a) -> float:
            return 0.5 * 9.81 * (np.cos(b) - np.cos(a)) - tau * (a + b)

        turns.append(brentq(energy, -a / 2, a) if energy(-a / 2) * energy(a) < 0 else 0.0)
    peaks = [abs(angle[i]) for i in range(1, len(angle) - 1) if _turns(angle, i)]
    count = len(turns) - 1
    assert count == 7
    np.testing.assert_allclose(peaks[: count - 1], turns[1:-1], atol=1e-4)
    np.testing.assert_allclose(abs(angle[-1]), abs(turns[-1]), atol=1e-8)
    np.testing.assert_allclose(result["der(angle.A)"][-1], 0.0, atol=1e-15)
    weight = 0.5 * 9.81 * np.sin(angle[-1])
    np.testing.assert_allclose(result["torque.A.z"][-1], weight, rtol=1e-9)
    assert abs(weight) <= tau


def _turns(angle: Any, i: int) -> bool:
    return bool((angle[i] - angle[i - 1]) * (angle[i + 1] - angle[i]) < 0)


def test_an_axis_with_a_kinetic_force_of_its_own_sticks_and_slips(built: Build) -> None:
    """A slide pulled by a spring of 100 N/m holds up to 8 N; stretched by 9 N it slips with 4 N, and stops
    2 * 5 N / (100 N/m) further, where the spring pushes with 1 N."""
    ground, car = Ground(), Body("car", 1.0, 1.0)

    def at(stretch: float) -> Model:
        return mechanism(
            "Slide",
            bodies=[car],
            joints=[Prismatic("D", ground.at((0, 0)), car.at((0, 0)), friction_force=(8.0, 4.0))],
            loads=[SpringDamper("s", ground.at((-1, 0)), car.at((0, 0)), 100.0, length=1.0)],
            plane="xy",
            start={"position.D": stretch},
        )

    still = simulate(built(at(0.07)), stop_time=1.0, step_size=0.1)
    np.testing.assert_allclose(still["position.D"], 0.07, rtol=1e-12)
    np.testing.assert_allclose(still["force.D.x"], 7.0, rtol=1e-9)
    slips = simulate(built(at(0.09)), stop_time=1.0, step_size=0.1)
    np.testing.assert_allclose(slips["position.D"][-1], -0.01, atol=1e-9)


def test_a_kinetic_factor_of_the_slip_velocity_is_stribecks_curve(built: Build) -> None:
    """The force of a block that slips is limit * (0.5 + 0.5 exp(-v/v_s)) at every instant."""
    curve = (1 + exp(-((x.diff() / v_s) ** 2))) / 2
    model = block(F, curve, v_s)
    result = simulate(built(model), stop_time=0.25, step_size=0.05)
    v = result["der(x)"][1:]
    expected = 5 * (1 + np.exp(-((v / 0.5) ** 2))) / 2
    np.testing.assert_allclose(result["lambda.seal"][1:], -np.sign(v) * expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("limit", "more", "told"),
    [
        (m, {}, "limit of friction 'dry'.*kg"),
        (F, {"normal": F}, "limit is given with normal or static"),
        (-1.0, {"static": 0.5}, "limit is given with normal or static"),
    ],
)
def test_a_limit_of_another_dimension_or_beside_a_normal_is_refused(
    limit: Any, more: Any, told: str
) -> None:
    """It is the force itself, in N."""
    with pytest.raises(ModelError, match=told):
        point_mass(
            "B",
            "x",
            [
                Nonholonomic("seal", x.diff()),
                Friction("dry", ["seal"], limit=limit, **more),
            ],
            energy=-F * x,
            parameters=[Parameter(F, 1.0, "N")],
        )
