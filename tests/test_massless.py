"""Bodies without mass or inertia, which their joints to others hold: M is singular, the motion is not."""

from __future__ import annotations

from math import cos, pi, sin
from pathlib import Path

import numpy as np
import pytest
from robots import BASE, MASS, joint, link, robot
from scipy.integrate import solve_ivp

from lagfmu import simulate
from lagfmu.bodies import (
    Body,
    Contact,
    Fixed,
    Gear,
    Gravity,
    Ground,
    Prismatic,
    Revolute,
    Spherical,
    Torsion,
    from_urdf,
    mechanism,
)
from lagfmu.errors import ModelError, SimulationError

g = 9.81  # m/s^2
ground = Ground()
NOTHING = (0, 0, 0)
WEIGHT = Gravity((0, 0, -g))
TARGETS = pytest.mark.parametrize("target", ["native", "python"])


def swung(length: float, friction: float = 0.0):
    """der(angle) of a point of 2 kg on a rod of that length, with a constant friction torque in its hinge."""

    def rates(_, y):
        return y[1], -g / length * sin(y[0]) - friction / (2 * length**2) * np.sign(y[1])

    return rates


@TARGETS
def test_a_mass_without_inertia_swings_as_a_point(target: str) -> None:
    """angle'' = -g/l sin(angle); the hinge, which carries no moment, pulls by m (g cos + l angle'^2) along
    the rod."""
    bob = Body("bob", 2.0, NOTHING)
    hinge = Revolute("A", ground.at((0, 0, 0)), bob.at((0, 0, 0.5)), axis="y")
    model = mechanism("Point", bodies=[bob], joints=[hinge], loads=[WEIGHT], start={"angle.A": 1.2})
    run = simulate(model, 1.0, tolerance=1e-10, target=target)
    wanted = solve_ivp(swung(0.5), (0, 1), (1.2, 0), rtol=1e-12, atol=1e-12).y[:, -1]
    assert run["angle.A"][-1] == pytest.approx(wanted[0], abs=1e-8)
    pull = 2 * (g * np.cos(run["angle.A"]) + 0.5 * run["der(angle.A)"] ** 2)
    for component, part in (("x", np.sin(run["angle.A"])), ("z", np.cos(run["angle.A"]))):
        np.testing.assert_allclose(run[f"force.A.{component}"], pull * part, atol=1e-7)
    for moment in "xyz":
        np.testing.assert_allclose(run[f"torque.A.{moment}"], 0, atol=1e-9)


@TARGETS
def test_a_link_without_mass_between_two_hinges_pulls_along_itself(target: str) -> None:
    """What it carries moves as the second body of a double pendulum whose first mass is 0, by Lagrange's
    equations; across itself the link carries nothing."""
    l1, h, m, J = 1.0, 0.5, 2.0, 0.1
    link, body = Body("link", 0, NOTHING), Body("body", m, (J, J, 0.02))
    joints = [
        Revolute("A", ground.at((0, 0, 0)), link.at((0, 0, 0)), axis="y"),
        Revolute("B", link.at((0, 0, -l1)), body.at((0, 0, h)), axis="y"),
    ]
    start = {"angle.A": 0.7, "angle.B": -0.2, "der(angle.A)": 0.5, "der(angle.B)": 0.0}
    model = mechanism("Double", bodies=[link, body], joints=joints, loads=[WEIGHT], start=start)
    run = simulate(model, 1.0, tolerance=1e-10, target=target)

    def rates(_, y):
        a, b, u, w = y
        M = [[m * l1**2, m * l1 * h * cos(a - b)], [m * l1 * h * cos(a - b), m * h**2 + J]]
        F = [
            -m * g * l1 * sin(a) - m * l1 * h * sin(a - b) * w**2,
            -m * g * h * sin(b) + m * l1 * h * sin(a - b) * u**2,
        ]
        return [u, w, *np.linalg.solve(M, F)]

    begun = (0.7, 0.5, 0.5, 0.5)
    a, b = solve_ivp(rates, (0, 1), begun, rtol=1e-12, atol=1e-12).y[:2, -1]
    assert run["angle.A"][-1] == pytest.approx(a, abs=1e-8)
    assert run["angle.A"][-1] + run["angle.B"][-1] == pytest.approx(b, abs=1e-8)
    across = run["force.A.x"] * np.cos(run["angle.A"]) - run["force.A.z"] * np.sin(run["angle.A"])
    np.testing.assert_allclose(across, 0, atol=1e-9)
    assert np.abs(run["force.A.z"]).min() > 1


