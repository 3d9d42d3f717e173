"""The models of the lectures: each against its closed forms, and against what they imply."""

from __future__ import annotations

import contextlib
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from conftest import EVERY
from scipy.integrate import simpson
from scipy.special import ellipk, ellipkinc

from lagfmu import Model, derive, simulate, verify
from lagfmu.errors import SimulationError
from lagfmu.testing import ModelFile, carried, check_closed_form, load, prepare, read_description

MODELS = Path(__file__).parent.parent / "models"
g = 9.81  # m/s^2

STEPS = {"HalfCar": 150}  # its wheels fly for a few hundredths of a second
CHANGED = {  # far from the defaults, consistent or not: the projection and the closed forms follow
    "Hemisphere": {"m": 2.3, "g": 3.7, "a": 0.6, "r": 0.6, "theta": -0.3, "der(theta)": -0.4},
    "InclineDisk": {"M": 3, "R": 0.4, "g": 1.6, "alpha": 0.2, "y": 0.2, "theta": 0.5, "der(y)": 1},
    "InclineDiskMinimal": {"M": 3, "R": 0.4, "g": 1.6, "alpha": 0.2, "der(theta)": 1},
    "PendulumCartesian": {"m": 0.3, "g": 1.6, "L": 2, "x": 1.7, "y": 0.9, "der(x)": 0.4},
    "PendulumAngle": {"m": 0.3, "g": 1.6, "L": 2, "theta": 2, "der(theta)": 0.2},
    "PendulumNullspace": {"m": 0.3, "g": 1.6, "L": 2, "x": 1.7, "y": 0.9, "der(x)": 0.4},
    "RotatingWire": {"m": 0.3, "omega": -1.5, "r": 0.4, "der(r)": -0.9, "der(phi)": -1.5},
    "Crane": {"M": 500, "m": 900, "g": 1.6, "c": 40, "x": -1.5, "y": -5.5, "l": 6.0, "der(l)": 0.1},
    "HalfCar": {"M": 900, "J": 1100, "m": 90, "k": 3e4, "c": 2e3, "der(s)": 15.0},
    "KnifeEdge": {
        "m": 3,
        "J": 0.7,
        "alpha": 0.9,
        "phi": 0.7,
        "der(phi)": -0.6,
        "der(x)": 2,
        "x": 1,
    },
    "Atwood": {"m1": 0.3, "m2": 3, "g": 1.6, "x1": 0.5, "x2": -0.5, "der(x1)": 0.4},
    "CartPendulum": {"M": 0.4, "m": 3, "L": 2, "c": 0.7, "s": 1, "x": 2, "der(s)": 0.3, "F": 2},
    "RollingSphere": {"m": 2.3, "g": 3.7, "a": 0.6, "r": 0.7, "theta": -0.3, "der(theta)": -0.4},
    "SlippingSphere": {
        "m": 2.3,
        "g": 3.7,
        "a": 0.6,
        "r": 0.8,
        "theta": 0.1,
        "mu_s": 0.3,
        "mu_k": 0.2,
    },
    "Ladder": {  # a start that is not at both wall and floor is another motion
        "m": 3,
        "g": 30,
        "l": 3,
        "theta": 1.0,
        "x": 1.5 * np.cos(1.0),
        "y": 1.5 * np.sin(1.0),
        "der(theta)": -0.3,
        "der(x)": 0.45 * np.sin(1.0),
        "der(y)": -0.45 * np.cos(1.0),
    },
    "Loop": {"m": 0.3, "g": 20, "a": 0.5, "y": -0.5, "der(x)": -5.9},
    "Chain": {"m": 2, "g": 1.6, "l": 0.4, "y1": 0.1, "x4": -0.3, "der(x2)": 1.5},
    "SliderCrank": {
        "J": 0.02,
        "m": 3,
        "M": 0.5,
        "k": 1e7,
        "c": 3e4,
        "phi": 1,
        "der(phi)": -20,
        "tau": 0.5,
    },
    "DoublePendulum": {"m1": 0.3, "m2": 2, "L1": 2, "L2": 0.5, "y1": 0.3, "der(y2)": 1.5},
    "BouncingBall": {"m": 0.3, "g": 3.7, "e": 0.4, "y": 0.5, "der(y)": 1},
}


