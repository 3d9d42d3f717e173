"""Bodies and joints in space: Newton and Euler hold for each body with the wrenches that the FMU reports."""

from __future__ import annotations

import warnings
from math import inf, pi
from pathlib import Path

import numpy as np
import pytest
from conftest import model_file
from scipy.integrate import solve_ivp
from sympy import Symbol, cos, sin
from sympy.physics.vector import dynamicsymbols

from lagfmu import Parameter, Track, derive, simulate
from lagfmu.bodies import (
    Body,
    Contact,
    Cylindrical,
    Distance,
    Fixed,
    Gear,
    Gravity,
    Ground,
    Motor,
    Planar,
    PointOnCurve,
    PointOnPlane,
    Prismatic,
    Revolute,
    Rolling,
    Screw,
    Spherical,
    Torsion,
    Universal,
    mechanism,
)
from lagfmu.errors import ModelError
from lagfmu.testing import Form, lower

g = 9.81  # m/s^2
s, TURN, TIME = Symbol("s"), Symbol("turn"), dynamicsymbols._t
FALL = (0.3, -0.5, -g)
ground = Ground()
MODELS = Path(__file__).parent.parent / "models"
TILT = ("rpy", 0.3, -0.4, 0.2)
KINDS = [
    Revolute,
    Prismatic,
    Universal,
    *(
        pytest.param(kind, marks=pytest.mark.thorough)
        for kind in (Cylindrical, Planar, Spherical, Fixed, PointOnPlane)
    ),
    pytest.param(lambda name, a, b: Screw(name, a, b, lead=0.2), id="Screw"),
    pytest.param(
        lambda name, a, b: Distance(name, a, b, 0.6), id="Distance", marks=pytest.mark.thorough
    ),
    pytest.param(
        lambda name, a, b: PointOnCurve(name, a, b, Track((s, s**2, s**3), s, -1, 1)),
        id="PointOnCurve",
        marks=pytest.mark.thorough,
    ),
]


def pair(kind, **more):
    """A first body on a ball joint, a second on it by the joint of that kind, both with products of inertia,
    centres of mass aside and oblique markers."""
    one = Body("one", 1.5, (0.04, 0.05, 0.06, 0.004, -0.003, 0.002), center=(0.02, 0.01, -0.03))
    two = Body("two", 0.7, (0.02, 0.03, 0.025, -0.001, 0.002, 0.003), center=(-0.01, 0.05, 0.02))
    pivot = Spherical("P", ground.at((0.1, 0.2, 0.3)), one.at((-0.2, 0.05, 0.1)))
    at, end = one.at((0.3, 0.1, -0.1), rotation=TILT), two.at((0.05, -0.2, 0.1), rotation=TILT)
    start = {"one.omega": (0.5, -1.0, 2.0), "two.omega": (0.3, 0.7, -1.1)}
    if kind is not Fixed:
        start["two.velocity"] = (0.2, 0.1, -0.3)
    with warnings.catch_warnings():  # a joint leaves not all of these
        warnings.simplefilter("ignore")
        return mechanism(
            "Pair",
            bodies=[one, two],
            joints=[pivot, kind("K", at, end)],
            loads=[Gravity(FALL)],
            start=start,
            **{name: of(one, two) for name, of in more.items()},
        )


def turning(row, body):
    """R of a body, from its quaternion."""
    w, x, y, z = (row[f"{body}.orientation.{q}"] for q in "wxyz")
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def vector(row, name):
    return np.array([row[f"{name}.{x}"] for x in "xyz"])


def rpy(roll, pitch, yaw):
    """URDF's: about x, then y, then z, of the fixed axes."""
    (a, b), (c, d), (e, f) = ((np.cos(x), np.sin(x)) for x in (roll, pitch, yaw))
    return (
        np.array([[e, -f, 0], [f, e, 0], [0, 0, 1]])
        @ np.array([[c, 0, d], [0, 1, 0], [-d, 0, c]])
        @ np.array([[1, 0, 0], [0, a, -b], [0, b, a]])
    )