@TARGETS
@pytest.mark.parametrize("plane", ["xy", None])
def test_the_coupler_of_a_four_bar_without_mass_is_a_rod(target: str, plane: str | None) -> None:
    """In the plane, and in space, where three of its rows are redundant: the force in both of its pins is
    along the coupler, and the angles are those of the linkage whose coupler has 1e-9 of the masses."""

    def run(mass: float):
        def at(of, x, y):
            return of.at((x, y) if plane else (x, y, 0))

        def body(name, m):
            return Body(name, m, 0.02 * m if plane else (0.02 * m,) * 3)

        crank, coupler, rocker = body("crank", 1.0), body("coupler", mass), body("rocker", 1.5)
        joints = [
            Revolute("A", at(ground, 0, 0), at(crank, -0.1, 0)),
            Revolute("B", at(crank, 0.1, 0), at(coupler, -0.25, 0)),
            Revolute("C", at(coupler, 0.25, 0), at(rocker, -0.2, 0)),
            Revolute("D", at(ground, 0.5, 0), at(rocker, 0.2, 0)),
        ]
        fall = (0, -g) if plane else (0, -g, 0)
        return simulate(
            mechanism(
                "FourBar",
                plane=plane,
                bodies=[crank, coupler, rocker],
                joints=joints,
                loads=[Gravity(fall)],
                start={"angle.A": pi / 2, "der(angle.A)": 3.0},
            ),
            0.5,
            target=target,
        )

    bare, light = run(0), run(1e-9)
    for pin in "ABCD":
        np.testing.assert_allclose(bare[f"angle.{pin}"], light[f"angle.{pin}"], atol=1e-6)
    turn = bare["angle.A"] + bare["angle.B"]
    force = bare["force.C.x"], bare["force.C.y"]  # in the axes of the coupler
    np.testing.assert_allclose(force[1], 0, atol=1e-7)
    np.testing.assert_allclose(np.hypot(*force), np.abs(light["force.C.x"]), rtol=1e-4, atol=1e-4)
    assert np.ptp(turn) > 0.1
    assert np.abs(force[0]).max() > 1


@TARGETS
def test_a_line_turns_about_what_is_not_along_it(target: str) -> None:
    """A thin rod along (1, 2, 2), its inertia rounded, on a hinge along z: J = (5/9) m l^2/12 about z; along
    itself it has none, and about a hinge there it is refused."""
    along = np.array([1, 2, 2]) / 3
    J = 0.3 * (np.eye(3) - np.outer(along, along))
    rod = Body("rod", 1.5, (*np.diag(J), J[0, 1], J[0, 2], J[1, 2]))

    def model(axis):
        pin = ground.at((0, 0, 0), axis=axis), rod.at((0, 0.4, 0), axis=axis)
        loads = [Gravity((0, -g, 0))]
        return mechanism(
            "Rod", bodies=[rod], joints=[Revolute("A", *pin)], loads=loads, start=begun
        )

    begun = {"angle.A": 0.5}
    run = simulate(model((0, 0, 1)), 0.5, tolerance=1e-10, target=target)
    about = J[2, 2] + 1.5 * 0.4**2
    wanted = solve_ivp(
        lambda _, y: (y[1], -1.5 * g * 0.4 / about * sin(y[0])),
        (0, 0.5),
        (0.5, 0),
        rtol=1e-12,
        atol=1e-12,
    ).y[0, -1]
    assert run["angle.A"][-1] == pytest.approx(wanted, abs=1e-8)
    rod = Body("rod", 1.5, (0, 0.3, 0.3))
    pin = Revolute("A", ground.at((0, 0, 0)), rod.at((0.2, 0, 0)), axis="x")
    along_itself = mechanism("Rod", bodies=[rod], joints=[pin], loads=[WEIGHT])
    with pytest.raises(ModelError, match=r"'rod.omega.x' has neither mass nor .*an inertia"):
        simulate(along_itself, 0.1, target=target)


