"""A scene holds what is asked for and nothing else; what it still reports are the full FMU's numbers."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from conftest import KINDS, MODELS, of_each_kind, scene_of
from runs import simulate_fmu, sources
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner

from lagfmu import Contact, Model, Parameter, simulate, verify
from lagfmu.errors import LagfmuError, ModelError
from lagfmu.methods import METHODS
from lagfmu.testing import (
    NATIVE,
    OPERATIONS,
    Prepared,
    Trajectory,
    app,
    model_source,
    prepare,
    savings,
)

FORCES = ("lambda.*", "Q.*")
Make = Callable[..., Path]


@pytest.fixture
def make(built: Any) -> Callable[..., Path]:
    """make(NAME, **needs): the FMU of a model for a scene that needs less."""

    def made(name: str, /, **needs: Any) -> Path:
        file, scene = scene_of(name)
        return built(file.model, replace(scene, **needs), file.closed_forms, whole=True)

    return made


def narrowed(name: str, **needs: Any) -> Prepared:
    """What such a scene prepares."""
    file, scene = scene_of(name)
    return prepare(file.model, replace(scene, **needs))


def largest_difference(one: Trajectory, other: Trajectory, names: Any) -> float:
    """Of some outputs, relative to the largest magnitude of each."""
    worst = 0.0
    for n in names:
        a, b = np.asarray(one[n], float), np.asarray(other[n], float)
        scale = np.abs(a).max() or 1.0
        worst = max(worst, float(np.abs(a - b).max() / scale))
    return worst


@cache
def exactly(path: Path) -> Trajectory:
    """A full FMU's own run at the tolerance 1e-11, with dop853: several scenes are held against it."""
    return simulate(path, tolerance=1e-11, start_values={"solver.method": "dop853"})


def variables(path: Path) -> dict[str, Any]:
    """The FMU's variables by name."""
    return {v.name: v for v in fmpy.read_model_description(str(path)).modelVariables}


def named(path: Path, causality: str) -> list[str]:
    """The names of its outputs, or parameters."""
    return [n for n, v in variables(path).items() if v.causality == causality]


# ---------------------------------------------------------------------------- the same numbers


@pytest.mark.parametrize("name", ["Hemisphere", "CartPendulum"])
def test_the_full_fmu_is_the_scene_that_asks_for_everything(
    name: str, native_fmu: Any, make: Make
) -> None:
    """Asking for every output, parameter, input, contact and method by pattern is asking for nothing
    less: the same bytes, but for the icon, which the FMUs that tests share do not have."""
    asked = make(name, outputs=["*"], inputs=["*"], contacts=["*"], methods=METHODS)
    full, other = (
        {n: archive.read(n) for n in archive.namelist() if not n.startswith("terminalsAndIcons/")}
        for archive in (zipfile.ZipFile(native_fmu(name)), zipfile.ZipFile(asked))
    )
    assert full == other


@pytest.mark.parametrize("name", of_each_kind(KINDS, kinds=("Hemisphere", "KnifeEdge", "HalfCar")))
def test_forces_alone_are_the_same_to_the_last_bit(name: str, native_fmu: Any, make: Make) -> None:
    """lambda and Q do not depend on whether anybody reads the coordinates and energies beside them."""
    _, scene = scene_of(name)
    needs = {"outputs": FORCES, "method": "dop853", "formulation": scene.formulation}
    path = make(name, **needs)
    full = simulate(native_fmu(name), start_values={"solver.method": "dop853"})
    run = simulate(path)
    names = [n for n in full.dtype.names if n.startswith(("lambda.", "Q."))]
    assert named(path, "output") == names
    prepared = narrowed(name, **needs)
    assert prepared.coded.equations.nv == len(prepared.model.coordinates)
    for n in names:
        assert (run[n] == full[n]).all(), n


@pytest.mark.parametrize(
    "name", of_each_kind(KINDS, kinds=("Hemisphere", "CartPendulum", "BouncingBall"))
)
def test_numbers_in_the_code_are_the_parameters_values(
    name: str, native_fmu: Any, make: Make
) -> None:
    """lambda and Q with every parameter folded in differ from the full FMU's by rounding, which a run
    at the tolerance 1e-11 carries no further than 1e-8 of their size."""
    path = make(name, outputs=FORCES, fixed=["*"], method="dop853")
    full = exactly(native_fmu(name))
    run = simulate(path, tolerance=1e-11)
    names = [n for n in run.dtype.names if n != "time"]
    assert largest_difference(full, run, names) < 1e-8
    assert set(named(path, "parameter")) == {
        "solver.tolerance",
        "solver.maximum_step",
        "solver.maximum_steps",
    }
    found = verify(path)  # what is left of the closed forms, with the numbers for the parameters
    assert found.closed_forms > 0
    assert found.passed, [c for c in found.checks if not c.passed]


