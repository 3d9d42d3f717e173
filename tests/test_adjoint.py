"""Adjoint derivatives: the rows of the Jacobian whose columns are the directional ones, each at once."""

from __future__ import annotations

import math
from ctypes import byref, c_double, c_size_t
from pathlib import Path

import numpy as np
import pytest
from sympy import Abs, Piecewise, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.redundant import platform

from lagfmu import Output, Parameter, Scene
from lagfmu.bodies import Body, Gravity, Ground, Revolute, SpringDamper, Torsion, mechanism
from lagfmu.testing import find_compiler, load

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

MODELS = (
    *("PendulumCartesian", "PendulumAngle", "Hemisphere", "CartPendulum"),
    *("InclineDiskMinimal", "KnifeEdge", "RotatingWire", "SliderCrank", "Gyroscope"),
)


def sides(one) -> tuple[list[str], list[str]]:
    """Unknowns that have derivatives: continuous outputs; knowns: states, inputs and time."""
    lib = one.library
    states = [d.variable.derivative.name for d in lib.description.derivatives]
    inputs = one.of(causality="input")
    unknowns = [
        n
        for n in one.of(causality="output", variability="continuous")
        if one.call("GetDirectionalDerivative", *asks(one, n, states[0])) == 0
    ]
    knowns = [n for n in (*states, *inputs, "time") if n != "energy.dissipated"]
    return unknowns, knowns


def asks(one, unknown: str, known: str, seed: float = 1.0):
    """The arguments of one derivative."""
    count = c_size_t(1)
    references = one.references([unknown]), count, one.references([known]), count
    return *references, byref(c_double(seed)), count, byref(c_double()), count


def jacobians(one) -> tuple[np.ndarray, np.ndarray]:
    """(unknowns, knowns) by columns and by rows."""
    unknowns, knowns = sides(one)
    columns = [one.derive("GetDirectionalDerivative", unknowns, [k], [1.0]) for k in knowns]
    rows = [one.derive("GetAdjointDerivative", [u], knowns, [1.0]) for u in unknowns]
    return np.array(columns).T, np.array(rows)


@pytest.mark.parametrize("name", MODELS)
def test_the_adjoint_is_the_transposed_jacobian(library3, name):
    """Row by row as column by column, to rounding of the terms; and for a seed of all unknowns at once."""
    one = library3(name)().start()
    for _ in range(3):
        one.step(0.05)
    directional, adjoint = jacobians(one)
    assert directional.size > 20
    scale = abs(directional).max()
    np.testing.assert_allclose(adjoint, directional, rtol=1e-11, atol=1e-13 * scale)
    unknowns, knowns = sides(one)
    seed = np.random.default_rng(1).normal(size=len(unknowns))
    found = one.derive("GetAdjointDerivative", unknowns, knowns, list(seed))
    np.testing.assert_allclose(found, seed @ directional, rtol=1e-11, atol=1e-11 * scale)


def assert_transposed(one) -> None:
    """Row by row as column by column, to rounding of the row's terms or, where these cancel, of all."""
    directional, adjoint = jacobians(one)
    assert directional.size > 100
    rows = abs(directional).max(axis=1, keepdims=True)
    assert (abs(adjoint - directional) <= 1e-11 * rows + 1e-13 * rows.max()).all()


def test_the_adjoint_of_a_long_chain(library3, built):
    """Eight links that are alike share one function, and each bob adds what both its links say."""
    model = load(Path(__file__).parents[1] / "models/chain.py", ["n=8"]).model
    one = library3(built(model, fmi=3))().start()
    one.step(0.05)
    assert_transposed(one)


def test_the_adjoint_of_bodies_in_space(library3, built):
    """Hinges of two kinds, and the norms of their forces as outputs."""
    links = [Body(f"b{k}", mass=1.0 + k, inertia=(0.02, 0.03, 0.01)) for k in range(3)]
    hinges, last = [], Ground().at((0, 0, 0))
    for k, link in enumerate(links):
        hinges.append(Revolute(f"J{k}", last, link.at((0.1, 0, 0.5)), axis="xy"[k % 2]))
        last = link.at((0, 0.1, -0.5))
    spring = SpringDamper("spring", Ground().at((1, 1, 1)), last, stiffness=30.0, length=1.0)
    start = {f"b{k}.position": (-0.1 * (k + 1), 0.1 * k, -0.5 - k) for k in range(3)}
    model = mechanism(
        "HangingLinks",
        bodies=links,
        joints=hinges,
        loads=[Gravity((0, 0, -9.81)), spring],
        start=start,
    )
    one = library3(built(model, fmi=3))().start()
    one.step(0.05)
    assert_transposed(one)


