"""Events in co-simulation of FMI 3.0: an importer that stops at them, sees both sides and hands them on."""

from __future__ import annotations

import itertools
import math
import zipfile
from collections.abc import Iterator
from ctypes import byref, c_bool, c_double, c_size_t, c_void_p
from dataclasses import replace
from xml.etree import ElementTree

import mpmath
import numpy as np
import pytest
import sympy
from conftest import scene_of
from fmi3 import Single
from single import ERROR
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass
from zoo.forces import JUMPS

from lagfmu import Contact, Input, Model
from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

STEPS = 0.1  # s between two communication points
COMBINATIONS = list(itertools.product((False, True), repeat=2))  # event mode, early return


def begin(library, *, events=False, early=False, **named) -> Single:
    """In Step Mode at the start, at a tolerance of 1e-12."""
    one = library(events=events, early=early).start(tolerance=1e-12, **named)
    if events:
        assert one.updates() == (False, False)
        one.does("EnterStepMode")
    return one


def run(one: Single, stop: float, grid: float = STEPS):
    """To the points of a grid and whatever comes between: each step with the instance there."""
    while one.time < stop * (1 - 1e-12):
        following = (math.floor(one.time / grid + 1e-9) + 1) * grid
        yield one.step(min(following, stop) - one.time)


def departure() -> tuple[float, float]:
    """Time and angle at which a particle that starts at 0.01 rad leaves the hemisphere (a = 1 m)."""
    with mpmath.workdps(30):
        theta0, g = mpmath.mpf(0.01), mpmath.mpf(9.81)
        theta = mpmath.acos(2 * mpmath.cos(theta0) / 3)
        end = mpmath.sqrt(theta - theta0)

        def slowness(s):
            # theta = theta0 + s^2, 2 g (cos(theta0) - cos(theta)) without cancellation
            energy = 4 * g * mpmath.sin(theta0 + s * s / 2) * mpmath.sin(s * s / 2)
            return 2 * s / mpmath.sqrt(energy)

        return float(mpmath.quad(slowness, [0, end / 4, end])), float(theta)


def test_the_importer_stops_where_the_particle_leaves(library3):
    """With steps of 0.1 s there is a point at the departure, its time that of the elliptic integral to 1e-12;
    there lambda is 0, before it the contact is closed, after it the particle flies on a parabola."""
    one = begin(library3("Hemisphere"), events=True, early=True)
    time, theta = departure()
    met = []
    for step in run(one, 2.0):
        if not step.event:
            assert not step.early
            continue
        assert step.early
        met.append(step.time)
        assert abs(one.get("lambda.surface")) < 1e-11
        assert one.get("contact.surface")
        assert one.get("departure.surface.count") == 0
        one.does("EnterEventMode")
        assert one.get("lambda.surface") == 0
        assert not one.get("contact.surface")
        assert one.get("departure.surface.count") == 1
        assert one.get("departure.surface.time") == step.time
        start = one.floats(["r", "theta", "der(r)", "der(theta)"])
        assert one.updates() == (False, False)
        one.does("EnterStepMode")
    assert met == [pytest.approx(time, abs=1e-12)]
    r, angle, rate, spin = start
    assert angle == pytest.approx(theta, abs=1e-11)
    tau = one.time - met[0]
    x = r * math.sin(angle) + (rate * math.sin(angle) + r * spin * math.cos(angle)) * tau
    z = r * math.cos(angle) + (rate * math.cos(angle) - r * spin * math.sin(angle)) * tau
    z -= 9.81 * tau**2 / 2
    assert one.get("r") == pytest.approx(math.hypot(x, z), abs=1e-11)
    assert one.get("theta") == pytest.approx(math.atan2(x, z), abs=1e-11)


@pytest.mark.parametrize("name", ["Hemisphere", "BouncingBall"])
def test_an_importer_that_meets_no_event_has_the_numbers_of_fmi_2(library, library3, name):
    """Neither event mode nor early return, or event mode without an event at a step's end: the same bits as
    FMI 2.0 at all points, whatever happens between them."""
    old = library(name)().start(tolerance=1e-12)
    outputs = [
        n for n, v in old.library.variables.items() if v.causality == "output" and v.type == "Real"
    ]
    new = [begin(library3(name), events=events) for events in (False, True)]
    for k in range(20):
        old.step(STEPS)
        for one in new:
            one.time = k * STEPS if k == 0 else one.time
            step = one.step(STEPS)
            assert not step.early
            assert not step.event
            assert one.floats(outputs) == old.reals(outputs)


