"""Closed loops from MJCF files: the forces in their joints against MuJoCo's equations with rigid loops."""

from __future__ import annotations

import functools
import warnings
from pathlib import Path
from typing import Any

import andrews
import mechanisms
import numpy as np
import pytest
import rigid

from lagfmu import simulate
from lagfmu.bodies import from_mjcf, mechanism
from lagfmu.testing import find_compiler, load

pytest.importorskip("mujoco")
from mjcf import Rigid

pytestmark = [
    pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine"),
    pytest.mark.filterwarnings("ignore:.*from the others"),
]

LOOPS = Path(__file__).parent / "mjcf"
SAMPLES = np.linspace(0.0, 0.5, 6)  # s
ALLOWED = 1e-8  # of a joint's force, relative to the largest

BOX = '<geom type="box" size="0.1 0.2 0.3" mass="1.5" contype="0" conaffinity="0" pos="0.1 0.2 -0.3"/>'


def run(path: Path, key: str = "", **options: Any) -> Any:
    """The FMU of a file, without its limits."""
    parts = from_mjcf(path, key=key, limits=False)
    model = mechanism(parts.name, **parts.arguments)
    asked = {"stop_time": SAMPLES[-1], "step_size": SAMPLES[1], "tolerance": 1e-11}
    return simulate(model, **{**asked, **options})


def missed(result: Any, k: int, wanted: dict[str, float]) -> float:
    """Of what has one value: the largest difference, relative to the largest force."""
    largest = max(abs(x) for n, x in wanted.items() if n.startswith("force"))
    told = {n: x for n, x in wanted.items() if result[f"unique.{n}"][k]}
    assert len(told) >= 8
    return max(abs(result[n][k] - x) for n, x in told.items()) / largest


@pytest.mark.parametrize("name", ["four_bar", "five_bar", "jansen", "delta", "leg", "slider_crank"])
def test_the_joints_of_a_loop_receive_what_newton_and_euler_say(name: str) -> None:
    """MuJoCo's M, bias and Jacobians with rigid loops, integrated by SciPy, and the wrench of each joint from
    the accelerations of all that hangs on it; driven for half a second."""
    path = LOOPS / f"{name}.xml"
    by_hand = Rigid(path, 0)
    result = run(path, key=by_hand.m.key(0).name)
    for k, state in enumerate(by_hand.moved(SAMPLES)):
        assert missed(result, k, by_hand.forces(state)) < ALLOWED


TIED = {
    "a polynomial of degree three": 'joint2="b_j" polycoef="0.1 0.5 -0.3 0.7 0"',
    "a joint that is held": 'polycoef="0.2 0 0 0 0"',
}


@pytest.mark.parametrize("name", TIED)
def test_joints_that_a_polynomial_ties_move_as_lagrange_says(name: str, tmp_path: Path) -> None:
    """q1 - ref1 = 0.1 + x/2 - 0.3 x^2 + 0.7 x^3 with x = q2 - ref2, of a hinge and a slide with references:
    the motion and the force of the tie are those of MuJoCo's M with the row's own derivatives."""
    world = (
        f'<body name="a"><joint name="a_j" axis="0 1 0" ref="0.3"/>{BOX}</body><body name="b" pos="1 0 0">'
        f'<joint name="b_j" type="slide" axis="1 0 1" ref="0.2" stiffness="50" armature="0.3"/>{BOX}</body>'
    )
    ends = {"a_j": 0.4 if "degree" in name else 0.5, "b_j": 0.2}  # on the row, at rest
    key = f'<keyframe><key name="on" qpos="{ends["a_j"]} {ends["b_j"]}"/></keyframe>'
    path = tmp_path / "m.xml"
    path.write_text(
        f'<mujoco model="M"><compiler angle="radian"/><worldbody>{world}</worldbody>'
        f'<equality><joint name="g" joint1="a_j" {TIED[name]}/></equality>{key}</mujoco>'
    )
    by_hand = Rigid(path, 0)
    result = run(path, key="on")
    for k, state in enumerate(by_hand.moved(SAMPLES)):
        np.testing.assert_allclose(result["angle.a_j"][k], state[0], rtol=0, atol=1e-9)
        np.testing.assert_allclose(result["position.b_j"][k], state[1], rtol=0, atol=1e-9)
        _, (row,) = by_hand.solve(state)
        assert result["lambda.g"][k] == pytest.approx(row[0], rel=1e-8)


