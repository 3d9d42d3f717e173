"""A native FMU whose inputs cannot change steps past the communication point and answers from dense
output: nobody who asks can tell.  Communication steps are powers of two, so that their sums are exact."""

from __future__ import annotations

import math
from ctypes import byref, c_double

import pytest
from single import DISCARD
from sympy import Rational, cos, sin, sqrt, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.forces import candle

from lagfmu import Contact, Holonomic, Model, Parameter
from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

STEPS = [2.0**-k for k in (0, 2, 5, 9, 13)]


def run(one, step: float, until: float) -> None:
    while one.time < until:
        one.step(step)


@pytest.mark.parametrize(
    ("name", "start", "steps", "most"),
    [
        *(
            pytest.param(name, {"solver.method": method}, STEPS, 500, id=f"{name}-{method}")
            for name in ("PendulumCartesian", "PendulumAngle", "Chain")
            for method in ("auto", "dop853", "radau")
        ),
        pytest.param("Hemisphere", {"theta": 0.3}, STEPS[1:], 200, id="Hemisphere"),
        pytest.param("BouncingBall", {}, STEPS[1:], 200, id="BouncingBall"),
    ],
)
def test_the_communication_step_changes_nothing_to_the_last_bit(library, name, start, steps, most):
    """From 1 s to 0.1 ms, in flight on the way to an obstacle as anywhere: the same internal steps,
    departures and landings, and the same outputs at the points that all have."""
    ends = []
    for step in steps:
        one = library(name)(logging=False).start(start, 1e-8)
        seen = []
        for until in (1.0, 2.0):
            run(one, step, until)
            seen.append((one.outputs(), one.integer("solver.steps")))
        ends.append(seen)
    assert all(end == ends[0] for end in ends)
    assert ends[0][1][1] < most  # not one a communication step


@pytest.mark.parametrize("method", ["dop853", "radau"])
def test_a_fine_communication_step_sees_the_same_motion_in_between(library, method):
    """What is read within a step is as accurate as its end: each of 2048 points of the pendulum agrees within
    the tolerance with a run that stops there, its f with zero to rounding."""
    names = ["x", "y", "der(x)", "der(y)", "lambda.rod"]
    tolerance = 1e-8
    fine, exact = (library("PendulumCartesian")(logging=False) for _ in range(2))
    fine.start({"solver.method": method}, tolerance)
    exact.start({"solver.maximum_step": 2.0**-9}, 1e-12)  # stands on every point
    for _ in range(2048):
        for one in (fine, exact):
            one.step(2.0**-9)
        for a, b in zip(fine.reals(names), exact.reals(names), strict=True):
            assert abs(a - b) < 20 * tolerance
        assert abs(fine.get("residual.rod")) < 1e-15


def cycloid() -> Model:
    """A bead on a cycloid, whose arc's length 4 R sin(phi / 2) swings as a spring does."""
    x, z, phi = dynamicsymbols("x z phi")
    R = symbols("R", positive=True)
    return point_mass(
        "Cycloid",
        "x z",
        [
            Holonomic("along", x - R * (phi + sin(phi))),
            Holonomic("up", z - R * (1 - cos(phi))),
        ],
        angles="phi",
        up=z,
        mass=0.2,
        parameters=[Parameter(R, 0.5, "m")],
        start={phi: 2.0},
    )


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10, 1e-12])
def test_states_within_long_steps_are_as_accurate_as_their_ends(built, library, tolerance):
    """The polynomial through a long step of the bead on a cycloid is off by eleven tolerances where the
    step's ends are off by less than one.  In two periods its energy stays within two tolerances, its arc's
    length within five of 4 R sin 1 cos(sqrt(g / 4 R) t); who looks at the end alone takes the same steps."""
    one, coarse = (
        library(built(cycloid()))(logging=False).start(None, tolerance) for _ in range(2)
    )
    start = one.get("energy.total")
    for k in range(1, 641):
        one.step(2.0**-7)
        phi, energy = one.reals(["phi", "energy.total"])
        assert abs(energy / start - 1) < 2 * tolerance
        arc = math.sin(1) * math.cos(math.sqrt(9.81 / 2) * k / 128)
        assert abs(math.sin(phi / 2) - arc) < 5 * tolerance
    coarse.step(5.0)
    assert coarse.outputs() == one.outputs()
    assert coarse.integer("solver.steps") == one.integer("solver.steps") < 213


