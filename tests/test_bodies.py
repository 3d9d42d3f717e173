"""Bodies and joints in the plane: the wrench in each joint, against what Newton says by hand."""

from __future__ import annotations

import re
import warnings
from math import acos, cos, hypot, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
import sympy
from conftest import model_file
from sympy import symbols
from sympy.physics.vector import dynamicsymbols

from lagfmu import Parameter, Scene, Spline, Track, simulate, verify
from lagfmu.bodies import (
    Body,
    Contact,
    Distance,
    Fixed,
    Force,
    Gear,
    Gravity,
    Ground,
    Motor,
    PointOnCurve,
    PointOnPlane,
    Prismatic,
    Revolute,
    Rolling,
    SpringDamper,
    Torque,
    Torsion,
    mechanism,
)
from lagfmu.errors import ModelError
from lagfmu.testing import prepare, typeset

g = 9.81  # m/s^2
t = dynamicsymbols._t
turn = symbols("turn")  # along a curve
ground = Ground()
MODELS = Path(__file__).parent.parent / "models"


def moved(model, stop=1.0, **options):
    """A run at a fine tolerance, in this process unless the target is another."""
    given = {"target": "python", "tolerance": 1e-11, **options}
    return simulate(model, stop, stop / 20, **given)


def plane(*, bodies, name="M", **parts):
    return mechanism(name, plane="xy", bodies=bodies, **parts)


def test_the_forces_of_a_slider_crank_are_those_of_d_alembert(native_fmu):
    """And with another crank, a heavier piston and a longer rod."""
    path = native_fmu("SliderCrankBodies")
    assert verify(path).passed
    changed = {"A.second.x": -0.07, "B.first.x": 0.12, "piston.mass": 2.0, "C.first.x": 0.4}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert verify(path, changed).passed


def test_a_mechanism_is_told_by_its_parts():
    """What is read of a mechanism is a line a body and a joint, not Lagrange's equations written out."""
    (section,) = typeset(prepare(model_file("slider_crank_bodies").model).form)
    lines = {e.label: e.text for e in section.equations}
    told = {name: lines[name] for name in ("crank", "B", "D")}
    assert told == {
        "crank": "body",
        "B": "revolute: rod on crank",
        "D": "prismatic: piston on ground",
    }


def test_a_pin_carries_a_compound_pendulum():
    """m = 2 kg, J = 0.03 kg m^2, the pin 0.4 m from the centre: J_A phi'' = -m g d sin phi, and the force of
    the pin, along the rod and across, is m g cos phi + m d phi'^2 and m g sin phi + m d phi''."""
    m, J, d, start = 2.0, 0.03, 0.4, 1.2
    bob = Body("bob", m, J)
    model = plane(
        bodies=[bob],
        joints=[Revolute("A", ground.at((0, 0), rotation=-pi / 2), bob.at((-d, 0)))],
        loads=[Gravity((0, -g))],
        start={"angle.A": start, "der(angle.A)": -0.7},
        read={"end": bob.at((0.3, 0))},
    )
    run = moved(model)
    phi, rate, acceleration = (run[n] for n in ("angle.A", "der(angle.A)", "der(angle.A,2)"))
    assert (phi[0], rate[0]) == pytest.approx((start, -0.7), rel=1e-14)
    assert acceleration == pytest.approx(-m * g * d * np.sin(phi) / (J + m * d**2), rel=1e-9)
    across, along = m * d * acceleration, -m * d * rate**2
    down, right = (  # the marker's x axis points down, its y axis to the right
        along * np.cos(phi) - across * np.sin(phi) - m * g,
        along * np.sin(phi) + across * np.cos(phi),
    )
    scale = m * g
    np.testing.assert_allclose(run["force.A.x"], down, atol=1e-9 * scale)
    np.testing.assert_allclose(run["force.A.y"], right, atol=1e-9 * scale)
    np.testing.assert_allclose(run["force.A.norm"], np.hypot(down, right), rtol=1e-9)
    assert not run["torque.A.z"].any()
    assert run["unique.A.x"].all()
    assert run["unique.A.y"].all()
    assert run["bob.omega.z"] == pytest.approx(rate, rel=1e-14)
    out, aside = (np.sin(phi), -np.cos(phi)), (np.cos(phi), np.sin(phi))  # of the rod
    for k, x in enumerate("xy"):
        end = 0.7 * np.array([out[k], rate * aside[k], acceleration * aside[k] - rate**2 * out[k]])
        told = [run[f"end.{what}.{x}"] for what in ("position", "velocity", "acceleration")]
        np.testing.assert_allclose(told, end, rtol=1e-10, atol=1e-12)


def test_a_bracket_carries_what_hangs_on_it():
    """A welded body of 3 kg, its centre 0.2 m beside the weld: 3 g upwards and 0.6 g N m about the marker."""
    part = Body("part", 3.0, 0.1, center=(0.2, 0.05))
    run = moved(
        plane(
            bodies=[part],
            joints=[Fixed("W", ground.at((1, 2)), part.at((0, 0)))],
            loads=[Gravity((0, -g))],
        )
    )
    assert run["force.W.y"] == pytest.approx(3 * g, rel=1e-13)
    assert run["torque.W.z"] == pytest.approx(0.6 * g, rel=1e-13)
    assert run["part.position.x"] == pytest.approx(1.2, rel=1e-14)


def test_a_slide_on_an_incline_takes_the_moment_of_an_eccentric_body():
    """A block slides down a line at 30 degrees with g/2; the rail carries m g cos 30 and, though its centre
    is 0.1 m above it, no moment: that of gravity along the line is what the mass itself needs."""
    block = Body("block", 2.0, 0.02, center=(0, 0.1))
    run = moved(
        plane(
            bodies=[block],
            joints=[Prismatic("D", ground.at((0, 0), rotation=-pi / 6), block.at((0, 0)))],
            loads=[Gravity((0, -g))],
        ),
        stop=0.5,
    )
    assert run["der(position.D,2)"] == pytest.approx(g / 2, rel=1e-12)
    assert run["position.D"] == pytest.approx(g / 4 * run["time"] ** 2, rel=1e-9)
    assert run["force.D.y"] == pytest.approx(2 * g * cos(pi / 6), rel=1e-12)
    np.testing.assert_allclose(run["force.D.x"], 0)
    # of gravity and of the inertia, at the marker
    moment = 0.1 * 2 * g * sin(pi / 6) - 0.1 * 2 * g / 2
    np.testing.assert_allclose(run["torque.D.z"], moment, atol=1e-12)