@pytest.mark.parametrize(
    "name", of_each_kind(KINDS, kinds=("PendulumAngle", "KnifeEdge", "CartPendulum"))
)
def test_coordinates_alone_follow_the_same_motion(name: str, native_fmu: Any, make: Make) -> None:
    """The motion does not depend on the formulation, nor on what is read: coordinates at the tolerance
    1e-11 agree to 1e-8 of their size."""
    names = [str(q.func) for q in scene_of(name)[0].model.coordinates]
    path = make(name, outputs=names, method="dop853")
    prepared = narrowed(name, outputs=names)
    full = exactly(native_fmu(name))
    run = simulate(path, tolerance=1e-11)
    assert named(path, "output") == [n for n in full.dtype.names if n in names]
    assert largest_difference(full, run, names) < 1e-8
    if prepared.formulation == "minimal":  # then no constraint is left to solve for
        assert prepared.system.m == 0


# ---------------------------------------------------------------------------- what goes


def test_who_only_reads_places_pays_for_no_multiplier() -> None:
    """The Cartesian pendulum for x and y is the equation of the angle, m L^2 theta'' = -m g L sin theta,
    and two functions of it: no row, no G, no lambda."""
    prepared = narrowed("PendulumCartesian", outputs=["x", "y"])
    assert prepared.formulation == "minimal"
    assert prepared.system.coordinates == ("theta",)
    assert prepared.system.m == 0
    assert prepared.coded.equations.bare
    text = model_source(prepared.coded, False)
    assert "lambda[0]" not in text  # none is computed
    assert "static void tangent(" not in text
    again = narrowed("PendulumCartesian", outputs=["x", "lambda.rod"])
    assert again.formulation == "multipliers"


def test_a_coordinate_on_which_no_output_depends_is_gone() -> None:
    """The knife edge turns at constant rate whatever its place: for phi alone, x, y and the edge's
    constraint are not there, nor the mass, gravity and slope behind them."""
    prepared = narrowed("KnifeEdge", outputs=["phi"])
    assert prepared.system.coordinates == ("phi",)
    assert prepared.system.rows == ()
    assert prepared.system.parameters == ("J",)
    assert set(prepared.numbers) == {"m", "g", "alpha"}


def test_a_force_needs_all_that_is_solved_with_it() -> None:
    """lambda of the knife edge depends on x, y and phi: nothing of the equations can go."""
    prepared = narrowed("KnifeEdge", outputs=["lambda.edge"])
    assert prepared.system.coordinates == ("x", "y", "phi")
    assert [v.name for v in prepared.table.outputs] == ["lambda.edge"]


def test_a_contact_that_cannot_open_pulls(make: Make) -> None:
    """A bead on a hoop cannot leave it: lambda = m g (3 cos theta - 2 cos theta0) goes through zero at
    cos theta = 2/3 cos theta0 and becomes negative, where the particle would have flown."""
    path = make("Hemisphere", outputs=["lambda.surface", "theta"], contacts=[])
    run = simulate(path, tolerance=1e-10)
    m, g = 1.0, 9.81
    expected = m * g * (3 * np.cos(run["theta"]) - 2 * np.cos(run["theta"][0]))
    assert run["lambda.surface"].min() < -m * g
    assert np.abs(run["lambda.surface"] - expected).max() < 1e-8 * m * g
    assert not [n for n in variables(path) if n.startswith(("contact", "departure"))]


def test_a_number_may_open_a_contact_at_the_start() -> None:
    """At r = 1 m the particle hovers over a hemisphere of 0.5 m: that the contact holds contradicts the
    radius that the scene gives, not the model's own; a start at r = a goes with it."""
    file, scene = scene_of("Hemisphere")
    small = replace(scene, contacts=[], fixed=["a=0.5"])
    assert prepare(file.model, small).structure.degrees_of_freedom == 1
    r, theta = file.model.coordinates
    numbers = replace(file.model, start={r: 1.0, theta: 0.01})
    with pytest.raises(ModelError, match=r"'surface' is open at the start"):
        prepare(numbers, small)


