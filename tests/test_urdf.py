"""Bodies and joints from URDF files: what is taken, and what is refused by name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robots import BASE, HINGE, MASS, joint, link, robot

from lagfmu import derive, simulate
from lagfmu.bodies import Gravity, Revolute, from_urdf, mechanism
from lagfmu.errors import LagfmuWarning, ModelError
from lagfmu.testing import Form, model_source

ARM = Path(__file__).parent.parent / "models" / "arm.urdf"


def test_links_are_bodies_and_joints_keep_their_names() -> None:
    """The root is the ground; a link without mass that is fixed to another is a frame on it."""
    arm = from_urdf(ARM)
    assert [body.name for body in arm.bodies][:2] == ["shoulder", "upper_arm"]
    assert [j.name for j in arm.joints] == [f"j{k}" for k in range(1, 7)]
    assert all(isinstance(j, Revolute) for j in arm.joints)
    assert arm.joints[0].limits == (-3.0, 3.0)
    assert arm.joints[5].limits is None
    assert arm.frames["tool"].body is arm.bodies[-1]
    assert {j.limits for j in from_urdf(ARM, limits=False).joints} == {None}


def test_an_inertia_in_turned_axes_is_turned_into_those_of_the_link() -> None:
    """J = R J' R^T keeps its trace and its principal moments."""
    body = {b.name: b for b in from_urdf(ARM).bodies}["wrist_1"]
    xx, yy, zz, xy, xz, yz = body.inertia
    J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    np.testing.assert_allclose(np.linalg.eigvalsh(J), [0.0012, 0.0019, 0.0022], rtol=1e-12)
    c, s = np.cos(0.3), np.sin(0.3)
    assert yz == pytest.approx(c * s * (0.0019 - 0.0012))


def test_the_damping_of_a_file_makes_a_mechanism(tmp_path: Path) -> None:
    """<dynamics damping> turns by -c der(angle), in a slide it pushes by -c der(position)."""
    damped = '<dynamics damping="2"/>', '<dynamics damping="3"/>'
    turns, slides = (
        joint("j", "base", "a", more=damped[0]),
        joint("s", "a", "b", "prismatic", damped[1]),
    )
    read = from_urdf(robot(tmp_path, BASE, *map(link, "ab"), turns, slides))
    model = mechanism("R", bodies=read.bodies, joints=read.joints, loads=read.loads)
    units = {
        str(p.symbol): (p.value, p.unit) for p in model.parameters if "damping" in str(p.symbol)
    }
    assert units == {
        "j_damper.damping": (2.0, "N.m.s/rad"),
        "s_damper.damping": (3.0, "N.s/m"),
    }


def test_a_marker_lays_z_along_the_axis_of_the_file() -> None:
    """The axis (0, 0.6, 0.8) of the fifth joint is the third column of both markers' rotations."""
    fifth = from_urdf(ARM).joints[4]
    for marker in (fifth.first, fifth.second):
        np.testing.assert_allclose(np.array(marker.rotation)[:, 2], [0, 0.6, 0.8], atol=1e-15)


def test_a_marker_is_turned_onto_minus_z_by_half_a_turn_about_y(tmp_path: Path) -> None:
    """Where no rotation is the least, the one that the documentation names."""
    down = joint("j", "base", "a").replace("0 0 1", "0 0 -2")
    (hinge,) = from_urdf(robot(tmp_path, BASE, link("a"), down)).joints
    np.testing.assert_allclose(hinge.first.rotation, np.diag([-1, 1, -1]), atol=1e-15)


def test_a_joint_behind_a_link_without_mass_stands_where_both_origins_put_it(
    tmp_path: Path,
) -> None:
    """A mast, 1 m up and turned by a right angle, carries a hinge 2 m along it, which turns about -z."""
    mast = '<origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/>'
    arm = joint("j", "mast", "arm").replace("0 0 1", "0 0 -1")
    parts = (
        joint("m", "base", "mast", "fixed", mast),
        arm.replace("<axis", '<origin xyz="2 0 0"/><axis'),
    )
    hinge = from_urdf(robot(tmp_path, BASE, link("mast", ""), link("arm"), *parts)).joints[0]
    np.testing.assert_allclose(hinge.first.point, (0, 2, 1), atol=1e-15)
    turned = np.array(hinge.first.rotation)
    np.testing.assert_allclose(turned[:, 2], (0, 0, -1), atol=1e-15)
    np.testing.assert_allclose(np.cross(turned[:, 0], turned[:, 1]), turned[:, 2], atol=1e-15)