def test_friction_in_the_hinge_of_a_link_without_mass_brakes_what_it_carries() -> None:
    """A constant torque in the hinge at the ground; a bob without inertia is welded on the link: as a point
    with that friction, up to where it turns round."""
    arm, bob = Body("arm", 0, NOTHING), Body("bob", 2.0, NOTHING)
    joints = [
        Revolute("A", ground.at((0, 0, 0)), arm.at((0, 0, 0)), axis="y", friction_torque=0.8),
        Fixed("weld", arm.at((0, 0, -0.5)), bob.at((0, 0, 0))),
    ]
    model = mechanism(
        "Rough", bodies=[arm, bob], joints=joints, loads=[WEIGHT], start={"angle.A": 1.2}
    )
    run = simulate(model, 1.5, tolerance=1e-10)
    wanted = solve_ivp(swung(0.5, 0.8), (0, 0.6), (1.2, 0), rtol=1e-12, atol=1e-12, max_step=1e-3)
    at = int(np.argmin(np.abs(run["time"] - 0.6)))
    assert run["angle.A"][at] == pytest.approx(wanted.y[0, -1], abs=1e-6)
    # m g l (cos a1 - cos a0) = -torque (a0 - a1) from turn to turn
    turns = run["angle.A"].min()
    assert 2 * g * 0.5 * (cos(turns) - cos(1.2)) == pytest.approx(0.8 * (1.2 - turns), abs=1e-3)


@TARGETS
def test_a_carriage_without_mass_hands_on_the_blow_of_its_stop(target: str) -> None:
    """A carriage at 2 m/s strikes its end, from which it rebounds with e = 0.5; a body of 2 kg hangs on its
    pin, h below it.  About the pin the angular momentum is kept, (J + m h^2) w+ + m h u+ = m h u-, and
    u+ = -e u-; the impulse on the stop is the change of m (u + h w)."""
    m, h, J, e = 2.0, 0.3, 0.05, 0.5
    carriage, body = Body("carriage", 0, NOTHING), Body("body", m, (J, J, J))
    joints = [
        Prismatic(
            "slide",
            ground.at((0, 0, 0)),
            carriage.at((0, 0, 0)),
            axis="x",
            limits=(-10, 1),
            restitution=e,
        ),
        Revolute("pin", carriage.at((0, 0, 0)), body.at((0, 0, h)), axis="y"),
    ]
    start = {"der(position.slide)": 2.0, "der(angle.pin)": 0.0}
    model = mechanism("Blow", bodies=[carriage, body], joints=joints, start=start)
    run = simulate(model, 0.6, target=target)
    after = run["time"] > 0.5
    u, w = -e * 2, m * h * (2 + e * 2) / (J + m * h**2)
    assert run["closing.slide.upper.time"][-1] == pytest.approx(0.5, abs=1e-9)
    np.testing.assert_allclose(run["body.velocity.x"][after], u + h * w, rtol=1e-7)
    straight = run["body.velocity.x"] ** 2 + run["body.velocity.z"] ** 2
    energy = m * straight / 2 + J * run["body.omega.y"] ** 2 / 2
    np.testing.assert_allclose(energy[after], m * (u + h * w) ** 2 / 2 + J * w**2 / 2, rtol=1e-6)
    if target == "native":
        lost = m * 2 - m * (u + h * w)
        assert run["closing.slide.upper.impulse"][-1] == pytest.approx(lost, rel=1e-9)


