"""Bodies and joints against Newton's and Euler's equations written by hand (independent/)."""

from __future__ import annotations

from functools import partial

import andrews
import arm
import hexapod
import iftomm
import numpy as np
import pytest
import wishbone
from joints import pin
from mechanisms import LINKAGES, cardan, door, stewart
from rigid import GROUND, Mass, Mechanism, rotation, state
from scipy.special import ellipj, ellipkm1

from lagfmu import simulate
from lagfmu.bodies import Body, Gravity, Ground, Spherical, mechanism

ALLOWED = 1e-9  # of a joint force, relative to the largest


def test_a_heavy_top_rests_on_its_ball_joint_with_m_a_minus_g(built):
    """An unsymmetric top spins on a point: its ball joint gives it the force m (a - g)."""
    J, tip = (1.0, 2.0, 2.5, 0.1, 0.05, -0.07), (0.0, 0.0, -0.3)
    joint = {"A": [partial(pin, GROUND, (0, 0, 0), 0, tip)]}
    by_hand = Mechanism([Mass.of(2.0, *J)], joint, (0, 0, -9.81))
    spin = (0.1, 0.2, 5.0)
    start = by_hand.speeds(state(((0, 0, 0.3), np.eye(3))), {0: spin})
    top = Body("top", 2.0, J)
    model = mechanism(
        "TopOnABall",
        bodies=[top],
        joints=[Spherical("A", Ground().at((0, 0, 0)), top.at(tip))],
        loads=[Gravity((0, 0, -9.81))],
        start={"top.position": (0, 0, 0.3), "top.omega": spin},
    )
    run = simulate(built(model), stop_time=1.0, tolerance=1e-12)
    ended = by_hand.moved(start, (0.0, 1.0))[-1]
    acceleration, _, received = by_hand.solve(1.0, ended)
    force = np.array([run[f"force.A.{x}"][-1] for x in "xyz"])
    np.testing.assert_allclose(force, received["A"][:3], rtol=0, atol=20 * ALLOWED)
    weight = 2.0 * (acceleration[0, :3] - by_hand.gravity)
    np.testing.assert_allclose(force, weight, rtol=0, atol=20 * ALLOWED)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9, 1e-12])
def test_a_body_near_its_middle_axis_flips_when_jacobis_functions_say(built, tolerance):
    """Near the middle axis a free body turns over each 2 K(k)/p (Landau & Lifshitz, Mechanics, sect. 37);
    over 1,000 turns its angular momentum in space and its energy stay within 100 tolerances, the 334th flip
    within 20,000 of them in seconds."""
    A, B, C = J = np.array([1.0, 2.0, 3.0])
    turn, lean = 5.0, 0.05  # rad/s about the middle axis, and about the third
    energy, momentum = B * turn**2 + C * lean**2, (B * turn) ** 2 + (C * lean) ** 2
    p = np.sqrt((C - B) * (momentum - energy * A) / (A * B * C))
    complementary = (C - A) * C * lean**2 / (momentum - energy * A)  # 1 - k^2
    quarter, flips, looks = ellipkm1(complementary) / p, 334, 8
    body = Body("body", 1.0, tuple(J))
    model = mechanism("FreeBody", bodies=[body], start={"body.omega": (0.0, -turn, lean)})
    run = simulate(
        built(model),
        stop_time=2 * flips * quarter,
        step_size=quarter / looks,
        tolerance=tolerance,
        start_values={"solver.method": "dop853"},
    )
    assert run["time"][-1] * turn > 1000 * 2 * np.pi
    w = np.stack([run[f"body.omega.{x}"] for x in "xyz"], axis=1)
    flip = slice(looks, None, 2 * looks)
    late = w[flip, 1] / ((C - A) / B * w[flip, 0] * w[flip, 2])
    assert len(late) == flips
    np.testing.assert_allclose(late, 0, rtol=0, atol=2e4 * tolerance)
    sn, *_ = ellipj(p * run["time"] - p * quarter, 1 - complementary)
    np.testing.assert_allclose(w[:, 1], turn * sn, rtol=0, atol=2e5 * tolerance)
    e = np.stack([run[f"body.orientation.{x}"] for x in "wxyz"], axis=1)
    in_space = np.array([rotation(q) @ (J * v) for q, v in zip(e, w, strict=True)])
    allowed = 100 * tolerance * np.sqrt(momentum)
    np.testing.assert_allclose(in_space, in_space[[0]].repeat(len(w), 0), rtol=0, atol=allowed)
    np.testing.assert_allclose(w**2 @ J, energy, rtol=100 * tolerance)


QUICK = (door, cardan, stewart)


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
@pytest.mark.parametrize(
    "make",
    [m if m in QUICK else pytest.param(m, marks=pytest.mark.thorough) for m in LINKAGES],
)
def test_joints_hold_as_by_newton_and_euler(make):
    """Hinges, balls, slides, universal joints and rods: what all do to each body, and the components that are
    determined where rows are redundant; which these are is told of each."""
    system = make().system(0.2)
    run = simulate(system.model, stop_time=0.2, tolerance=1e-12, target="python")
    wanted = system.expected(0.2)
    size = max(abs(x) for x in wanted.values())
    found = {name: float(run[name][-1]) for name in wanted}
    assert found == pytest.approx(wanted, rel=0, abs=ALLOWED * size)