def test_all_problems_are_told_at_once(tmp_path: Path) -> None:
    """Of three links without inertia each is named."""
    parts: list[Any] = [BASE]
    for k in range(3):
        parts += [link(f"l{k}", ""), joint(f"j{k}", "base", f"l{k}")]
    with pytest.raises(ModelError, match="has 3 problems"):
        from_urdf(robot(tmp_path, *parts))


def test_what_is_no_number_or_missing_is_told_by_name_at_once(tmp_path: Path) -> None:
    """Of masses, axes, places, dampers and shapes; what a link lacks is not taken for 1 kg m^2."""
    looks = '<visual><geometry><box size="1 -1 1"/></geometry></visual><visual><geometry/></visual>'
    place = '<origin xyz="0 inf 0"/><dynamics damping="much"/>'
    parts = [
        link("a", MASS.replace('mass value="1"', 'mass value="nan"') + looks),
        link("b", '<inertial><mass value="1"/></inertial>'),
        link("c", MASS.replace('ixx="1" ', "")),
        joint("j", "base", "a", more=place).replace("0 0 1", "0 1"),
        joint("k", "a", "b"),
    ]
    with pytest.raises(ModelError) as caught:
        from_urdf(robot(tmp_path, BASE, *parts))
    told = str(caught.value)
    assert "has 8 problems" in told
    for problem in (
        "link 'a': <mass value> is 'nan', expected a finite number",
        "link 'a': <box size> is '1 -1 1', expected 3 finite numbers, none below 0",
        "link 'a': <geometry> in line 1 is empty",
        "link 'b': <inertial> in line 1 lacks <inertia>",
        "link 'c': <inertia> in line 1 lacks ixx=",
        "joint 'j': <axis xyz> is '0 1', expected 3 finite numbers",
        "joint 'j': <origin xyz> is '0 inf 0'",
        "joint 'j': <dynamics damping> is 'much', expected a finite number",
    ):
        assert problem in told, problem


def test_a_damper_of_the_file_brakes_its_joint(tmp_path: Path) -> None:
    """J w' = -c w of a hinge, m v' = -c v of a slide."""
    damped = '<dynamics damping="0.5"/>'
    axle = joint("h", "base", "a", more=damped)
    slide = joint("s", "base", "b", "prismatic", damped)
    parts = from_urdf(robot(tmp_path, BASE, link("a"), link("b"), axle, slide))
    rates = ("der(angle.h)", "der(position.s)")
    of = {"bodies": parts.bodies, "joints": parts.joints, "loads": parts.loads}
    run = simulate(mechanism("D", **of, start=dict.fromkeys(rates, 2.0)), 1.0, tolerance=1e-10)
    assert [run[rate][-1] for rate in rates] == pytest.approx([2 * np.exp(-0.5)] * 2, rel=1e-8)


def test_hinges_share_their_code_however_their_markers_are_turned() -> None:
    """The hinges between the arm's links have axes and points of their own, some oblique: data of one
    function, for the equations and for their changes."""
    arm = from_urdf(ARM, limits=False)
    text = model_source(Form(derive(mechanism("Arm", bodies=arm.bodies, joints=arm.joints))))
    assert text.count("/* Of j2, j3, j4, j5, j6. */\nstatic void dynamics_kind_") == 1
    assert text.count("/* Of j2, j3, j4, j5, j6. */\nstatic void tangent_kind_") == 1
    # so do the gyroscopic torques of bodies whose tensors have the same zeros
    assert text.count("/* Of shoulder, wrist_2. */\nstatic void dynamics_kind_") == 1