@pytest.mark.parametrize(("events", "early"), COMBINATIONS)
def test_each_bounce_is_a_point_with_two_sides(library3, events, early):
    """With early return a step ends at each impact of the ball; with event mode it is met there: falling
    before, rising by the coefficient of restitution after.  The motion is the same."""
    lib = library3("BouncingBall")
    one, plain = begin(lib, events=events, early=early), begin(lib)
    bounces = 0
    for step in run(one, 1.5):
        assert events or not step.event
        assert step.early <= early
        if step.early:
            bounces += 1
        if not step.event:
            continue
        (before,) = one.floats(["der(y)"])
        one.meets_event()
        (after,) = one.floats(["der(y)"])
        assert before < 0
        assert after == pytest.approx(-one.get("e") * before, rel=1e-9)
    for _ in run(plain, 1.5):
        pass
    assert (bounces > 1) == early
    assert (
        one.get("closing.floor.count" if "closing.floor.count" in lib.variables else "steps") >= 0
    )
    np.testing.assert_allclose(one.get("y"), plain.get("y"), atol=1e-9)


def corner() -> Model:
    """A ball between two walls, without gravity."""
    x, y = dynamicsymbols("x y")
    return point_mass(
        "Corner",
        "x y",
        [Contact("left", x, restitution=0.5), Contact("floor", y, restitution=0.8)],
        start={x: 0.3, y: 0.1, x.diff(): -3.0, y.diff(): -1.0},
    )


@pytest.mark.parametrize("later", [0.0, 1e-15, 1e-11])
def test_impacts_of_one_instant_are_one_event(library3, built, later):
    """Two walls that are struck at once, whatever rounding makes of the times: one point, both impacts."""
    one = begin(
        library3(built(corner(), fmi=3)), events=True, early=True, values={"x": 0.3 + later}
    )
    met = []
    for step in run(one, 0.5):
        if step.event:
            one.meets_event()
            met.append((step.time, *one.floats(["der(x)", "der(y)"])))
    assert len(met) == 1
    assert met[0] == pytest.approx((0.1, 1.5, 0.8), abs=1e-10)


def test_an_event_at_the_end_of_a_step_is_met_without_early_return(library3):
    """Event mode without early return: a step that ends exactly at the departure signals it there; one that
    ends later has handled it."""
    lib = library3("Hemisphere")
    scout = begin(lib, events=True, early=True)
    (time,) = (s.time for s in run(scout, 1.7) if s.event)
    one = begin(lib, events=True)
    for _ in range(16):
        assert not one.step(STEPS).event
    while one.time < time:
        step = one.step(time - one.time)
    assert one.time == time
    assert step.event
    assert not step.early
    assert one.get("contact.surface")
    one.meets_event()
    assert not one.get("contact.surface")


def test_an_event_that_is_not_met_happens_with_the_next_step(library3):
    """An importer that goes on without fmi3EnterEventMode: the contact opens where it should have, once."""
    one, met = (begin(library3("Hemisphere"), events=True, early=True) for _ in range(2))
    for _ in run(one, 2.0):
        pass
    for step in run(met, 2.0):
        if step.event:
            met.meets_event()
    assert one.get("departure.surface.count") == 1
    assert one.outputs() == met.outputs()


def test_frictions_and_jumps_are_events_too(library3, built):
    """A sphere that rolls, slips and then leaves another one; a force that jumps: each is a point, once."""
    one = begin(library3("SlippingSphere"), events=True, early=True)
    modes = ("sticks.grip", "contact.surface")
    met = []
    for step in run(one, 2.0):
        if step.event:
            before = [one.get(n) for n in modes]
            one.meets_event()
            met.append((before, [one.get(n) for n in modes]))
    assert met == [([True, True], [False, True]), ([False, True], [False, False])]
    for event, time in (("slipping.grip", 1.3743230302674), ("departure.surface", 1.4929820117040)):
        assert one.get(f"{event}.time") == pytest.approx(time, abs=1e-10)
    gate = library3(built(JUMPS["Gate"](), fmi=3))
    one = begin(gate, events=True, early=True)
    times = []
    for step in run(one, float(gate.description.defaultExperiment.stopTime)):
        if step.event:
            times.append(step.time)
            one.meets_event()
    assert len(times) > 0
    assert all(b - a > 1e-9 for a, b in itertools.pairwise(times))


def test_a_state_saved_before_an_event_is_met_brings_back_both_sides(library3):
    """The limit from the left, that from the right and the rest of the run: the same bits in another
    instance."""
    lib = library3("Hemisphere")
    one, other = (begin(lib, events=True, early=True) for _ in range(2))
    for step in run(one, 2.0):
        if step.event:
            break
    data = one.bytes_of(one.saved())
    state = c_void_p()
    other.does("DeserializeFMUState", data, c_size_t(len(data)), byref(state))
    other.does("SetFMUState", state)
    other.time = one.time
    for each in (one, other):
        assert each.get("contact.surface")
        each.meets_event()
        for _ in run(each, 2.0):
            pass
    assert one.outputs() == other.outputs()
    plain = lib().start()
    assert "its mode is" in plain.refuses("SetFMUState", _in_event_mode(lib, other))