def files() -> dict[str, tuple[ModelFile, int]]:
    """Scene's name -> its model file and its number there."""
    loaded = [load(path) for path in sorted(MODELS.glob("*.py"))]
    return {s.name: (f, k) for f in loaded for k, s in enumerate(f.scenes) if s.name in CHANGED}


FILES = files()


def run(name: str, values: dict[str, float] | None = None, **options):
    file, k = FILES[name]
    return simulate(prepare(file.model, file.scenes[k]), start_values=values, **options)


@pytest.mark.parametrize("changed", [False, True], ids=["defaults", "changed"])
@pytest.mark.parametrize("tolerance", [1e-8, 1e-12])
@pytest.mark.parametrize("name", sorted(CHANGED))
def test_outputs_equal_the_closed_forms(name: str, tolerance: float, changed: bool) -> None:
    """Over long steps, so that it is the integrator's tolerance that counts."""
    file, k = FILES[name]
    values = CHANGED[name] if changed else {}
    scene = file.scenes[k]
    moving = [f"{i.symbol.func}" for i in file.model.prescribed]  # inputs that go on by themselves
    besides = [form.format(n) for n in moving for form in ("{}", "der({})", "der({},2)")]
    steps = STEPS.get(name, 10)
    result = run(
        name, values, tolerance=tolerance, step_size=scene.stop_time / steps, besides=besides
    )
    inputs = {str(i.symbol.func): i.start for i in file.model.inputs}
    known = {str(p.symbol): p.value for p in file.model.parameters} | inputs | values
    closed_forms = carried(scene, file.closed_forms)
    assert any(c.name.startswith("lambda.") for c in closed_forms)
    for closed_form in closed_forms:
        check = check_closed_form(closed_form, result, known, max(tolerance, 1e-12))
        assert check.points > 0, closed_form.name
        assert check.error < check.allowed, closed_form.name


def test_the_table_above_names_every_scene_of_the_lectures() -> None:
    assert set(FILES) == set(CHANGED)


def test_particle_leaves_the_hemisphere_when_the_elliptic_integral_says() -> None:
    """With cos(theta/2) = k sin(p), k = cos(theta0/2), the fall from rest takes sqrt(a/g) (K - F(p))."""
    result = run("Hemisphere", {"theta": 0.3}, tolerance=1e-12)
    k = np.cos(0.15)
    p = np.arcsin(np.sqrt((1 + 2 / 3 * np.cos(0.3)) / 2) / k)
    time = np.sqrt(1 / g) * (ellipk(k**2) - ellipkinc(p, k**2))
    assert result["departure.surface.time"][-1] == pytest.approx(time, rel=1e-10)


def test_disk_without_multiplier_moves_and_pulls_as_the_disk_with_one() -> None:
    with_lambda, without = run("InclineDisk"), run("InclineDiskMinimal")
    for name in ("y", "theta", "der(y,2)", "lambda.rolling", "Q.y", "Q.theta"):
        np.testing.assert_allclose(without[name], with_lambda[name], rtol=1e-12, atol=1e-15)


def test_three_pendulums_are_one_motion() -> None:
    runs = [run(f"Pendulum{kind}", tolerance=1e-12) for kind in ("Cartesian", "Angle", "Nullspace")]
    for name in ("x", "y", "der(x)", "der(y,2)", "lambda.rod", "energy.total"):
        scale = np.abs(runs[0][name]).max()
        for other in runs[1:]:
            np.testing.assert_allclose(other[name], runs[0][name], rtol=0, atol=1e-10 * scale)


def test_pendulum_returns_after_a_complete_elliptic_integral() -> None:
    """The period is 4 sqrt(L/g) K(sin(theta0/2))."""
    period = 4 * np.sqrt(1 / g) * ellipk(np.sin(0.5) ** 2)
    for name in ("PendulumCartesian", "PendulumAngle", "PendulumNullspace"):
        end = run(name, stop_time=period, step_size=period, tolerance=1e-12)[-1]
        assert (end["x"], end["y"]) == pytest.approx((np.sin(1), -np.cos(1)), abs=1e-11)
        assert (end["der(x)"], end["der(y)"]) == pytest.approx((0, 0), abs=1e-10)


