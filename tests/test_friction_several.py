"""Friction in two directions, on several feet, in impacts; Painleve's paradox; Model Exchange."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from runs import simulate_fmu
from sympy import Rational, cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import (
    Contact,
    Friction,
    Model,
    Nonholonomic,
    Parameter,
    Scene,
    multiplier,
    simulate,
)
from lagfmu.errors import SimulationError
from lagfmu.fmu.compiler import find_compiler
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
MODELS = Path(__file__).parent.parent / "models"
g = 9.81  # m/s^2
x, y, z, theta, phi = dynamicsymbols("x y z theta phi")
m, G, mu, alpha, a, h, J, e = symbols("m g mu alpha a h J e", nonnegative=True)
mu_k = symbols("mu_k", nonnegative=True)
MASS = [Parameter(m, 1.0, "kg"), Parameter(G, g, "m/s^2")]


def puck() -> Model:
    """A point mass that slides on an inclined table in both directions, x downhill."""
    return Model(
        name="Puck",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2) / 2
        - m * G * (z * cos(alpha) - x * sin(alpha)),
        coordinates={x: "m", y: "m", z: "m"},
        constraints=[
            Contact("table", z),
            Nonholonomic("along", x.diff()),
            Nonholonomic("across", y.diff()),
            Friction(
                "grip",
                of=["along", "across"],
                normal=multiplier("table"),
                static=mu,
                kinetic=mu_k,
            ),
        ],
        parameters=[
            *MASS,
            Parameter(mu, 0.5, "1"),
            Parameter(mu_k, 0.4, "1"),
            Parameter(alpha, 0.3, "rad"),
        ],
        start={x.diff(): 0.5, y.diff(): 2.0},
    )


def feet() -> Model:
    """A body on two feet at -a and a along an incline, its centre h above it."""
    rows = [
        Contact("low", y - h + a * sin(theta)),
        Contact("up", y - h - a * sin(theta)),
        Nonholonomic("low_rests", x.diff() + h * theta.diff()),
        Nonholonomic("up_rests", x.diff() + h * theta.diff()),
    ]
    return Model(
        name="Feet",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2
        + J * theta.diff() ** 2 / 2
        - m * G * (y * cos(alpha) - x * sin(alpha)),
        coordinates={x: "m", y: "m", theta: "rad"},
        constraints=[
            *rows,
            Friction("low", of=["low_rests"], normal=multiplier("low"), static=mu),
            Friction("up", of=["up_rests"], normal=multiplier("up"), static=mu),
        ],
        parameters=[
            *MASS,
            Parameter(mu, 0.5, "1"),
            Parameter(alpha, float(np.arctan(0.42)), "rad"),
            Parameter(a, 1.0, "m"),
            Parameter(h, 0.5, "m"),
            Parameter(J, 0.3, "kg.m^2"),
        ],
        start={y: 0.5},
    )


def ball() -> Model:
    """A solid ball that is thrown onto the floor."""
    return Model(
        name="Ball",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2
        + Rational(1, 5) * m * a**2 * phi.diff() ** 2
        - m * G * y,
        coordinates={x: "m", y: "m", phi: "rad"},
        constraints=[
            Contact("floor", y, restitution=e),
            Nonholonomic("rolling", x.diff() - a * phi.diff()),
            Friction("grip", of=["rolling"], normal=multiplier("floor"), static=mu),
        ],
        parameters=[
            *MASS,
            Parameter(mu, 0.3, "1"),
            Parameter(a, 0.1, "m"),
            Parameter(e, 0.5, "1", min=0, max=1),
        ],
        start={y: 0.5, x.diff(): 2.0},
    )


Make = Callable[[Callable[[], Model]], Path]


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Make:
    """native(model): path of its native FMU, built once."""
    made: dict[Callable[[], Model], Path] = {}

    def get(model: Callable[[], Model]) -> Path:
        if model not in made:
            prepared = prepare(model(), Scene(model.__name__.title()))
            made[model] = write(prepared, tmp_path_factory.mktemp("fmu"), (), target="native")
        return made[model]

    return get


def file_model(name: str) -> Callable[[], Model]:
    def model() -> Model:
        return load(MODELS / f"{name}.py").model

    model.__name__ = name
    return model


rod = file_model("falling_rod")


def test_two_rows_slide_along_one_curve_and_stop_together(native: Make) -> None:
    """With mu = tan(alpha) the speed down the slope plus the speed itself is constant: from (0, v0) the
    puck approaches v0/2 straight down (the classical problem of the sliding puck)."""
    values = {"mu": float(np.tan(0.3)), "mu_k": float(np.tan(0.3)), "der(x)": 0.0}
    run = simulate(
        native(puck), stop_time=3.0, step_size=0.03, tolerance=1e-10, start_values=values
    )
    down, across = run["slip.along"], run["slip.across"]
    assert down + np.hypot(down, across) == pytest.approx(2.0, rel=1e-8)
    lam = np.stack([run["lambda.along"], run["lambda.across"]])
    slip = np.stack([down, across])
    N = run["lambda.table"]
    assert lam == pytest.approx(-np.tan(0.3) * N * slip / np.hypot(*slip), abs=1e-11)


def test_two_rows_come_to_rest(native: Make) -> None:
    """The slide ends where both velocities vanish, the energy is heat, and the puck stays there."""
    run = simulate(native(puck), stop_time=2.5, step_size=0.05)
    assert run["sticks.grip"][-1]
    assert not run["sticks.grip"][0]
    assert np.hypot(run["der(x)"][-1], run["der(y)"][-1]) < 1e-14
    total = run["energy.total"] + run["energy.dissipated"]
    assert total == pytest.approx(total[0], abs=1e-7)
    at_rest = run[run["sticks.grip"]]
    assert (at_rest["x"] == at_rest["x"][0]).all()
    assert at_rest["lambda.along"] == pytest.approx(-m_g_sin(0.3), rel=1e-12)


def m_g_sin(angle: float) -> float:
    return g * float(np.sin(angle))


@pytest.mark.parametrize("slope", [0.42, 0.4999, 0.5001, 0.7])
def test_two_feet_hold_as_long_as_they_can_together(native: Make, slope: float) -> None:
    """tan(alpha) <= mu: though the least-norm share asks more of the upper foot than it can hold, the pair
    holds; above, both slip with g (sin(alpha) - mu cos(alpha))."""
    angle = float(np.arctan(slope))
    run = simulate(native(feet), stop_time=1.0, step_size=0.1, start_values={"alpha": angle})
    holds = slope < 0.5
    assert (run["sticks.low"] == holds).all()
    assert (run["sticks.up"] == holds).all()
    expected = 0.0 if holds else g * (np.sin(angle) - 0.5 * np.cos(angle)) / 2
    assert run["x"][-1] == pytest.approx(expected, abs=1e-9)
    for foot in ("low", "up"):
        cone = 0.5 * run[f"lambda.{foot}"] - np.abs(run[f"lambda.{foot}_rests"])
        assert (cone >= -1e-11).all()
    both = run["lambda.low_rests"] + run["lambda.up_rests"]
    assert both == pytest.approx(-m_g_sin(angle) if holds else -0.5 * g * np.cos(angle), rel=1e-11)


@pytest.mark.parametrize("friction", [1.30, 1.36, 1.5])
@pytest.mark.parametrize("way", [1, -1])
def test_painleve_is_refused_by_name_and_only_there(
    native: Make, friction: float, way: int
) -> None:
    """A uniform rod at tan(theta) = 2: from mu = 4/3 on, and in one direction of slip, no acceleration
    agrees with Coulomb's law.  Elsewhere N = m g.../(1 + 3 cos(theta) (cos(theta) - mu sin(theta)))."""
    values = {"theta": float(np.arctan(2)), "y": 2 / 5**0.5, "mu": friction, "der(x)": 2.0 * way}

    def start() -> float:
        run = simulate(native(rod), stop_time=1e-3, step_size=1e-3, start_values=values)
        return float(run["lambda.floor"][0])

    if way < 0 and friction > 4 / 3:
        with pytest.raises(
            SimulationError, match=r"'grip': sliding has no acceleration, or several"
        ):
            start()
    else:
        inner = 1 + 3 / 5 + way * 3 * friction * 2 / 5
        assert start() == pytest.approx(g / inner, rel=1e-10)


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("target", ["native", "python"])
def test_painleve_is_looked_for_with_each_foot_in_the_air(
    native: Make, target: str, way: int
) -> None:
    """On both feet sliding is well posed for any mu (det B = det K); on the front one alone it is up to
    mu = (1/m + a^2/J) J/(a h) = 2.6, and beyond that there may be two solutions: refused."""
    angle = {"alpha": 0.0, "der(x)": 1.0 * way}

    def start(friction: float) -> np.ndarray:
        run = {"stop_time": 1e-3, "step_size": 1e-3, "start_values": {**angle, "mu": friction}}
        if target == "native":
            return simulate(native(feet), **run)
        return simulate(feet(), scene=Scene("Feet"), **run)

    assert start(1.9)["der(x,2)"][0] == pytest.approx(-way * 1.9 * g, rel=1e-10)
    assert start(2.59)["contact.low"][0] != start(2.59)["contact.up"][0]  # it tips over
    with pytest.raises(SimulationError, match="has no acceleration, or several"):
        start(2.61)