def _in_event_mode(lib, one):
    one.does("EnterEventMode")
    return one.saved()


def lifted() -> Model:
    """A block on the floor, under a force F that is set."""
    y = dynamicsymbols("y")
    F = sympy.symbols("F")
    return point_mass(
        "LiftedBlock",
        "y",
        [Contact("floor", y)],
        up=y,
        mass=2.0,
        inputs=[Input(F, "N")],
        forces={y: F},
    )


def test_inputs_that_are_set_in_event_mode_act_at_once(library3, built):
    """A block on the floor: half its weight leaves half the normal force; twice its weight opens the contact
    there and then, which asks for another instant, and lifts the block by g."""
    one = begin(library3(built(lifted(), fmi=3)), events=True, early=True)
    one.step(STEPS)
    weight = 2.0 * 9.81
    one.does("EnterEventMode")
    one.set("F", weight / 2)
    assert one.get("lambda.floor") == pytest.approx(weight / 2, rel=1e-14)
    assert one.updates() == (False, False)
    one.set("F", 2 * weight)
    assert one.get("lambda.floor") == 0
    assert one.get("departure.floor.count") == 0
    assert one.updates() == (True, False)
    assert one.get("departure.floor.count") == 1
    assert one.get("departure.floor.time") == one.time
    assert one.updates() == (False, False)
    one.does("EnterStepMode")
    one.step(STEPS)
    assert one.get("y") == pytest.approx(9.81 * STEPS**2 / 2, rel=1e-10)
    assert one.get("departure.floor.count") == 1


def test_without_event_mode_it_cannot_be_entered(library3):
    """fmi3EnterEventMode is refused by name where the instance was made without eventModeUsed."""
    one = begin(library3("Hemisphere"), early=True)
    one.step(STEPS)
    assert "without the event mode" in one.refuses("EnterEventMode")


# ---------------------------------------------------------------------------- clocks


def test_clocks_tick_at_their_events(library3, built):
    """The clock of the surface ticks when the particle leaves, in event mode alone, until the instant is
    over; an importer that does not use event mode is told why it cannot have the FMU."""
    file, scene = scene_of("Hemisphere")
    lib = library3(built(file.model, replace(scene, name="Ticking"), fmi=3, clocks=True))
    refused = lib(early=True)
    assert not refused.handle
    assert [status for status, _, _ in refused.log] == [ERROR]
    assert "'clock.surface'" in refused.log[0][2]
    assert "eventModeUsed" in refused.log[0][2]
    one = begin(lib, events=True, early=True)
    ticks = []
    for step in run(one, 2.0):
        assert "GetClock" in one.refuses("GetClock", *one.get_call("clock.surface")[1])
        if step.event:
            one.does("EnterEventMode")
            ticks.append(one.get("clock.surface"))
            assert one.get("departure.surface.time") == step.time
            one.updates()
            ticks.append(one.get("clock.surface"))
            one.does("EnterStepMode")
    assert ticks == [True, False]
    one.does("EnterEventMode")  # at a time without an event
    assert not one.get("clock.surface")
    function, arguments = (
        "SetClock",
        (one.references(["clock.surface"]), c_size_t(1), byref(c_bool(True))),
    )
    assert "calculated" in one.refuses(function, *arguments)


# ---------------------------------------------------------------------------- intermediate update