def test_an_input_that_nothing_drives_is_a_number(native_fmu: Any, make: Make) -> None:
    """The cart under no force moves as with F = 0 held, and F is not there."""
    path = make("CartPendulum", inputs=[], method="dop853")
    full = exactly(native_fmu("CartPendulum"))
    run = simulate(path, tolerance=1e-11)
    assert "F" not in variables(path)
    assert largest_difference(full, run, ["s", "x", "y", "lambda.rod"]) < 1e-9


def test_a_number_can_be_another_than_the_models(make: Make) -> None:
    """On the moon, g = 1.62 m/s2, the string of the machine pulls with 2 m1 m2 g / (m1 + m2)."""
    path = make("Atwood", outputs=["lambda.string"], fixed=["g=1.62"])
    run = simulate(path)
    assert run["lambda.string"] == pytest.approx(-2 * 2.0 * 1.0 * 1.62 / (2.0 + 1.0), rel=1e-12)
    assert "g" not in variables(path)
    assert {"m1", "m2"} <= set(variables(path))


def test_start_values_can_be_set_though_nobody_reads_them(make: Make) -> None:
    """A particle that starts at theta0 = 1 rad with nothing but lambda to be read still leaves where
    cos theta = 2/3 cos theta0: lambda is m g cos theta0 at the start and zero in flight."""
    path = make("Hemisphere", outputs=["lambda.surface"], fixed=["m=1", "g=9.81"])
    assert named(path, "output") == ["lambda.surface"]
    assert variables(path)["theta"].causality == "local"
    run = simulate(path, start_values={"theta": 1.0}, tolerance=1e-10)
    assert run["lambda.surface"][0] == pytest.approx(9.81 * np.cos(1.0), rel=1e-12)
    assert run["lambda.surface"][-1] == 0
    assert verify(path, {"theta": 1.0}).passed


def test_model_exchange_of_a_scene(make: Make) -> None:
    """An importer's integrator finds the states and their derivatives of a pruned FMU too, as local
    variables: the pendulum's x goes the same way."""
    path = make("PendulumCartesian", outputs=["x"], fixed=["*"], stop_time=2.0)
    run = simulate_fmu(str(path), fmi_type="ModelExchange", relative_tolerance=1e-9)
    twin = simulate(path, tolerance=1e-10)
    assert run["x"][-1] == pytest.approx(twin["x"][-1], abs=1e-6)


# ---------------------------------------------------------------------------- parts of the runtime


def test_one_integrator_and_no_event_code_are_linked(make: Make, native_fmu: Any) -> None:
    """A pendulum has no contact and a scene one method: the other integrators and the search for events
    are neither in the sources nor in the binary."""
    path = make("PendulumCartesian", outputs=["lambda.rod"], method="dop853")
    gone = {"rk4.c", "radau.c", "rattle.c", "events.c", "contacts.c", "modes.c"}
    assert not gone & sources(path).keys()
    assert {"dop853.c", "optional.c"} <= sources(path).keys()
    full = native_fmu("PendulumCartesian")
    assert gone & sources(full).keys() == gone - {"events.c", "contacts.c", "modes.c"}
    size = {p: zipfile.ZipFile(p).getinfo(_binary(p)).file_size for p in (path, full)}
    assert size[path] < 0.93 * size[full]


def test_without_constraints_there_are_no_rungs_for_them(make: Make, built: Any) -> None:
    """A pendulum of which only its place is read is one angle, and no multiplier: what solves for dependent
    rows is not there, as in the FMU of a spring and a mass; which without its mass is still refused."""
    place = make("PendulumAngle", outputs=["x"])
    x = dynamicsymbols("x")
    m, k = symbols("m k", nonnegative=True)
    spring = Model(
        name="Spring",
        lagrangian=m * x.diff() ** 2 / 2 - k * x**2 / 2,
        coordinates={x: "m"},
        parameters=[Parameter(m, 1.0, "kg"), Parameter(k, 1.0, "N/m")],
        start={x: 1.0},
    )
    path = built(spring, whole=True)
    for fmu in (place, path):
        held = {Path(n).stem for n in sources(fmu) if n.endswith(".c")}
        assert not {"orthogonal", "nullspace", "weighted", "cod", "leastnorm"} & held
        assert {"kkt", "schur"} <= held
    assert simulate(path, 1.0)["x"][-1] == pytest.approx(np.cos(1.0), rel=1e-7)
    with pytest.raises(LagfmuError, match="the mass matrix is singular"):
        simulate(path, 0.1, start_values={"m": 0.0})


def _binary(path: Path) -> str:
    with zipfile.ZipFile(path) as archive:
        return next(n for n in archive.namelist() if n.startswith("binaries/"))