@pytest.mark.parametrize("axes", [2, pytest.param(6, marks=pytest.mark.thorough)])
def test_an_arm_carries_itself_as_recursive_newton_and_euler_say(axes):
    """An arm on prescribed motions: the whole wrench in each joint, the drive's torque included."""
    links = arm.LINKS[:axes]
    run = simulate(arm.model(links), stop_time=2.0, step_size=0.5, target="python")
    for row in run:
        wanted = arm.wrenches(row["time"], links)
        size = max(np.abs(w).max() for w in wanted.values())
        for k, link in enumerate(links, 1):
            names = [f"{what}.J{k}.{x}" for what in ("force", "torque") for x in "xyz"]
            found = [row[name] for name in names]
            np.testing.assert_allclose(found, wanted[link.name], rtol=0, atol=1e-11 * size)
            assert row[f"lambda.M{k}"] == pytest.approx(wanted[link.name][5], abs=1e-11 * size)


@pytest.mark.thorough
def test_a_platform_on_six_driven_legs_presses_its_joints_as_newton_and_euler_say(native_fmu):
    """Its motion is prescribed, so that nothing is integrated: the whole wrench in each of 18 joints, and
    the force of each drive."""
    run = simulate(native_fmu("Stewart"), stop_time=2.0, step_size=0.25)
    for row in run:
        wanted = hexapod.wrenches(row["time"])
        size = max(np.abs(w).max() for w in wanted.values())
        for name, wrench in wanted.items():
            names = [f"{what}.{name}.{x}" for what in ("force", "torque") for x in "xyz"]
            found = [row[n] for n in names]
            np.testing.assert_allclose(found, wrench, rtol=0, atol=1e-10 * size)
        for k in range(1, 7):
            assert row[f"lambda.drive{k}"] == pytest.approx(wanted[f"leg{k}"][2], abs=1e-10 * size)


@pytest.mark.thorough
def test_a_wheel_loads_its_suspension_as_newton_and_euler_say(native_fmu):
    """Double wishbone on a bump, from the same start, up to where the wheel leaves the road: the force in
    each joint, of an integration by hand."""
    stop = 0.3
    run = simulate(native_fmu("DoubleWishbone"), stop, tolerance=1e-12)
    parts = []
    for name in wishbone.NAMES:
        r, v, w = (
            [run[f"{name}.{what}.{x}"][0] for x in "xyz"]
            for what in ("position", "velocity", "omega")
        )
        e = np.array([run[f"{name}.orientation.{x}"][0] for x in "wxyz"])
        parts.append([*r, *e, *v, *(rotation(e) @ w)])
    wanted = wishbone.norms(np.concatenate(parts), stop)
    found = {name: run[f"force.{name}.norm"][-1] for name in wanted}
    assert found == pytest.approx(wanted, rel=0, abs=ALLOWED * max(wanted.values()))


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
@pytest.mark.parametrize(
    ("make", "tolerance"),
    [
        (iftomm.pendulum, 1e-12),
        pytest.param(iftomm.windows, 1e-12, marks=pytest.mark.thorough),
        pytest.param(iftomm.squeezer, 1e-12, marks=pytest.mark.thorough),
        pytest.param(iftomm.bricard, 1e-10, marks=pytest.mark.thorough),
        pytest.param(iftomm.governor, 1e-12, marks=pytest.mark.thorough),
    ],
)
def test_the_iftomm_benchmarks_press_their_joints_as_other_equations_say(make, tolerance, built):
    """A01 to A05 of the library of computational benchmark problems, among them mechanisms that lose rank on
    the way (A02), are overconstrained (A04), or stiff (A05)."""
    system = make()
    run = simulate(built(system.model), system.stop, tolerance=tolerance)
    wanted = system.expected(system.stop)
    size = max(abs(x) for x in wanted.values())
    found = {name: float(run[name][-1]) for name in wanted}
    assert found == pytest.approx(wanted, rel=0, abs=ALLOWED * size)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_what_forces_hold_still_does_not_hold_up_the_motion(built):
    """Bricard's linkage begins with bars at rest between forces that cancel: their rounding is no motion, and
    four more digits cost a method of order eight no more than four times the steps."""
    fmu = built(iftomm.bricard().model)
    steps = [simulate(fmu, 2.0, 0.1, tol)["solver.steps"][-1] for tol in (1e-8, 1e-12)]
    assert steps[1] < 4 * steps[0]


def test_andrews_squeezer_presses_its_pins_as_published(built):
    """Seven bodies on ten pins: each pin's force is that of an integration by hand, and what is published of
    them (the test set for initial value problem solvers) is right to 1e-9 rad and 1e-7 of a force."""
    system = andrews.squeezer()
    run = simulate(built(system.model), stop_time=system.stop, tolerance=1e-13)
    wanted = system.expected(system.stop)
    size = max(abs(x) for x in wanted.values())
    found = {name: float(run[name][-1]) for name in wanted}
    assert found == pytest.approx(wanted, rel=0, abs=ALLOWED * size)
    assert found["angle.O"] == pytest.approx(andrews.PUBLISHED["angle"], abs=2e-9)
    turned = np.exp(1j * run["K2.orientation.z"][-1])
    for name in ("P3", "P4", "P6"):
        force = turned * (found[f"force.{name}.x"] + 1j * found[f"force.{name}.y"])
        assert force == pytest.approx(andrews.PUBLISHED[name], abs=1e-7 * size)
