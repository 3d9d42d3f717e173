"""What a model with friction offers, and what it refuses by name: formulations, methods, derivatives, model
exchange, starts, impacts on several feet."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import fmpy
import numpy as np
import pytest
from conftest import model_file
from instance import instance
from runs import simulate_fmu
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner

from lagfmu import (
    Contact,
    Embedding,
    Friction,
    Model,
    Nonholonomic,
    Scene,
    multiplier,
    simulate,
)
from lagfmu.errors import ModelError
from lagfmu.testing import app, find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
MODELS = Path(__file__).parent.parent / "models"
FEET, PUCK = (model_file(name).model for name in ("two_feet", "puck"))
g = 9.81  # m/s^2
Build = Callable[..., Path]


@pytest.fixture(scope="module")
def belt(native_fmu: Callable[[str], Path]) -> Path:
    return native_fmu("Belt")


def described(path: Path) -> Element:
    """modelDescription.xml."""
    with zipfile.ZipFile(path) as archive:
        return fromstring(archive.read("modelDescription.xml"))


def test_without_multipliers_in_the_equations_friction_is_the_same(
    belt: Path, built: Build
) -> None:
    """`nullspace` eliminates lambda from the equations of motion and reports it: the block on the belt
    sticks, slips and turns as with `multipliers`."""
    other = built(model_file("belt").model, Scene("Belt", formulation="nullspace"))
    run = {"stop_time": 2.0, "step_size": 0.05, "tolerance": 1e-10}
    ours, theirs = simulate(belt, **run), simulate(other, **run)
    assert ours["slipping.grip.count"][-1] == 3
    for name in set(ours.dtype.names) - {"solver.steps"}:
        a, b = (np.asarray(x[name], dtype=float) for x in (ours, theirs))
        assert a == pytest.approx(b, abs=1e-8 * max(1.0, np.abs(b).max())), name


def test_an_embedding_is_refused_by_name() -> None:
    """It leaves no normal force, which the cone needs."""
    x, z, s = dynamicsymbols("x z s")
    plain = model_file("belt").model
    with pytest.raises(ModelError, match="friction with an embedding: the normal force is needed"):
        Model(
            name="Embedded",
            lagrangian=plain.lagrangian,
            coordinates={x: "m", z: "m"},
            constraints=[
                Contact("belt", z),
                Nonholonomic("ride", x.diff()),
                Friction("grip", of=["ride"], normal=multiplier("belt"), static=0.3),
            ],
            parameters=plain.parameters,
            embedding=Embedding({s: "m"}, {x: s, z: 0}),
        )


def test_no_directional_derivatives_are_offered(belt: Path) -> None:
    """The description says so, and an importer that asks all the same is refused."""
    description = fmpy.read_model_description(str(belt))
    assert not description.coSimulation.providesDirectionalDerivative
    assert not description.modelExchange.providesDirectionalDerivative
    with instance(belt) as one:
        one.start({})
        at = {n: v.valueReference for n, v in one.variables.items()}
        with pytest.raises(fmpy.fmi1.FMICallException):
            one.fmu.getDirectionalDerivative([at["lambda.ride"]], [at["x"]], [1.0])
        assert "without derivatives of its outputs" in one.log[-1][2]


def test_the_residual_of_a_row_is_its_missed_velocity_in_every_mode(belt: Path) -> None:
    """Riding, sliding and riding again: residual.ride = x' - speed, and lambda of the row is unique."""
    run = {"stop_time": 1.0, "step_size": 0.02}
    found = simulate(belt, **run)
    assert {*found["sticks.grip"]} == {0, 1}
    assert found["residual.ride"] == pytest.approx(found["der(x)"] - 0.2, abs=1e-15)
    assert found["residual.ride"] == pytest.approx(found["slip.ride"], abs=1e-15)
    assert np.abs(found["residual.ride"][found["sticks.grip"] == 1]).max() < 1e-15
    assert found["unique.ride"].all()
    assert found["unique.belt"].all()


@pytest.mark.parametrize("values", [{}, {"der(x)": -0.7}, {"z": 0.3, "der(x)": 1.0}])
def test_friction_moves_no_start_value(belt: Path, values: dict[str, float]) -> None:
    """Riding, sliding, in the air: it starts with the velocity that it was given, and nothing is told."""
    with instance(belt) as one:
        one.start(values)
        one.step(1e-9)
        assert one.get("der(x)") == pytest.approx(values.get("der(x)", 0.2), abs=1e-7)
        assert one.get("sticks.grip") == (not values)
        assert one.get("contact.belt") == ("z" not in values)
        assert not [text for _, _, text in one.log if "projected" in text]


