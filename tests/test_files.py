"""A file that an engineer has is the model: the commands take it without Python, and run nothing in it."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lagfmu import simulate
from lagfmu.errors import LagfmuError
from lagfmu.testing import app, load

ARM = Path(__file__).parent.parent / "models" / "arm.urdf"
INERTIA = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
BODY = f'<link name="a"><inertial><mass value="1"/>{INERTIA}</inertial></link>'
SLIDE = '<joint name="s" type="prismatic"><parent link="b"/><child link="a"/><axis xyz="0 0 1"/></joint>'


def robot(
    tmp_path: Path, text: str = f'<robot name="R"><link name="b"/>{BODY}{SLIDE}</robot>'
) -> Path:
    path = tmp_path / "r.urdf"
    path.write_text(text)
    return path


def test_a_urdf_file_is_a_model_by_itself(tmp_path: Path) -> None:
    """What slides along the vertical falls by g t^2/2, with 9.81 m/s^2; an argument says where it begins."""
    result = simulate(robot(tmp_path), stop_time=1.0, step_size=0.5)
    np.testing.assert_allclose(result["position.s"], -9.81 / 2 * result["time"] ** 2, atol=1e-12)
    begun = load(robot(tmp_path), ["position.s=0.25"]).model
    assert simulate(begun, stop_time=0.5)["position.s"][0] == 0.25


def test_motors_are_inputs_of_torque_or_of_motion(tmp_path: Path) -> None:
    """A force of m g holds the weight; prescribed at rest the joint needs it."""
    by_force = load(robot(tmp_path), ["motors=torque"]).model
    held = simulate(by_force, stop_time=1.0, start_values={"s_motor.force": 9.81})
    np.testing.assert_allclose(held["position.s"], 0, atol=1e-12)
    still = simulate(load(robot(tmp_path), ["motors=motion"]).model, stop_time=1.0)
    np.testing.assert_allclose(still["force.s.z"], 9.81)


def test_a_floating_base_is_asked_for(tmp_path: Path) -> None:
    """A single link falls; without a floating base nothing moves, which is told."""
    path = robot(tmp_path, f'<robot name="R">{BODY}</robot>')
    result = simulate(load(path, ["base=floating"]).model, stop_time=1.0)
    assert result["a.position.z"][-1] == pytest.approx(-9.81 / 2)
    with pytest.raises(LagfmuError, match="base=floating"):
        load(path)


def test_arguments_that_are_none_are_told_at_once(tmp_path: Path) -> None:
    """With what there is."""
    with pytest.raises(LagfmuError) as caught:
        load(robot(tmp_path), ["base=loose", "wheels=4", "position.s=far"])
    told = str(caught.value)
    for part in ("base=fixed or floating", "'wheels=4': expected base=", "'far' is no number"):
        assert part in told


def test_new_writes_the_python_file_to_go_on_from(tmp_path: Path) -> None:
    """It makes the same model as the file itself."""
    shutil.copy(ARM, tmp_path / "arm.urdf")
    (tmp_path / "own").mkdir()
    asked = ["new", str(tmp_path / "own" / "my.py"), "--from", str(tmp_path / "arm.urdf")]
    assert CliRunner().invoke(app, asked).exit_code == 0
    of_python, of_file = load(tmp_path / "own" / "my.py").model, load(tmp_path / "arm.urdf").model
    assert of_python.start == of_file.start
    assert of_python.lagrangian == of_file.lagrangian