def test_a_rod_without_mass_pulls_along_itself():
    """A bob at rest, aside by 0.5 rad, on a rod: it pulls with m g cos(0.5), towards the ground's marker."""
    bob = Body("bob", 1.5, 0.01)
    tilted = (sin(0.5), -cos(0.5))
    model = plane(
        bodies=[bob],
        joints=[Distance("L", ground.at((0, 0), rotation=-0.2), bob.at((0, 0)), 1.0)],
        loads=[Gravity((0, -g))],
        start={"bob.position": tilted},
    )
    first = moved(model, stop=0.1)[0]
    pull = 1.5 * g * cos(0.5)
    assert first["lambda.L"] == pytest.approx(-pull, rel=1e-12)
    expected = [-pull * sin(0.7), pull * cos(0.7)]  # in the axes of the first marker
    assert [first["force.L.x"], first["force.L.y"]] == pytest.approx(expected, rel=1e-12)


def test_a_point_on_a_line_is_held_across_it():
    """A rod of 2 m leans in a corner, free of friction: both walls push by right angles, as its two freedoms
    less two rows demand; its power balance holds."""
    rod = Body("rod", 3.0, 1.0)
    model = plane(
        bodies=[rod],
        joints=[
            PointOnPlane("floor", ground.at((0, 0)), rod.at((1, 0))),
            PointOnPlane("wall", ground.at((0, 0)), rod.at((-1, 0)), axis="x"),
        ],
        loads=[Gravity((0, -g))],
        start={"rod.orientation.z": -1.0},
    )
    first = moved(model, stop=0.2)[0]
    # x = cos a, y = sin a of the centre, (J + m) a'' = -m g cos a
    acceleration = -3 * g * cos(1.0) / (1.0 + 3.0)
    assert first["rod.position.x"] == pytest.approx(cos(1.0), rel=1e-13)
    assert first["force.wall.x"] == pytest.approx(-3 * sin(1.0) * acceleration, rel=1e-12)
    assert first["force.floor.y"] == pytest.approx(3 * (g + cos(1.0) * acceleration), rel=1e-12)


def test_a_wheel_rolls_down_an_incline():
    """J = m r^2/2: it rolls with (2/3) g sin(alpha); the line gives -m g sin(alpha)/3 along, m g cos(alpha)
    across, and the moment of the force along it about the wheel's centre turns the wheel."""
    m, r, alpha = 2.0, 0.3, 0.4
    wheel = Body("wheel", m, m * r**2 / 2)
    run = moved(
        plane(
            bodies=[wheel],
            joints=[Rolling("R", ground.at((0, 0), rotation=-alpha), wheel.at((0, 0)), r)],
            loads=[Gravity((0, -g))],
        )
    )
    along = run["der(wheel.position.x,2)"] / cos(alpha)
    assert along == pytest.approx(2 / 3 * g * sin(alpha), rel=1e-11)
    assert run["force.R.x"] == pytest.approx(-m * g * sin(alpha) / 3, rel=1e-11)
    assert run["force.R.y"] == pytest.approx(m * g * cos(alpha), rel=1e-11)
    assert run["torque.R.z"] == pytest.approx(m * r**2 / 2 * run["der(wheel.orientation.z,2)"])


def test_a_gear_divides_a_torque():
    """Wheels on a 7:3 gear: (J1 + (3/7)^2 J2) a = tau, and the teeth hand on J2 (3/7)^2 a of it."""
    one, two = Body("one", 1.0, 0.5), Body("two", 1.0, 2.0)
    run = moved(
        plane(
            bodies=[one, two],
            joints=[
                Gear("teeth", "A", "B", ratio=-7 / 3, offset=0.2),
                Revolute("A", ground.at((0, 0)), one.at((0, 0))),
                Revolute("B", ground.at((1, 0)), two.at((0, 0))),
            ],
            loads=[Motor("motor", "A", torque=1.4)],
            start={"angle.A": 0.0},
        ),
        stop=20.0,
    )
    a = 1.4 / (0.5 + (3 / 7) ** 2 * 2.0)
    assert run["der(angle.A,2)"] == pytest.approx(a, rel=1e-12)
    assert run["angle.A"] == pytest.approx(a * run["time"] ** 2 / 2, rel=1e-10)
    assert run["angle.B"] == pytest.approx(-3 / 7 * (run["angle.A"] - 0.2), rel=1e-12, abs=1e-12)
    assert run["angle.A"][-1] > 40 * 2 * pi
    assert run["lambda.teeth"] == pytest.approx(-((3 / 7) ** 2) * 2.0 * a, rel=1e-12)
    assert run["torque.A.z"] == pytest.approx(1.4)  # the motor; the teeth are no part of the joint
    assert run["motor.power"] == pytest.approx(1.4 * run["der(angle.A)"], rel=1e-14)


def test_a_cam_turns_work_into_the_motion_of_both_wheels():
    """angle.A = 0.5 B + 0.3 B^2 - 0.1 B^3 with s its slope: (J2 + s^2 J1) B'^2/2 = tau B from rest, and the
    wheel A receives J1 (s B'' + s' B')."""
    one, two = Body("one", 1.0, 0.5), Body("two", 1.0, 2.0)
    run = moved(
        plane(
            bodies=[one, two],
            joints=[
                Gear("cam", "A", "B", ratio=0.5, higher=[0.3, -0.1]),
                Revolute("A", ground.at((0, 0)), one.at((0, 0))),
                Revolute("B", ground.at((1, 0)), two.at((0, 0))),
            ],
            loads=[Motor("motor", "B", torque=1.4)],
            start={"angle.B": 0.0},
        ),
        stop=4.0,
    )
    B, rate, second = (run[n] for n in ("angle.B", "der(angle.B)", "der(angle.B,2)"))
    slope, bend = 0.5 + 0.6 * B - 0.3 * B**2, (0.6 - 0.6 * B) * rate
    assert run["angle.A"] == pytest.approx(0.5 * B + 0.3 * B**2 - 0.1 * B**3, rel=1e-10, abs=1e-12)
    assert (2.0 + slope**2 * 0.5) * rate**2 / 2 == pytest.approx(1.4 * B, rel=1e-8, abs=1e-10)
    torque = 0.5 * (slope * second + bend * rate)
    largest = abs(torque).max()
    assert run["lambda.cam"] == pytest.approx(torque, rel=1e-8, abs=1e-9 * largest)
    assert B[-1] > 2


def test_a_motor_that_prescribes_an_angle_supplies_the_torque_for_it():
    """phi = 0.3 sin(5 t): tau = J phi'' on a wheel, from a law and from an input with its derivatives."""
    wheel = Body("wheel", 1.0, 0.2)

    def model(motion):
        from sympy import sin as sine

        law = symbols("amplitude") * sine(symbols("rate") * t)
        return plane(
            bodies=[wheel],
            joints=[Revolute("A", ground.at((0, 0)), wheel.at((0, 0)))],
            loads=[Motor("motor", "A", motion=motion or law, rate=1.5)],
            parameters=[]
            if motion
            else [
                Parameter(symbols("amplitude"), 0.3, "rad"),
                Parameter(symbols("rate"), 5.0, "rad/s"),
            ],
        )

    run = moved(model(None))
    torque = -0.2 * 0.3 * 25 * np.sin(5 * run["time"])
    np.testing.assert_allclose(run["torque.A.z"], torque, atol=1e-10)
    power = torque * 1.5 * np.cos(5 * run["time"])
    np.testing.assert_allclose(run["motor.power"], power, atol=1e-9)

    time = np.linspace(0, 1, 2001)
    names = ("motor.angle", "der(motor.angle)", "der(motor.angle,2)")
    drive = np.zeros(len(time), [(n, float) for n in ("time", *names)])
    drive["time"] = time
    for k, n in enumerate(names):
        drive[n] = 0.3 * 5**k * np.sin(5 * time + k * pi / 2)
    run = moved(model(True), inputs=drive, tolerance=1e-9)
    np.testing.assert_allclose(run["lambda.motor"][1:], torque[:-1], atol=1e-6)  # inputs are held