def test_an_undamped_scene_has_one_integrator_by_default() -> None:
    """radau cures stiffness by damping.  Where no force holds a velocity nothing damps: `auto` is dop853
    alone; the slider-crank's damper keeps both."""
    for name, fixed, selectable in (
        ("PendulumCartesian", [], "dop853"),
        ("CartPendulum", [], "auto"),
        ("CartPendulum", ["c=0"], "dop853"),
    ):
        prepared = narrowed(name, outputs=["lambda.rod"], fixed=fixed)
        assert prepared.scene.selectable == (selectable,)


def test_a_stiff_scene_of_forces_goes_on_with_radau(native_fmu: Any, make: Make) -> None:
    """A cart in syrup, c = 1e6 N s/m, is stiff for its pendulum beside it: of a scene that reads lambda
    alone `auto` still takes the implicit method, with its Jacobian, and few steps."""
    path = make("CartPendulum", outputs=["lambda.rod"], fixed=["c=1e6"])
    full = simulate(native_fmu("CartPendulum"), 1.0, start_values={"c": 1e6}, besides=())
    run = simulate(path, 1.0, besides=["solver.steps"])
    assert run["solver.steps"][-1] < 5000
    assert largest_difference(full, run, ["lambda.rod"]) < 1e-6


def test_a_method_that_was_left_out_cannot_be_chosen(make: Make) -> None:
    """Of two methods the FMU offers these, by name, and refuses a third."""
    path = make("PendulumCartesian", methods=["dop853", "rk4"], method="dop853")
    assert variables(path)["solver.method"].description == "integrator: dop853 or rk4 (fixed step)"
    simulate(path, stop_time=0.1, start_values={"solver.method": "rk4"})
    with pytest.raises(LagfmuError, match="'radau'"):
        simulate(path, stop_time=0.1, start_values={"solver.method": "radau"})


def test_a_scene_of_forces_offers_no_directional_derivatives(make: Make) -> None:
    """Unless they are asked for: fmi2GetDirectionalDerivative, and the equations behind it."""
    for asked, expected in ((None, False), (True, True)):
        path = make("PendulumCartesian", outputs=["lambda.rod"], derivatives=asked)
        description = fmpy.read_model_description(str(path))
        assert description.coSimulation.providesDirectionalDerivative is expected
        with zipfile.ZipFile(path) as archive:
            assert (b"static void tangent(" in archive.read("sources/model.c")) is expected


# ---------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("name", "needs", "parts"),
    [
        (  # all at once, each with what it might have meant
            "Hemisphere",
            {
                "outputs": ["lamda.surface"],
                "fixed": ["M", "g=x", "a=-1"],
                "contacts": ["floor"],
                "inputs": ["F"],
            },
            [
                "output 'lamda.surface' is unknown; did you mean 'lambda.surface'",
                "fixed parameter 'M' is unknown",
                "fixed parameter 'g' = 'x' is no number",
                "fixed parameter 'a' = -1.0",
                "contact 'floor' is unknown; did you mean 'surface'",
                "input 'F' is unknown; there is none",
            ],
        ),
        # the ball begins above the ground: that it is held there contradicts the start
        (
            "BouncingBall",
            {"contacts": []},
            ["'floor' is open at the start", "name it in `contacts`"],
        ),
        # a pendulum without length has no angle: the folded equations would be 0/0
        ("PendulumCartesian", {"fixed": ["L=0"]}, ["'L' = 0.0"]),
        # there would be nothing to integrate
        ("Hemisphere", {"outputs": ["solver.steps"]}, ["depend on no coordinate"]),
        # a text would be taken letter by letter
        ("Atwood", {"outputs": "lambda.rod"}, ["outputs = 'lambda.rod', expected a list of names"]),
        *(  # whoever knows SciPy's integrators is told which of the menu does their work
            ("Atwood", {"method": given}, [f"method '{given}' is unknown", f": take {instead}"])
            for given, instead in {
                "RK45": "dop853",
                "DOP853": "dop853",
                "Radau": "radau",
                "LSODA": "auto",
            }.items()
        ),
    ],
)
def test_a_scene_that_cannot_be_is_refused(name: str, needs: Any, parts: list[str]) -> None:
    """Unknown names, a contact that cannot stay closed, a number that is divided by, no motion at all."""
    with pytest.raises(LagfmuError) as refused:
        narrowed(name, **needs)
    for part in parts:
        assert part in str(refused.value)


# ---------------------------------------------------------------------------- what it saved


