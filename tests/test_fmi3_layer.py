"""The FMI 3.0 layer of native FMUs, call by call: creation, refusals, types, dependencies, Model Exchange."""

from __future__ import annotations

import ctypes
import math
import random
import zipfile
from ctypes import byref, c_bool, c_char_p, c_double, c_int, c_size_t, c_uint32, c_void_p
from xml.etree import ElementTree

import numpy as np
import pytest
from fmi3 import LOGGER
from single import DISCARD, ERROR

from lagfmu.testing import Face, described, find_compiler, write

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

CONSTANT, DEPENDENT = 1, 5  # fmi3DependencyKind


@pytest.fixture
def pendulum(library3):
    """Cartesian pendulum: x, y under x^2 + y^2 = L^2."""
    return library3("PendulumCartesian")


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"token": "{0}"}, "token is {0}"),
        ({"token": "a#b"}, "a##b"),
        ({"name": b""}, "name is empty"),
    ],
)
@pytest.mark.parametrize("exchange", [False, True])
def test_an_instance_that_cannot_be_is_null_with_a_reason(pendulum, options, part, exchange):
    """The reason is in the log, where '#' begins a value reference and is doubled if it is none."""
    one = pendulum(exchange=exchange, **options)
    assert not one.handle
    assert [status for status, _, _ in one.log] == [ERROR]
    assert part in one.log[0][2]


def test_it_is_no_fmu_for_scheduled_execution(pendulum):
    """fmi3InstantiateScheduledExecution returns NULL and says what the FMU is made for."""
    told = []
    logger = LOGGER(lambda _, status, __, text: told.append((status, text.decode())))
    token = pendulum.description.instantiationToken.encode()
    assert pendulum.dll.fmi3GetVersion() == b"3.0"
    made = pendulum.dll.fmi3InstantiateScheduledExecution(
        *(b"one", token, None, c_bool(False), c_bool(False), None, logger, None, None, None)
    )
    assert made is None
    assert told[0][0] == ERROR
    assert "co-simulation" in told[0][1]


def test_a_variable_is_got_by_its_own_type_alone(pendulum):
    """A Float64 is no Float32, the method an Enumeration and no Int32; counts of values are held against
    counts of variables."""
    one = pendulum().start()
    x = one.references(["x"]), c_size_t(1)
    values = (c_double * 2)()
    for kind in ("Float32", "Int8", "UInt16", "Int32", "Int64", "UInt64", "Boolean", "String"):
        text = one.refuses(f"Get{kind}", *x, values, c_size_t(1))
        assert f"fmi3Get{kind}: value reference" in text
        assert f"no {kind}" in text
    assert "2 values for 1" in one.refuses("GetFloat64", *x, values, c_size_t(2))
    assert "no Binary" in one.refuses("GetBinary", *x, values, values, c_size_t(1))
    for kind in ("Float32", "Int8", "String"):
        one.does(f"Get{kind}", None, c_size_t(0), None, c_size_t(0))
    assert one.get("solver.method") == 1
    assert one.get("unique.rod") is True
    assert one.get("time") == 0
    one.step(0.25)
    assert one.get("time") == 0.25
    method = (
        one.references(["solver.method"]),
        c_size_t(1),
        byref(ctypes.c_int64(1 << 60)),
        c_size_t(1),
    )
    assert "before the end" in one.refuses("SetInt64", *method)
    fresh = pendulum()
    assert "'solver.method' = 1152921504606846976" in fresh.refuses("SetInt64", *method)


def test_a_step_that_cannot_be_done_is_discarded(pendulum):
    """It leaves all as it was, tells where it stands and asks for the end; past the stop time is an error."""
    one = pendulum().start(stop=1.0)
    one.step(0.1)
    before = one.bytes_of(one.saved())
    step = one.step(1e-300, status=DISCARD)
    assert step.terminate
    assert step.time == 0.1
    assert one.bytes_of(one.saved()) == before
    one.step(0.95, status=ERROR)
    assert "stop time 1.0 s" in one.log[-1][2]
    one.time = 0.1
    one.step(0.9)