def test_a_weld_closes_a_loop_of_four_bodies(tmp_path: Path) -> None:
    """Two chains of a ball and a hinge, their ends welded at a point and attitude of their own: of its six
    rows each has one value."""
    chains = "".join(
        f'<body name="{n}1" pos="{x} 0 0"><joint name="{n}_ball" type="ball"/>{BOX}'
        f'<body name="{n}2" pos="0 0 -0.6" euler="{20 * x} 0 10"><joint name="{n}_hinge" axis="1 {x} 0" '
        f'damping="0.2"/>{BOX}</body></body>'
        for n, x in (("a", 0), ("b", 1))
    )
    path = tmp_path / "m.xml"
    path.write_text(
        f'<mujoco model="M"><worldbody>{chains}</worldbody><equality><weld name="w" body1="a2" body2="b2" '
        'anchor="0.1 0.2 0.3"/></equality><keyframe><key name="on" ctrl=""/></keyframe></mujoco>'
    )
    by_hand = Rigid(path, 0)
    result = run(path)
    for k, state in enumerate(by_hand.moved(SAMPLES)):
        wanted = by_hand.forces(state)
        assert {"force.w.x", "torque.w.y", "torque.b_hinge.y"} <= {*wanted}
        assert missed(result, k, wanted) < ALLOWED


def squeezer(tmp_path: Path) -> Path:
    """Andrews' squeezer in space: as a tree, with three connects and a tendon for the spring."""
    hung = {k: next(p for p in andrews.PINS if p[3] == k) for k in range(1, 8)}

    def body(k: int) -> str:
        m, J, center, angle = andrews.BODIES[k - 1]
        name, on, at, _, own = hung[k]
        turned = andrews.BODIES[on - 1][3] if on else 0.0
        assert own == 0 or k == 3
        inner = "".join(body(x) for x in hung if hung[x][1] == k)
        site = f'<site name="hook" pos="{_at(andrews.HOOK)}"/>' if k == 3 else ""
        return (
            f'<body name="K{k}" pos="{_at(at)}" euler="0 0 {angle - turned!r}"><joint name="{name}"/>'
            f'<inertial pos="{_at(center)}" mass="{m}" diaginertia="{J} {J} {J}"/>{site}{inner}</body>'
        )

    ties = "".join(
        f'<connect name="{name}" body1="K{i}" body2="K{k}" anchor="{_at(s1)}"/>'
        for name, i, s1, k, _ in andrews.PINS[-3:]
    )
    world = "".join(body(k) for k in hung if hung[k][1] == 0)
    path = tmp_path / "squeezer.xml"
    path.write_text(
        f'<mujoco model="squeezer"><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>'
        f'<site name="C" pos="{_at(andrews.C)}"/>{world}</worldbody><equality>{ties}</equality><tendon>'
        f'<spatial name="spring" stiffness="{andrews.STIFFNESS}" springlength="{andrews.FREE}">'
        '<site site="C"/><site site="hook"/></spatial></tendon>'
        f'<actuator><motor name="motor" joint="O" gear="{andrews.TORQUE}"/></actuator>'
        '<keyframe><key name="on" ctrl="1"/></keyframe></mujoco>'
    )
    return path


def _at(z: complex) -> str:
    return f"{z.real!r} {z.imag!r} 0"


def test_andrews_squeezer_as_a_file_has_the_forces_of_its_seven_bodies(tmp_path: Path) -> None:
    """At 0.03 s the crank's angle and the force in each pin are those of Newton's and Euler's equations."""
    result = run(squeezer(tmp_path), key="on", stop_time=andrews.STOP, step_size=andrews.STOP / 3)
    wanted = andrews.squeezer().expected(andrews.STOP)
    turned = wanted["angle.O"] - andrews.BODIES[0][3]  # the file counts from its start
    assert result["angle.O"][-1] == pytest.approx(turned, rel=1e-9)
    largest = max(abs(x) for n, x in wanted.items() if n.startswith("force"))
    for name, first, _, second, _ in andrews.PINS:
        # a hinge of the file has the axes of its body at the start, a connect those of its first
        turned = andrews.BODIES[second - 1][3] - (andrews.BODIES[first - 1][3] if first else 0.0)
        turned = 0.0 if name in ("P3", "P4", "P6") else turned
        by_hand = complex(*(wanted[f"force.{name}.{x}"] for x in "xy")) * np.exp(-1j * turned)
        found = complex(*(result[f"force.{name}.{x}"][-1] for x in "xy"))
        assert abs(found - by_hand) < ALLOWED * largest, name