@pytest.mark.parametrize(
    ("restitution", "friction"), [(0.0, 0.3), (0.5, 0.3), (0.0, 0.1), (1.0, 0.05)]
)
def test_oblique_impact_obeys_newton_and_coulomb(
    native: Make, restitution: float, friction: float
) -> None:
    """A ball without spin: Lambda_t = min(mu Lambda_n, (2/7) m v) and Lambda_n = (1 + e) m v_n, and what
    the motion loses is the heat."""
    fall = float(np.sqrt(2 * g * 0.5))
    values = {"e": restitution, "mu": friction}
    end = fall / g + 1e-6
    run = simulate(native(ball), stop_time=end, step_size=end, start_values=values)[-1]
    push = min(friction * (1 + restitution) * fall, 2.0 * 2 / 7)
    assert run["der(x)"] == pytest.approx(2.0 - push, abs=1e-5)
    assert 0.1 * run["der(phi)"] == pytest.approx(2.5 * push, abs=1e-5)
    assert run["der(y)"] == pytest.approx(restitution * fall, abs=2e-5)
    total = run["energy.total"] + run["energy.dissipated"]
    assert total == pytest.approx(g * 0.5 + 2.0, rel=1e-9)
    assert run["energy.dissipated"] >= 0


@pytest.mark.parametrize("spin", [-60.0, 0.0, 40.0, 200.0])
def test_no_bounce_raises_the_energy_and_both_targets_agree(native: Make, spin: float) -> None:
    """A spinning ball bounces to rest: energy and heat together stay, heat never falls."""
    values = {"e": 0.8, "der(phi)": spin, "mu": 0.6}
    options = {"stop_time": 1.5, "step_size": 0.125, "start_values": values}
    ours = simulate(native(ball), **options)
    theirs = simulate(ball(), scene=Scene("Ball"), **options)
    total = ours["energy.total"] + ours["energy.dissipated"]
    assert total == pytest.approx(total[0], rel=1e-8)
    assert (np.diff(ours["energy.dissipated"]) >= -1e-12).all()
    for name in ("x", "y", "phi", "der(phi)", "energy.dissipated"):
        assert ours[name] == pytest.approx(theirs[name], abs=1e-6), name


