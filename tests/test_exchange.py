"""Model exchange call by call: what an importer's integrator is told at the state that it has set."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from ctypes import byref, c_double, c_int

import numpy as np
import pytest
from fmi2 import EventInfo, Library, Single
from sympy import Rational, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.forces import lifted

from lagfmu import Contact, Holonomic, Input, Model, Parameter
from lagfmu.testing import prepare

G, RADIUS = 10.0, 0.2
t = dynamicsymbols._t
x, y, z, u, phi, roll, pitch = dynamicsymbols("x y z u phi roll pitch")
m, g, A, w, R = symbols("m g A w R", positive=True)
MASS, GRAVITY = Parameter(m, 2.0, "kg"), Parameter(g, G, "m/s^2")


def shaken() -> Model:
    """A block pushed by A sin(w t), over a table that an importer moves."""
    return point_mass(
        "Shaken",
        "y",
        [Contact("table", y - u)],
        up=y,
        parameters=[MASS, GRAVITY, Parameter(A, 3.0, "N"), Parameter(w, 2.0, "rad/s")],
        forces={y: A * sin(w * t)},
        inputs=[Input(u, "m")],
        start={y: 1.0},
    )


def ball() -> Model:
    """A ball that rolls once it lies on the floor, which falls by a tenth."""
    return point_mass(
        "Lander",
        "x y",
        [
            Contact("floor", y - R),
            Holonomic("rolling", x - R * phi, while_closed="floor"),
        ],
        angles="phi",
        up=y - x / 10,
        energy=Rational(1, 5) * m * R**2 * phi.diff() ** 2,
        parameters=[MASS, GRAVITY, Parameter(R, RADIUS, "m")],
        start={x: 0.5, y: 1.0, phi: 0.3},
    )


def table() -> Model:
    """A plate on five legs, two more than it needs."""
    legs = [(2, 2), (2, -2), (-2, 2), (-2, -2), (0, 1)]
    return Model(
        name="Plate",
        lagrangian=m * (z.diff() ** 2 + R**2 * (roll.diff() ** 2 + pitch.diff() ** 2)) / 2
        - m * g * z,
        coordinates={z: "m", roll: "rad", pitch: "rad"},
        constraints=[
            Contact(f"leg{k}", z + a * R * roll + b * R * pitch) for k, (a, b) in enumerate(legs)
        ],
        parameters=[MASS, GRAVITY, Parameter(R, RADIUS, "m")],
        start={z: 0.0},
    )


def masses_on_springs() -> Model:
    """x_0 = 0 and x_26 = 26 L are walls."""
    x = dynamicsymbols("x1:26")
    k, L = symbols("k L", positive=True)
    stretched = (b - a - L for a, b in itertools.pairwise((0, *x, 26 * L)))
    kinetic = sum(m * s.diff() ** 2 / 2 for s in x)
    return Model(
        "MassesOnSprings",
        lagrangian=kinetic - sum(k * by**2 / 2 for by in stretched),
        coordinates=dict.fromkeys(x, "m"),
        parameters=[MASS, Parameter(k, 200, "N/m"), Parameter(L, 1, "m")],
        start={s: float(j) for j, s in enumerate(x, 1)},
    )


@pytest.fixture
def of(built, library) -> Callable[[Callable[[], Model]], Library]:
    """of(MODEL): its binary."""
    return lambda model: library(built(model()))


def landed(library: Library) -> Single:
    """The ball, let down onto the floor at x = 0.5 m and phi = 0.3."""
    one = library.continuous()
    one.states((0.5, 0.0, RADIUS - 1e-7, -1.0, 0.3, 0.0))
    one.meets_event()
    return one


def test_a_force_is_that_of_the_time(of):
    """m y'' = A sin(w t) - m g at each time that is set, the state left as it is."""
    one = of(shaken).continuous()
    for time in (0.3, 0.8, 0.3):
        one.does("SetTime", c_double(time))
        _, acceleration = one.array("GetDerivatives", 2)
        assert acceleration == pytest.approx(3 * np.sin(2 * time) / 2 - G, rel=1e-14)


def test_a_motion_is_where_the_importer_has_set_it(of):
    """The table is at u whatever der(u) and der(u,2) are: an importer sets all three at each time, and none
    is carried on from an earlier one."""
    one = of(shaken).continuous()
    for time in (0.25, 1.0):
        one.does("SetTime", c_double(time))
        if time > 0.25:
            assert one.get("residual.table") == pytest.approx(0.9, rel=1e-14)
        for name, value in {"u": 0.1, "der(u)": 0.4, "der(u,2)": -0.3}.items():
            one.set(name, value)
        assert one.get("residual.table") == pytest.approx(0.9, rel=1e-14)
        (indicator,) = one.array("GetEventIndicators", 1)
        assert indicator == pytest.approx(0.9, rel=1e-8)


def test_a_restored_state_has_its_contacts(of):
    """In flight y'' = -g, on the floor y'' = 0, whichever was saved first and restored last."""
    one = of(ball).continuous()
    flight = one.saved()
    one.states((0.5, 0.0, RADIUS - 1e-7, -1.0, 0.3, 0.0))
    one.meets_event()
    rolling = one.saved()
    for state, expected in ((rolling, 0.0), (flight, -G), (rolling, 0.0)):
        one.does("SetFMUstate", state)
        assert one.array("GetDerivatives", 6)[3] == pytest.approx(expected, abs=1e-9)


def test_a_ball_that_has_landed_rolls_from_where_it_is(of):
    """x - R phi keeps the level at which it landed: nothing turns the ball back to x = R phi, and no step
    needs a projection."""
    one = landed(of(ball))
    for way in (0.0, 0.7):
        speed = 1.0
        one.states((0.5 + way, speed, RADIUS, 0.0, 0.3 + way / RADIUS, speed / RADIUS))
        found = one.array("GetDerivatives", 6)
        gains = G / 10 * 5 / 7  # m/s^2, of a solid ball
        expected = [speed, gains, 0, 0, speed / RADIUS, gains / RADIUS]
        assert found == pytest.approx(expected, abs=1e-9)
        assert one.get("residual.rolling") == pytest.approx(0, abs=1e-12)
        assert not one.asks_for_event()


def test_looking_at_the_indicators_changes_no_derivative(of):
    """A plate on five legs, a little beside its floor as an integrator leaves it: the accelerations are the
    same bits whether or not the indicators were read."""
    one = of(table).continuous()
    for height in (0.0, 1e-7, -1e-7):
        one.states((height, 1e-6, 1e-7, 0.0, -2e-7, 1e-6))
        before = one.array("GetDerivatives", 6)
        indicators = one.array("GetEventIndicators", 5)
        assert one.array("GetDerivatives", 6) == before
        assert sum(indicators) == pytest.approx(2 * G, rel=1e-3)


def test_time_has_no_unit(library):
    """The pendulum whose g is 1e6 times as large does in a millisecond what the other does in a second: the
    drift dies out 1e3 times as fast, f'' = -alpha^2 f, and velocities are 1e3 times as large."""
    alphas, speeds, sizes = [], [], []
    for factor in (1.0, 1e6):
        gravity = 9.81 * factor
        one = library("PendulumCartesian").continuous(g=gravity)
        px, _, py, _ = one.array("GetContinuousStates", 4)
        nominals = one.array("GetNominalsOfContinuousStates", 4)
        sizes.append(nominals[0])
        speeds.append(nominals[1])
        one.states((1.001 * px, 0.0, 1.001 * py, 0.0))
        _, ax, _, ay = one.array("GetDerivatives", 4)
        f = (1.001**2 - 1) * (px**2 + py**2)
        alphas.append(np.sqrt(-2 * (1.001 * px * ax + 1.001 * py * ay) / f))
    assert sizes[1] == pytest.approx(sizes[0], rel=1e-12)
    assert speeds[1] == pytest.approx(1e3 * speeds[0], rel=1e-9)
    assert alphas[1] == pytest.approx(1e3 * alphas[0], rel=1e-6)


def test_many_masses_on_springs_at_rest_have_their_highest_frequency_as_rate(of):
    """Masses between two walls, tied by springs of length L, stand at places j L: in their
    fastest motion neighbours go against each other, at 2 sqrt(k/m) = 20/s.  Rounding of the places shakes
    them by eps j L 20/s, and ten tolerances of 1e-8 of a speed that counts are no less."""
    one = of(masses_on_springs).continuous()
    sizes, speeds = np.reshape(one.array("GetNominalsOfContinuousStates", 50), (25, 2)).T
    np.testing.assert_allclose(sizes, np.arange(1, 26), rtol=1e-12)
    shaken = np.finfo(float).eps * 20
    np.testing.assert_allclose(speeds / sizes, 10 / 1e-8 * shaken, rtol=1e-6)
    assert prepare(masses_on_springs()).structure.start.rate == pytest.approx(20, rel=1e-6)


def test_a_skate_that_slips_sideways_is_set_straight(library):
    """Its place being right, a hundredth of its speed across the blade asks for an event, in which
    x' sin phi = y' cos phi is met again, and the importer is told that its states were moved."""
    one = library("KnifeEdge").continuous()
    along, across = np.array([np.cos(0.5), np.sin(0.5)]), np.array([-np.sin(0.5), np.cos(0.5)])
    for slip in (0.0, 0.02):
        vx, vy = 2 * along + slip * across
        one.states((0.0, vx, 0.0, vy, 0.5, 0.3))
        assert one.asks_for_event() == (slip > 0)
    assert one.meets_event().values
    _, vx, _, vy, _, turning = one.array("GetContinuousStates", 6)
    assert vx * np.sin(0.5) - vy * np.cos(0.5) == pytest.approx(0, abs=1e-14)
    assert np.hypot(vx, vy) == pytest.approx(2, rel=1e-3)
    assert turning == 0.3
    assert not one.asks_for_event()


@pytest.mark.parametrize("e", [0.3, 1.0])
def test_a_bounce_returns_its_part_of_the_speed_at_the_floor(library, e):
    """An importer's step ends d below the floor with the speed s, which was sqrt(s^2 - 2 g d) at y = 0: the
    ball goes up from there with e times that."""
    one = library("BouncingBall").continuous(e=e)
    depth, speed = 1e-5, 2.0
    one.states((-depth, -speed))
    one.does("EnterEventMode")
    assert one.events().values
    height, rebound = one.array("GetContinuousStates", 2)
    assert height == pytest.approx(0, abs=1e-12)
    assert rebound == pytest.approx(e * np.sqrt(speed**2 - 2 * one.get("g") * depth), rel=1e-12)
    one.does("EnterEventMode")
    assert not one.events().values  # nothing more happens


def test_a_force_that_has_come_is_said_and_lifts_off(of):
    """At the end of an importer's step past t = 0.5 s a pull of 3 m g has come, whether or not it has looked:
    an event is asked for, in which the block leaves the floor; it goes up with 2 g."""
    one = of(lifted).continuous()
    for time in (0.4, 0.6):
        one.does("SetTime", c_double(time))
        one.states((0.0, 0.0))
        assert one.asks_for_event() == (time > 0.5)
    one.does("EnterEventMode")
    one.events()
    assert one.integer("departure.floor.count") == 1
    assert one.get("lambda.floor") == 0
    assert one.array("GetDerivatives", 2) == pytest.approx([0, 2 * one.get("g")], rel=1e-12)


def test_what_an_importer_has_not_seen_is_said(library, of):
    """At the end of its step a ball has gone through the floor, or a surface pulls: an event is asked for,
    whether or not the importer has looked at the indicators; above, and on the surface, none is."""
    one = of(ball).continuous()
    for height, speed, expected in ((0.3, -1.0, 0), (RADIUS - 1e-6, -1.0, 1)):
        one.states((0.5, 0.0, height, speed, 0.3, 0.0))
        assert one.asks_for_event() == expected
    one = library("Hemisphere").continuous()
    r, _, theta, _ = one.array("GetContinuousStates", 4)
    for rate, expected in ((0.1, 0), (50.0, 1)):
        one.states((r, 0.0, theta, rate))
        assert one.asks_for_event() == expected


def test_an_event_that_cannot_be_met_asks_for_no_other(library):
    """After an error fmi2NewDiscreteStates wants no further call, and fmi2CompletedIntegratorStep no
    event: importers go on by what stands there."""
    one = library("PendulumCartesian").continuous()
    event, end = c_int(1), c_int(1)
    one.states((0.0, 1.0, 0.0, 0.0))  # both ends of the rod in one place: no direction pulls
    one.refuses("CompletedIntegratorStep", 1, byref(event), byref(end))
    assert (event.value, end.value) == (0, 0)
    info = EventInfo(1, 1, 1, 1, 1, 1.0)
    one.refuses("NewDiscreteStates", byref(info))
    assert bytes(info) == bytes(EventInfo())


def test_what_has_drifted_off_a_table_still_lies_on_it(of):
    """A block that an integrator has carried half a millimetre above a table that nobody moved is put back at
    an event and does not leave; one whose table then drops by as much does."""
    one = of(shaken).continuous()
    one.states((-1e-7, -1.0))
    for height, drop, shut in ((0.0, 0.0, 1), (5e-4, 0.0, 1), (0.0, -5e-4, 0)):
        if height:
            one.states((height, 0.0))
        one.does("EnterEventMode")
        for name, value in {"u": drop, "der(u)": 0.0, "der(u,2)": 0.0}.items():
            one.set(name, value)
        assert one.events().values or drop
        assert one.array("GetContinuousStates", 2) == pytest.approx([0, 0], abs=1e-9)
        assert one.integer("contact.table") == shut
        assert one.integer("departure.table.count") == 1 - shut
        one.does("EnterContinuousTimeMode")