def test_a_four_bar_as_a_file_has_the_forces_of_the_four_bar(tmp_path: Path) -> None:
    """The rods of tests/independent, three hinges and a connect: in the plane each pin has one force."""
    linkage = mechanisms.four_bar()
    by_hand, begin = linkage.reference()
    places = {name: np.array(place) for name, (_, place) in linkage.bodies.items()}

    def inertial(name: str, origin: Any) -> str:
        mass = linkage.bodies[name][0]
        J = mass.J
        own = " ".join(map(repr, map(float, (*J.diagonal(), J[0, 1], J[0, 2], J[1, 2]))))
        center = " ".join(map(repr, (places[name] - origin).tolist()))
        return f'<inertial pos="{center}" mass="{mass.m}" fullinertia="{own}"/>'

    pins = {name: np.array(tie.point) for name, tie in linkage.ties.items()}
    text = " ".join(map(repr, (pins["B"] - pins["A"]).tolist()))
    coupled = (
        f'<body name="coupler" pos="{text}"><joint name="B" axis="0 1 0"/>'
        f"{inertial('coupler', pins['B'])}</body>"
    )
    world = (
        f'<body name="crank"><joint name="A" axis="0 1 0"/>{inertial("crank", pins["A"])}{coupled}</body>'
        f'<body name="rocker" pos="0.7 0 0"><joint name="D" axis="0 1 0"/>'
        f"{inertial('rocker', pins['D'])}</body>"
    )
    anchor = " ".join(map(repr, (pins["C"] - pins["B"]).tolist()))
    crank, coupler, rocker = begin.reshape(-1, 13)[:, 11].tolist()  # about y
    speeds = f"{crank!r} {coupler - crank!r} {rocker!r}"
    path = tmp_path / "m.xml"
    path.write_text(
        f'<mujoco model="M"><option gravity="0 0 {-linkage.gravity}"/><worldbody>{world}</worldbody>'
        f'<equality><connect name="C" body1="coupler" body2="rocker" anchor="{anchor}"/></equality>'
        f'<keyframe><key name="on" qvel="{speeds}"/></keyframe></mujoco>'
    )
    result = run(path, key="on")
    states = by_hand.moved(begin, SAMPLES)
    for k, state in enumerate(states):
        _, _, received = by_hand.solve(SAMPLES[k], state)
        look = rigid.Look(SAMPLES[k], state, 3)
        largest = max(float(np.hypot(w[0], w[2])) for w in received.values())
        for joint in "ABC":
            tie = linkage.ties[joint]
            axes = look.R[-1 if tie.first == "ground" else [*linkage.bodies].index(tie.first)]
            force = axes.T @ received[joint][:3]
            # the hinge's z is the file's y: x stays, y is -z
            names = "xz" if joint == "C" else "xy"
            signs = 1 if joint == "C" else -1
            found = [result[f"force.{joint}.{x}"][k] for x in names]
            np.testing.assert_allclose(
                found, [force[0], signs * force[2]], rtol=0, atol=ALLOWED * largest
            )


def test_a_slider_crank_as_a_file_has_the_forces_of_the_model() -> None:
    """Crank, rod and piston of models/slider_crank_space.py, the pin between rod and piston a connect."""
    models = Path(__file__).parent.parent / "models"
    model = load(models / "slider_crank_space.py").model
    path = LOOPS / "slider_crank.xml"
    found = run(path, key="on")
    wanted = simulate(model, stop_time=SAMPLES[-1], step_size=SAMPLES[1], tolerance=1e-11)
    largest = np.abs(wanted["force.A.norm"]).max()
    same = functools.partial(np.testing.assert_allclose, rtol=0, atol=ALLOWED * largest)
    for name in ("force.A.x", "force.A.y", "force.B.x", "force.B.y", "force.C.x", "force.C.y"):
        same(found[name], wanted[name], err_msg=name)
    same(found["force.D.y"], wanted["force.D.y"])  # the file's slide has its z along x


PIN = '<joint name="{}" axis="0 1 0"/><geom type="capsule" size="0.02" fromto="0 0 0 {}"/>'


def test_a_crank_that_turns_all_round_passes_no_singular_configuration(tmp_path: Path) -> None:
    """0.3 + 0.922 < 0.8 + 0.51 m (Grashof): its four links are never on one line, and the row that is
    redundant everywhere is no crossing where it may be another than before."""
    path = tmp_path / "m.xml"
    path.write_text(
        f'<mujoco model="M"><worldbody><body name="crank">{PIN.format("A", "0 0 0.3")}'
        f'<body name="coupler" pos="0 0 0.3">{PIN.format("B", "0.9 0 0.2")}</body></body>'
        f'<body name="rocker" pos="0.8 0 0">{PIN.format("D", "0.1 0 0.5")}</body></worldbody><equality>'
        '<connect name="C" body1="coupler" body2="rocker" anchor="0.9 0 0.2"/></equality></mujoco>'
    )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run(path, stop_time=1.0, tolerance=1e-6)
    assert not [str(w.message) for w in caught if "singular" in str(w.message)]


def test_sites_are_frames_that_are_read_where_the_file_has_them() -> None:
    """The tips of both arms of the five-bar, which are one point, through half a second of its servos."""
    path = LOOPS / "five_bar.xml"
    by_hand = Rigid(path, 0)
    parts = from_mjcf(path, key="reach")
    model = mechanism(parts.name, **parts.arguments, read=parts.frames)
    result = simulate(model, stop_time=SAMPLES[-1], step_size=SAMPLES[1], tolerance=1e-11)
    for k, state in enumerate(by_hand.moved(SAMPLES)):
        by_hand.look(state)
        for name in ("tip", "end"):
            found = [result[f"{name}.position.{x}"][k] for x in "xyz"]
            wanted = by_hand.d.site(name).xpos
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10)