def test_a_spring_and_its_damper_pull_along_their_line():
    """Between a wall and a block on a rail: m x'' = -k (x - l) - c x' - preload."""
    block = Body("block", 2.0, 1.0)
    run = moved(
        plane(
            bodies=[block],
            joints=[Prismatic("D", ground.at((0, 0)), block.at((0, 0)))],
            loads=[SpringDamper("S", ground.at((0, 0)), block.at((0, 0)), 50.0, 0.6, 3.0, 1.0)],
            start={"position.D": 0.9},
        )
    )
    x, v, a = (run[n] for n in ("position.D", "der(position.D)", "der(position.D,2)"))
    assert run["force.S"] == pytest.approx(50 * (x - 0.6) + 3 * v + 1.0, rel=1e-12)
    assert -2 * a == pytest.approx(run["force.S"], rel=1e-12)
    rest, w, s = 0.6 - 1 / 50, sqrt(50 / 2), 3.0 / 4
    wd = sqrt(w**2 - s**2)
    time = run["time"]
    swing = np.exp(-s * time) * (np.cos(wd * time) + s / wd * np.sin(wd * time))
    np.testing.assert_allclose(x, rest + (0.9 - rest) * swing, atol=1e-9)
    assert not run["force.D.x"].any()  # springs are no part of a joint


def test_a_torsion_spring_turns_back():
    """J phi'' = -k (phi - slack) + preload about a pin at the centre, for many turns from the start."""
    wheel = Body("wheel", 1.0, 0.5)
    run = moved(
        plane(
            bodies=[wheel],
            joints=[Revolute("A", ground.at((0, 0)), wheel.at((0, 0)))],
            loads=[Torsion("S", "A", stiffness=2.0, angle=0.25, preload=0.1)],
            start={"angle.A": 30.0},
        ),
        stop=10.0,
    )
    rest = 0.25 + 0.05
    expected = rest + (30 - rest) * np.cos(2 * run["time"])
    np.testing.assert_allclose(run["angle.A"], expected, atol=1e-8)
    assert run["torque.S"] == pytest.approx(0.5 * run["der(angle.A,2)"], abs=1e-9)


def test_forces_and_torques_act_where_they_are_said_to():
    """A free body of 2 kg and 0.5 kg m^2: a force (3, 0) at 0.2 m above the centre gives 1.5 m/s^2 and
    -0.6/0.5 rad/s^2; one that follows the marker goes on in its axes; a torque of 1 N m adds 2 rad/s^2."""
    part = Body("part", 2.0, 0.5)

    def first(*loads):
        row = moved(plane(bodies=[part], loads=loads, start={"part.orientation.z": pi / 2}), 0.01)[
            0
        ]
        found = [f"der(part.{x},2)" for x in ("position.x", "position.y", "orientation.z")]
        return [float(row[n]) for n in found]

    above = part.at((0.2, 0))  # the body stands upright: its x axis is the ground's y axis
    assert first(Force("F", above, (3, 0))) == pytest.approx([1.5, 0, -1.2], abs=1e-14)
    assert first(Force("F", above, (3, 0), follows=True)) == pytest.approx([0, 1.5, 0], abs=1e-14)
    assert first(Torque("T", part, 1.0)) == pytest.approx([0, 0, 2], abs=1e-14)
    pushed = plane(bodies=[part], loads=[Force("F", above), Torque("T", part)])
    assert [i.symbol.name for i in pushed.inputs] == ["F.x", "F.y", "T.z"]


def test_a_joint_stops_at_its_limits():
    """Flaps of 2 kg fall from the level to stops at -0.5 and at 0.5 rad and rest there on m g d cos(0.5)."""
    right, left = Body("right", 2.0, 0.05), Body("left", 2.0, 0.05)
    hinge = ground.at((0, 0))
    run = moved(
        plane(
            bodies=[right, left],
            joints=[
                Revolute("A", hinge, right.at((-0.3, 0)), limits=(-0.5, 2.0)),
                Revolute("B", hinge, left.at((0.3, 0)), limits=(-2.0, 0.5)),
            ],
            loads=[Gravity((0, -g))],
        )
    )
    last = run[-1]
    J = 0.05 + 2 * 0.3**2
    speed = sqrt(2 * 2 * g * 0.3 * sin(0.5) / J)  # rad/s, by the energy
    for flap, stop, away, sign in (("A", "lower", "upper", 1), ("B", "upper", "lower", -1)):
        assert last[f"contact.{flap}.{stop}"]
        assert not last[f"contact.{flap}.{away}"]
        assert last[f"angle.{flap}"] == pytest.approx(-0.5 * sign, rel=1e-12)
        torque = sign * 2 * g * 0.3 * cos(0.5)
        assert last[f"torque.{flap}.z"] == pytest.approx(torque, rel=1e-12)
        assert last[f"closing.{flap}.{stop}.impulse"] == pytest.approx(J * speed, rel=1e-8)


def test_a_wheel_on_a_rough_line_rolls_or_slips():
    """J = m r^2/2 on an incline: it rolls where tan(alpha) <= 3 mu, else a = g (sin - mu cos)."""
    m, r = 2.0, 0.3

    def run(alpha, mu):
        wheel = Body("wheel", m, m * r**2 / 2)
        line = ground.at((0, 0), rotation=-alpha)
        model = plane(
            bodies=[wheel],
            contacts=[Contact("C", line, wheel.at((0, 0)), r, friction=mu)],
            loads=[Gravity((0, -g))],
            start={"wheel.position": (r * sin(alpha), r * cos(alpha))},
        )
        return moved(model, target="native", scene=Scene("M", stop_time=1.0))

    rolls, slips = run(0.4, 0.2), run(0.8, 0.2)
    assert rolls["sticks.C"].all()
    assert not slips["sticks.C"][1:].any()
    assert rolls["force.C.x"] == pytest.approx(-m * g * sin(0.4) / 3, rel=1e-9)
    normal = m * g * cos(0.8)
    assert slips["force.C.y"] == pytest.approx(normal, rel=1e-9)
    assert slips["force.C.x"][1:] == pytest.approx(-0.2 * normal, rel=1e-9)
    assert slips["torque.C.z"][1:] == pytest.approx(-0.2 * normal * r, rel=1e-9)


