"""Bodies and joints from MJCF files: what is taken, with its closed form, and what is refused by name."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lagfmu import Input, Parameter, build_fmu, derive, simulate, verify
from lagfmu.bodies import Body, Gravity, Ground, Revolute, Rotor, from_mjcf, mechanism
from lagfmu.errors import LagfmuWarning, ModelError
from lagfmu.testing import Form, lower

mujoco = pytest.importorskip("mujoco")

BALL = '<geom type="sphere" size="0.1" mass="2" pos="0 0 -0.5" contype="0" conaffinity="0"/>'
BOX = (
    '<geom type="box" size="0.1 0.2 0.3" mass="1.5" contype="0" conaffinity="0" pos="0.1 0.2 -0.3" '
    'euler="10 20 30"/>'
)


def written(tmp_path: Path, world: str, more: str = "") -> Path:
    path = tmp_path / "m.xml"
    option = '<option><flag contact="disable"/></option>'
    path.write_text(f'<mujoco model="M">{option}<worldbody>{world}</worldbody>{more}</mujoco>')
    return path


def accelerations(model: Any) -> tuple[dict[str, float], dict[str, float]]:
    """v' and lambda at the start, by names."""
    eom = derive(model)
    system = lower(Form(eom))
    x = np.array([float(model.start[s]) for s in model.states])
    n, m = len(model.coordinates), eom.m
    p, u = [float(value.value) for value in eom.parameters], [0.0] * len(eom.u)
    M, F, G, _, gamma = map(np.asarray, system.assemble(0.0, x[:n], x[n:], u, p))
    whole = np.block([[M, -G.T], [G, np.zeros((m, m))]])
    found = np.linalg.lstsq(whole, np.concatenate([F, gamma]), rcond=1e-13)[0].tolist()
    names = [c.name for c in eom.constraints]
    vdot = dict(zip(system.directions, found[: system.nv], strict=True))
    return vdot, dict(zip(names, found[system.nv :], strict=True))


def of_mujoco(path: Path) -> dict[str, float]:
    """The accelerations of its bodies' centres of mass, and R^T w', at its first key frame."""
    m = mujoco.MjModel.from_xml_path(str(path))
    d = mujoco.MjData(m)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    mujoco.mj_forward(m, d)
    found = {}
    for b in range(1, m.nbody):
        J, change = np.zeros((6, m.nv)), np.zeros((6, m.nv))
        mujoco.mj_jacBodyCom(m, d, J[:3], J[3:], b)
        mujoco.mj_jacDot(m, d, change[:3], change[3:], d.xipos[b], b)
        a = J @ d.qacc_smooth + change @ d.qvel
        a[3:] = d.xmat[b].reshape(3, 3).T @ a[3:]
        names = [f"{what}.{x}" for what in ("position", "omega") for x in "xyz"]
        found |= {f"{m.body(b).name}.{n}": x for n, x in zip(names, a.tolist(), strict=True)}
    return found