def test_a_state_saved_within_a_long_step_goes_on_as_if_it_had_not_been(built, library):
    """Saved within long steps of the bead on a cycloid, some of which are integrated anew as far as each
    point, before anybody had looked, and restored where nothing moved: the same outputs to the bit."""
    one = library(built(cycloid()))(logging=False).start(None, 1e-8)
    for _ in range(64):
        one.step(2.0**-7)
        state = one.saved()
        other = library(built(cycloid()))(logging=False).start(None, 1e-4)
        other.does("SetFMUstate", other.loaded(one.bytes_of(state)))
        one.does("FreeFMUstate", byref(state))
        other.time = one.time
        assert other.outputs() == one.outputs()


@pytest.mark.parametrize("name", ["PendulumCartesian", "Hemisphere"])
def test_looking_changes_nothing_to_the_last_bit(library, name):
    """Between two steps the state is found when somebody asks.  Who looks at every communication point, who
    looks at the last one alone, and who restores a state that was saved before anybody had looked see the
    same outputs, and go on to the same ones."""
    curious, blind, other = (library(name)(logging=False).start(None, 1e-8) for _ in range(3))
    for _ in range(40):
        curious.step(2.0**-6)
        curious.outputs()
        blind.step(2.0**-6)
    state = blind.saved()
    other.does("SetFMUstate", state)
    other.does("FreeFMUstate", byref(state))
    other.time = blind.time
    for _ in range(2):
        expected = curious.outputs()
        assert blind.outputs() == expected
        assert other.outputs() == expected
        for one in (curious, blind, other):
            one.step(2.0**-6)
            one.step(2.0**-6)


@pytest.mark.parametrize("step", STEPS[1:])
def test_an_event_ahead_is_invisible_until_its_time(library, step):
    """The particle's departure is found while the integrator stands far ahead.  Until then the contact is
    closed, pushes, and counts no departure; the departure's time is the same to the last bit whatever the
    communication step, and lambda is zero from then on."""
    first = library("Hemisphere")(logging=False).start({"theta": 0.3}, 1e-9)
    run(first, 1.0, 2.0)
    (expected,) = first.reals(["departure.surface.time"])
    one = library("Hemisphere")(logging=False).start({"theta": 0.3}, 1e-9)
    for _ in range(int(1 / step)):
        one.step(step)
        push, time = one.reals(["lambda.surface", "departure.surface.time"])
        closed = one.integer("contact.surface")
        count = one.integer("departure.surface.count")
        if one.time < expected:
            assert (closed, count, time) == (1, 0, 0.0)
            assert push > 0
        else:
            assert (closed, count, time) == (0, 1, expected)
            assert push == 0


@pytest.mark.parametrize("step", STEPS[1:])
def test_a_landing_ahead_is_invisible_until_its_time(library, step):
    """A ball let go at 1 m meets the floor at sqrt(2 h/g) = 0.45 s, which is found while the integrator
    stands far ahead, below the floor.  Until then the ball falls, above the floor, at -g t; from then on it
    rises with e of the speed."""
    g, e = 9.81, 0.7
    landing = math.sqrt(2 / g)
    one = library("BouncingBall")(logging=False).start(None, 1e-9)
    for _ in range(round(0.5 / step)):
        one.step(step)
        height, speed = one.reals(["y", "der(y)"])
        if one.time < landing:
            assert height == pytest.approx(1 - g * one.time**2 / 2, rel=1e-12)
            assert speed == pytest.approx(-g * one.time, rel=1e-12)
        else:
            assert speed == pytest.approx(e * g * landing - g * (one.time - landing), rel=1e-9)
            assert height > 0


def lifted() -> Model:
    """A ball lifted by a force that has no value deeper than 1 cm below the floor: P sqrt(y/l + 0.01)."""
    y = dynamicsymbols("y")
    P, l = symbols("P l", positive=True)  # noqa: E741
    return point_mass(
        "Lifted",
        "y",
        [Contact("floor", y)],
        up=y,
        parameters=[Parameter(P, 3.0, "N"), Parameter(l, 1.0, "m")],
        forces={y: P * sqrt(y / l + Rational(1, 100))},
        start={y: 1.0},
    )