@pytest.mark.parametrize("kind", KINDS)
def test_newton_and_euler_hold_with_the_reported_wrenches(kind):
    """m r'' = sum F and J w' + w x J w = sum (T + s x F): the second body receives the wrench of a joint at
    its own marker, the first receives the opposite there, whatever the joint leaves free; and what is told of
    accelerations, of the joint's own among them, is how the velocities change."""
    run = simulate(pair(kind), 0.1, 5e-3, tolerance=1e-10, target="python")
    for name in (n for n in run.dtype.names if n.endswith(",2)")):
        velocity = run[name.replace(",2", "")]
        differences = (velocity[2:] - velocity[:-2]) / 1e-2
        np.testing.assert_allclose(run[name][1:-1], differences, atol=0.02, err_msg=name)
    inertia = {
        "one": [[0.04, 0.004, -0.003], [0.004, 0.05, 0.002], [-0.003, 0.002, 0.06]],
        "two": [[0.02, -0.001, 0.002], [-0.001, 0.03, 0.003], [0.002, 0.003, 0.025]],
    }
    mass = {"one": 1.5, "two": 0.7}
    for row in run[::10]:
        R = {b: turning(row, b) for b in mass}
        r = {b: vector(row, f"{b}.position") for b in mass}
        pivot = np.array([0.1, 0.2, 0.3])
        end = r["two"] + R["two"] @ np.array([0.06, -0.25, 0.08])
        axes = {"P": np.eye(3), "K": R["one"] @ rpy(0.3, -0.4, 0.2)}
        F = {j: axes[j] @ vector(row, f"force.{j}") for j in axes}
        T = {j: axes[j] @ vector(row, f"torque.{j}") for j in axes}
        wrenches = {
            "one": [(F["P"], T["P"], pivot), (-F["K"], -T["K"], end)],
            "two": [(F["K"], T["K"], end)],
        }
        for b, m in mass.items():
            acceleration = np.array([row[f"der({b}.position.{x},2)"] for x in "xyz"])
            force = sum(f for f, _, _ in wrenches[b]) + m * np.array(FALL)
            np.testing.assert_allclose(force, m * acceleration, atol=1e-11)
            w = vector(row, f"{b}.omega")
            rate = np.array([row[f"der({b}.omega.{x})"] for x in "xyz"])
            J = np.array(inertia[b])
            moment = sum(t + np.cross(p - r[b], f) for f, t, p in wrenches[b])
            np.testing.assert_allclose(R[b].T @ moment, J @ rate + np.cross(w, J @ w), atol=1e-12)


def test_a_marker_is_told_as_its_body_carries_it():
    """r + R s, r' + R (w x s), r'' + R (w' x s + w x (w x s)) along the ground's axes, and URDF's angles of R
    and of the marker's own rotation."""
    run = simulate(
        pair(
            Revolute, read=lambda one, two: {"end": two.at((0.05, -0.2, 0.1), TILT), "frame": one}
        ),
        0.2,
        0.1,
        tolerance=1e-10,
        target="python",
    )
    for row in run:
        R, w = turning(row, "two"), vector(row, "two.omega")
        rates = np.array([row[f"der(two.omega.{x})"] for x in "xyz"])
        acceleration = np.array([row[f"der(two.position.{x},2)"] for x in "xyz"])
        s = np.array([0.06, -0.25, 0.08])
        told = {
            "position": vector(row, "two.position") + R @ s,
            "velocity": vector(row, "two.velocity") + R @ np.cross(w, s),
            "acceleration": acceleration + R @ (np.cross(rates, s) + np.cross(w, np.cross(w, s))),
        }
        for what, expected in told.items():
            np.testing.assert_allclose(vector(row, f"end.{what}"), expected, atol=1e-12)
        for name, axes in (("end", R @ rpy(0.3, -0.4, 0.2)), ("frame", turning(row, "one"))):
            np.testing.assert_allclose(rpy(*turned(row, name)), axes, atol=1e-14)


def turned(row, name):
    return [row[f"{name}.rpy.{x}"] for x in ("roll", "pitch", "yaw")]