def test_a_slope_that_is_no_number_stays_with_its_output(library3, built):
    """At rest the speed sqrt(x'^2 + y'^2) has none by x' and y', and others have theirs; of two cases the one
    that holds is differentiated: d sqrt(x)/dx at x = 0 is in the other."""
    x, y = dynamicsymbols("x y")
    k, L = symbols("k L", positive=True)
    root = Piecewise((x, x < L), (sqrt(L * (x - L)), True))
    model = point_mass(
        "Corner",
        "x y",
        energy=-k * root**2 / 2,
        parameters=[Parameter(k, 2, "N/m"), Parameter(L, 1, "m")],
        start={x: 0.5, y: 0.0},
        outputs=[
            Output("speed", sqrt(x.diff() ** 2 + y.diff() ** 2), "m/s"),
            Output("root", root, "m"),
        ],
    )
    one = library3(built(model, Scene("Corner"), fmi=3))().start()
    states = ["x", "y", "der(x)", "der(y)"]
    assert one.derive("GetAdjointDerivative", ["root", "der(x,2)"], states, [3.0, 1.0]) == [
        1,
        0,
        0,
        0,
    ]
    assert "derivative of 'speed'" in one.refuses("GetAdjointDerivative", *asks(one, "speed", "x"))


def test_a_force_of_infinite_slope_is_told_and_its_neighbours_have_theirs(library3, built):
    """m x'' = -k sqrt(L |x|), whose slope at x = 0 is infinite, beside m y'' = -k y, which the same step
    of the chain rule asks: d x''/dx is refused, d y''/dy = -k/m."""
    x, y = dynamicsymbols("x y")
    k, L = symbols("k L", positive=True)
    model = point_mass(
        "Steep",
        "x y",
        parameters=[Parameter(k, 2, "N/m"), Parameter(L, 1, "m")],
        forces={x: -k * sqrt(L * Abs(x)), y: -k * y},
        start={x: 0.0, y: 0.5},
    )
    one = library3(built(model, Scene("Steep"), fmi=3))().start()
    asked = ["der(x,2)", "der(y,2)"]
    one.refuses("GetAdjointDerivative", *asks(one, "der(x,2)", "x"))
    assert one.derive("GetAdjointDerivative", asked, ["y"], [0.0, 1.0]) == [-2]


def test_a_constraint_runs_away_from_what_stands_still(library3):
    """phi - omega t at a given phi: -omega a second."""
    one = library3("RotatingWire")().start()
    for function in ("GetDirectionalDerivative", "GetAdjointDerivative"):
        assert one.derive(function, ["residual.drive"], ["time"], [1.0]) == [-2.0]


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_the_adjoint_of_redundant_rows(library3, built):
    """Where one constraint follows from others: of Q, of the motion and of what is unique."""
    one = library3(built(platform(True), fmi=3))().start()
    directional, adjoint = jacobians(one)
    assert directional.size > 20
    np.testing.assert_allclose(
        adjoint, directional, rtol=1e-10, atol=1e-11 * abs(directional).max()
    )


def test_what_has_no_derivative_has_no_adjoint(library3):
    """A parameter is no unknown and no known; a seed is a number."""
    one = library3("PendulumCartesian")().start()
    assert "derivative of 'm'" in one.refuses("GetAdjointDerivative", *asks(one, "m", "x"))
    assert "'m'" in one.refuses("GetAdjointDerivative", *asks(one, "lambda.rod", "m"))
    asked = asks(one, "lambda.rod", "x", math.nan)
    assert "seed of 'lambda.rod' is nan" in one.refuses("GetAdjointDerivative", *asked)


def test_derivatives_by_an_angle_that_counts_turns(library3, built):
    """A pendulum on a torsion spring, two turns on: its states are settled where they are set, so that by
    angle.A nothing changes, and by the attitude all that hangs on the angle; as differences say."""
    pendulum, ground = Body("pendulum", mass=1.0, inertia=(0.02, 0.03, 0.05)), Ground()
    model = mechanism(
        "WoundUp",
        bodies=[pendulum],
        joints=[Revolute("A", ground.at((0, 0, 0)), pendulum.at((0.2, 0.1, 0)), axis="z")],
        loads=[Gravity((0, -9.81, 1.0)), Torsion("S", "A", stiffness=3.0, angle=0.1)],
        start={"angle.A": 4 * math.pi + 0.7, "der(angle.A)": 1.0},
    )
    one = library3(built(model, fmi=3))(exchange=True).start()
    one.does("EnterContinuousTimeMode")
    states = [d.variable.derivative.name for d in one.library.description.derivatives]
    x, size = np.array(one.array("GetContinuousStates", len(states))), c_size_t(len(states))
    unknowns = ["angle.A", "torque.S", "energy.potential"]
    told = {u.variable.name: u.dependencies for u in one.library.description.outputs}
    assert "pendulum.orientation.z" in {v.name for v in told["torque.S"]}

    def values(y: np.ndarray) -> np.ndarray:
        one.does("SetContinuousStates", (c_double * len(y))(*y), size)
        return np.array(one.floats(unknowns))

    for k, name in enumerate(states):
        step = np.zeros(len(x))
        step[k] = 1e-6
        slopes = (values(x + step) - values(x - step)) / 2e-6
        values(x)
        found = one.derive("GetDirectionalDerivative", unknowns, [name], [1.0])
        np.testing.assert_allclose(found, slopes, atol=1e-7)
        if name == "angle.A":
            assert not any(found)
    assert "angle.A" in states
    directional, adjoint = jacobians(one)
    np.testing.assert_allclose(adjoint, directional, rtol=1e-11, atol=1e-12)
