"""What is large and what is small at a start: no unit counts, no far place, no lost digits."""

from __future__ import annotations

import math

import pytest
from fmpy.fmi1 import FMICallException
from instance import instance
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Friction, Input, Model, Nonholonomic, Parameter, multiplier
from lagfmu.bodies import Body, Gravity, Ground, Motor, Prismatic, Revolute, mechanism

g = 9.81  # m/s^2


def refusal(path, values) -> str:
    """Why the start is refused."""
    with instance(path) as one:
        with pytest.raises(FMICallException):
            one.start(values)
        return " ".join(text for status, _, text in one.log if status >= 2)


@pytest.mark.parametrize("omega", [1e-3, 1.0, 1e6, 1e9])
def test_a_skate_draws_its_cycloid_however_small(native_fmu, omega):
    """From rest at x = y = 0, with no length given anywhere, x = G sin(w t)^2/(2 w^2), which is 1e-18 m at
    w = 1e9/s, and lambda = -2 m G sin(w t): each to 1e-6 of its own size, G = g sin(alpha)."""
    G = g / 2
    with instance(native_fmu("KnifeEdge")) as one:
        one.start({"der(phi)": omega})
        for k in range(1, 6):
            one.step(0.7 / omega)
            phase = 0.7 * k
            x = G * math.sin(phase) ** 2 / (2 * omega**2)
            y = G * (phase - math.sin(2 * phase) / 2) / (2 * omega**2)
            assert abs(one.get("x") - x) < 1e-6 * G / omega**2
            assert abs(one.get("y") - y) < 1e-6 * G / omega**2
            assert abs(one.get("lambda.edge") + 2 * G * math.sin(phase)) < 1e-6 * G


def test_an_incline_of_hardly_any_angle(native_fmu):
    """At 1e-300 rad the disk's own time is 1e150 s, and the integrator stands as far ahead: at 1 s
    y = g alpha t^2/3 all the same, to ten digits."""
    with instance(native_fmu("InclineDisk")) as one:
        one.start({"alpha": 1e-300})
        for t in (0.5, 1.0):
            one.step(0.5)
            assert one.get("y") == pytest.approx(g * 1e-300 * t**2 / 3, rel=1e-10, abs=0)
            assert one.get("theta") == pytest.approx(g * 1e-299 * t**2 / 3, rel=1e-10, abs=0)


@pytest.mark.parametrize("step", [1e-12, 1e-2, 1e6])
def test_a_fall_from_rest_looks_the_same_on_every_scale(native_fmu, step):
    """Atwood's masses, from 0 at rest, fall by a t^2/2 with a = g/3 in any communication step: nothing but
    that step says what is long and what is short."""
    with instance(native_fmu("Atwood")) as one:
        one.start()
        for k in range(1, 4):
            one.step(step)
            fallen = g / 3 * (k * step) ** 2 / 2
            assert one.get("x1") == pytest.approx(fallen, rel=1e-9)
            assert one.get("x2") == pytest.approx(-fallen, rel=1e-9)


def test_a_ball_thrown_from_the_floor_comes_back_to_it(native_fmu):
    """From y = 0 with v, the height v^2/(2 g) is the only length: thrown at 1 nm/s or 1 km/s, it is back
    after 2 v/g and leaves with e v, to the same relative accuracy."""
    for v in (1e-9, 1.0, 1e3):
        with instance(native_fmu("BouncingBall")) as one:
            one.start({"y": 0.0, "der(y)": v})
            one.step(1.0 * v / g)
            assert one.get("y") == pytest.approx(v**2 / (2 * g), rel=1e-9)
            one.step(1.5 * v / g)  # half a v/g after the bounce
            rise = 0.7 * v * 0.5 * v / g - g * (0.5 * v / g) ** 2 / 2
            assert one.get("y") == pytest.approx(rise, rel=1e-7)


def test_an_angle_without_digits_for_a_direction_is_refused(native_fmu):
    """Neighbours of 1e300 are 1e284 rad apart: no direction.  A million turns leave ten digits."""
    for name, angle in (("RollingSphere", "phi"), ("KnifeEdge", "phi"), ("Ladder", "theta")):
        text = refusal(native_fmu(name), {angle: 1e300})
        assert f"the angle {angle} = 1e+300 rad" in text
        assert "whole turns" in text
    with instance(native_fmu("RollingSphere")) as one:
        one.start({"phi": 2e6 * math.pi})
        # far turned itself, it presses on as if it were not: lambda = m g cos(theta) at rest
        assert one.get("lambda.surface") == pytest.approx(g * math.cos(0.05), rel=1e-12)


def test_a_far_place_is_no_size_of_another_coordinate(native_fmu):
    """A ladder at x = 1e300 m lets its upper end fall as one at x = 1 m does, in front of no wall: the end is
    1.86 m above the floor, does not touch it, and lambda.floor = m g/(1 + 3 cos(theta)^2)."""
    with instance(native_fmu("Ladder")) as one:
        one.start({"x": 1e300})
        assert not one.get("contact.top")
        push = 10.0 * g / (1 + 3 * math.cos(1.2) ** 2)
        assert one.get("lambda.floor") == pytest.approx(push, rel=1e-9)
        one.step(0.1)
        assert one.get("residual.top") < 1.86


def test_a_rod_that_newtons_method_never_reaches_is_refused(native_fmu):
    """L^2 = 1e-600 m^2 is no number: from 0.1 m away the bob cannot be put at |q| = L = 1e-300 m, and is not
    left at some smaller |q|.  At 1e-12 m it can, to rounding."""
    path = native_fmu("PendulumCartesian")
    text = refusal(path, {"L": 1e-300, "x": 0.1, "y": 0.0})
    assert "cannot be projected" in text
    assert "'rod'" in text
    with instance(path) as one:
        one.start({"L": 1e-12, "x": 0.06, "y": -0.08})
        assert math.hypot(one.get("x"), one.get("y")) == pytest.approx(1e-12, rel=1e-14)