def test_roll_pitch_and_yaw_begin_and_are_told_at_gimbal_lock_too():
    """At a pitch of 90 degrees roll and yaw turn about one line: the attitude alone determines the three
    together, which are told so that they are it; elsewhere they are what was given."""
    box = Body("box", 1.0, (0.1, 0.1, 0.1))

    side = {"side": box.at((0, 0, 0), rotation=TILT)}
    for angles in [(0.3, -0.4, 3.0), (-3.0, 1.5, 0.2)]:
        model = mechanism("Box", bodies=[box], start={"side.rpy": angles}, read=side)
        row = simulate(model, 0.001, 0.001, target="python")[0]
        assert turned(row, "side") == pytest.approx(angles, rel=1e-13)
    at_lock = (
        ((0, pi / 2, 0), "python"),
        ((0.3, pi / 2, 0.5), "native"),
        ((0.7, -pi / 2, 0), "python"),
    )
    for angles, target in at_lock:
        model = mechanism("Box", bodies=[box], start={"box.rpy": angles}, read={"frame": box})
        row = simulate(model, 0.001, 0.001, target=target)[0]
        np.testing.assert_allclose(rpy(*turned(row, "frame")), rpy(*angles), atol=1e-14)


def slider_crank(hinge=Revolute):
    """The planar slider-crank, built in space: hinges about z, a slide along x."""
    crank = Body("crank", 2.0, (0.005, 0.01, 0.01))
    rod = Body("rod", 1.0, (0.002, 0.02, 0.02))
    piston = Body("piston", 0.5, (0.001, 0.001, 0.001))
    joints = [
        Revolute("A", ground.at((0, 0, 0)), crank.at((-0.1, 0, 0))),
        Revolute("B", crank.at((0.1, 0, 0)), rod.at((-0.25, 0, 0))),
        hinge("C", rod.at((0.25, 0, 0)), piston.at((0, 0, 0))),
        Prismatic("D", ground.at((0, 0, 0)), piston.at((0, 0, 0)), axis="x"),
    ]
    return mechanism(
        "SliderCrank",
        bodies=[crank, rod, piston],
        joints=joints,
        loads=[Gravity((0, -g, 0))],
        start={"angle.A": pi / 4, "der(angle.A)": 10.0},
    )


def test_of_a_redundant_slider_crank_these_forces_are_unique_and_right():
    """20 rows on 18 speeds have rank 17.  Unique are Fx, Fy of A, B, C, and Fy, Tz of D; these are the forces
    of the same mechanism in the plane, where all are.  With a ball at C one row is left over."""
    with pytest.warns(UserWarning, match="follow from the others.* or make a hinge Spherical"):
        run = simulate(slider_crank(), 0.5, 0.05, tolerance=1e-11, target="python")
    told = {n.removeprefix("unique."): run[n] for n in run.dtype.names if n[:7] == "unique."}
    unique = {n for n, always in told.items() if always.all()}
    of_rows = {f"{j}.{x}" for j in "ABC" for x in "xy"} | {"D.y", "D.rz"}
    assert {n for n in unique if n.count(".") == 1} == of_rows
    parts = {f"force.{j}.{x}" for j in "ABC" for x in "xy"} | {"force.D.y", "torque.D.z"}
    still = {"torque.A.z", "torque.B.z", "torque.C.z", "force.D.x"}  # which nothing carries
    assert unique - of_rows == parts | still
    assert not any(told[n].any() for n in told.keys() - unique)
    assert sum(n.count(".") == 1 for n in told) == 20
    file = model_file("slider_crank_bodies")
    flat = simulate(file.model, 0.5, 0.05, tolerance=1e-11, target="python")
    for n in [
        "angle.A",
        *(f"force.{j}.{x}" for j in "ABC" for x in "xy"),
        "force.D.y",
        "torque.D.z",
    ]:
        scale = abs(flat["force.A.norm"]).max()
        np.testing.assert_allclose(run[n], flat[n], atol=1e-9 * scale, err_msg=n)
    with pytest.warns(UserWarning, match=r"constraint 'D\.z' follows from the others"):
        simulate(slider_crank(Spherical), 0.1, 0.05, target="python")


