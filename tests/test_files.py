"""A file that an engineer has is the model: the commands take it without Python, and run nothing in it."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from lagfmu import simulate
from lagfmu.errors import LagfmuError, LagfmuWarning
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


FOUR_BAR = """<mujoco model="four_bar">
  <default><geom type="capsule" size="0.02" contype="0" conaffinity="0"/><joint axis="0 1 0"/></default>
  <worldbody>
    <body name="crank"><joint name="A"/><geom fromto="0 0 0 0 0 0.3"/>
      <body name="coupler" pos="0 0 0.3"><joint name="B"/><geom fromto="0 0 0 0.9 0 0.2"/></body>
    </body>
    <body name="rocker" pos="0.8 0 0"><joint name="D"/><geom fromto="0 0 0 0.1 0 0.5"/></body>
  </worldbody>
  <equality><connect name="C" body1="coupler" body2="rocker" anchor="0.9 0 0.2"/></equality>
  <actuator><motor name="drive" joint="A" gear="2"/></actuator>
  <keyframe><key name="away" qpos="0.30 -0.28 0.19"/><key name="low" qpos="3 0 0"/></keyframe>
</mujoco>
"""
SLIDE_OF_MJCF = """<mujoco model="M"><worldbody><body name="a"><joint name="s" type="slide" axis="0 0 1"/>
<geom type="sphere" size="0.1" mass="1" contype="0" conaffinity="0"/></body></worldbody>
<actuator><motor name="m" joint="s"/></actuator>
<keyframe><key name="home" qpos="0.25" ctrl="9.81"/></keyframe></mujoco>
"""


def mjcf(tmp_path: Path, text: str) -> Path:
    pytest.importorskip("mujoco")
    path = tmp_path / "m.xml"
    path.write_text(text)
    return path


def test_an_mjcf_file_is_a_model_by_itself(tmp_path: Path) -> None:
    """Its slide falls by g t^2/2; at the key frame whose control is m g it stays; motors= stand in place of
    the file's."""
    path = mjcf(tmp_path, SLIDE_OF_MJCF)
    result = simulate(path, stop_time=1.0, step_size=0.5)
    np.testing.assert_allclose(result["position.s"], -9.81 / 2 * result["time"] ** 2, atol=1e-12)
    held = simulate(load(path, ["key=home"]).model, stop_time=1.0)
    np.testing.assert_allclose(held["position.s"], 0.25, atol=1e-12)
    still = simulate(load(path, ["motors=motion", "position.s=0.5"]).model, stop_time=1.0)
    np.testing.assert_allclose(still["force.s.z"], 9.81)
    assert still["position.s"][-1] == pytest.approx(0.5)
    assert not load(path, ["motors=none"]).model.inputs


@pytest.mark.filterwarnings("ignore:.*follows from the others")
def test_a_loop_closes_near_where_its_file_begins(tmp_path: Path) -> None:
    """A key frame of two digits closes near them, untold; a start that is given is kept, and the others
    follow; a key frame that closes nowhere near is told."""
    path = mjcf(tmp_path, FOUR_BAR)
    near = dict(load(path, ["key=away"]).model.joint_starts)
    assert near["angle.A"][0] == pytest.approx(0.30, abs=0.05)
    assert near["angle.D"][0] == pytest.approx(0.20, abs=0.05)
    asked = load(path, ["angle.A=0.5"]).model.joint_starts
    assert asked["angle.A"] == (0.5, True)
    with pytest.warns(LagfmuWarning, match="its equalities miss by 1.7"):
        load(path, ["key=low"])
    with pytest.raises(LagfmuError, match=r"motors=motion: angle\.A, angle\.B, angle\.D are tied"):
        load(path, ["motors=motion"])


def test_arguments_of_an_mjcf_file_that_are_none_are_told_at_once(tmp_path: Path) -> None:
    """With what there is."""
    path = mjcf(tmp_path, SLIDE_OF_MJCF)
    with pytest.raises(LagfmuError) as caught:
        load(path, ["key", "motors=some", "base=floating"])
    told = str(caught.value)
    for part in (
        "'key': expected key=...",
        "motors=file or none or torque",
        "'base=floating': exp",
    ):
        assert part in told
    with pytest.raises(LagfmuError, match="no key frame is called 'up', expected one of home"):
        load(path, ["key=up"])


def test_without_mujoco_an_mjcf_file_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the words of an error, whatever the command."""
    path = tmp_path / "m.xml"
    path.write_text(SLIDE_OF_MJCF)
    monkeypatch.setitem(sys.modules, "mujoco", None)
    done = CliRunner().invoke(app, ["show", str(path)])
    assert done.exit_code != 0
    assert "reading MJCF needs mujoco: pip install mujoco" in " ".join(done.output.split())


@pytest.mark.filterwarnings("ignore:.*follows from the others")
def test_new_writes_the_python_file_of_an_mjcf_file(tmp_path: Path) -> None:
    """It makes the same model as the file itself."""
    path = mjcf(tmp_path, FOUR_BAR)
    asked = ["new", str(tmp_path / "own" / "my.py"), "--from", str(path)]
    assert CliRunner().invoke(app, asked).exit_code == 0
    of_python, of_file = load(tmp_path / "own" / "my.py").model, load(path).model
    assert of_python.start == of_file.start
    assert of_python.lagrangian == of_file.lagrangian
    assert of_python.inputs == of_file.inputs