def test_what_lies_on_a_rising_plate_begins_to_rise_with_it():
    """A contact that touches where the mechanism begins holds velocities as a joint does: without a blow."""
    up, r = symbols("up", real=True), 0.3
    plate, wheel = Body("plate", 1.0, 0.1), Body("wheel", 2.0, 0.1)
    model = plane(
        bodies=[plate, wheel],
        joints=[Prismatic("lift", ground.at((0, 0)), plate.at((0, 0)), axis="y")],
        contacts=[Contact("C", plate.at((0, 0)), wheel.at((0, 0)), r)],
        loads=[Gravity((0, -g)), Motor("drive", "lift", motion=up * t)],
        start={"wheel.position": (0, r)},
        parameters=[Parameter(up, 0.5, "m/s")],
    )
    rate = dynamicsymbols("wheel.position.y").diff(t)
    assert model.start[rate] == pytest.approx(0.5, rel=1e-15)
    run = moved(model, target="native")
    assert run["wheel.velocity.y"] == pytest.approx(0.5, rel=1e-12)
    assert run["force.C.y"] == pytest.approx(2.0 * g, rel=1e-12)
    assert run["closing.C.y.count"][-1] == 0


def test_a_parameter_that_two_parts_share_is_one():
    """Two arms of one length, given once: the FMU has it once, in its own unit."""
    L = Parameter(symbols("arm", positive=True), 250.0, "mm")
    one, two = Body("one", 1.0, 0.1), Body("two", 1.0, 0.1)
    model = plane(
        bodies=[one, two],
        joints=[
            Revolute("A", ground.at((0, 0)), one.at((0, 0))),
            Revolute("B", one.at((L, 0)), two.at((0, 0))),
            Revolute("C", ground.at((0, L)), two.at((0, L.symbol))),
        ],
    )
    assert [p.value for p in model.parameters if p.symbol == L.symbol] == [0.25]
    first = moved(model, stop=0.01)[0]
    x, y, angle = (first[f"two.{q}"] for q in ("position.x", "position.y", "orientation.z"))
    assert hypot(x, y) == pytest.approx(0.25, rel=1e-13)  # the end of the first arm
    assert (x - 0.25 * sin(angle), y + 0.25 * cos(angle)) == pytest.approx((0, 0.25), abs=1e-13)


def test_a_bead_on_a_circle_is_a_pendulum():
    """R s'' = -g cos(s) with s from the horizontal, and the circle pushes with m (R s'^2 - g sin(s)) towards
    the centre: on a frame that is turned by 0.3, in both targets."""
    bead, R = Body("bead", 2.0, 0.01), 0.5
    circle = Track((R * sympy.cos(turn), R * sympy.sin(turn)), turn, -4, 4)
    joint = PointOnCurve("K", ground.at((0, 0), rotation=0.3), bead.at((0, 0)), circle)
    loads = [Gravity((0, -g))]
    model = plane(bodies=[bead], joints=[joint], loads=loads, start={"K.curve.s": -0.2})
    for target in ("native", "python"):
        run = moved(model, target=target)
        s, rate = run["K.curve.s"] + 0.3, run["der(K.curve.s)"]
        np.testing.assert_allclose(
            run["der(K.curve.s,2)"], -g * np.cos(s) / R, rtol=1e-9, atol=1e-9
        )
        push = -2.0 * (R * rate**2 - g * np.sin(s))  # along c, from the centre
        np.testing.assert_allclose(run["force.K.x"], push * np.cos(s - 0.3), atol=1e-9)
        np.testing.assert_allclose(run["force.K.y"], push * np.sin(s - 0.3), atol=1e-9)
        np.testing.assert_allclose(run["energy.total"], run["energy.total"][0], atol=1e-9)


def test_a_bead_on_a_parabola_and_on_a_table_is_carried_by_what_is_across():
    """At rest on y = x^2/(2 p) it feels m g/sqrt(1 + (x/p)^2); on a table it keeps its energy and stays on
    the spline, having begun where only x was given."""
    bead, p = Body("bead", 1.5, 0.01), Parameter(symbols("p", positive=True), 0.4, "m")
    at = ground.at((0, 0)), bead.at((0, 0))
    parabola = Track((turn, turn**2 / (2 * p.symbol)), turn, -1, 1)
    given = {"bodies": [bead], "loads": [Gravity((0, -g))], "start": {"bead.position.x": 0.2}}
    joint = PointOnCurve("K", *at, parabola, unit="m")
    first = moved(plane(joints=[joint], parameters=[p], **given), stop=0.01)[0]
    assert first["force.K.norm"] == pytest.approx(1.5 * g / sqrt(1 + 0.5**2), rel=1e-13)
    road = Spline("road", [0, 0.3, 0.7, 1.0], [0.1, 0, 0.05, 0.2], "m", "m")
    run = moved(plane(joints=[PointOnCurve("K", *at, road)], **given))
    assert run["bead.position.x"][0] == 0.2
    np.testing.assert_allclose(run["K.curve.s"], run["bead.position.x"], atol=1e-14)
    height = [road.table(x, 0) for x in run["bead.position.x"].tolist()]
    np.testing.assert_allclose(run["bead.position.y"], height, atol=1e-14)
    np.testing.assert_allclose(run["energy.total"], run["energy.total"][0], atol=1e-9)


def test_a_mechanism_is_assembled_from_the_joint_coordinates_that_are_given():
    """A four-bar linkage, drawn as one line: the crank's angle and rate stay, the rest closes, velocities
    too; the angle between coupler and rocker is that of the cosine law.  The elbow may bend the other way as
    well: a warning says so, and what start bends it there."""
    names, lengths = ("crank", "coupler", "rocker"), (0.2, 0.5, 0.4)
    parts = [Body(n, 1.0, 0.01) for n in names]
    ends = [(b.at((-x / 2, 0)), b.at((x / 2, 0))) for b, x in zip(parts, lengths, strict=True)]
    (a1, a2), (b1, b2), (c1, c2) = ends
    joints = [
        Revolute("A", ground.at((0, 0)), a1),
        Revolute("B", a2, b1),
        Revolute("C", b2, c1),
        Revolute("D", c2, ground.at((0.45, 0))),
    ]
    start = {"angle.A": 1.1, "der(angle.A)": -3.0}
    with pytest.warns(UserWarning, match="the joints close in two ways") as told:
        model = plane(bodies=parts, joints=joints, start=start)
    first = moved(model, stop=0.001)[0]
    assert (first["angle.A"], first["der(angle.A)"]) == pytest.approx((1.1, -3.0), rel=1e-13)
    assert max(abs(first[f"residual.{j.name}.{x}"]) for j in joints for x in "xy") < 1e-15
    diagonal2 = 0.2**2 + 0.45**2 - 2 * 0.2 * 0.45 * cos(1.1)
    between = (0.5**2 + 0.4**2 - diagonal2) / (2 * 0.5 * 0.4)
    assert -cos(first["angle.C"]) == pytest.approx(between, rel=1e-12)
    other = re.search(r"for the other start '(angle\.\w)' at (\S+)$", str(told[0].message))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chosen = plane(bodies=parts, joints=joints, start={**start, other[1]: float(other[2])})
    elbow = moved(chosen, stop=0.001)[0]
    assert elbow["angle.A"] == pytest.approx(1.1, rel=1e-13)
    assert sin(elbow["angle.C"]) == pytest.approx(-sin(first["angle.C"]), rel=1e-12)