def test_a_redundant_slider_crank_loses_no_rank_at_its_dead_centre(native_fmu):
    """On one line, rows that stand for all 20 may depend on each other, and others stand for them: no warning
    of a singular configuration."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        run = simulate(native_fmu("SliderCrankSpace"), 0.3, 0.05, 1e-8, {"angle.A": 0.7})
    assert not any("singular" in str(w.message) for w in told)
    assert run["angle.A"][-1] > pi


def test_a_rough_sleeve_is_braked_against_the_way_of_its_surface():
    """Spinning and falling at 45 degrees: -mu N (v, r w)/|(v, r w)| with N = m g cos 45 of the two
    components across, not a friction for each."""
    sleeve, axis = Body("sleeve", 2.0, (0.01, 0.01, 0.02)), (1, 0, -1)
    mu, r, N = 0.3, 0.02, 2.0 * g * np.cos(pi / 4)
    joint = Cylindrical(
        "A", ground.at((0, 0, 0), axis=axis), sleeve.at((0, 0, 0), axis=axis), friction=mu, radius=r
    )
    model = mechanism(
        "Sleeve",
        bodies=[sleeve],
        joints=[joint],
        loads=[Gravity((0, 0, -g))],
        start={"der(angle.A)": 20.0},
    )
    run = simulate(model, 0.5, 0.1, tolerance=1e-10)
    v, surface = run["der(position.A)"], r * run["der(angle.A)"]
    speed = np.hypot(v, surface)
    np.testing.assert_allclose(run["force.A.z"], -mu * N * v / speed, atol=1e-12)
    np.testing.assert_allclose(run["torque.A.z"], -r * mu * N * surface / speed, atol=1e-12)
    assert run["angle.A"][-1] > pi  # it goes on over turns, as the start names it


def test_a_bead_on_a_rough_helix_rubs_with_the_norm_of_what_is_across_it():
    """c = (R cos s, R sin s, h s), sliding down: v' = g sin a - mu N/m with N/m = |(g cos a, k v^2)|, since
    gravity across the curve is square to its curvature k = R/(R^2 + h^2)."""
    R, h, mu, m = 0.5, 0.4, 0.3, 2.0
    bead = Body("bead", m, (0.01, 0.01, 0.01))
    helix = Track((R * cos(s), R * sin(s), -h * s), s, -10, 10)
    model = mechanism(
        "Helix",
        bodies=[bead],
        joints=[PointOnCurve("K", ground.at((0, 0, 0)), bead.at((0, 0, 0)), helix, friction=mu)],
        loads=[Gravity((0, 0, -g))],
        start={"K.curve.s": 1.0, "der(K.curve.s)": 2.0},
    )
    run = simulate(model, 1.0, 0.1, tolerance=1e-11)
    way = np.hypot(R, h)  # of one radian

    def across(v):
        return np.hypot(g * R / way, R / way**2 * v**2)

    def rates(_, y):
        return [y[1], g * h / way - mu * across(y[1])]

    at = {"t_eval": run["time"], "rtol": 1e-12, "atol": 1e-13}
    length, v = solve_ivp(rates, (0, 1), [way, 2 * way], **at).y
    np.testing.assert_allclose(run["K.curve.s"] * way, length, rtol=1e-9)
    np.testing.assert_allclose(run["der(K.curve.s)"] * way, v, rtol=1e-9)
    normal, rubs = m * across(v), m * mu * across(v)
    np.testing.assert_allclose(run["force.K.norm"][1:], np.hypot(normal, rubs)[1:], rtol=1e-9)
    angle = run["K.curve.s"]
    tangent = -R * np.sin(angle) / way, R * np.cos(angle) / way, -h / way
    along = sum(run[f"force.K.{x}"] * t for x, t in zip("xyz", tangent, strict=True))
    np.testing.assert_allclose(along[1:], -rubs[1:], rtol=1e-9)


def test_wheels_are_put_on_the_cart_whose_place_is_given():
    """A cart of which only the place is told stands straight, its wheels 0.3 m to either side; they were put
    on the ground first, both in one place, and the cart was turned by 1 degree to fit."""
    cart = Body("cart", 10.0, (0.3, 0.5, 0.6), center=(0.1, 0, 0))
    wheels = {side: Body(side, 1.0, (0.005, 0.009, 0.005)) for side in ("left", "right")}
    places = {"left": 0.3, "right": -0.3}
    model = mechanism(
        "Cart",
        bodies=[cart, *wheels.values()],
        joints=[
            *(
                Revolute(f"axle_{n}", cart.at((0, places[n], 0)), w.at((0, 0, 0)), axis="y")
                for n, w in wheels.items()
            ),
            *(
                Rolling(f"roll_{n}", ground.at((0, 0, 0)), w.at((0, 0, 0)), radius=0.15)
                for n, w in wheels.items()
            ),
            PointOnPlane("caster", ground.at((0, 0, 0)), cart.at((0.5, 0, -0.15)), axis="z"),
        ],
        loads=[Gravity((0, 0, -g))],
        start={"cart.position": (0.1, 0, 0.15)},
    )
    start = {str(q): float(x) for q, x in model.start.items()}
    found = {n: start[f"{n}.position.y(t)"] for n in wheels}
    assert found == pytest.approx(places, abs=1e-12)
    assert start.get("cart.orientation.z(t)", 0.0) == pytest.approx(0.0, abs=1e-12)


def test_a_ball_on_a_turntable_goes_round_with_two_sevenths_of_its_rate():
    """The contact moves with the table: v' = (2/7) W x v, so that the ball rolls on a circle of its own."""
    table, r = Body("table", 50.0, (10.0, 10.0, 20.0)), 0.02
    ball = Body("ball", 0.1, (0.4 * 0.1 * r**2,) * 3)
    model = mechanism(
        "Turntable",
        bodies=[table, ball],
        joints=[
            Revolute("T", ground.at((0, 0, 0)), table.at((0, 0, 0))),
            Rolling("R", table.at((0, 0, 0)), ball.at((0, 0, 0)), radius=r),
        ],
        loads=[Gravity((0, 0, -g)), Motor("M", "T", motion=3.0 * TURN * TIME)],
        parameters=[Parameter(TURN, 1.0, "rad/s")],
        start={"ball.position": (0.3, 0.0, r), "ball.velocity": (0.1, 0.2, 0.0)},
    )
    run = simulate(model, 2.0, 0.5, tolerance=1e-10, target="python")
    rate, v = 2 / 7 * 3.0, 0.1 + 0.2j
    place = 0.3 + v * (np.exp(1j * rate * run["time"]) - 1) / (1j * rate)
    np.testing.assert_allclose(
        run["ball.position.x"] + 1j * run["ball.position.y"], place, atol=1e-8
    )
    np.testing.assert_allclose(run["force.R.z"], 0.1 * g, rtol=1e-12)
    across = np.hypot(run["force.R.x"], run["force.R.y"])
    np.testing.assert_allclose(across, 0.1 * rate * abs(v), rtol=1e-8)
    force, torque = (run[f"{of}.R.x"] + 1j * run[f"{of}.R.y"] for of in ("force", "torque"))
    np.testing.assert_allclose(torque, -1j * r * force, atol=1e-15)  # (0, 0, -r) x force