def test_savings_are_counted_on_the_code() -> None:
    """Places alone halve the pendulum's operations; a full scene saves nothing."""
    assert savings(narrowed("PendulumCartesian")) is None
    found = savings(narrowed("PendulumCartesian", outputs=["x", "y"], fixed=["*"]))
    assert found is not None
    full, scene_ = found.full, found.scene
    assert scene_[OPERATIONS] < 0.5 * full[OPERATIONS]
    assert scene_[NATIVE] < full[NATIVE]
    for what, before, after in (
        ("coordinates that are integrated", 2, 1),
        ("constraints that are solved with them", 1, 0),
    ):
        assert (full[what], scene_[what]) == (before, after)
    assert any("no multiplier is solved for" in text for text in found.left_out)
    assert any("m = 1 kg" in text for text in found.left_out)


def test_show_tells_what_was_left_out() -> None:
    """lagfmu show MODEL.py --outputs lambda.surface --fixed m,g."""
    result = CliRunner().invoke(
        app,
        ["show", str(MODELS / "hemisphere.py"), "--outputs", "lambda.surface", "--fixed", "m,g"],
    )
    assert result.exit_code == 0, result.output
    text = " ".join(result.output.split())
    assert "What the scene leaves out" in text
    assert "parameters that are numbers in the code: m = 1 kg, g = 9.81 m/s2" in text
    assert "operations of the right-hand side" in text


def test_the_command_line_builds_a_scene(tmp_path: Path) -> None:
    """lagfmu build --outputs --fixed --name: the pruned FMU passes its closed forms; a file of three FMUs
    needs --scene for a --name."""
    words = f"--fixed m,g --name Normal --target native --out {tmp_path}".split()
    asked = ["--outputs", "lambda.*,departure.surface.time", *words]
    refused = CliRunner().invoke(app, ["build", str(MODELS / "pendulum.py"), *words])
    assert refused.exit_code == 2
    assert "choose one of them with --scene" in " ".join(refused.output.split())
    result = CliRunner().invoke(app, ["build", str(MODELS / "hemisphere.py"), *asked])
    assert result.exit_code == 0, result.output
    path = tmp_path / "native" / "Normal.fmu"
    assert named(path, "output") == ["lambda.surface", "departure.surface.time"]
    page = zipfile.ZipFile(path).read("documentation/index.html").decode()
    assert "What this scene leaves out" in page


def test_a_scene_may_ask_for_an_accuracy(make: Make) -> None:
    """Scene(accuracy='1e-4:lambda.string'): settings are measured, and the FMU holds lambda to that."""
    path = make("Atwood", accuracy="1e-4:lambda.string", outputs=["lambda.string"])
    run = simulate(path)
    assert run["lambda.string"] == pytest.approx(-2 * 2.0 * 1.0 * 9.81 / (2.0 + 1.0), rel=1e-4)
    page = zipfile.ZipFile(path).read("documentation/index.html").decode()
    assert 'id="choice"' in page


@pytest.mark.parametrize("name", ["Hemisphere", "RollingSphere", "Loop"])
def test_a_contact_that_holds_is_a_holonomic_constraint(name: str) -> None:
    """In the equations of a scene without `contacts`, no inequality is left, and what acts while the
    contact is closed acts always."""
    prepared = narrowed(name, contacts=[])
    assert not any(isinstance(c, Contact) for c in prepared.equations.constraints)
    assert prepared.system.contacts == ()
    assert len(prepared.system.permanent) == prepared.system.m
    assert all(row.kind != "contact" for row in prepared.system.rows)


def test_reals_alone_tell_the_same(make, native_fmu):
    """With reals_only no variable is a Boolean, Integer or Enumeration: mode 1.0, count 1.0, and every number
    that of the full FMU; its closed forms hold."""
    path = make("Hemisphere", name="HemisphereReals", reals_only=True, method="dop853")
    found = variables(path)
    assert {v.type for v in found.values()} == {"Real"}
    assert "solver.method" not in found
    assert all(v.unit == "1" for n, v in found.items() if n.startswith(("contact.", "unique.")))
    reals = simulate(path, stop_time=2.0, step_size=0.1)
    full = simulate(native_fmu("Hemisphere"), 2.0, 0.1, start_values={"solver.method": "dop853"})
    for name in full.dtype.names:
        np.testing.assert_array_equal(reals[name], full[name].astype(float), name)
    assert reals["contact.surface"][[0, -1]].tolist() == [1.0, 0.0]
    assert reals["departure.surface.count"][-1] == 1.0
    assert verify(path).passed