@TARGETS
def test_a_gear_holds_a_finger_without_mass(target: str) -> None:
    """It follows its leader at the ratio, and adds nothing to what resists the leader."""
    leader, finger = Body("leader", 1.0, (0.1, 0.1, 0.1)), Body("finger", 0, NOTHING)
    joints = [
        Revolute("A", ground.at((0, 0, 0)), leader.at((0, 0, 0.2)), axis="y"),
        Revolute("B", leader.at((0, 0, -0.2)), finger.at((0, 0, 0)), axis="y"),
        Gear("gear", "B", "A", 2.0),
    ]
    start = {"angle.A": 0.3}
    model = mechanism("Finger", bodies=[leader, finger], joints=joints, loads=[WEIGHT], start=start)
    run = simulate(model, 0.5, tolerance=1e-10, target=target)
    wanted = solve_ivp(
        lambda _, y: (y[1], -g * 0.2 / (0.1 + 0.2**2) * sin(y[0])),
        (0, 0.5),
        (0.3, 0),
        rtol=1e-12,
        atol=1e-12,
    ).y[0, -1]
    assert run["angle.A"][-1] == pytest.approx(wanted, abs=1e-8)
    np.testing.assert_allclose(run["angle.B"], 2 * run["angle.A"], atol=1e-12)
    np.testing.assert_allclose(run["lambda.gear"], 0, atol=1e-10)


@pytest.mark.parametrize(
    ("joints", "told"),
    [
        ([], "'point.omega.x', 'point.omega.y', 'point.omega.z' has neither mass nor a constraint"),
        ([Spherical], "'point.omega.x', 'point.omega.y', 'point.omega.z' has neither"),
        ([Revolute], "'point.omega.z' has neither mass nor a constraint that determines its accel"),
    ],
)
def test_a_point_that_spins_freely_is_refused(joints, told: str) -> None:
    """What nothing resists: on no joint, on a ball at its centre, on a hinge through it; with the remedy."""
    point = Body("point", 1.0, NOTHING)
    held = [kind("A", ground.at((0, 0, 0)), point.at((0, 0, 0))) for kind in joints]
    with pytest.raises(ModelError) as caught:
        simulate(mechanism("Free", bodies=[point], joints=held, loads=[WEIGHT]), 0.1)
    assert told in str(caught.value)
    assert "give it a mass (what turns, an inertia), or a constraint" in str(caught.value)


def test_a_place_at_which_a_spin_is_free_is_refused_and_another_taken() -> None:
    """A head without inertia on a roll, and a yaw whose axis goes through it while it is upright, when
    nothing resists the yaw; rolled over by 0.3 rad it falls."""
    neck, head = Body("neck", 0.1, NOTHING), Body("head", 1.0, NOTHING)
    joints = [
        Revolute("yaw", ground.at((0, 0, 0)), neck.at((0, 0, -0.1))),
        Revolute("roll", neck.at((0, 0, 0)), head.at((0, 0, -0.2)), axis="x"),
    ]

    def model(roll: float):
        start = {"angle.roll": roll}
        return mechanism("Head", bodies=[neck, head], joints=joints, loads=[WEIGHT], start=start)

    with pytest.raises(ModelError, match="elsewhere it has: start at another place than"):
        simulate(model(0), 0.1)
    run = simulate(model(0.3), 0.1, tolerance=1e-10)
    wanted = solve_ivp(
        lambda _, y: (y[1], g / 0.2 * sin(y[0])), (0, 0.1), (0.3, 0), rtol=1e-12, atol=1e-12
    ).y[0, -1]
    assert run["angle.roll"][-1] == pytest.approx(wanted, abs=1e-8)


@TARGETS
def test_a_contact_that_opens_and_leaves_a_spin_ends_the_run_by_name(target: str) -> None:
    """A spring presses a flap without mass onto a post of 1 kg, which it pushes away, up to where the spring
    is slack, after a quarter of a period: then nothing says how the flap turns."""
    flap, post = Body("flap", 0, NOTHING), Body("post", 1.0, (0.1, 0.1, 0.1))
    joints = [
        Revolute("A", ground.at((0, 0, 0)), flap.at((0, 0, 0)), axis="y"),
        Prismatic("D", ground.at((1, 0, 0)), post.at((0, 0, 0))),
        Contact("rests", post.at((0, 0, 0)), flap.at((1, 0, 0))),
    ]
    spring = Torsion("spring", "A", stiffness=5.0, angle=0.01)
    model = mechanism("Flap", bodies=[flap, post], joints=joints, loads=[spring])
    with pytest.raises(SimulationError, match=r"t = 0\.7.*flap\.omega\.y"):
        simulate(model, 1.0, target=target)