def test_a_shaft_with_two_universal_joints_turns_evenly_and_its_middle_does_not():
    """Hooke's joint with the bend b: w2/w1 = cos b/(1 - sin^2 b sin^2 a), a from where the first fork lies
    along the axis of the bend; the second joint, whose forks lie alike, takes that back."""
    b, J = 0.5, (0.01, 0.01, 0.02)
    one, two, three = (Body(n, 1.0, J) for n in ("one", "two", "three"))
    model = mechanism(
        "Cardan",
        bodies=[one, two, three],
        joints=[
            Revolute("A", ground.at((0, 0, 0)), one.at((0, 0, 0))),
            Universal("U", one.at((0, 0, 0.1)), two.at((0, 0, -0.5))),
            Universal("V", two.at((0, 0, 0.5)), three.at((0, 0, -0.1)), "y", second_axis="x"),
            Cylindrical("B", ground.at((0, np.sin(b), 0.2 + np.cos(b))), three.at((0, 0, 0))),
        ],
        start={"angle.A": 0.3, "der(angle.A)": 10.0},
    )
    run = simulate(model, 0.5, 0.1, tolerance=1e-10, target="python")
    np.testing.assert_allclose(run["der(angle.B)"], run["der(angle.A)"], rtol=1e-10)
    ratio = np.cos(b) / (1 - (np.sin(b) * np.sin(run["angle.A"])) ** 2)
    np.testing.assert_allclose(run["two.omega.z"] / run["der(angle.A)"], ratio, rtol=1e-9)