def test_links_that_are_fixed_to_another_are_one_body_with_it(tmp_path: Path) -> None:
    """Two masses of 1 kg, 2 m apart: the centre between them, and m d^2 about it; a mass without inertia
    counts as a point, and without folding the weld tells its wrench."""
    there = '<origin xyz="2 0 0"/>'
    weld = joint("w", "a", "b", "fixed", there)
    path = robot(tmp_path, BASE, link("a"), link("b"), HINGE, weld)
    parts = from_urdf(path)
    (body,) = parts.bodies
    assert (body.mass, body.center) == (2.0, (1.0, 0.0, 0.0))
    np.testing.assert_allclose(body.inertia, (2, 4, 4, 0, 0, 0))
    assert parts.frames["b"].point == (2.0, 0.0, 0.0)
    assert [j.name for j in from_urdf(path, fold_fixed=False).joints] == ["j", "w"]
    point = link("b", '<inertial><mass value="1"/></inertial>')
    (body,) = from_urdf(robot(tmp_path, BASE, link("a"), point, HINGE, weld)).bodies
    np.testing.assert_allclose(body.inertia, (1, 3, 3, 0, 0, 0))


def test_what_is_drawn_stands_where_all_its_origins_put_it(tmp_path: Path) -> None:
    """A cylinder lies along the z of its own origin: one of 2 m and a quarter of a turn about y reaches from
    x = 0 to x = 2 about (1, 2, 3).  On a link that is welded on 2 m further on and turned by a quarter about
    z, a box of (1, 2, 3) m at (1, 0, 0) of it is at (2, 1, 0), its first edge along y."""
    turned = '<origin xyz="1 2 3" rpy="0 1.5707963267948966 0"/>'
    wheel = f'<visual>{turned}<geometry><cylinder radius="0.1" length="2"/></geometry></visual>'
    case = '<visual><origin xyz="1 0 0"/><geometry><box size="1 2 3"/></geometry></visual>'
    weld = joint("w", "a", "b", "fixed", '<origin xyz="2 0 0" rpy="0 0 1.5707963267948966"/>')
    links = link("a", MASS + wheel), link("b", MASS + case)
    (body,) = from_urdf(robot(tmp_path, BASE, *links, HINGE, weld)).bodies
    rod, box = body.shape
    np.testing.assert_allclose([rod.start, rod.end], [(0, 2, 3), (2, 2, 3)], atol=1e-15)
    assert rod.radius == 0.1
    np.testing.assert_allclose(box.center, (2, 1, 0), atol=1e-15)
    assert box.size == (1, 2, 3)
    np.testing.assert_allclose(np.array(box.rotation)[:, 0], (0, 1, 0), atol=1e-15)


def test_a_limit_of_0_is_one(tmp_path: Path) -> None:
    """An elbow bends from -2 rad to 0, a knee from 0, which is left out, to 2; both begin stretched."""
    elbow = joint("j", "base", "a", "revolute", '<limit lower="-2" upper="0"/>')
    knee = joint("k", "base", "b", "revolute", '<limit upper="2"/>')
    parts = from_urdf(robot(tmp_path, BASE, link("a"), link("b"), elbow, knee))
    assert [j.limits for j in parts.joints] == [(-2.0, 0.0), (0.0, 2.0)]
    assert parts.start == {"angle.j": 0.0, "angle.k": 0.0}


def test_friction_mimic_and_a_start_within_limits(tmp_path: Path) -> None:
    """<dynamics friction> is a torque in N.m, <mimic> a gear; limits without 0 begin in the middle."""
    friction = '<dynamics friction="0.5" damping="1"/><limit lower="0.2" upper="0.6"/>'
    leader = joint("i", "base", "a", "revolute", friction)
    follower = joint("j", "base", "b", more='<mimic joint="i" multiplier="-2" offset="0.1"/>')
    parts = from_urdf(robot(tmp_path, BASE, link("a"), link("b"), leader, follower))
    hinge, _, gear = parts.joints
    assert hinge.friction_torque == 0.5
    assert (gear.name, gear.first, gear.second) == ("j_mimic", "j", "i")
    assert parts.start == pytest.approx({"angle.i": 0.4, "angle.j": -0.7})
    of = {"bodies": parts.bodies, "joints": parts.joints, "loads": parts.loads}
    model = mechanism("R", **of, start=parts.start)
    result = simulate(model, stop_time=0.1, step_size=0.1, start_values={"der(angle.i)": 0.0})
    np.testing.assert_allclose(result["angle.j"], -2 * result["angle.i"] + 0.1, atol=1e-12)