def test_a_trolley_above_its_load_rolls_aside_and_turns_nothing():
    """A load that is put half a rope of 1 m below its trolley: the trolley rolls by sqrt(3)/2 m, either way,
    and a warning tells the other.  Nothing turns the load (it was by -0.5 rad, without a word)."""
    trolley, load = Body("trolley", 10.0, 1.0), Body("load", 1.0, 0.01)
    rope = Distance("rope", trolley.at((0, 0)), load.at((0, 0)), length=1.0)
    rail = Prismatic("rail", ground.at((0, 0)), trolley.at((0, 0)), axis="x")
    given = {"load.position": (0.0, -0.5)}
    with pytest.warns(UserWarning, match="the joints close in two ways") as told:
        model = plane(bodies=[trolley, load], joints=[rail, rope], start=given)
    start = {str(q): x for q, x in model.start.items()}
    aside = start["trolley.position.x(t)"]
    assert abs(aside) == pytest.approx(sqrt(3) / 2, rel=1e-9)
    assert start["load.orientation.z(t)"] == pytest.approx(0, abs=1e-9)
    other = re.search(r"for the other start 'position\.rail' at (\S+)$", str(told[0].message))
    assert float(other[1]) == pytest.approx(-aside, rel=1e-9)


def test_a_parallelogram_that_is_folded_flat_keeps_the_angle_that_is_given():
    """Crank at 0, and so all links on one line: what is omitted finds the way there (the crank was moved to
    -3.4 rad, for it "cannot be closed there")."""
    parts = [Body(n, 1.0, 0.01) for n in ("crank", "coupler", "rocker")]
    (a1, a2), (b1, b2), (c1, c2) = (
        (b.at((-x / 2, 0)), b.at((x / 2, 0))) for b, x in zip(parts, (0.2, 0.5, 0.2), strict=True)
    )
    pairs = ((ground.at((0, 0)), a1), (a2, b1), (b2, c1), (c2, ground.at((0.5, 0))))
    joints = [Revolute(n, *ends) for n, ends in zip("ABCD", pairs, strict=True)]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = plane(bodies=parts, joints=joints, start={"angle.A": 0.0})
    start = {str(q): x for q, x in model.start.items()}
    assert start["crank.orientation.z(t)"] == pytest.approx(0, abs=1e-9)
    assert cos(start["rocker.orientation.z(t)"]) == pytest.approx(-1, abs=1e-6)


@pytest.mark.parametrize("target", ["native", "python"])
def test_another_length_moves_what_was_only_assembled(target):
    """With a longer rod and another crank the given angle and its rate stay; the piston is where the triangle
    of crank and rod says."""
    model = model_file("slider_crank_bodies").model
    changed = {"A.second.x": -0.12, "B.first.x": 0.13, "C.first.x": 0.4}
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # no given value moves
        run = simulate(model, 0.001, 0.001, target=target, start_values=changed)
    assert run["angle.A"][0] == pytest.approx(pi / 4, rel=1e-14)
    assert run["der(angle.A)"][0] == pytest.approx(10.0, rel=1e-14)
    across = 0.25 * sin(pi / 4)
    reach = 0.25 * cos(pi / 4) + sqrt(0.65**2 - across**2)
    assert run["position.D"][0] == pytest.approx(reach, rel=1e-13)


def test_a_given_start_that_cannot_be_moves_and_is_told_with_both_numbers():
    """A rocker of 0.4 m on a crank of 0.2 m and a coupler of 0.5 m reaches angles up to a limit only."""
    parts = [Body(n, 1.0, 0.01) for n in ("crank", "coupler", "rocker")]
    one, two, three = parts
    joints = [
        Revolute("A", ground.at((0, 0)), one.at((-0.1, 0))),
        Revolute("B", one.at((0.1, 0)), two.at((-0.25, 0))),
        Revolute("C", two.at((0.25, 0)), three.at((0.2, 0))),
        Revolute("D", ground.at((0.45, 0)), three.at((-0.2, 0))),
    ]
    with pytest.warns(
        UserWarning,
        match=r"do not allow the given start angle\.D = 0\.1, .* starts with angle\.D = 1\.2\d+ instead",
    ) as told:
        model = plane(bodies=parts, joints=joints, start={"angle.D": 0.1})
    assert len(told) == 1
    reach = (0.7**2 - 0.45**2 - 0.4**2) / (2 * 0.45 * 0.4)  # crank and coupler in line
    angle = model.start[next(q for q in model.coordinates if q.name == "rocker.orientation.z")]
    assert angle == pytest.approx(acos(reach), rel=1e-7)


def _parallelogram(start):
    """Links of 0.2, 0.5, 0.2 and 0.5 m; the rocker has three times the crank's moment of inertia."""
    crank, coupler, rocker = parts = [
        Body(n, 1.0, J) for n, J in (("crank", 0.01), ("coupler", 0.02), ("rocker", 0.03))
    ]
    joints = [
        Revolute("A", ground.at((0, 0)), crank.at((-0.1, 0))),
        Revolute("B", crank.at((0.1, 0)), coupler.at((-0.25, 0))),
        Revolute("C", coupler.at((0.25, 0)), rocker.at((0.1, 0))),
        Revolute("D", ground.at((0.5, 0)), rocker.at((-0.1, 0))),
    ]
    return plane(bodies=parts, joints=joints, start=start)


def _two_wheels(start):
    """The second wheel turns back at half the rate of the first, and has four times its moment of inertia."""
    first, second = Body("first", 1.0, 0.01), Body("second", 1.0, 0.04)
    pins = [Revolute("A", ground.at((0, 0)), first.at((0, 0)))]
    pins += [Revolute("B", ground.at((1, 0)), second.at((0, 0))), Gear("mesh", "A", "B", -2.0)]
    return plane(bodies=[first, second], joints=pins, start=start)


def _arm_of_two(start):
    """Two links of 1 m."""
    upper, fore = Body("upper", 1.0, 0.01), Body("fore", 1.0, 0.02)
    pins = [Revolute("A", ground.at((0, 0)), upper.at((-0.5, 0)))]
    pins += [Revolute("B", upper.at((0.5, 0)), fore.at((-0.5, 0)))]
    return plane(bodies=[upper, fore], joints=pins, start=start, read={"tip": fore.at((0.5, 0))})


