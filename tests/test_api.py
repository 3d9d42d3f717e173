"""build_fmu(): built once, verified once, the figures in the FMU's page."""

from __future__ import annotations

import zipfile
from dataclasses import replace

import pytest
from conftest import MODELS, model_file
from fmpy import read_model_description
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner
from zoo import point_mass

import lagfmu
from lagfmu import (
    ClosedForm,
    Contact,
    Scene,
    VerificationError,
    build_fmu,
    simulate,
    verify,
)
from lagfmu.errors import BuildError, SettingError
from lagfmu.testing import NoCompilerWarning, app, load, target_in, targets

m, g = symbols("m g", positive=True)
z = dynamicsymbols("z")
RESTING = point_mass("Resting", "z", [Contact("floor", z)], up=z, mass=2.0)
WEIGHT = ClosedForm("lambda.floor", m * g)


def page(path) -> str:
    with zipfile.ZipFile(path) as archive:
        return archive.read("documentation/index.html").decode()


@pytest.mark.parametrize("target", ["python", "native"])
def test_a_particle_at_rest_is_verified_when_it_is_built(tmp_path, target):
    """The floor carries the weight, lambda = m g, and the page of the FMU says that this was found."""
    path = build_fmu(RESTING, tmp_path, Scene("Resting"), [WEIGHT], target)
    assert path == tmp_path / "Resting.fmu"
    assert "lambda.floor" in page(path).split("Verification")[-1]


def test_a_statement_that_does_not_hold_is_an_error_and_the_file_is_kept(tmp_path):
    """A floor that would carry twice the weight: the message names the statement, its error and what is
    allowed; the FMU stands, and its page shows the failure."""
    twice = ClosedForm("lambda.floor", 2 * m * g)
    with pytest.raises(VerificationError, match=r"lambda\.floor: FAIL 5\.0e-01") as refused:
        build_fmu(RESTING, tmp_path, Scene("Resting"), [twice], "native")
    assert "Resting.fmu" in str(refused.value)
    assert "FAIL" in page(tmp_path / "Resting.fmu")


def test_the_licence_of_the_runtime_is_not_the_models(tmp_path):
    """What lagfmu puts in is under its own licence, which a file says; the description has the model's."""
    for model, said in ((RESTING, None), (replace(RESTING, license="CC0-1.0"), "CC0-1.0")):
        path = build_fmu(model, tmp_path, target="native", check=False)
        assert read_model_description(str(path)).license == said
        with zipfile.ZipFile(path) as archive:
            text = archive.read("documentation/licenses/license.txt").decode()
        assert "sources/ but for model.c" in text
        assert "MIT License" in text
    lean = build_fmu(model, tmp_path, target="native", check=False, sources=False)
    with zipfile.ZipFile(lean) as archive:
        assert "sources/" not in archive.read("documentation/licenses/license.txt").decode()


def test_figures_change_nothing_but_the_page(tmp_path):
    """With and without verification the FMU is the same, byte for byte, in all but its page."""
    contents = []
    for check in (True, False):
        path = build_fmu(RESTING, tmp_path, None, [WEIGHT], "native", check=check)
        with zipfile.ZipFile(path) as archive:
            contents.append({n: archive.read(n) for n in archive.namelist()})
    with_figures, without = contents
    assert with_figures.pop("documentation/index.html") != without.pop("documentation/index.html")
    assert with_figures == without


@pytest.mark.thorough
def test_an_fmu_for_other_machines_builds(tmp_path):
    """One without a binary for this machine cannot be simulated here, and is built all the same."""
    foreign = "darwin64"
    path = build_fmu(RESTING, tmp_path, None, [WEIGHT], "native", [foreign])
    with zipfile.ZipFile(path) as archive:
        assert any(n.startswith(f"binaries/{foreign}/") for n in archive.namelist())


@pytest.mark.parametrize("asked", [None, "native", "python"])
def test_the_floor_carries_the_weight_on_the_target_that_the_result_names(asked):
    """lambda = m g on both; native where none is asked for, and the first line that is printed says it."""
    run = simulate(RESTING, 0.1, target=asked)
    assert run["lambda.floor"] == pytest.approx(2.0 * 9.81, rel=1e-12)
    assert run.target == run[-3:].target == (asked or "native")
    assert repr(run).startswith(f"Resting ({run.target}): ")
    assert f"Resting ({run.target}): " in run._repr_html_()
    with pytest.raises(ValueError, match=r"no column of Resting; did you mean 'lambda.floor'"):
        run["lambda.flor"]