JOINTS = {
    "hinge with a reference": (
        '<joint name="j" axis="1 2 3" pos="0 0.1 0" ref="20"/>',
        "0.7",
        "1.1",
    ),
    "slide with a reference": (
        '<joint name="j" type="slide" axis="1 2 3" ref="0.2"/>',
        "0.7",
        "1.1",
    ),
    "ball": ('<joint name="j" type="ball" pos="0 0.1 0"/>', "0.8 0.6 0 0", "1 2 3"),
    "free": ('<freejoint name="j"/>', "1 2 3 0.8 0 0.6 0", "1 2 3 4 5 6"),
    "spring, damper, armature": (
        '<joint name="j" axis="0 1 1" stiffness="3" springref="30" damping="0.4" armature="0.3"/>',
        "0.7",
        "1.1",
    ),
    "two hinges": (
        '<joint name="j" axis="1 0 0" armature="0.1"/>'
        '<joint name="k" axis="0 1 1" stiffness="2" damping="1"/>',
        "0.4 0.9",
        "1.1 -2",
    ),
    "two hinges, the other way round": (
        '<joint name="j" axis="0 1 0" armature="0.1"/><joint name="k" axis="1 0 0" damping="1"/>',
        "0.4 0.9",
        "1.1 -2",
    ),
    "two hinges apart": (
        '<joint name="j" axis="1 0 0" armature="0.1" pos="0.1 0.2 0.3"/>'
        '<joint name="k" axis="0 1 1" stiffness="2" damping="1"/>',
        "0.4 0.9",
        "1.1 -2",
    ),
    "three hinges": (
        '<joint name="j" axis="1 0 0" damping="1"/><joint name="k" axis="0 1 0" armature="0.2" damping="2"/>'
        '<joint name="l" axis="0 0 1" stiffness="5"/>',
        "0.4 0.9 -0.6",
        "1.1 -2 3",
    ),
    "three hinges, left-handed": (
        '<joint name="j" axis="0 0 1" damping="1"/><joint name="k" axis="0 1 0" armature="0.2" damping="2"/>'
        '<joint name="l" axis="1 0 0" stiffness="5"/>',
        "0.4 0.9 -0.6",
        "1.1 -2 3",
    ),
    "two slides and a hinge": (
        '<joint name="j" type="slide" axis="1 0 0" ref="1" damping="1"/>'
        '<joint name="k" type="slide" axis="0 0 1" stiffness="2"/>'
        '<joint name="l" axis="0 1 0" armature="1"/>',
        "0.4 0.9 -0.6",
        "1.1 -2 3",
    ),
    "three slides": (
        "".join(f'<joint type="slide" axis="{x}"/>' for x in ("1 0 0", "0 1 0", "0 0 1")),
        "0.4 0.9 -0.6",
        "1.1 -2 3",
    ),
    "three hinges, points apart": (
        '<joint name="j" axis="1 0 0" damping="1" ref="20"/><joint name="k" axis="0 1 0" pos="0 0.1 0.2"/>'
        '<joint name="l" axis="0 0 1" pos="0.1 0 0" armature="0.2"/>',
        "0.4 0.9 -0.6",
        "1.1 -2 3",
    ),
    "two hinges, axes askew": (
        '<joint name="j" axis="1 0 0" armature="0.1"/><joint name="k" axis="1 1 0" damping="1"/>',
        "0.4 0.9",
        "1.1 -2",
    ),
    "a hinge, then a slide": (
        '<joint name="j" axis="0 0 1" stiffness="2"/><joint name="k" type="slide" axis="1 1 1" ref="0.3"/>',
        "0.4 0.9",
        "1.1 -2",
    ),
}
CHAINS = {
    "three slides",
    "three hinges, points apart",
    "two hinges, axes askew",
    "a hinge, then a slide",
}


@pytest.mark.parametrize("name", JOINTS)
def test_each_kind_of_joint_moves_as_in_the_format_s_own_engine(name: str, tmp_path: Path) -> None:
    """A body on it, another on a hinge, a weld and a servo: v' of both is that of MuJoCo to rounding."""
    joints, qpos, qvel = JOINTS[name]
    second = f'<body name="b" pos="0.3 0.1 -1" euler="0 40 0"><joint name="last" axis="0 1 0"/>{BOX}</body>'
    welded = f'<body pos="0.2 0 0" euler="0 0 30">{BOX}{second}</body>'
    world = f'<body name="a" pos="0 0 1" euler="30 0 0">{joints}{BALL}{BOX}{welded}</body>'
    servo = '<actuator><position name="servo" joint="last" kp="3" kv="0.2" gear="2"/></actuator>'
    key = f'<keyframe><key name="home" qpos="{qpos} 0.5" qvel="{qvel} -0.7"/></keyframe>'
    path = written(tmp_path, world, servo + key)
    parts = from_mjcf(path, key="home")
    found, _ = accelerations(mechanism(parts.name, **parts.arguments))
    if name not in CHAINS:
        assert {b.name for b in parts.bodies} == {"a", "b"}
    m = mujoco.MjModel.from_xml_path(str(path))
    d = mujoco.MjData(m)
    mujoco.mj_resetDataKeyframe(m, d, 0)
    mujoco.mj_forward(m, d)
    of_b = {n: x for n, x in of_mujoco(path).items() if n.startswith("b.")}
    largest = max(map(abs, of_b.values()))
    assert max(abs(found[n] - x) for n, x in of_b.items()) < 1e-12 * max(1.0, largest)