@pytest.mark.parametrize("friction", [0.0, 0.2, 0.9])
def test_two_rough_feet_that_land_together_share_one_impact(friction: float) -> None:
    """A body dropped flat onto both feet with v along the floor: without turning over, friction takes
    min(v, mu v_n) of it; the feet carry m v_n, and what is lost is heat."""
    height, v = 0.2, 2.0
    fall = float(np.sqrt(2 * g * height))
    values = {"mu": friction, "alpha": 0.0, "y": 0.5 + height, "der(x)": v}
    end = fall / g + 1e-7
    run = {"stop_time": end, "step_size": end, "start_values": values, "tolerance": 1e-10}
    last = simulate(FEET, scene=Scene("Feet"), **run)[-1]
    assert last["contact.low"]
    assert last["contact.up"]
    assert last["der(x)"] == pytest.approx(max(0.0, v - friction * fall), abs=2e-6)
    assert last["der(theta)"] == pytest.approx(0.0, abs=1e-9)
    total = last["energy.total"] + last["energy.dissipated"]
    assert total == pytest.approx(g * (0.5 + height) + v**2 / 2, rel=1e-8)


def test_model_exchange_counts_the_heat_of_impacts_and_slides(built: Build) -> None:
    """A body dropped flat that slides on: `energy.dissipated` jumps by what the impact takes, 1/2 m v_n^2 and
    the friction's share, and grows by -power.grip_low - power.grip_up from there."""
    path = built(FEET)
    values = {"mu": 0.2, "alpha": 0.0, "y": 0.7, "der(x)": 2.0}
    outputs = ["energy.dissipated", "energy.total", "power.grip_low", "power.grip_up", "der(x)"]
    run = {"stop_time": 0.5, "output_interval": 0.01, "start_values": values, "output": outputs}
    far = simulate_fmu(str(path), fmi_type="ModelExchange", relative_tolerance=1e-9, **run)
    fall = np.sqrt(2 * g * 0.2)
    after = 2.0 - 0.2 * fall
    lost = fall**2 / 2 + 2.0**2 / 2 - after**2 / 2
    landed = np.flatnonzero(far["energy.dissipated"])[0]
    assert far["energy.dissipated"][landed] == pytest.approx(lost, rel=1e-6)
    power = far["power.grip_low"] + far["power.grip_up"]
    rubbed = -float(np.sum(np.diff(far["time"]) * (power[1:] + power[:-1]) / 2))
    assert rubbed > 0.5  # J
    assert far["energy.dissipated"][-1] - lost == pytest.approx(rubbed, rel=1e-2)
    total = far["energy.total"] + far["energy.dissipated"]
    np.testing.assert_allclose(total, total[0], rtol=1e-7)


def test_the_energy_dissipated_is_a_state_of_model_exchange(built: Build) -> None:
    """Where frictions rub: calculated at the start, with a derivative, both among the initial unknowns, its
    nominal value the energy of the motion, and set anew by impacts.  A scene that leaves it out has none."""
    root = described(built(FEET))
    entries = root.findall("ModelVariables/ScalarVariable")
    index = {e.get("name"): str(k) for k, e in enumerate(entries, 1)}
    lost, rate = (
        entries[int(index[n]) - 1] for n in ("energy.dissipated", "der(energy.dissipated)")
    )
    assert (lost.get("initial"), lost.get("variability")) == ("calculated", "continuous")
    assert (rate.get("causality"), rate[0].get("unit")) == ("local", "W")
    assert rate[0].get("derivative") == index["energy.dissipated"]
    assert lost[0].get("reinit") == "true"
    assert 0.1 < float(lost[0].get("nominal")) < 100
    for place, n in (("Derivatives", rate), ("InitialUnknowns", rate), ("InitialUnknowns", lost)):
        listed = {u.get("index") for u in root.findall(f"ModelStructure/{place}/Unknown")}
        assert index[n.get("name")] in listed
    root = described(built(FEET, Scene("FeetX", outputs=("x",))))
    assert not [e for e in root.iter("ScalarVariable") if "dissipated" in str(e.get("name"))]
    assert len(root.findall("ModelStructure/Derivatives/Unknown")) == 6


def test_model_exchange_of_two_rows_comes_to_rest_too(built: Build) -> None:
    """The puck slides along its curve, and stops when and where it does in co-simulation."""
    path = str(built(PUCK))
    run = {"stop_time": 2.5, "output_interval": 0.1, "relative_tolerance": 1e-9}
    outputs = ["x", "y", "sticks.grip"]
    near, far = (
        simulate_fmu(path, fmi_type=kind, output=outputs, **run)
        for kind in ("CoSimulation", "ModelExchange")
    )
    assert near["sticks.grip"][-1]
    assert far["sticks.grip"][-1]
    for name in ("x", "y"):
        assert far[name][-1] == pytest.approx(near[name][-1], abs=2e-5)


def test_an_output_is_added_on_the_command_line(tmp_path: Path) -> None:
    """lagfmu build MODEL --add-output: the share of the grip that is used, k x/(mu_s m g) while the block
    rides; in the FMU with its unit, without a change of the file."""
    word = "used = abs(lambda.ride)/(mu_s*m*g) [1]"
    model = str(MODELS / "belt.py")
    options = ["--target", "native", "--out", str(tmp_path), "--add-output", word]
    result = CliRunner().invoke(app, ["build", model, *options])
    assert result.exit_code == 0, result.output
    run = simulate(tmp_path / "native" / "Belt.fmu", stop_time=0.2, step_size=0.1)
    assert run["used"] == pytest.approx(100 * run["x"] / (0.5 * g), abs=1e-12)
    assert run["used"][-1] > 0.7