@pytest.mark.parametrize(
    ("mechanism_of", "start", "nearest"),
    [
        (_arm_of_two, {"tip.position": (3.0, 4.0)}, {"tip.position.x": 1.2, "tip.position.y": 1.6}),
        (
            _parallelogram,
            {"crank.orientation.z": 0.3, "rocker.orientation.z": 0.5},
            {"crank.orientation.z": 0.45, "rocker.orientation.z": 0.45},
        ),
        (
            _parallelogram,
            {"angle.A": 0.3, "der(angle.A)": 3.0, "der(angle.D)": 5.0},
            {"der(angle.A)": 4.5, "der(angle.D)": 4.5},
        ),
        (
            _two_wheels,
            {"angle.A": 3.0, "angle.B": 1.0},
            {"angle.A": 0.5, "angle.B": -0.25},
        ),
    ],
)
def test_given_values_that_contradict_each_other_move_least(mechanism_of, start, nearest):
    """An arm reaches towards a place beyond its 2 m; angles and rates that contradict each other meet at the
    mean by their moments of inertia, (0.01 0.3 + 0.03 0.5)/0.04 and the like.  Each is told with both."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        mechanism_of(start)
    moved = [re.search(r"starts with (\S+) = (\S+) instead", str(w.message)) for w in told]
    found = {m[1]: float(m[2]) for m in moved if m}
    assert found == pytest.approx(nearest, rel=1e-6)


def blocks(**more):
    """Of 9 kg and 1 kg on a line, the second begins 1 m behind the first; the start of the mechanism."""
    one, two = Body("one", 9.0, 0.1), Body("two", 1.0, 0.1)
    slides = [
        Prismatic("A", ground.at((0, 0)), one.at((0, 0))),
        Prismatic("B", ground.at((1, 0)), two.at((0, 0))),
    ]
    tied = Distance("L", one.at((0, 0)), two.at((0, 0)), 2.0)
    model = plane(bodies=[one, two], joints=[*slides, *more.pop("ties", [tied])], **more)
    return {str(name): value for name, value in model.start.items()}


def test_what_is_not_given_moves_least_in_the_metric_of_the_masses():
    """A rod of 2 m between two blocks that begin 1 m apart: nine tenths of the way are the lighter one's."""
    begun = blocks()
    assert begun["one.position.x(t)"] == pytest.approx(-0.1, abs=1e-12)
    assert begun["two.position.x(t)"] == pytest.approx(1.9, rel=1e-12)


def test_rates_that_contradict_each_other_give_way_to_the_joints():
    """1 m/s of each where the first goes twice as fast as the second: told, and then v_1 = 2 v_2."""
    start = {"der(position.A)": 1.0, "der(position.B)": 1.0}
    with pytest.warns(UserWarning, match=r"given start der\(position\.[AB]\) = 1\.0, "):
        begun = blocks(ties=[Gear("G", "A", "B", ratio=2.0)], start=start)
    v = [begun[f"Derivative({b}.position.x(t), t)"] for b in ("one", "two")]
    assert v[0] == pytest.approx(2 * v[1], rel=1e-14)


def test_a_branch_beyond_a_limit_is_none():
    """A post of 1 m stands 1 m beside a rod of 1 m on a hinge, at +-60 degrees; where a stop forbids one of
    them there is one way to close."""
    for limits, ways in ((None, 2), ((-3.0, 0.0), 1)):
        arm = Body("arm", 1.0, 0.1)
        hinge = Revolute("A", ground.at((0, 0)), arm.at((-1, 0)), limits=limits)
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            plane(
                bodies=[arm], joints=[hinge, Distance("L", ground.at((1, 0)), arm.at((0, 0)), 1.0)]
            )
        assert ["two ways" in str(w.message) for w in told] == [True] * (ways - 1)