def test_a_rotor_slows_a_pendulum_by_its_inertia(tmp_path: Path) -> None:
    """(J + m l^2 + a) angle'' = -m g l sin(angle), and lambda is -a angle''."""
    J, mass, length, a, g, angle = 0.02, 2.0, 0.5, 0.3, 9.81, 0.4
    bob = Body("bob", mass, (J, J, J))
    hinge = Revolute("A", Ground().at((0, 0, 0)), bob.at((0, length, 0)))
    loads = [Gravity((0, -g, 0)), Rotor("rotor", "A", a)]
    model = mechanism("P", bodies=[bob], joints=[hinge], loads=loads, start={"angle.A": angle})
    vdot, lam = accelerations(model)
    wanted = -mass * g * length * np.sin(angle) / (J + mass * length**2 + a)
    assert vdot["bob.omega.z"] == pytest.approx(wanted, rel=1e-13)
    assert lam["rotor"] == pytest.approx(-a * wanted, rel=1e-13)


def test_a_rotor_in_a_slide_is_a_mass(tmp_path: Path) -> None:
    """A weight of 2 kg whose slide drives 3 kg falls with 2/5 g."""
    joint = '<joint name="j" type="slide" axis="0 0 1" armature="3"/>'
    parts = from_mjcf(written(tmp_path, f'<body name="a">{joint}{BALL}</body>'))
    vdot, lam = accelerations(mechanism(parts.name, **parts.arguments))
    assert vdot["a.position.z"] == pytest.approx(-9.81 * 2 / 5, rel=1e-13)
    assert lam["j_rotor"] == pytest.approx(3 * 9.81 * 2 / 5, rel=1e-13)


def test_a_connected_loop_holds_its_weight_by_statics(tmp_path: Path) -> None:
    """A bar of 2 kg on a hinge, held up by a ball joint at its other end: each takes half its weight."""
    bar = '<geom type="capsule" fromto="0 0 0 1 0 0" size="0.02" mass="2"/>'
    world = f'<body name="bar"><joint name="j" axis="0 1 0"/>{bar}</body>'
    post = (
        '<body name="post" pos="1 0 0"><joint name="k" type="slide" axis="0 0 1" stiffness="1e3"/>'
    )
    tie = '<equality><connect name="tie" body1="post" body2="bar" anchor="0 0 0"/></equality>'
    stop = '<joint joint1="k" polycoef="0 0 0 0 0" name="held"/>'
    path = written(tmp_path, f"{world}{post}{BALL}</body>", tie.replace("</e", f"{stop}</e"))
    parts = from_mjcf(path)
    _, lam = accelerations(mechanism(parts.name, **parts.arguments))
    assert lam["tie.z"] == pytest.approx(9.81, rel=1e-12)
    assert lam["held"] == pytest.approx(2 * 9.81 + 9.81, rel=1e-12)


def test_a_weld_and_a_gear_are_met_where_the_file_puts_them(tmp_path: Path) -> None:
    """A weld of two turned bodies is closed at the file's configuration; a gear keeps q1 = 1 + 2 q2."""
    bodies = "".join(
        f'<body name="{n}" pos="{k} 0 0" euler="{20 * k} 10 0"><joint name="{n}_j" axis="0 1 0"/>'
        f"{BALL}</body>"
        for k, n in enumerate("abc")
    )
    ties = '<weld name="w" body1="a" body2="b"/>'
    ties += '<joint name="g" joint1="b_j" joint2="c_j" polycoef="1 2 0 0 0"/>'
    parts = from_mjcf(written(tmp_path, bodies, f"<equality>{ties}</equality>"))
    weld, gear = (next(j for j in parts.joints if j.name == n) for n in "wg")
    assert (gear.ratio, gear.offset) == (2.0, 1.0)
    joints = [j for j in parts.joints if j is not gear]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = mechanism("W", bodies=parts.bodies, joints=joints, start=parts.start)
    assert {type(weld).__name__, weld.first.body.name, weld.second.body.name} == {"Fixed", "a", "b"}
    begins = {str(s): float(x) for s, x in model.start.items()}
    assert begins["a.position.x(t)"] == pytest.approx(-0.5 * np.sin(np.pi / 18), abs=1e-15)


def test_actuators_are_inputs_with_their_gains(tmp_path: Path) -> None:
    """A motor's gear is its torque of a control of 1; a position servo's gain is gear kp."""
    world = f'<body name="a"><joint name="j"/>{BALL}</body>'
    actuators = '<motor name="m" joint="j" gear="5"/><position name="p" joint="j" kp="3" gear="2"/>'
    actuators += '<velocity name="v" joint="j" kv="4"/>'
    parts = from_mjcf(written(tmp_path, world, f"<actuator>{actuators}</actuator>"))
    assert [type(i) for i in parts.inputs] == [Input] * 3
    assert [(str(i.symbol), i.unit) for i in parts.inputs] == [
        ("m.control(t)", "1"),
        ("p.control(t)", "rad"),
        ("v.control(t)", "rad/s"),
    ]
    assert all(isinstance(p, Parameter) for p in parts.parameters)
    assert [(p.value, p.unit) for p in parts.parameters] == [
        (5.0, "N.m"),
        (6.0, "N.m/rad"),
        (4.0, "N.m.s/rad"),
    ]
    servo = {load.name: load for load in parts.loads if load.name.endswith("_servo")}
    assert servo["p_servo"].stiffness == 12.0
    assert servo["v_servo"].damping == 4.0