def test_without_a_compiler_a_weight_is_carried_in_python_and_the_remedy_is_named(
    tmp_path, monkeypatch
):
    """What would be native is python, with a warning that names the package; what is asked for stays."""
    monkeypatch.setattr(targets, "find_compiler", lambda: None)
    with pytest.warns(NoCompilerWarning, match=r"pip install ziglang; the target is python"):
        run = simulate(RESTING, 0.1)
    assert run.target == "python"
    assert run["lambda.floor"] == pytest.approx(2.0 * 9.81, rel=1e-12)
    with pytest.warns(NoCompilerWarning):
        assert target_in(build_fmu(RESTING, tmp_path, closed_forms=[WEIGHT])) == "python"
    with pytest.warns(NoCompilerWarning):
        assert verify(RESTING, closed_forms=[WEIGHT]).passed
    assert simulate(tmp_path / "Resting.fmu", 0.1).target == "python"


def test_a_model_file_runs_in_its_first_scene_unless_another_is_given(native_fmu):
    """The pendulum's file in x and y, then in its angle; an FMU is in its scene already."""
    path = MODELS / "pendulum.py"
    first, second, *_ = load(path).scenes
    assert simulate(path, 0.1).name == first.name
    for scene in (second, second.name):
        assert simulate(str(path), 0.1, scene=scene).name == second.name
        assert lagfmu.show(path, scene).prepared.scene.name == second.name
        assert lagfmu.play(path, scene).name == second.name
    with pytest.raises(SettingError, match=r"no FMU is called 'Nothing'; known: "):
        simulate(path, 0.1, scene="Nothing")
    with pytest.raises(SettingError, match=r"scene .* is for a model file: .* is an FMU"):
        lagfmu.play(native_fmu(first.name), second.name)
    with pytest.raises(SettingError, match=r"scene .* is for a model: .* is an FMU"):
        simulate(native_fmu(first.name), 0.1, scene=second)


def test_without_a_compiler_what_slips_is_refused_with_the_remedy(monkeypatch):
    """A block on a belt sticks and slips, which native FMUs alone do: the refusal names the friction, and the
    package that compiles it."""
    monkeypatch.setattr(targets, "find_compiler", lambda: None)
    file = model_file("belt")
    told = r"it has no friction \('grip'\); build --target native \(.*pip install ziglang"
    with pytest.warns(NoCompilerWarning), pytest.raises(BuildError, match=told):
        simulate(file.model, 0.1, scene=file.scenes[0])


def test_without_a_compiler_the_command_says_what_it_builds(tmp_path, monkeypatch):
    """`lagfmu build` and `lagfmu simulate` of the particle at rest: python, as folder and title say."""
    monkeypatch.setattr(targets, "find_compiler", lambda: None)
    (tmp_path / "resting.py").write_text(
        "from sympy import symbols\nfrom sympy.physics.mechanics import dynamicsymbols\n"
        "from lagfmu import Contact, Model, Parameter\n"
        "m, g, z = *symbols('m g', positive=True), dynamicsymbols('z')\n"
        "model = Model('Resting', lagrangian=m*z.diff()**2/2 - m*g*z, coordinates={z: 'm'},\n"
        "    constraints=[Contact('floor', z)],\n"
        "    parameters=[Parameter(m, 2.0, 'kg'), Parameter(g, 9.81, 'm/s^2')])\n"
    )
    for command in (["build", "--out", str(tmp_path), "--no-check"], ["simulate"]):
        done = CliRunner().invoke(app, [command[0], str(tmp_path / "resting.py"), *command[1:]])
        assert done.exit_code == 0, done.output
        assert done.output.count("pip install ziglang") == 1
    assert "Resting (python) at t = " in done.output
    assert target_in(tmp_path / "python" / "Resting.fmu") == "python"
    assert not (tmp_path / "native").exists()


def test_an_fmu_runs_as_what_it_is(tmp_path):
    """The target is fixed when it is built: another one is refused by name."""
    path = build_fmu(RESTING, tmp_path, check=False)
    assert simulate(path, 0.1).target == "native"
    with pytest.raises(SettingError, match="target 'python' is for a model"):
        simulate(path, 0.1, target="python")