@pytest.mark.parametrize("said_twice", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_a_chain_of_seventy_links_begins_where_its_angles_say(said_twice, monkeypatch):
    """Link k at the angle phi_k = sum a_j is at sum of (cos, sin) phi_j less the half of its own, and moves
    with w_k = sum a_j'; also where the angles of all links from the ground are given besides.  No dense
    matrix is decomposed for it."""
    monkeypatch.setattr(np.linalg, "lstsq", None)
    n = 70
    links = [Body(f"b{k}", mass=1.0, inertia=0.1) for k in range(n)]
    ends = [ground.at((0, 0)), *(b.at((0.5, 0)) for b in links)]
    hinges = [Revolute(f"J{k}", ends[k], b.at((-0.5, 0))) for k, b in enumerate(links)]
    turns, rates = 0.1 * np.sin(np.arange(n)), 0.2 * np.cos(np.arange(n))
    phi, w = np.cumsum(turns), np.cumsum(rates)
    start = {f"angle.J{k}": turns[k] for k in range(n)}
    start |= {f"der(angle.J{k})": rates[k] for k in range(n)}
    if said_twice:
        start |= {f"b{k}.orientation.z": phi[k] for k in range(n)}
    model = plane(bodies=links, joints=hinges, start=start)
    found = {str(s.name if s.is_Function else s): float(x) for s, x in model.start.items()}
    away, moving = (np.exp(1j * phi), 1j * w * np.exp(1j * phi))
    for name, part in (("b{}.position.{}", away), ("Derivative(b{}.position.{}(t), t)", moving)):
        place = np.cumsum(part) - part / 2
        for k in range(n):
            at = [found[name.format(k, c)] for c in "xy"]
            np.testing.assert_allclose(at, [place[k].real, place[k].imag], rtol=0, atol=1e-10)


def test_what_cannot_be_closed_says_which_joint_misses():
    """A link of 1 m between pins that are 3 m apart misses by at least 2 m."""
    link = Body("link", 1.0, 0.1)
    joints = [
        Revolute("A", ground.at((0, 0)), link.at((0, 0))),
        Revolute("B", ground.at((3, 0)), link.at((1, 0))),
    ]
    with pytest.raises(ModelError) as caught:
        plane(bodies=[link], joints=joints)
    for part in (
        "'A' cannot be closed",
        "'B' cannot be closed",
        "misses it by 1",
        "correct a length",
    ):
        assert part in str(caught.value)


arm = Body("arm", 1.0, 0.1)
pin = Revolute("A", ground.at((0, 0)), arm.at((0, 0)))


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        (
            {"bodies": [Body("b", -1, 0.1)]},
            "body 'b' has the mass -1, expected a positive number in kg, or 0 where joints",
        ),
        ({"bodies": [Body("b", 1, -0.1)]}, "body 'b' has the inertia -0.1"),
        (
            {"bodies": [Body("b", "heavy", 0.1)]},
            "b.mass is 'heavy', expected a finite number in kg",
        ),
        (
            {"bodies": [Body("b", 1, 0.1), Body("b", 1, 0.1)]},
            "'b' is used twice, by a Body and a Body",
        ),
        ({"bodies": [Body("my body", 1, 0.1)]}, "the name 'my body', expected one word"),
        ({"bodies": [Body("lambda", 1, 0.1)]}, "'lambda': this name is reserved"),
        ({"bodies": ["arm"]}, "bodies hold 'arm', expected Body(...)"),
        ({"joints": ["A"]}, "joints and loads hold 'A', expected one of Joint"),
        ({"joints": [pin, pin]}, "'A' is used twice, by a Revolute and a Revolute"),
        (
            {"joints": [Revolute("A", arm.at((0, 0)), arm.at((1, 0)))]},
            "Revolute 'A': both markers are on 'arm', expected two bodies",
        ),
        (
            {"joints": [Revolute("A", ground.at((0, 0)), Body("x", 1, 1).at((0, 0)))]},
            "its second marker is on 'x', which is not among the bodies (arm)",
        ),
        (
            {"joints": [Revolute("A", ground, arm)]},
            "first is Ground(name='ground'), expected a marker",
        ),
        (
            {"joints": [Prismatic("D", ground.at((0, 0)), arm.at((0, 0)), axis="z")]},
            "Prismatic 'D': axis is 'z', expected 'x' or 'y' in the plane xy",
        ),
        (
            {"joints": [Revolute("A", ground.at((0, 0, 0)), arm.at((0, 0)))]},
            "A.first is (0, 0, 0), expected 2 components (x, y)",
        ),
        (
            {"joints": [Revolute("A", ground.at((0, 0)), arm.at((0, 0)), limits=(1, -1))]},
            "limits are (1, -1), expected the smaller value first",
        ),
        (
            {"joints": [Revolute("A", ground.at((0, 0)), arm.at((0, 0)), friction=0.3)]},
            "Revolute 'A': friction is given without the radius of the pin",
        ),
        (
            {"joints": [Fixed("A", ground.at((0, 0)), arm.at((0, 0)), limits=(0, 1))]},
            "no angle or position to be limited",
        ),
        (
            {"joints": [pin], "loads": [Motor("motor", "a")]},
            "no joint is called 'a', expected one of A",
        ),
        (
            {
                "joints": [Fixed("W", ground.at((0, 0)), arm.at((0, 0)))],
                "loads": [Torsion("S", "W")],
            },
            "Torsion 'S': Fixed 'W' has neither an angle nor a position, expected one of none",
        ),
        ({"joints": [pin, Gear("G", "A", "A", 2.0)]}, "Gear 'G' ties 'A' to itself"),
        ({"plane": "yz"}, "plane = 'yz', expected 'xy'"),
        (
            {"joints": [PointOnCurve("K", ground.at((0, 0)), arm.at((0, 0)), (turn, turn))]},
            "PointOnCurve 'K': its curve is (turn, turn), expected a Track",
        ),
        (
            {
                "joints": [
                    PointOnCurve("K", ground.at((0, 0)), arm.at((0, 0)), Track((turn,), turn, 0, 1))
                ]
            },
            "its curve has 1 components, expected 2",
        ),
        (
            {"joints": [Revolute("A", ground.at((0, 0)), arm.at((0, 0)), axis=2)]},
            "Revolute 'A': axis is 2, expected 'z' in the plane xy",
        ),
        (
            {"joints": [Prismatic("D", ground.at((0, 0)), arm.at((0, 0)), friction=[1, 2, 3])]},
            "friction is [1, 2, 3], expected one coefficient, or the static and the kinetic",
        ),
        (
            {"joints": [Revolute("A", ground.at((0, 0)), arm.at((0, 0)), restitution=0.5)]},
            "restitution is given, but no limits at which it could rebound",
        ),
        (
            {"contacts": [Contact("K", ground.at((0, 0)), arm.at((0, 0)), radius=-0.1)]},
            "Contact 'K': radius is -0.1, expected a number of at least 0 in m",
        ),
        (
            {"contacts": [Contact("K", ground.at((0, 0)), arm.at((0, 0)), restitution=2)]},
            "Contact 'K': restitution is 2, expected 0 (no rebound) to 1 (no loss)",
        ),
        (
            {"joints": [Distance("L", ground.at((0, 0)), arm.at((0, 0)), -1)]},
            "L.length is -1, expected a positive number in m",
        ),
        ({"joints": [pin, Gear("G", "A", None, 2.0)]}, "Gear 'G' names the joint None"),
        (
            {"joints": [pin], "loads": [Motor("motor", "A", torque=1, motion=True)]},
            "torque and motion are given, expected one of them",
        ),
        (
            {"loads": [Force("push", ground.at((0, 0)), (1, 0))]},
            "Force 'push' acts on the ground, which does not move",
        ),
        ({"bodies": arm}, "bodies is Body("),
        ({"start": [1.0]}, "start is [1.0], expected a dict by names: start={'angle.A': ...}"),
        (
            {"bodies": [Body("b", Parameter("m", 1.0, "kg"), 0.1)]},
            "b.mass: parameter 'm' is no SymPy symbol",
        ),
        (
            {"bodies": [Body("b", Parameter(sympy.Symbol("m"), 1.0, "m"), 0.1)]},
            "b.mass: parameter m has the unit 'm', expected kg",
        ),
        (
            {"joints": [Revolute("A", Ground("floor").at((0, 0)), arm.at((0, 0)))]},
            "its first marker is on the ground 'floor', expected 'ground'",
        ),
        (
            {
                "joints": [
                    PointOnCurve("K", ground.at((0, 0)), arm.at((0, 0)), Track((1, 2), turn, 0, 1))
                ]
            },
            "its points (1, 2) do not depend on turn, expected expressions of a symbol",
        ),
        (
            {
                "joints": [
                    PointOnCurve(
                        "K",
                        ground.at((0, 0)),
                        arm.at((0, 0)),
                        Track((turn, sympy.log(-1 - turn**2)), turn, 0, 1),
                    )
                ]
            },
            "joint 'K' has no finite value where it begins: start it elsewhere",
        ),
        ({"read": {"tip": pin}}, "Reading 'tip': at is Revolute("),
        ({"read": {"tip": ground.at((0, 0))}}, "'tip': its marker is on the ground"),
        ({"read": {"arm": arm}}, "'arm' is used twice, by a Body and a Reading"),
        ({"start": {"angle.B": 1.0}}, "start names 'angle.B', which has no start of its own"),
        ({"start": {"arm.position": 1.0}}, "start of 'arm.position' is 1.0, expected 2 numbers"),
        ({"start": {"arm.position.x": "left"}}, "is 'left', expected finite numbers"),
    ],
)
def test_what_is_wrong_with_a_mechanism_is_told_by_name(parts, told):
    """Each thing by its name, its value, and what was expected."""
    given = {"plane": "xy", "bodies": [arm], **parts}
    with pytest.raises(ModelError) as caught:
        mechanism("M", **given)
    assert told in str(caught.value)


def test_all_that_is_wrong_is_told_at_once():
    """A negative mass, a joint on a body that is not there, a motor of no joint."""
    with pytest.raises(ModelError) as caught:
        plane(
            bodies=[Body("b", -1, 0.1)],
            joints=[pin],
            loads=[Motor("motor", "Z")],
        )
    assert len(caught.value.problems) == 3