def described(path) -> Iterator[ElementTree.Element]:
    """The variables of modelDescription.xml."""
    with zipfile.ZipFile(path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    yield from root.find("ModelVariables")


def force(t: float) -> float:
    """An input that bends: N at time t [s]."""
    return 3 * math.sin(4 * t) + t


def test_inputs_are_followed_within_a_step(library3):
    """A cart whose driving force is supplied within one step of 1 s moves as one that is driven in 400 steps,
    extrapolated; a force that is held is 1e-3 m off."""
    lib = library3("CartPendulum")

    def supplied(one, time, asked, returns):
        if asked:
            one.set("F", force(time))

    one = begin(lib)
    assert force(0) == 0
    one = lib(between=supplied, named=["F", "s"]).start(tolerance=1e-12)
    one.step(1.0)
    assert one.get("F") == force(1.0)

    def stepped(count: int) -> np.ndarray:
        held = begin(lib)
        for k in range(count):
            held.set("F", force((k + 0.5) / count))
            held.step(1 / count)
        return np.array(held.floats(["s", "der(s)", "x"]))

    coarse, fine = stepped(200), stepped(400)  # second order, by midpoints
    exact = fine + (fine - coarse) / 3
    np.testing.assert_allclose(one.floats(["s", "der(s)", "x"]), exact, atol=2e-9)
    assert abs(stepped(1)[0] - exact[0]) > 1e-3


def test_a_motion_that_was_supplied_stands_where_it_was_supplied(library3):
    """The crane's rope is drawn in at 1 m/s within one step: at its end the rope, and the input that is read,
    are as long as the importer said at that time."""
    motion = {"l": lambda t: 2 - t, "der(l)": lambda t: -1.0, "der(l,2)": lambda t: 0.0}

    def supplied(one, time, asked, returns):
        for name, value in motion.items():
            if asked:
                one.set(name, value(time))

    one = library3("Crane")(between=supplied, named=list(motion)).start(tolerance=1e-12)
    one.step(0.1)
    assert one.floats(list(motion)) == [value(0.1) for value in motion.values()]
    x, y = one.floats(["x", "y"])
    assert math.hypot(x - one.get("s"), y) == pytest.approx(1.9, abs=1e-12)


def test_outputs_are_read_within_a_step_and_change_nothing(library3):
    """Hemisphere in one step of 1.5 s: at each instant that the importer is shown, lambda is that of the
    closed form at that angle, times only rise, and the end is the same bits as without a look."""
    lib = library3("Hemisphere")
    seen = []

    def looks(one, time, asked, returns):
        assert not asked
        seen.append((time, *one.floats(["theta", "lambda.surface"])))

    one = lib(between=looks, named=["theta", "lambda.surface"]).start(tolerance=1e-10)
    plain = lib().start(tolerance=1e-10)
    for each in (one, plain):
        for h in (1.5, 0.1, 0.3):
            each.step(h)
    times = [t for t, _, _ in seen]
    assert len(times) > 10
    assert times == sorted(times)
    assert times[-1] == one.time
    for time, theta, normal in seen:
        if time < departure()[0]:
            assert normal == pytest.approx(
                9.81 * (3 * math.cos(theta) - 2 * math.cos(0.01)), abs=1e-8
            )
    assert one.outputs() == plain.outputs()


@pytest.mark.parametrize("early", [False, True])
def test_the_importer_may_ask_for_an_early_return(library3, early):
    """At the first instant after 0.2 s that it is shown it asks for 0.33 s: the step ends there if early
    return was agreed upon, else it goes on; what follows is the same motion."""
    lib = library3("CartPendulum")

    def asks(one, time, asked, returns):
        assert returns <= (early and time < 1.0)  # at its end there is nothing to return from
        return 0.33 if not asked and time > 0.2 and one.time < 0.1 else None

    one = lib(early=early, between=asks, named=["s"]).start(tolerance=1e-10)
    step = one.step(1.0)
    assert (step.early, step.event) == (early, False)
    assert step.time == (0.33 if early else 1.0)
    if early:
        one.step(0.67)
    plain = lib().start(tolerance=1e-10)
    plain.step(1.0)
    assert one.get("s") == pytest.approx(plain.get("s"), abs=1e-8)


def test_within_a_step_only_what_was_named_is_exchanged(library3):
    """A variable that was not named, one that is set where it is not asked for, a function that has no place
    there: refused by name, and the step goes on; a variable that cannot be named is refused at once."""
    lib = library3("CartPendulum")
    refused: set[str] = set()

    def tries(one, time, asked, returns):
        value = c_double(1.0)
        if not asked:
            other = one.references(["x"]), c_size_t(1), byref(value), c_size_t(1)
            refused.add(one.refuses("GetFloat64", *other))
            refused.add(one.refuses("SetFloat64", *one.set_call("F", 1.0)[1]))
            refused.add(one.refuses("GetFMUState", byref(c_void_p())))
            refused.add(one.refuses("Reset"))
        else:
            refused.add(one.refuses("SetFloat64", *one.set_call("F", math.nan)[1]))
            refused.add(one.refuses("GetFloat64", *one.get_call("s")[1]))

    one = lib(between=tries, named=["F", "s"]).start()
    plain = lib().start()
    for each in (one, plain):
        each.step(0.1)
    assert one.outputs() == plain.outputs()
    text = " ".join(refused)
    for part in ("'x' was not named", "no input is asked", "'F' = nan", "GetFMUState", "Reset"):
        assert part in text
    for name in ("m", "solver.tolerance", "time"):
        other = lib(between=tries, named=[name])
        assert not other.handle
        assert f"'{name}' cannot be an intermediate variable" in other.log[0][2]


@pytest.mark.parametrize("name", ["CartPendulum", "BouncingBall", "HalfCar", "SlippingSphere"])
def test_what_the_description_marks_is_what_can_be_named(fmi3_fmu, library3, name):
    """intermediateUpdate in modelDescription.xml and the binary agree on every variable."""
    lib = library3(name)

    def silent(*_):
        return None

    marked = {
        v.get("name") for v in described(fmi3_fmu(name)) if v.get("intermediateUpdate") == "true"
    }
    assert marked == {n for n in lib.variables if lib(between=silent, named=[n]).handle}
