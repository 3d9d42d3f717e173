"""Coulomb friction: what sticks, what slips, when, and what becomes of the energy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import model_file
from fmpy.fmi1 import FMICallException
from instance import instance
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Contact,
    Friction,
    Holonomic,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    multiplier,
    norm,
    simulate,
)
from lagfmu.errors import ModelError, SimulationError
from lagfmu.testing import carried, check_closed_form, find_compiler, lagrange, prepare

MODELS = Path(__file__).parent.parent / "models"
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
g = 9.81  # m/s^2
RUNS: dict[str, list[dict[str, float]]] = {
    "FrictionOscillator": [{}, {"x": -0.3, "k": 40.0, "mu_k": 0.1, "mu_s": 0.1}, {"x": 0.02}],
    "Belt": [{}, {"speed": 0.5, "der(x)": 0.5, "mu_s": 0.8, "k": 50.0}],
    "InclineFriction": [
        {},
        {"alpha": np.arctan(3 * 0.4) * 1.001},
        {"alpha": np.arctan(3 * 0.4) * 0.999},
        {"alpha": np.arctan(3.5 * 0.4) * 1.001, "kappa": 0.4},
        {"alpha": np.arctan(3.5 * 0.4) * 0.999, "kappa": 0.4},
        {"alpha": 0.2, "der(y)": 1.5},
        {"alpha": 0.2, "der(theta)": 20.0},
        {"alpha": 0.2, "der(y)": -1.0, "der(theta)": 3.0, "kappa": 1.0},
    ],
    "Bowling": [{}, {"der(x)": 3.0, "der(phi)": -20.0, "mu": 0.3}],
    "SlippingSphere": [{}, {"mu_s": 1.2, "mu_k": 0.9}, {"theta": 0.3, "mu_k": 0.05}],
    "RoughHemisphere": [{}, {"theta": 0.2}, {"theta": 0.4, "mu_k": 0.3}, {"der(theta)": 0.9}],
}


@pytest.mark.parametrize("name", sorted(RUNS))
def test_reported_values_obey_lagranges_and_coulombs_laws_to_rounding(
    native_fmu: Any, prepared: Any, name: str
) -> None:
    """Each equation of motion, each constraint, the cone and the force of sliding, from the model file alone:
    relative to its own terms 1e-13, the cone 1e-12.  |lambda| <= mu_s N while it sticks; lambda =
    -mu_k N s/|s| and power <= 0 while it slips."""
    made = prepared(name)
    law = made.model.frictions[0]
    row, normal = law.of[0], str(next(iter(law.normal.free_symbols)))
    laws = lagrange(made.model, frozenset(v.name for v in made.table.variables))
    closed_forms = carried(made.scene, laws)
    assert any(c.name == "cone of grip" for c in closed_forms)
    for values in RUNS[name]:
        result = simulate(native_fmu(name), start_values=values, step_size=0.0137)
        known = {str(p.symbol): p.value for p in made.model.parameters} | values
        mu_s, mu_k = known[str(law.static)], known[str(law.sliding)]
        lam, N, slip = result[f"lambda.{row}"], result[normal], result[f"slip.{row}"]
        sticks = result["sticks.grip"]
        scale = 1e-12 * float(np.abs(N).max())
        assert (np.abs(lam[sticks]) <= mu_s * N[sticks] + scale).all()
        sliding = ~sticks & (np.abs(slip) > 1e-9)
        assert lam[sliding] == pytest.approx(-mu_k * N[sliding] * np.sign(slip[sliding]), abs=scale)
        assert (result["power.grip"] <= 0).all()
        assert (np.diff(result["energy.dissipated"]) >= -1e-13).all()
        assert result["margin.grip"] == pytest.approx(mu_s * N - np.abs(lam), abs=scale)
        for closed_form in closed_forms:
            check = check_closed_form(closed_form, result, known, 1e-300)
            assert check.error <= check.allowed, closed_form.name


@pytest.mark.parametrize("name", ["Belt", "FrictionOscillator", "RoughHemisphere"])
def test_events_do_not_depend_on_the_communication_step(native_fmu: Any, name: str) -> None:
    """Short steps, long steps: the same end, the same starts of slipping."""
    ends = [
        simulate(native_fmu(name), stop_time=2.0, step_size=h, tolerance=1e-11)[-1]
        for h in (2.0, 0.1, 0.003)
    ]
    for end in ends[1:]:
        for column in ends[0].dtype.names:
            if column != "solver.steps":
                a, b = float(end[column]), float(ends[0][column])
                assert a == pytest.approx(b, rel=1e-8, abs=1e-8), column


def test_a_friction_that_shall_not_slip_is_the_plain_constraint() -> None:
    """Scene(frictions=()): on a smooth incline the disk rolls, lambda = -(1/3) M g sin(alpha); coefficients,
    modes and heat are no more, and `minimal` is there again."""
    file = model_file("incline_friction")
    scene = Scene("Rolls", frictions=(), contacts=(), formulation="minimal")
    run = simulate(file.model, scene=scene, stop_time=1.0, step_size=0.5)
    assert run["lambda.rolling"] == pytest.approx(-g * np.sin(np.pi / 6) / 3, rel=1e-12)
    assert run["y"][-1] == pytest.approx(g * np.sin(np.pi / 6) / 3, rel=1e-8)
    names = {v.name for v in prepare(file.model, scene).table.variables}
    assert not names & {"mu_s", "mu_k", "sticks.grip", "slip.rolling", "energy.dissipated"}


def test_the_log_tells_when_a_friction_slips_and_that_it_sticks(native_fmu: Any) -> None:
    """Category logEvents, as the departures of contacts: the block rides on the belt, slips, rides again."""
    with instance(native_fmu("Belt")) as one:
        one.start()
        for _ in range(8):
            one.step(0.1)
        told = [text for _, category, text in one.log if category == "logEvents"]
        slipped = f"friction grip began to slip at t = {one.get('slipping.grip.time')!r} s"
        stuck = f"friction grip began to stick at t = {one.get('sticking.grip.time')!r} s"
        assert told == [slipped, stuck]


@pytest.mark.parametrize(
    ("step", "tolerance", "values"),
    [
        (0.02689, 1.1e-7, {"g": 21.797, "k": 38.355, "m": 1.0607, "mu_s": 0.948, "x": -0.0536}),
        (0.11111, 5.5e-10, {"g": 17.66, "k": 131.62, "m": 0.54214, "mu_s": 1.215, "x": -0.0456}),
    ],
)
def test_what_rests_from_the_start_on_goes_on_resting(
    native_fmu: Any, step: float, tolerance: float, values: dict[str, float]
) -> None:
    """A spring too weak for the friction: weight and floor balance to rounding; no place is singular."""
    run = {"stop_time": 20 * step, "step_size": step, "tolerance": tolerance}
    found = simulate(native_fmu("FrictionOscillator"), start_values=values, **run)
    assert found["sticks.grip"].all()
    assert (found["x"] == values["x"]).all()
    assert np.abs(found["z"]).max() < 1e-15


def test_a_step_that_is_taken_again_does_not_rub_twice(native_fmu: Any) -> None:
    """From rest at x0 until it turns round, after pi sqrt(m/k) = 0.31 s, a mass on a spring has lost mu_k m g
    (x0 - x), and energy.total with it stays what it was, on the way back too: also where a step is undone
    and taken in two, and after one that cannot be taken."""
    with instance(native_fmu("FrictionOscillator")) as one:
        one.start(tolerance=1e-10, stop_time=1.0)
        begun = one.get("energy.total")
        for _ in range(10):
            before, now = one.fmu.getFMUState(), one.time
            one.step(0.06)
            one.fmu.setFMUState(before)
            one.fmu.freeFMUState(before)
            one.time = now
            one.step(0.02)
            with pytest.raises(FMICallException):
                one.fmu.doStep(currentCommunicationPoint=one.time, communicationStepSize=2.0)
            one.step(0.04)
            lost = one.get("energy.dissipated")
            assert one.get("energy.total") + lost == pytest.approx(begun, rel=1e-9)
            if one.time < 0.31:
                assert lost == pytest.approx(0.2 * g * (0.2 - one.get("x")), rel=1e-9)


# ------------------------------------------------------------------ what is refused

x, y, z, u = dynamicsymbols("x y z u")
m, mu = symbols("m mu", positive=True)
G = symbols("g", positive=True)


def block(*constraints: Any, **more: Any) -> Model:
    """A block on a table, pushed by nothing."""
    return Model(
        name="Block",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2 - m * G * y,
        coordinates={x: "m", y: "m", z: "m"},
        constraints=[
            Contact("table", y),
            Nonholonomic("rest", x.diff()),
            *constraints,
        ],
        parameters=[
            Parameter(m, 1.0, "kg"),
            Parameter(G, 9.81, "m/s^2"),
            Parameter(mu, 0.3, "1"),
        ],
        **more,
    )


N = multiplier("table")
WRONG = {
    "of names what is not there": (
        [Friction("grip", of=["rset"], normal=N, static=mu)],
        r"names 'rset', which is no constraint of this model \(constraints: table, rest\)",
    ),
    "of is no list": ([Friction("grip", of="rest", normal=N, static=mu)], "expected a list"),
    "of is a contact": (
        [Friction("grip", of=["table"], normal=N, static=mu)],
        "names the contact 'table'",
    ),
    "normal names what is not there": (
        [Friction("grip", of=["rest"], normal=multiplier("tabel"), static=mu)],
        "lambda.tabel is no multiplier of this model's constraints",
    ),
    "normal is not linear": (
        [Friction("grip", of=["rest"], normal=N**2 / (m * G), static=mu)],
        "is neither linear in the multipliers nor a sum of norms",
    ),
    "normal is a norm of contacts": (
        [
            Contact("side", z),
            Friction("grip", ["rest"], norm(N, multiplier("side")), static=mu),
        ],
        "is a norm with the contacts 'side', 'table', expected multipliers of joints",
    ),
    "normal is a difference of norms": (
        [
            Holonomic("side", z),
            Friction("grip", ["rest"], norm(N, multiplier("side")) - N, static=mu),
        ],
        "is neither linear in the multipliers nor a sum of norms",
    ),
    "normal is no force": (
        [Friction("grip", of=["rest"], normal=N * m, static=mu)],
        "expected N",
    ),
    "normal is limited itself": (
        [Friction("grip", of=["rest"], normal=multiplier("rest"), static=mu)],
        "is itself limited by the friction 'grip'",
    ),
    "mu is negative": (
        [Friction("grip", of=["rest"], normal=N, static=-0.1)],
        "static of friction 'grip' is -0.1",
    ),
    "mu is not a number": (
        [Friction("grip", of=["rest"], normal=N, static=float("nan"))],
        "expected a number of at least 0",
    ),
    "mu has a unit": (
        [Friction("grip", of=["rest"], normal=N, static=mu * m)],
        "static of friction 'grip'.*expected 1",
    ),
    "kinetic above static": (
        [Friction("grip", of=["rest"], normal=N, static=0.2, kinetic=0.3)],
        "kinetic = 0.3 is above static = 0.2",
    ),
    "multiplier is no force": (
        [
            Holonomic("circle", x**2),
            Friction("grip", of=["circle"], normal=N, static=mu),
        ],
        "'circle'.*(is in N/m, expected N|no multiplier can hold it)",
    ),
    "one row in two frictions": (
        [
            Friction("grip", of=["rest"], normal=N, static=mu),
            Friction("other", of=["rest"], normal=N, static=mu),
        ],
        "belongs to the frictions 'grip' and 'other'",
    ),
    "rows that are not perpendicular": (
        [
            Nonholonomic("slant", x.diff() + z.diff()),
            Friction("grip", of=["rest", "slant"], normal=N, static=mu),
        ],
        r"'rest' and 'slant' are not perpendicular \(the product of their directions is 1\)",
    ),
    "an unknown symbol": (
        [Friction("grip", of=["rest"], normal=N, static=symbols("nu"))],
        "nu is neither coordinate, parameter nor input",
    ),
}


@pytest.mark.parametrize("case", sorted(WRONG))
def test_a_friction_that_makes_no_sense_is_refused_with_the_remedy(case: str) -> None:
    """The message names the friction, what was found and what was expected."""
    constraints, words = WRONG[case]
    with pytest.raises(ModelError, match=words):
        block(*constraints)


def test_the_minimal_formulation_is_refused_by_name() -> None:
    """It eliminates the normal force, which the cone needs."""
    model = block(Friction("grip", of=["rest"], normal=N, static=mu))
    with pytest.raises(ModelError, match="'minimal' with friction"):
        prepare(model, Scene("Block", formulation="minimal"))


def test_a_multiplier_in_a_force_is_told_of_friction() -> None:
    """A force that is limited by another is a Friction, not an expression."""
    with pytest.raises(ModelError, match="is a Friction in `constraints`"):
        block(forces={x: -mu * N})


def test_a_power_that_is_no_number_is_refused(native_fmu: Any) -> None:
    """m g R sqrt(g/R) at g = 1e300 m/s^2 is beyond all doubles: never -inf with fmi2OK."""
    with pytest.raises(SimulationError, match=r"not finite at t = .*: power\.grip"):
        simulate(
            native_fmu("RoughHemisphere"),
            start_values={"g": 1e300},
            stop_time=2e-150,
            step_size=1e-150,
        )


@pytest.mark.parametrize("mass", [1e-300, pytest.param(1e300, marks=pytest.mark.thorough)])
def test_no_unit_of_mass_moves_the_cone(mass: float) -> None:
    """A rod of any mass slips at the same time, under lambda in proportion to its mass: the square of 1e-300
    is 0 and that of 1e300 infinite, but no friction sticks outside of its cone for that."""
    file = model_file("falling_rod")
    run, other = (
        simulate(file.model, 0.7, 0.07, start_values={"m": m}, scene=file.scenes[0])
        for m in (1.0, mass)
    )
    assert other["sticks.grip"].tolist() == run["sticks.grip"].tolist()
    assert (other["margin.grip"] / mass).tolist() == pytest.approx(run["margin.grip"].tolist())


@pytest.mark.parametrize(
    "gravity", [1e-300, *(pytest.param(x, marks=pytest.mark.thorough) for x in (1e-150, 1e150))]
)
def test_what_slipping_has_cost_scales_with_gravity(gravity: float) -> None:
    """Energy goes as m g l, in times of sqrt(l/g): the share that friction has taken when the rod has fallen
    is the same on any planet. lambda_t . s of 1e-300 m/s^2 is below the smallest double; its work is not."""
    file = model_file("falling_rod")
    shares = []
    for g in (9.81, gravity):
        time = 0.7 * math.sqrt(9.81 / g)
        run = simulate(file.model, time, time / 10, start_values={"g": g}, scene=file.scenes[0])
        shares.append(run["energy.dissipated"][-1] / g)
    assert shares[0] > 0
    assert shares[1] == pytest.approx(shares[0], rel=1e-6)