def test_there_is_nothing_to_configure_and_no_clock_with_an_interval(pendulum):
    """Configuration mode and time-based clocks are refused by name."""
    one = pendulum()
    assert "fmi3EnterConfigurationMode" in one.refuses("EnterConfigurationMode")
    one.does(
        "EnterInitializationMode",
        c_bool(False),
        c_double(0),
        c_double(0),
        c_bool(False),
        c_double(0),
    )
    clock = one.references(["x"]), c_size_t(1), (c_double * 1)(), (c_int * 1)()
    assert "no time-based Clock" in one.refuses("GetIntervalDecimal", *clock)


def test_log_categories_are_switched(pendulum):
    """As in FMI 2.0: warnings of a tolerance that cannot be held are told if they are listened to."""
    one = pendulum()
    one.does("SetDebugLogging", c_bool(False), c_size_t(0), None)
    one.start(tolerance=1e-20)
    assert not one.log
    one.does("Reset")
    one.does("SetDebugLogging", c_bool(True), c_size_t(1), (c_char_p * 1)(b"logStatusWarning"))
    one.start(tolerance=1e-20)
    assert len(one.log) == 1


# ---------------------------------------------------------------------------- dependencies


def test_dependencies_that_the_description_leaves_out_are_refused_in_words(
    prepared, library3, tmp_path, monkeypatch
):
    """Not as if the variable were no unknown: who asks learns that it may depend on all."""
    monkeypatch.setattr(described, "MOST", 5)
    path = write(prepared("PendulumCartesian"), tmp_path, face=Face(3))
    with zipfile.ZipFile(path) as archive:
        assert b"dependencies=" not in archive.read("modelDescription.xml")
    one = library3(path)(exchange=True).start()
    for name in ("lambda.rod", "der(x,2)"):
        (reference,) = one.references([name])
        ask = "GetNumberOfVariableDependencies", c_uint32(reference), byref(c_size_t())
        assert "all states and inputs" in one.refuses(*ask)


@pytest.mark.parametrize("name", ["Hemisphere", "CartPendulum", "RotatingWire"])
def test_dependencies_are_those_of_the_description(fmi3_fmu, library3, name):
    """Before and after the initialization, each unknown of the model structure; others are refused."""
    with zipfile.ZipFile(fmi3_fmu(name)) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    structure = root.find("ModelStructure")
    one = library3(name)()

    def asked(reference: int) -> dict[int, int]:
        count = c_size_t()
        one.does("GetNumberOfVariableDependencies", c_uint32(reference), byref(count))
        n = count.value
        of, on, knowns = (c_size_t * n)(), (c_size_t * n)(), (c_uint32 * n)()
        kinds = (c_int * n)()
        one.does("GetVariableDependencies", c_uint32(reference), of, knowns, on, kinds, count)
        assert not any(of)
        assert not any(on)
        return dict(zip(knowns, kinds, strict=True))

    def check(element) -> None:
        reference = int(element.get("valueReference"))
        knowns = [int(k) for k in element.get("dependencies", "").split()]
        kinds = {"constant": CONSTANT, "dependent": DEPENDENT}
        said = element.get("dependenciesKind")
        told = [kinds[k] for k in said.split()] if said else [DEPENDENT] * len(knowns)
        assert asked(reference) == dict(zip(knowns, told, strict=True))

    initial = structure.findall("InitialUnknown")
    assert initial
    for element in initial:
        check(element)
    one.start()
    for element in (*structure.findall("Output"), *structure.findall("ContinuousStateDerivative")):
        check(element)
    text = one.refuses("GetNumberOfVariableDependencies", c_uint32(0), byref(c_size_t()))
    assert "none of the unknowns" in text
    assert "no variable" in one.refuses(
        "GetNumberOfVariableDependencies", c_uint32(10**6), byref(c_size_t())
    )


# ---------------------------------------------------------------------------- Model Exchange


def test_event_indicators_are_variables_too(library3):
    """Their values are those of fmi3GetEventIndicators, and in co-simulation the same: lambda of a closed
    contact, the gap of an open one."""
    lib = library3("Hemisphere")
    names = [n for n in lib.variables if n.startswith("indicator.")]
    one, two = lib(exchange=True).start(), lib().start()
    count = c_size_t()
    one.does("GetNumberOfEventIndicators", byref(count))
    assert count.value == len(names) == 1
    assert one.array("GetEventIndicators", 1) == one.floats(names) == two.floats(names)
    assert two.get(names[0]) == pytest.approx(two.get("lambda.surface"), rel=1e-13)
    for _ in range(20):
        two.step(0.1)
    assert not two.get("contact.surface")
    assert two.get(names[0]) == pytest.approx(two.get("r") - 1, abs=1e-8)