def test_a_spinning_top_stands_on_a_contact_as_on_a_ball_joint():
    """Its tip lies aside of its centre: what turns with it pushes too.  It does not slip while it stands on a
    rough floor, and both carry m (g + the acceleration of the centre)."""
    top = Body("top", 0.1, (1e-4, 1e-4, 5e-5), center=(1e-4, 0, 0.04))
    tip = ground.at((0, 0, 0)), top.at((0, 0, 0))
    given = {"bodies": [top], "loads": [Gravity((0, 0, -g))]}
    start = {"top.rpy": (0.3, 0.1, 0), "top.omega": (0.5, 0, 150.0), "end.velocity": (0, 0, 0)}
    given |= {"read": {"end": tip[1]}, "start": start}
    held = mechanism("Held", joints=[Spherical("tip", *tip)], **given)
    contact = Contact("tip", *tip, friction=2.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        free = mechanism("Free", contacts=[contact], **given)
    runs = [simulate(model, 0.02, 0.002, tolerance=1e-10) for model in (held, free)]
    assert runs[1]["sticks.tip"].all()
    for name in ("force.tip.x", "force.tip.y", "force.tip.z", "der(top.omega.x)"):
        one, two = (run[name] for run in runs)
        np.testing.assert_allclose(one, two, atol=1e-8 * abs(one).max(), err_msg=name)


def test_a_gear_in_space_counts_turns():
    """7:3 between wheels on square shafts, 1,000 turns from 50 rad on: the attitudes tell the angles modulo
    2 pi alone, and are what the angles say to the end."""
    shaft = (0.01, 0.01, 0.02)
    one, two = Body("one", 1.0, shaft), Body("two", 1.0, shaft)
    side = ("rpy", pi / 2, 0, 0)
    joints = [
        Revolute("A", ground.at((0, 0, 0)), one.at((0, 0, 0))),
        Revolute("B", ground.at((1, 0, 0), rotation=side), two.at((0, 0, 0), rotation=side)),
        Gear("teeth", "A", "B", ratio=7 / 3),
    ]
    start = {"angle.A": 50.0, "der(angle.A)": 60.0}
    model = mechanism("Geared", bodies=[one, two], joints=joints, start=start)
    stop = 1000 * 2 * pi / 60
    run = simulate(model, stop, stop / 10, tolerance=1e-9)
    half = np.arctan2(run["one.orientation.z"], run["one.orientation.w"])
    np.testing.assert_allclose(np.sin(half - run["angle.A"] / 2), 0, atol=1e-12)
    np.testing.assert_allclose(run["angle.A"], 50 + 60 * run["time"], rtol=1e-8)
    np.testing.assert_allclose(run["angle.B"], 3 / 7 * run["angle.A"], rtol=1e-12, atol=1e-9)


def test_a_torsion_spring_turns_both_wheels_of_its_shaft():
    """Of 0.02 and 0.01 kg m^2 on a leaning shaft that turns at 5 rad/s: the twist is cos(w t) of the first,
    w^2 = k (1/J1 + 1/J2) = 150/s^2, the angular momentum stays."""
    one, two = Body("one", 1.0, (0.01, 0.01, 0.02)), Body("two", 1.0, (0.01, 0.01, 0.01))
    shaft = {"axis": (1.0, 2.0, 2.0)}
    joints = [
        Revolute("A", ground.at((0, 0, 0), **shaft), one.at((0, 0, 0))),
        Revolute("B", one.at((0, 0, 0.1)), two.at((0, 0, 0))),
    ]
    spring = Torsion("spring", "B", stiffness=1.0, angle=0.1)
    start = {"angle.B": 0.4, "der(angle.A)": 5.0, "der(angle.B)": 0.0}
    model = mechanism("Twist", bodies=[one, two], joints=joints, loads=[spring], start=start)
    run = simulate(model, 2.0, 0.05, tolerance=1e-11)
    twist = 0.1 + 0.3 * np.cos(np.sqrt(150.0) * run["time"])
    np.testing.assert_allclose(run["angle.B"], twist, atol=1e-9)
    np.testing.assert_allclose(run["torque.spring"], 0.1 - twist, atol=1e-9)
    np.testing.assert_allclose(
        0.02 * run["one.omega.z"] + 0.01 * run["two.omega.z"], 0.15, atol=1e-9
    )


arm = Body("arm", 1.0, (0.1, 0.1, 0.1))


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"bodies": [Body("b", 1.0, 0.1)]}, "'b' has the inertia 0.1, expected three numbers"),
        (
            {"bodies": [Body("b", 1.0, (0.1, 0.1, 0.21))]},
            "principal moments of inertia 0.1, 0.1, 0.21 kg.m^2, expected none below 0",
        ),
        (
            {"joints": [Revolute("A", ground.at((0, 0, 0), axis=(0, 0, 0)), arm.at((0, 0, 0)))]},
            "axis (0, 0, 0) turns nothing, expected a direction",
        ),
        (
            {
                "joints": [
                    Fixed("A", ground.at((0, 0, 0), rotation=(0, 0, 0, 0)), arm.at((0, 0, 0)))
                ]
            },
            "expected a direction, or a rotation: a right-handed orthogonal matrix",
        ),
        (
            {"joints": [Fixed("A", ground.at((0, 0, 0), axis=(inf, 0, 0)), arm.at((0, 0, 0)))]},
            "axis (inf, 0, 0) turns nothing, expected a direction",
        ),
        ({"bodies": [Body("b", 1.0, [[1, 0, 0]] * 3)]}, "expected three numbers (xx, yy, zz)"),
        ({"start": {"arm.orientation": (0, 0, 0, 0)}}, "expected a quaternion of norm 1"),
        (
            {"joints": [Revolute("A", ground.at((0, 0)), arm.at((0, 0, 0)))]},
            "A.first is (0, 0), expected 3 components (x, y, z)",
        ),
        (
            {
                "joints": [Cylindrical("A", ground.at((0, 0, 0)), arm.at((0, 0, 0)))],
                "loads": [Motor("motor", "A")],
            },
            "Cylindrical 'A' turns and slides: one of the two is named, expected one of angle.A, position.A",
        ),
        (
            {"joints": [Universal("U", ground.at((0, 0, 0)), arm.at((0, 0, 0)), second_axis="x")]},
            "the axes of universal joint 'U' begin 0 degrees from parallel, expected square",
        ),
        (
            {
                "joints": [
                    Fixed("F", ground.at((0, 0, 0)), arm.at((0, 0, 0), ("rpy", 0, 0, pi / 6))),
                    Universal("U", ground.at((0, 0, 0)), arm.at((0, 0, 0))),
                ]
            },
            "universal joint 'U' cannot be closed: at the nearest that was found its axes miss being square",
        ),
        (
            {"joints": [Spherical("A", ground.at((0, 0, 0)), arm.at((0, 0, 0)), friction=0.1)]},
            "friction is given, but only Revolute, Prismatic and Cylindrical joints",
        ),
        ({"start": {"arm.rpy": 0.3}}, "start of 'arm.rpy' is 0.3, expected three numbers: roll"),
        (
            {"start": {"arm.rpy": (0, 0, 1), "arm.orientation.w": 1.0}},
            "the attitude of 'arm' is given twice",
        ),
    ],
)
def test_what_is_wrong_with_a_mechanism_in_space_is_told_by_name(parts, told):
    """A tensor that no mass has, a direction without length, two components, two motions to drive."""
    with pytest.raises(ModelError) as caught:
        mechanism("M", **{"bodies": [arm], **parts})
    assert told in str(caught.value)