def test_a_rough_pin_slows_a_wheel_by_the_force_that_it_carries():
    """A balanced wheel on a pin of 2 cm, mu = 0.3: the pin carries m g, so that |torque| = mu r m g until it
    stops, at t = J w/(mu r m g); there it sticks."""
    wheel = Body("wheel", 2.0, 0.05)
    pin = Revolute("A", ground.at((0, 0)), wheel.at((0, 0)), friction=0.3, radius=0.02)
    model = plane(
        bodies=[wheel], joints=[pin], loads=[Gravity((0, -g))], start={"der(angle.A)": 2.0}
    )
    torque = 0.3 * 0.02 * 2.0 * g
    stops = 0.05 * 2.0 / torque
    run = moved(model, stop=2 * stops, target="native")
    turning = run["time"] < stops
    np.testing.assert_allclose(run["torque.A.z"][turning], -torque, rtol=1e-10)
    np.testing.assert_allclose(
        run["der(angle.A)"][turning], 2 - torque / 0.05 * run["time"][turning]
    )
    assert run["sticking.A.time"][-1] == pytest.approx(stops, rel=1e-9)
    assert run["angle.A"][-1] == pytest.approx(2.0 * stops / 2, rel=1e-9)


def test_a_rough_slide_holds_a_block_up_to_the_angle_of_friction():
    """tan(alpha) = 0.5: it stays with mu = 0.6, and slides with g (sin - mu cos) with mu = 0.4."""
    alpha = 0.4636476090008061

    def run(mu):
        block = Body("block", 2.0, 0.02)
        slide = Prismatic("D", ground.at((0, 0), rotation=-alpha), block.at((0, 0)), friction=mu)
        return moved(
            plane(bodies=[block], joints=[slide], loads=[Gravity((0, -g))]), 0.5, target="native"
        )

    held, slides = run(0.6), run(0.4)
    assert held["sticks.D"].all()
    assert held["force.D.x"] == pytest.approx(-2 * g * sin(alpha), rel=1e-12)
    expected = g * (sin(alpha) - 0.4 * cos(alpha))
    assert slides["der(position.D,2)"][1:] == pytest.approx(expected, rel=1e-11)
    assert slides["force.D.x"][1:] == pytest.approx(-0.4 * 2 * g * cos(alpha), rel=1e-11)


def test_a_limit_gives_back_the_part_of_the_speed_that_its_restitution_says():
    """A hinge without forces turns at 2 rad/s between stops at 0 and 1 rad with e = 0.5: it strikes at 0.5 s,
    1.5 s and 3.5 s, each time with half the speed, and loses 3/4 of its energy."""
    door = Body("door", 2.0, 0.05)
    hinge = Revolute("A", ground.at((0, 0)), door.at((0, 0)), limits=(0, 1), restitution=0.5)
    run = moved(
        plane(bodies=[door], joints=[hinge], start={"der(angle.A)": 2.0}), 4.0, target="native"
    )
    assert run["closing.A.upper.count"][-1] == 2
    assert run["closing.A.lower.time"][-1] == pytest.approx(1.5, rel=1e-9)
    assert run["closing.A.upper.time"][-1] == pytest.approx(3.5, rel=1e-9)
    assert run["der(angle.A)"][-1] == pytest.approx(-0.25, rel=1e-9)
    assert run["energy.dissipated"][-1] == pytest.approx(0.05 / 2 * (4 - 1 / 16), rel=1e-9)


def test_a_mechanism_of_the_plane_is_not_told_to_take_one():
    """Two hinges at one point: the rows that are too many are named, without the remedy of one in space."""
    bar = Body("bar", 1.0, 0.1)
    joints = [Revolute(n, ground.at((0, 0)), bar.at((-0.5, 0))) for n in ("A", "B")]
    with pytest.warns(UserWarning, match="follow from the others") as told:
        prepare(plane(bodies=[bar], joints=joints))
    assert not any("Spherical" in str(w.message) for w in told)


def _lift(**more):
    """A boom on a cylinder, whose stroke that closes is 0.446 m, or its mirror image."""
    boom, tube, rod = Body("boom", 500.0, 700.0), Body("tube", 40.0, 4.0), Body("rod", 20.0, 2.0)
    given = {
        "plane": "xy",
        "bodies": [boom, tube, rod],
        "joints": [
            Revolute("foot", ground.at((0, 1.5)), boom.at((-2, 0))),
            Revolute("A", ground.at((0.8, 1.0)), tube.at((-0.6, 0))),
            Prismatic("L", tube.at((0, 0)), rod.at((0, 0)), axis="x", limits=(0.2, 1.4)),
            Revolute("B", rod.at((0.5, 0)), boom.at((-0.5, 0.2))),
        ],
    }
    return mechanism("Lift", **given | more)


def test_a_motor_that_the_joints_cannot_follow_is_named_with_the_remedy():
    """A boom 1.5 m long to its eye never is 9 m away from the foot of its cylinder."""
    with pytest.raises(
        ModelError, match=r"motor 'M' prescribes .* by Motor\(\.\.\., start=\.\.\.\)"
    ):
        _lift(loads=[Motor("M", "L", motion=True, start=8.0)])


def test_a_motor_that_prescribes_what_is_out_of_reach_hears_what_is_nearest():
    """Crank and rocker of 0.3 m, a coupler of 0.4 m and pins 0.6 m apart: with coupler and rocker in line
    the crank is at arccos(-1/9); the joints close, so that none of them is to blame."""
    crank, coupler, rocker = parts = [Body(n, 1.0, 0.01) for n in ("crank", "coupler", "rocker")]
    joints = [
        Revolute("A", ground.at((0, 0)), crank.at((-0.15, 0))),
        Revolute("B", crank.at((0.15, 0)), coupler.at((-0.2, 0))),
        Revolute("C", coupler.at((0.2, 0)), rocker.at((-0.15, 0))),
        Revolute("D", rocker.at((0.15, 0)), ground.at((0.6, 0))),
    ]
    drive = Motor("drive", "A", motion=True, start=3.0)
    with pytest.raises(ModelError) as refused:
        plane(bodies=parts, joints=joints, loads=[drive])
    (problem,) = refused.value.problems
    assert "motor 'drive' prescribes angle.A = 3 rad, which the joints cannot follow" in problem
    assert f"the nearest that was found is {acos(-1 / 9):.6g} rad" in problem


def test_a_joint_that_is_assembled_beyond_its_limits_is_told_with_its_place():
    """A reversed cylinder closes too: a start of its stroke takes the one that is meant."""
    eye = complex(1.5, 0.2) * complex(cos(0.6), sin(0.6)) + 1.5j - complex(0.8, 1.0)
    with pytest.warns(
        UserWarning, match=r"position\.L is assembled at -2\.64\d+, beyond its limits"
    ):
        _lift(start={"angle.foot": 0.6, "position.L": -abs(eye) - 1.1})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        _lift(start={"angle.foot": 0.6, "position.L": abs(eye) - 1.1})