def test_model_exchange_opens_the_contact(library3):
    """Past cos(theta) = 2/3 the indicator is negative, and the event opens the contact, as in FMI 2.0."""
    one = library3("Hemisphere")(exchange=True).start()
    assert not one.updates()[0]
    assert one.nominals  # those of this start
    one.does("EnterContinuousTimeMode")
    theta = 0.85
    rate = math.sqrt(2 * 9.81 * (1 - math.cos(theta)))
    one.does("SetTime", c_double(1.7))
    states = (c_double * 4)(1.0, 0.0, theta, rate)
    one.does("SetContinuousStates", states, c_size_t(4))
    assert one.array("GetEventIndicators", 1)[0] < 0
    event, end = c_bool(), c_bool()
    one.does("CompletedIntegratorStep", c_bool(True), byref(event), byref(end))
    assert event.value
    one.does("EnterEventMode")
    assert one.updates() == (False, True)  # integrators begin anew at such a state
    assert one.array("GetContinuousStates", 4) == list(states)
    one.does("EnterContinuousTimeMode")
    assert one.get("lambda.surface") == 0
    assert one.get("departure.surface.time") == 1.7
    assert "nan" in one.refuses("SetTime", c_double(math.nan))
    bad = (c_double * 4)(math.nan, 0, 0, 0)
    assert "state 1" in one.refuses("SetContinuousStates", bad, c_size_t(4), status=DISCARD)
    assert "3 values" in one.refuses("GetContinuousStateDerivatives", bad, c_size_t(3))


def test_saved_states_of_another_fmu_are_refused(library3):
    """By its token, and by its type of interface."""
    one = library3("Hemisphere")().start()
    data = one.bytes_of(one.saved())
    other = library3("PendulumCartesian")().start()
    state = c_void_p()
    arguments = data, c_size_t(len(data)), byref(state)
    assert "another FMU" in other.refuses("DeserializeFMUState", *arguments)
    exchange = library3("Hemisphere")(exchange=True).start()
    assert "other type" in exchange.refuses("SetFMUState", one.saved())


@pytest.mark.parametrize("name", ["PendulumCartesian", "Gyroscope", "SliderCrankBodies"])
def test_continuous_states_are_set_one_by_one(library3, name):
    """In Continuous-Time Mode SetFloat64 of each state is SetContinuousStates of all (FMI 3.0.2, 3.2.1), in
    whatever order and number of calls, of quaternions too; in Event Mode those that no event changes."""
    one, two = (library3(name)(exchange=True).start() for _ in range(2))
    states = [u.variable.derivative.name for u in one.library.description.derivatives]
    size = len(states)
    begun = one.array("GetContinuousStates", size)
    chance = random.Random(3)
    for instance in (one, two):
        assert not instance.updates()[0]
        instance.does("EnterContinuousTimeMode")
    for _ in range(3):
        moved = [x + 1e-3 * chance.uniform(-1, 1) for x in begun]
        one.does("SetContinuousStates", (c_double * size)(*moved), c_size_t(size))
        for k in chance.sample(range(size), size):
            two.set(states[k], moved[k])
            assert two.get(states[k]) == moved[k]
        found = [i.array("GetContinuousStateDerivatives", size) for i in (one, two)]
        assert found[0] == found[1]
        assert one.array("GetContinuousStates", size) == two.array("GetContinuousStates", size)
        assert one.outputs() == two.outputs()
    for k in range(size):  # what is not set again stays, though it was evaluated
        moved[k] += 1e-3
        one.does("SetContinuousStates", (c_double * size)(*moved), c_size_t(size))
        two.set(states[k], moved[k])
        found = [i.array("GetContinuousStateDerivatives", size) for i in (one, two)]
        scale = np.abs(found[0]).max()
        np.testing.assert_allclose(found[1], found[0], rtol=1e-12, atol=1e-12 * scale)
    call, arguments = two.set_call(states[0], math.nan)
    assert "expected a finite number" in two.refuses(call, *arguments)
    two.does("EnterEventMode")
    call, arguments = two.set_call(states[0], begun[0] + 1)
    assert "before the end of the initialization" in two.refuses(call, *arguments)