@pytest.mark.parametrize("step", [1.0, 2.0**-6])
def test_what_lies_behind_an_obstacle_need_not_be_defined(built, library, step):
    """On its way to the floor the integrator meets a force that has no value behind it.  The ball lands all
    the same, no faster than the work v^2/2 = g h - (P/m) 2/3 (1.01^(3/2) - 0.01^(3/2)) h allows, and lies
    there: lambda = m g - 0.1 P."""
    one = library(built(lifted()))().start(None, 1e-9)
    fastest = 0.0
    while one.time < 2.0:
        one.step(step)
        fastest = max(fastest, -one.get("der(y)"))
    assert fastest <= math.sqrt(2 * (9.81 - 3.0 * 2 / 3 * (1.01**1.5 - 0.01**1.5)))
    lying = one.reals(["y", "der(y)", "lambda.floor"])
    assert lying == pytest.approx([0, 0, 9.81 - 0.3], abs=1e-12)
    assert not [text for status, _, text in one.log if status >= DISCARD]


@pytest.mark.parametrize(
    "name", ["PendulumCartesian", "Hemisphere", "BouncingBall", "Loop", "DoublePendulum"]
)
def test_rollback_within_a_step_ahead_is_exact(library, name):
    """Saved where dense output answers, in the middle of an internal step: the same future from the state
    and from its bytes in another instance, to the last bit, asked at other instants in between too."""
    one = library(name)(logging=False).start(None, 1e-8)
    for k in range(17, 40):  # up to a point behind which another one needs no step
        run(one, 2.0**-6, k / 64)
        steps = one.integer("solver.steps")
        state, moment = one.saved(), one.time
        data = one.bytes_of(state)
        run(one, 2.0**-6, (k + 1) / 64)
        if one.integer("solver.steps") == steps:
            break
    ahead = one.integer("solver.steps") == steps
    run(one, 2.0**-6, 1.0)
    expected = one.outputs()

    one.does("SetFMUstate", state)
    one.time = moment
    run(one, 2.0**-6, 1.0)
    assert one.outputs() == expected

    other = library(name)(logging=False).start({"solver.method": "rk4"}, 1e-4)
    other.does("SetFMUstate", other.loaded(data))
    other.time = moment
    run(other, 2.0**-6, 1.0)
    assert other.outputs() == expected
    if name != "Loop":  # whose particle is about to leave
        assert ahead
    one.does("FreeFMUstate", byref(state))


@pytest.mark.parametrize("stop", [None, 1.0], ids=["no stop time", "stop time"])
@pytest.mark.parametrize("step", [1.0, 0.25, 2.0**-10])
def test_a_failure_ahead_is_invisible_until_its_time(built, library, step, stop):
    """The force is defined until t = 1 s, where it ends: the FMU gets there, with and without being told
    to stop, and x = 1 + P/(2 m) (t^2/2 - ...) is right; then the step is refused and nothing changes."""
    one = library(built(candle()))().start(None, 1e-9, stop)
    run(one, step, 1.0)
    speed, place, lam = one.reals(["der(x)", "x", "lambda.line"])
    assert speed == pytest.approx(3.0 / 2 * 2 / 3, rel=1e-6)  # P/(2 m) (2/3) T
    assert place == pytest.approx(1 + 3.0 / 2 * (2 / 3 - 4 / 15), rel=1e-6)
    assert lam == pytest.approx(0.0, abs=1e-9)
    before = one.outputs()
    if stop is None:
        text = one.refuses("DoStep", c_double(1.0), c_double(0.125), 1, status=DISCARD)
        assert "not finite" in text
        assert one.outputs() == before


def test_the_stop_time_is_never_passed(built, library):
    """Neither by the integrator, whose stages would meet the undefined force, nor by a sum of steps that
    exceeds it by rounding: ten steps of 0.1 s."""
    one = library(built(candle()))().start(None, 1e-9, 1.0)
    for _ in range(10):
        one.step(0.1)
    (speed,) = one.reals(["der(x)"])
    assert speed == pytest.approx(1.0, rel=1e-6)
    assert not [text for status, _, text in one.log if status >= DISCARD]