def test_a_floating_base_falls_freely(tmp_path: Path) -> None:
    """The root link is a body, which begins where its frame is that of the ground."""
    parts = from_urdf(robot(tmp_path, link("base"), link("a"), HINGE), base="floating")
    assert [b.name for b in parts.bodies] == ["base", "a"]
    loads = [*parts.loads, Gravity((0, 0, -9.81))]
    of = {"bodies": parts.bodies, "joints": parts.joints, "loads": loads}
    result = simulate(mechanism("R", **of, start=parts.start), stop_time=1.0, step_size=0.5)
    np.testing.assert_allclose(result["base.position.z"], -9.81 / 2 * result["time"] ** 2)
    np.testing.assert_allclose(result["force.j.norm"], 0, atol=1e-12)


def test_any_name_of_a_file_becomes_one_word_and_both_are_told(tmp_path: Path) -> None:
    """8 -> _8, joint_0.0 -> joint_0_0; a joint that is called like its link gets _joint."""
    joints = (joint("joint_0.0", "base", "8"), joint("arm", "8", "arm"))
    parts = from_urdf(robot(tmp_path, BASE, link("8"), link("arm"), *joints))
    assert [b.name for b in parts.bodies] == ["_8", "arm"]
    assert [j.name for j in parts.joints] == ["joint_0_0", "arm_joint"]
    assert "_8 is the link '8', joint_0_0 is the joint 'joint_0.0'" in parts.description
    mechanism("R", bodies=parts.bodies, joints=parts.joints, start=parts.start)


def test_an_inertia_that_a_program_rounded_is_told_and_used(tmp_path: Path) -> None:
    """1, 1, 2.001 kg.m^2 misses the triangle inequality by 5e-4 of the largest; 2.01 is refused."""
    near = MASS.replace('izz="1"', 'izz="2.001"')
    parts = from_urdf(robot(tmp_path, BASE, link("a", near), HINGE))
    with pytest.warns(LagfmuWarning, match=r"2.001 kg.m\^2, is above the sum of the others, 2.0"):
        mechanism("R", bodies=parts.bodies, joints=parts.joints)
    beyond = near.replace("2.001", "2.01")
    parts = from_urdf(robot(tmp_path, BASE, link("a", beyond), HINGE))
    with pytest.raises(ModelError, match="none is above the sum"):
        mechanism("R", bodies=parts.bodies, joints=parts.joints)


def test_floating_and_planar_joints_are_taken(tmp_path: Path) -> None:
    """A free body begins at the joint's origin; a planar joint moves in the plane across its axis."""
    free = joint("f", "base", "a", "floating", '<origin xyz="0 0 1" rpy="0 0 0.5"/>')
    parts = from_urdf(
        robot(tmp_path, BASE, link("a"), link("b"), free, joint("p", "a", "b", "planar"))
    )
    model = mechanism("R", bodies=parts.bodies, joints=parts.joints, start=parts.start)
    assert [type(j).__name__ for j in parts.joints] == ["Planar"]
    start = {str(s): x for s, x in model.start.items()}
    assert start["a.position.z(t)"] == 1.0
    assert start["a.orientation.z(t)"] == pytest.approx(np.sin(0.25))


def test_a_spherical_joint_of_bullet_is_a_ball(tmp_path: Path) -> None:
    """Through which no torque goes: what hangs 2 m below it swings as a pendulum, at first by its weight's
    moment over its inertia about the ball, 9.81 * 2 sin(0.1) / (1 + 2^2) rad/s^2."""
    below = MASS.replace("<mass", '<origin xyz="0 0 -2"/><mass')
    parts = from_urdf(robot(tmp_path, BASE, link("a", below), joint("b", "base", "a", "spherical")))
    model = mechanism(
        "R",
        bodies=parts.bodies,
        joints=parts.joints,
        loads=[Gravity((0, 0, -9.81))],
        start={**parts.start, "a.rpy": (0.1, 0, 0)},
    )
    result = simulate(model, stop_time=0.1, step_size=0.1)
    moment = 9.81 * 2 * np.sin(0.1)
    assert result["der(a.omega.x)"][0] == pytest.approx(-moment / 5)
    np.testing.assert_allclose(result["torque.b.norm"], 0, atol=1e-12)