def test_a_file_may_have_links_without_mass_between_joints(tmp_path: Path) -> None:
    """A universal joint as two hinges; a mass without inertia; an inertia that a program rounded from 0."""
    nearly = '<inertia ixx="-5e-20" ixy="0" ixz="0" iyy="1e-20" iyz="0" izz="0"/>'
    point = f'<inertial><origin xyz="0.3 0 0"/><mass value="2"/>{nearly}</inertial>'
    cross = joint("i", "base", "cross"), joint("j", "cross", "a").replace("0 0 1", "0 1 0")
    end = joint("k", "a", "p")
    path = robot(tmp_path, BASE, link("cross", ""), link("a", MASS), link("p", point), *cross, end)
    parts = from_urdf(path)
    assert [(b.mass, b.inertia[:3]) for b in parts.bodies] == [
        (0.0, (0, 0, 0)),
        (1.0, (1, 1, 1)),
        (2.0, (0, 0, 0)),
    ]
    run = simulate(
        mechanism("R", bodies=parts.bodies, joints=parts.joints, loads=[WEIGHT], start=parts.start),
        0.1,
    )
    assert np.isfinite(run["angle.k"]).all()


@TARGETS
@pytest.mark.parametrize("mass", [0.0, 1e-3])
@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_a_beam_on_two_pins_bears_its_load_and_nobody_knows_along_it(
    unit: float, mass: float, target: str
) -> None:
    """A load of 4 kg at a quarter of a beam: the nearer pin lifts three quarters of it; along the beam the
    pins may push at each other by any force, whether the beam has mass or not, in any unit of mass."""
    beam, load = Body("beam", mass * unit, mass * unit), Body("load", 4.0 * unit, 0.1 * unit)
    model = mechanism(
        "Beam",
        plane="xy",
        bodies=[beam, load],
        joints=[
            Revolute("A", ground.at((0, 0)), beam.at((-0.5, 0))),
            Revolute("B", ground.at((1, 0)), beam.at((0.5, 0))),
            Fixed("W", beam.at((-0.25, 0)), load.at((0, 0))),
        ],
        loads=[Gravity((0, -g))],
    )
    run = simulate(model, stop_time=0.1, step_size=0.1, target=target)
    half = mass * g / 2
    assert run["force.A.y"] / unit == pytest.approx(3 * g + half, rel=1e-12)
    assert run["force.B.y"] / unit == pytest.approx(g + half, rel=1e-12)
    assert [*run["unique.force.A.y"], *run["unique.force.B.y"]] == [1] * 4
    assert [*run["unique.force.A.x"], *run["unique.force.B.x"]] == [0] * 4


@TARGETS
def test_in_small_units_of_mass_a_coupler_on_massless_cranks_swings_alike(target: str) -> None:
    """Three parallel cranks of 0.4 m, two without mass: beside rows of 1 m a mass of 1e-9 kg is none, and yet
    the motion is that of 1 kg, and each force the billionth part, also where redundant rows share it."""
    runs = []
    for unit in (1.0, 1e-9):
        crank, coupler = Body("crank", unit, 0.02 * unit), Body("coupler", 3 * unit, 0.1 * unit)
        bodies = [crank, *(Body(n, 0.0, 0.0) for n in ("left", "right"))]
        joints = []
        for k, body in enumerate(bodies):
            joints.append(Revolute(f"A{k}", ground.at((0.5 * k, 0)), body.at((-0.2, 0))))
            at = coupler.at((0.5 * k - 0.5, 0))
            joints.append(Revolute(f"B{k}", body.at((0.2, 0)), at))
        model = mechanism(
            "Cranks",
            plane="xy",
            bodies=[*bodies, coupler],
            joints=joints,
            loads=[Gravity((0, -g))],
            start={f"angle.A{k}": -1.0 for k in range(3)},
        )
        runs.append((unit, simulate(model, stop_time=0.3, step_size=0.1, target=target)))
    (_, plain), (unit, small) = runs
    assert small["angle.A0"] == pytest.approx(plain["angle.A0"], rel=1e-7)
    for name in ("force.A0.x", "force.A1.y", "force.B2.norm"):
        size = abs(plain[name]).max()
        assert small[name] / unit == pytest.approx(plain[name], abs=1e-6 * size)