def test_a_quaternion_that_is_given_with_another_norm_is_told():
    """(0, 3, 0, 4) begins as (0, 0.6, 0, 0.8); three digits are rounding."""
    with pytest.warns(
        UserWarning, match=r"the norm 5, expected 1: it begins at \(0.0, 0.6, 0.0, 0.8\)"
    ):
        model = mechanism("M", bodies=[arm], start={"arm.orientation": (0, 3, 0, 4)})
    begins = {str(q.func): x for q, x in model.start.items() if not q.is_Derivative}
    assert [begins[f"arm.orientation.{x}"] for x in "wxyz"] == pytest.approx([0, 0.6, 0, 0.8])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mechanism("M", bodies=[arm], start={"arm.orientation": (0.707, 0.707, 0, 0)})


def screw(lead=0.5, start=None, loads=(), limits=None, **more):
    """A nut of 2 kg and 0.05 kg m^2 on a vertical screw."""
    nut = Body("nut", 2.0, (0.03, 0.03, 0.05))
    joint = Screw("S", ground.at((0, 0, 0)), nut.at((0, 0, 0)), lead=lead, limits=limits, **more)
    loads = [Gravity((0, 0, -g)), *loads]
    return mechanism("Nut", bodies=[nut], joints=[joint], loads=loads, start=start)