def test_a_mass_that_has_lost_its_digits_is_refused(native_fmu):
    """Below 2.2e-308 a double has fewer digits: 5e-324 kg times 9.81 m/s^2 would be 10 times 5e-324."""
    text = refusal(native_fmu("BouncingBall"), {"m": 5e-324})
    assert "the mass of y is 5e-324" in text
    assert "at least 2.23e-308" in text


def box() -> Model:
    """1 kg on two feet, which together hold mu m g = 3.924 N; pushed at its centre."""
    x, z, theta, F = dynamicsymbols("x z theta F")
    m, G, mu, h, a, J = symbols("m g mu h a J", positive=True)
    return point_mass(
        "Box",
        "x z",
        [
            Contact("left", z - h * cos(theta) - a * sin(theta)),
            Contact("right", z - h * cos(theta) + a * sin(theta)),
            Nonholonomic("rub", x.diff() + h * cos(theta) * theta.diff()),
            Friction("grip", ["rub"], multiplier("left") + multiplier("right"), static=mu),
        ],
        angles="theta",
        energy=J * theta.diff() ** 2 / 2 - m * G * z,
        parameters=[
            Parameter(G, g, "m/s^2"),
            Parameter(mu, 0.4, "1"),
            Parameter(h, 0.4, "m"),
            Parameter(a, 0.3, "m"),
            Parameter(J, 0.05, "kg.m^2"),
        ],
        forces={x: F},
        inputs=[Input(F, "N", 2.0)],
        start={z: 0.4},
    )


@pytest.mark.parametrize("method", ["auto", "rk4"])
def test_what_rests_has_no_natural_time(method, built):
    """Held by friction under F = 2 N + 10 N/s (t - 0.1 s) it takes one step, however long; it slides from
    F = mu m g on, at t = 0.2924 s, with x' = 5 m/s^3 (t - 0.2924 s)^2."""
    with instance(built(box())) as one:
        one.start({"solver.method": method} if method != "auto" else {})
        one.step(0.1)
        before = one.get("solver.steps")
        one.set("F", 2.0)
        one.fmu.setRealInputDerivatives([one.variables["F"].valueReference], [1], [10.0])
        one.step(0.11)
        if method == "auto":
            assert one.get("solver.steps") - before == 1
        assert one.get("sticks.grip")
        assert one.get("lambda.rub") == pytest.approx(-3.1, abs=1e-12)
        one.step(0.11)
        assert one.get("slipping.grip.time") == pytest.approx(0.2924, abs=1e-13)
        assert one.get("der(x)") == pytest.approx(5 * 0.0276**2, abs=1e-12)


def test_a_wedge_that_nothing_turns_has_no_scale_of_its_turning(built):
    """A wedge of 0.2 rad under 51 kg in an upright guide, all faces rough, no lever arm anywhere: torques are
    rounding, and no time is one of them.  Drawn out with 1200 N/s it holds up to its limit, and then slides
    in tens of steps."""
    base, shoe, load = (Body(n, m, 0.01) for n, m in (("base", 3.0), ("shoe", 1.0), ("load", 50.0)))
    floor, face, guide, slope = 0.2, 0.25, 0.1, 0.2
    joints = [
        Prismatic("floor", Ground().at((0, 0)), base.at((0, 0)), friction=floor),
        Prismatic("face", base.at((0, 0), slope), shoe.at((0, 0), slope), friction=face),
        Revolute("pin", shoe.at((0, 0)), load.at((0, 0))),
        Prismatic("guide", Ground().at((0, 0)), load.at((0, 0)), axis="y", friction=guide),
    ]
    loads = [Gravity((0, -g)), Motor("pull", "floor")]
    model = mechanism("Wedge", plane="xy", bodies=[base, shoe, load], joints=joints, loads=loads)
    push = face * math.cos(slope) - math.sin(slope), math.cos(slope) + face * math.sin(slope)
    N = 51 * g / (push[1] + guide * push[0])
    limit = floor * (3 * g + N * push[1]) + N * push[0]
    with instance(built(model)) as one:
        one.start()
        one.step(0.001)
        one.fmu.setRealInputDerivatives([one.variables["pull.force"].valueReference], [1], [1200.0])
        one.step(0.2)
        assert one.get("slipping.floor.time") == pytest.approx(0.001 + limit / 1200, rel=1e-9)
        assert one.get("solver.steps") < 100


def test_headway_is_judged_by_the_motion_as_it_is(built):
    """A mass that creeps at 1e-7 m/s has a natural time of 1e7 s; a spring k x^3 / L^2 on which it is then
    pushed makes that 30 ms, and a second of it is no lack of headway: the energy of the push is kept."""
    x, F = dynamicsymbols("x F")
    k, L = symbols("k L", positive=True)
    model = point_mass(
        "Creeps",
        "x",
        energy=-k * x**4 / L**2 / 4,
        parameters=[Parameter(k, 1e3, "N/m"), Parameter(L, 1.0, "m")],
        forces={x: F},
        inputs=[Input(F, "N")],
        start={x.diff(): 1e-7},
    )
    with instance(built(model)) as one:
        one.start({"solver.maximum_steps": 50}, tolerance=1e-10)
        one.set("F", 1e3)
        one.step(1.0)
        assert one.get("solver.steps") > 100
        assert one.get("energy.total") == pytest.approx(1e3 * one.get("x"), rel=1e-7)