def test_motor_of_the_wire_pays_for_the_bead() -> None:
    """The energy grows by the integral of lambda omega."""
    result = run("RotatingWire", tolerance=1e-12)
    work = simpson(result["lambda.drive"] * 2.0, x=result["time"])
    gain = result["energy.total"][-1] - result["energy.total"][0]
    assert work == pytest.approx(gain, rel=1e-7)


def test_skate_from_rest_feels_twice_the_weight_that_pulls_it_sideways() -> None:
    """lambda = -2 m g sin(alpha) sin(omega t), and x never exceeds g sin(alpha)/(2 omega^2)."""
    result = run("KnifeEdge")
    expected = -2 * g * 0.5 * np.sin(result["time"])
    np.testing.assert_allclose(result["lambda.edge"], expected, rtol=0, atol=1e-7)
    assert result["x"].max() == pytest.approx(g * 0.5 / 2, rel=1e-4)
    assert result["x"].min() > -1e-7


def test_equal_masses_on_a_string_rest() -> None:
    result = run("Atwood", {"m1": 1.0, "m2": 1.0})
    assert result["lambda.string"] == pytest.approx(-g, rel=1e-14)
    assert np.abs(result["x1"]).max() < 1e-14


def test_cart_keeps_its_energy_without_friction_and_loses_what_friction_takes() -> None:
    free = run("CartPendulum", {"c": 0.0}, tolerance=1e-12)
    assert np.ptp(free["energy.total"]) < 1e-10
    braked = run("CartPendulum", {"c": 2.0}, tolerance=1e-12)
    heat = simpson(2.0 * braked["der(s)"] ** 2, x=braked["time"])
    lost = braked["energy.total"][0] - braked["energy.total"][-1]
    assert heat == pytest.approx(lost, rel=1e-7)


def test_kinetic_energy_with_all_forces_gives_the_equations_of_the_lagrangian() -> None:
    """ME 6590: eq. (2), K and F_q, against eq. (3), L and Q_nc."""
    model: Model = FILES["CartPendulum"][0].model
    s, _, y = model.coordinates
    m, gravity = (p.symbol for p in model.parameters if str(p.symbol) in "mg")
    lagrangian = model.kinetic_energy - m * gravity * y
    other = replace(model, kinetic_energy=None, lagrangian=lagrangian, forces={s: model.forces[s]})
    first, second = derive(model), derive(other)
    assert first.M == second.M
    assert first.G == second.G
    assert all(sp.expand(a - b) == 0 for a, b in zip(first.F, second.F, strict=True))
    assert sp.expand(first.potential - second.potential) == 0


@pytest.mark.parametrize("name", EVERY)
def test_statements_hold_with_parameters_and_starts_drawn_at_random(name: str, native_fmu) -> None:
    """Each parameter, then each start value too, times e^-0.4 to e^0.4: whatever a model states of its FMU,
    with what it says of its own validity, is missed by none that the FMU accepts."""
    path, rng, accepted = native_fmu(name), np.random.default_rng(7), 0
    known = read_description(path).modelVariables
    numbers = [v for v in known if v.type == "Real" and float(v.start or 0)]
    parameters = [v for v in numbers if v.causality == "parameter" and "solver." not in v.name]
    starts = [v for v in numbers if v.initial in ("exact", "approx") and v.causality == "output"]
    for drawn in (parameters, [*parameters, *starts], [*parameters, *starts]):
        values = {}
        for v in drawn:
            value = float(v.start) * np.exp(rng.uniform(-0.4, 0.4))
            values[v.name] = np.clip(value, float(v.min or -np.inf), float(v.max or np.inf))
        with warnings.catch_warnings(), contextlib.suppress(SimulationError):
            warnings.simplefilter("ignore")  # starts that are moved onto the constraints
            found = verify(path, values)
            accepted += 1
            assert found.passed, [str(c) for c in found.checks if c.failed]
    assert accepted