def test_names_are_words_and_what_is_left_out_is_counted(tmp_path: Path) -> None:
    """A joint and a body of one name, a name of two words; one warning with numbers."""
    world = f'<body name="left arm"><joint name="left arm" frictionloss="1"/><site name="tip"/>{BALL}</body>'
    path = written(tmp_path, world.replace('contype="0"', 'contype="1"'))
    with pytest.warns(LagfmuWarning, match="left out: 1 geoms that can touch"):
        parts = from_mjcf(path)
    assert [b.name for b in parts.bodies] == ["left_arm"]
    assert [j.name for j in parts.joints] == ["left_arm_joint"]
    assert parts.joints[0].friction_torque == 1.0
    assert parts.frames["tip"].body is parts.bodies[0]
    assert parts.bodies[0].description == "'left arm' of the file"


def test_a_joint_stops_at_its_range_and_swings_between_its_limits(tmp_path: Path) -> None:
    """Where it strikes it loses its speed, so that it never comes back above the angle of its stop."""
    joint = '<joint name="j" axis="0 1 0" armature="0.1" range="-10 40" limited="true"/>'
    key = '<keyframe><key name="home" qpos="0.5"/></keyframe>'
    parts = from_mjcf(written(tmp_path, f'<body name="a">{joint}{BALL}</body>', key), key="home")
    model = mechanism(parts.name, **parts.arguments)
    result = simulate(model, stop_time=2.0, step_size=0.01, tolerance=1e-9)
    angle, stop = result["angle.j"], np.pi / 18
    fastest = 2 * 9.81 * 0.5 * np.sin(stop) / (2 * 0.5**2 + 0.1)  # angle'' at the stop is less
    assert -stop - 1e-9 <= angle.min() <= -stop + fastest * 0.005**2 / 2
    later = angle[int(angle.argmin()) :]
    assert stop - fastest * 0.005**2 / 2 <= later.max() <= stop + 1e-7


def test_what_several_hinges_transmit_moves_both_bodies(tmp_path: Path) -> None:
    """A build holds m a and the rate of angular momentum of each body against all that acts on it."""
    joints = '<joint name="j" axis="1 0 0" armature="0.1" pos="0.1 0.2 0.3"/>'
    joints += '<joint name="k" axis="0 1 0" damping="1" stiffness="2"/>'
    more = '<actuator><motor name="drive" joint="k"/></actuator><keyframe>'
    more += '<key name="home" qpos="0.4 0.9" qvel="1 -2" ctrl="3"/></keyframe>'
    parts = from_mjcf(written(tmp_path, f'<body name="a">{joints}{BOX}</body>', more), key="home")
    fmu = build_fmu(mechanism(parts.name, **parts.arguments), tmp_path)
    assert verify(fmu, stop_time=0.5).passed


GOOD = f'<body name="a"><joint name="j"/>{BALL}</body>'


def test_an_unknown_key_and_a_missing_file_are_told(tmp_path: Path) -> None:
    """With the ones that there are, and the path."""
    with pytest.raises(ModelError, match="no key frame is called 'up', expected one of none"):
        from_mjcf(written(tmp_path, GOOD), key="up")
    with pytest.raises(ModelError, match="cannot be read"):
        from_mjcf(tmp_path / "none.xml")


def test_each_of_several_joints_of_one_body_has_its_friction(tmp_path: Path) -> None:
    """Two hinges with losses of 0.5 and 2 N m: a body without mass between them carries both."""
    hinges = '<joint name="j" frictionloss="0.5"/><joint name="k" axis="1 0 0" frictionloss="2"/>'
    parts = from_mjcf(written(tmp_path, f'<body name="a">{hinges}{BALL}</body>'))
    assert {j.name: j.friction_torque for j in parts.joints} == {"j": 0.5, "k": 2.0}
    assert [b.name for b in parts.bodies] == ["a", "j_body"]