@pytest.mark.parametrize("lead", [0.5, -0.5])
def test_a_nut_falls_down_its_thread(lead):
    """alpha = -m g h / (J + m h^2), h = lead / (2 pi); the thread carries F = m (g + a) and takes -h F: what
    is left of the weight turns the nut, over more than a turn, from where the angle begins."""
    h, m, J = lead / (2 * pi), 2.0, 0.05
    result = simulate(screw(lead, {"angle.S": 4 * pi}), 1.0)
    alpha = -m * g * h / (J + m * h**2)
    t = result["time"]
    thrust = m * (g + h * alpha)
    assert result["angle.S"] == pytest.approx(4 * pi + alpha * t**2 / 2, abs=1e-8 * 4 * pi)
    assert result["position.S"] == pytest.approx(h * result["angle.S"], abs=1e-9)
    assert result["nut.position.z"] == pytest.approx(result["position.S"], abs=1e-9)
    assert result["force.S.z"] == pytest.approx(thrust, rel=1e-7)
    assert result["torque.S.z"] == pytest.approx(-h * thrust, rel=1e-7)


def test_a_motor_holds_the_load_of_a_screw():
    """m g h holds the nut: the joint passes on its weight, and no torque, since the motor is part of it."""
    h = 0.5 / (2 * pi)
    model = screw(0.5, {"position.S": 0.1}, [Motor("drive", "angle.S", torque=2.0 * g * h)])
    result = simulate(model, 1.0)
    assert result["position.S"] == pytest.approx(0.1, abs=1e-9)
    assert result["force.S.z"] == pytest.approx(2.0 * g, rel=1e-9)
    assert abs(result["torque.S.z"]).max() < 1e-9


def test_a_screw_stops_at_the_limit_of_its_angle():
    """Limits are of the angle: the nut stands a turn below where it began."""
    result = simulate(screw(limits=(-2 * pi, 2 * pi)), 3.0)
    assert result["angle.S"][-1] == pytest.approx(-2 * pi, abs=1e-8)
    assert result["nut.position.z"][-1] == pytest.approx(-0.5, abs=1e-8)


def test_screws_that_are_none_are_refused():
    """Without a lead, or with friction that no law here gives."""
    with pytest.raises(ModelError, match=r"Screw 'S': lead is 0\.0"):
        screw(lead=0.0)
    with pytest.raises(ModelError, match="Screw 'S': friction is given"):
        screw(friction=0.1, radius=0.01)
    nut = Body("nut", 2.0, 0.05)
    joint = Screw("S", ground.at((0, 0)), nut.at((0, 0)), lead=0.5)
    with pytest.raises(ModelError, match="Screw 'S' is a joint in space"):
        mechanism("Nut", plane="xy", bodies=[nut], joints=[joint])


def test_a_limit_of_an_angle_is_met_up_to_rounding_of_the_attitude() -> None:
    """At 0 the angle of a hinge and its limit 0 have no size, but the attitude that the angle is told by is
    rounded beside 1: a gap of 1e-16 rad is none."""
    hinge = Revolute("A", ground.at((0, 0, 0)), arm.at((0, 0, 0)), limits=(0, 1))
    eom = derive(mechanism("M", bodies=[arm], joints=[hinge]))
    system = lower(Form(eom))
    q = [1.0 if name.endswith(".w") else 0.0 for name in system.coordinates]
    told = system.terms(0.0, q, [], [float(p.value) for p in eom.parameters])
    by_row = dict(zip((row.name for row in system.rows), told, strict=True))
    assert by_row["A.lower"] == by_row["A.upper"] == 1