@pytest.mark.parametrize("name", ["belt", "friction_oscillator", "rough_hemisphere"])
def test_model_exchange_tells_the_same_motion(native: Make, name: str) -> None:
    """An importer's own integrator, stopped by the indicators of every mode."""
    model = file_model(name)
    path = str(native(model))
    run = {"stop_time": 1.5, "output_interval": 0.05, "relative_tolerance": 1e-9}
    outputs = ["x" if name != "rough_hemisphere" else "theta", "sticks.grip", "slipping.grip.count"]
    ours = simulate_fmu(path, fmi_type="CoSimulation", output=outputs, **run)
    theirs = simulate_fmu(path, fmi_type="ModelExchange", output=outputs, **run)
    at = {round(float(t), 9): k for k, t in enumerate(theirs["time"])}  # the last at an event
    pairs = [(k, at[round(float(t), 9)]) for k, t in enumerate(ours["time"])]
    for column in outputs:
        a, b = (np.asarray(r[column], dtype=float) for r in (ours, theirs))
        for k, j in pairs:
            assert a[k] == pytest.approx(b[j], abs=2e-5), (column, ours["time"][k])


def test_multipliers_that_are_shared_are_told() -> None:
    """unique.ROW is false on two feet that both stick."""
    run = simulate(feet(), scene=Scene("Feet"), stop_time=0.1, step_size=0.1)
    assert not run["unique.low_rests"].any()
    assert not run["unique.up_rests"].any()
