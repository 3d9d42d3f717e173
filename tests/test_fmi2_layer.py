"""The FMI layer of native FMUs, call by call: life cycle, refusals, memory, saved states, derivatives."""

from __future__ import annotations

import math
import random
from ctypes import (
    byref,
    c_char_p,
    c_double,
    c_int,
    c_size_t,
    c_uint,
    c_void_p,
    create_string_buffer,
)

import numpy as np
import pytest
from fmi2 import EXCHANGE, Library
from single import DISCARD, ERROR

from lagfmu.methods import NUMBERS
from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

MODELS = ("PendulumCartesian", "Hemisphere", "CartPendulum", "InclineDiskMinimal", "KnifeEdge")


@pytest.fixture
def pendulum(library) -> Library:
    """Cartesian pendulum: x, y under x^2 + y^2 = L^2."""
    return library("PendulumCartesian")


# ---------------------------------------------------------------------------- creation


def test_the_library_says_what_it_is(pendulum):
    """FMI 2.0, default types."""
    assert pendulum.dll.fmi2GetVersion() == b"2.0"
    assert pendulum.dll.fmi2GetTypesPlatform() == b"default"


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"guid": b"{0}"}, "GUID is {0}"),
        ({"guid": b"100%s%n"}, "GUID is 100%s%n"),
        ({"name": b""}, "name is empty"),
        ({"name": None}, "name is empty"),
        ({"half": True}, "freeMemory one is missing"),
        ({"kind": 7}, "neither"),
        ({"room": False}, "no memory"),
    ],
)
def test_an_instance_that_cannot_be_is_null_with_a_reason(pendulum, options, part):
    """fmi2Instantiate returns NULL and tells why through the logger that it was given."""
    one = pendulum(**options)
    assert not one.handle
    assert [status for status, _, _ in one.log] == [ERROR]
    assert part in one.log[0][2]
    assert not one.blocks


def test_memory_is_one_block_and_is_given_back(pendulum):
    """One block in fmi2Instantiate, one in fmi2GetFMUstate; none while it is simulated."""
    one = pendulum()
    assert one.allocations == 1
    one.start()
    for _ in range(10):
        one.step(0.05)
        one.outputs()
    assert one.allocations == 1
    state = one.saved()
    one.saved(state)  # reused
    assert one.allocations == 2
    one.does("FreeFMUstate", byref(state))
    assert not state
    one.does("FreeFMUstate", byref(state))  # NULL is ignored
    one.does("Terminate")
    one.free()
    one.free()
    assert not one.blocks


def test_an_importer_may_leave_memory_to_the_fmu(pendulum):
    """Without the two callbacks it takes and gives back its own, states included, and runs alike."""
    one, other = pendulum(memory=False).start(), pendulum().start()
    state = one.saved()
    for _ in range(3):
        for each in (one, other):
            each.step(0.1)
    assert one.outputs() == other.outputs()
    assert one.allocations == 0
    one.does("FreeFMUstate", byref(state))
    one.does("Terminate")


# ---------------------------------------------------------------------------- life cycle


def test_calls_in_the_wrong_state_are_refused_and_change_nothing(pendulum):
    """Each returns fmi2Error with function and state in the log; the life goes on."""
    one, calm = pendulum(), pendulum().start()
    info = create_string_buffer(64)
    step = (c_double(0), c_double(0.1), 1)
    value = one.references(["lambda.rod"]), c_size_t(1), (c_double * 1)()
    early = [
        ("ExitInitializationMode", ()),
        ("Terminate", ()),
        ("DoStep", step),
        ("GetReal", value),
        ("CancelStep", ()),
        ("EnterEventMode", ()),
        ("SetTime", (c_double(0),)),
        ("NewDiscreteStates", (info,)),
        ("GetDerivatives", ((c_double * 4)(), c_size_t(4))),
        ("GetRealStatus", (2, byref(c_double()))),
    ]
    for function, arguments in early:
        text = one.refuses(function, *arguments)
        assert f"fmi2{function}" in text
        assert "'instantiated'" in text
    one.initializing()
    for function, arguments in (
        ("EnterInitializationMode", ()),
        ("SetupExperiment", (0, c_double(0), c_double(0), 0, c_double(0))),
        ("DoStep", step),
        ("Terminate", ()),
    ):
        assert "'initialization mode'" in one.refuses(function, *arguments)
    one.does("ExitInitializationMode")
    for function in ("EnterInitializationMode", "ExitInitializationMode", "EnterEventMode"):
        assert "'step complete'" in one.refuses(function)
    for each in (one, calm):
        each.step(0.1)
    assert one.outputs() == calm.outputs()
    one.does("Terminate")
    assert one.outputs() == calm.outputs()
    assert "'terminated'" in one.refuses("DoStep", c_double(0.1), c_double(0.1), 1)
    assert "'terminated'" in one.refuses("Terminate")
    one.does("Reset")
    one.start()
    one.step(0.1)
    assert one.outputs() == calm.outputs()


def test_null_is_no_instance(pendulum):
    """Every function returns fmi2Error for NULL; fmi2FreeInstance ignores it."""
    null = c_void_p()
    assert pendulum.dll.fmi2DoStep(null, c_double(0), c_double(1), 0) == ERROR
    assert pendulum.dll.fmi2GetReal(null, None, c_size_t(0), None) == ERROR
    assert pendulum.dll.fmi2Reset(null) == ERROR
    assert pendulum.dll.fmi2GetEventIndicators(null, None, c_size_t(0)) == ERROR
    pendulum.dll.fmi2FreeInstance(null)


def test_empty_arrays_are_fine_and_missing_ones_are_not(pendulum):
    """No values: NULL is allowed; one value: it is refused."""
    one = pendulum().start()
    for function in ("GetReal", "SetReal", "GetInteger", "SetBoolean", "GetString", "SetString"):
        one.does(function, None, c_size_t(0), None)
        assert "NULL" in one.refuses(function, None, c_size_t(1), None)


# ---------------------------------------------------------------------------- values


def test_values_that_cannot_be_are_refused(pendulum):
    """The name, the value and what was expected; nothing is set."""
    one = pendulum()
    for name, value, parts in (
        ("m", -1.0, ("'m' = -1.0", "bounds [0.0, inf]")),
        ("L", 0.0, ("'L' = 0.0", "positive")),
        ("x", math.nan, ("'x' = nan", "finite")),
        ("solver.tolerance", 2.0, ("bounds [0.0, 0.1]",)),
        ("lambda.rod", 1.0, ("'lambda.rod'", "calculated")),
    ):
        text = one.refuses("SetReal", *one.set_call(name, value))
        assert all(part in text for part in parts), text
    for number in (0, 9, -1):
        text = one.refuses("SetInteger", *one.method_call("solver.method", number))
        assert f"'solver.method' = {number}, expected one of 1 (auto), 2 (dop853)" in text
    text = one.refuses("SetString", one.references(["m"]), c_size_t(1), (c_char_p * 1)(b"a"))
    assert "is no String" in text
    assert "999 is no Real" in one.refuses(
        "SetReal", (c_uint * 1)(999), c_size_t(1), (c_double * 1)()
    )
    assert "is no Boolean" in one.refuses("SetBoolean", (c_uint * 1)(0), c_size_t(1), (c_int * 1)())
    unique = one.references(["unique.rod"]), c_size_t(1), (c_int * 1)(1)
    assert "calculated" in one.refuses("SetBoolean", *unique)
    pair = one.references(["m", "g"]), c_size_t(2), (c_double * 2)(7.0, math.inf)
    assert "'g' = inf" in one.refuses("SetReal", *pair)
    one.start()
    assert one.reals(["m", "g"]) == [1.0, 9.81]
    for name, value in (("m", 1.0 + 1e-15), ("x", one.get("x"))):
        text = one.refuses("SetReal", *one.set_call(name, value))
        assert "before the end of the initialization" in text


def test_a_fixed_parameter_takes_the_bits_that_it_has(pendulum):
    """Importers set parameters again before each step: m = 1, dop853, tolerance 0; nothing changes."""
    one = pendulum().start({"solver.method": "dop853"})
    one.step(0.1)
    before = one.outputs()
    for name, value in (("m", 1.0), ("solver.tolerance", 0.0), ("g", 9.81)):
        one.does("SetReal", *one.set_call(name, value))
    one.set("solver.method", "dop853")
    assert one.outputs() == before
    text = one.refuses("SetInteger", *one.method_call("solver.method", NUMBERS["rk4"]))
    assert "before the end of the initialization" in text
    text = one.refuses("SetReal", *one.set_call("solver.tolerance", -0.0))
    assert "before the end of the initialization" in text


def test_rattle_is_refused_where_it_is_none(library):
    """M(q), friction or an elimination: the symmetric method needs M constant and positions only."""
    for name, fits in (("PendulumCartesian", True), ("Hemisphere", False), ("KnifeEdge", False)):
        one = library(name)()
        arguments = one.method_call("solver.method", NUMBERS["rattle"])
        if fits:
            one.does("SetInteger", *arguments)
        else:
            assert "constant mass matrix" in one.refuses("SetInteger", *arguments)


def test_initialization_mode_shows_the_projected_start(pendulum):
    """x = 0.7, y = -0.8 miss the rod: what is read is on it, moved values are told once each."""
    one = pendulum().initializing()
    one.set("x", 0.7)
    one.set("y", -0.8)
    x, y = one.reals(["x", "y"])
    assert abs(x**2 + y**2 - 1) < 1e-15
    assert abs(x / y + 0.7 / 0.8) < 1e-12  # the nearest point lies on the same ray
    told = [text for status, category, text in one.log if category == "logStatusWarning"]
    assert any(text.startswith("start value x = 0.7 misses the constraints") for text in told)
    one.does("ExitInitializationMode")
    assert one.reals(["x", "y"]) == [x, y]


def test_what_can_be_set_can_be_read_from_the_beginning(pendulum):
    """As it was set, not yet projected; what is calculated is not there yet."""
    one = pendulum()
    one.set("x", 0.7)
    assert one.reals(["x", "m"]) == [0.7, 1.0]
    for name in ("lambda.rod", "energy.total"):
        arguments = one.references([name]), c_size_t(1), (c_double * 1)()
        assert "'instantiated'" in one.refuses("GetReal", *arguments)


# ---------------------------------------------------------------------------- logging


def test_categories_are_switched_one_by_one(pendulum):
    """Warnings are told if their category is on; switched on, a category is on alone; errors always;
    an unknown category is refused."""

    def warnings(one) -> int:
        one.does("Reset")
        count = len(one.log)
        one.start(tolerance=1e-20)
        return len(one.log) - count

    one = pendulum(logging=False)
    assert warnings(one) == 0
    names = (c_char_p * 1)(b"logStatusWarning")
    one.does("SetDebugLogging", 1, c_size_t(1), names)
    assert warnings(one) == 1
    one.does("SetDebugLogging", 0, c_size_t(1), names)
    assert warnings(one) == 0
    one.does("SetDebugLogging", 1, c_size_t(0), None)
    assert warnings(one) == 1
    one.does("SetDebugLogging", 0, c_size_t(1), names)
    assert warnings(one) == 0
    one.does("SetDebugLogging", 1, c_size_t(1), (c_char_p * 1)(b"logEvents"))
    assert warnings(one) == 0
    one.does("SetDebugLogging", 0, c_size_t(0), None)
    assert "calculated" in one.refuses("SetReal", *one.set_call("lambda.rod", 1.0))
    assert "'nonsense'" in one.refuses(
        "SetDebugLogging", 1, c_size_t(1), (c_char_p * 1)(b"nonsense")
    )


# ---------------------------------------------------------------------------- steps


def test_a_step_that_cannot_be_leaves_everything_as_it_was(pendulum):
    """Illegal ones are errors, hopeless ones are discarded; outputs and saved state are the same bytes."""
    one, calm = pendulum().start(stop=1.0), pendulum().start(stop=1.0)
    for each in (one, calm):
        each.step(0.1)
    before, state = one.outputs(), one.bytes_of(one.saved())
    for t, h, part in (
        (0.1, 0.0, "is 0.0 s"),
        (0.1, -0.1, "is -0.1 s"),
        (0.1, math.nan, "nan s"),
        (0.1, math.inf, "inf s"),
        (0.0, 0.1, "point is 0.0 s"),
        (math.nan, 0.1, "point is nan s"),
        (0.1, 0.91, "stop time 1.0 s"),
    ):
        assert part in one.refuses("DoStep", c_double(t), c_double(h), 1)
        assert one.bytes_of(one.saved()) == state
    assert "0.1" in one.refuses("DoStep", c_double(0.1), c_double(1e-300), 1, status=DISCARD)
    assert one.outputs() == before
    time, ended = c_double(), c_int(1)
    one.does("GetRealStatus", 2, byref(time))
    one.does("GetBooleanStatus", 3, byref(ended))
    # whoever tries the same step again would never end
    assert (time.value, ended.value) == (0.1, 1)
    for _ in range(9):
        for each in (one, calm):
            each.step(0.1)
    one.does("GetBooleanStatus", 3, byref(ended))
    assert ended.value == 0
    assert one.outputs() == calm.outputs()


def test_asynchronous_status_has_nothing_to_say(pendulum):
    """Steps are never pending: fmi2Discard, and fmi2CancelStep is an error."""
    one = pendulum().start()
    assert "never pending" in one.refuses("GetStatus", 0, byref(c_int()), status=DISCARD)
    assert "never pending" in one.refuses("GetStringStatus", 1, byref(c_char_p()), status=DISCARD)
    assert "never pending" in one.refuses("GetIntegerStatus", 0, byref(c_int()), status=DISCARD)
    assert "fmi2CancelStep" in one.refuses("CancelStep")


# ---------------------------------------------------------------------------- saved states


def test_a_state_saved_in_initialization_brings_back_what_was_set(pendulum):
    """Parameters, start values and the mode: an instance that has only been created takes them over."""
    one = pendulum()
    one.does("SetupExperiment", 1, c_double(1e-9), c_double(0), 0, c_double(0))
    one.set("m", 2.5)
    one.does("EnterInitializationMode")
    one.set("x", 0.8)
    one.set("y", -0.6)
    data = one.bytes_of(one.saved())
    other = pendulum()
    other.does("SetFMUstate", other.loaded(data))
    for each in (one, other):
        each.does("ExitInitializationMode")
        each.step(0.4)
    assert one.outputs() == other.outputs()
    assert other.get("m") == 2.5


def test_foreign_and_damaged_bytes_are_refused(library):
    """Of another FMU, cut short, altered, of no FMU; a Model Exchange state in co-simulation."""
    lib = library("PendulumCartesian")
    one = lib().start()
    one.step(0.1)
    data = one.bytes_of(one.saved())
    other = library("Hemisphere")().start()
    foreign = other.bytes_of(other.saved())
    altered = bytearray(data)
    altered[-9] ^= 1
    for wrong, part in (
        (foreign, "another FMU"),
        (data[:-8], "cut short"),
        (data[:20], "too few"),
        (b"", "too few"),
        (bytes(altered), "checksum"),
        (b"x" * len(data), "no saved state"),
    ):
        state = c_void_p()
        text = one.refuses("DeSerializeFMUstate", wrong, c_size_t(len(wrong)), byref(state))
        assert part in text
        assert not state
    assert "less room" in one.refuses(
        "SerializeFMUstate", one.saved(), create_string_buffer(8), c_size_t(8)
    )
    exchange = lib(kind=EXCHANGE).start()
    assert "other type" in exchange.refuses("SetFMUstate", one.saved())
    one.step(0.1)


# ---------------------------------------------------------------------------- derivatives


def continuous(lib) -> list[str]:
    """Continuous Real outputs."""
    return [
        n
        for n, v in lib.variables.items()
        if v.type == "Real" and v.causality == "output" and v.variability == "continuous"
    ]


def states_of(lib) -> list[str]:
    """State variables in the order of Model Exchange."""
    return [d.variable.derivative.name for d in lib.description.derivatives]


@pytest.mark.parametrize("name", MODELS)
def test_directional_derivatives_are_those_of_the_outputs(library, name):
    """Symbolic against central differences of every output along every state and input."""
    lib = library(name)
    one = lib(kind=EXCHANGE).start()
    one.goes_on()
    states, outputs = states_of(lib), continuous(lib)
    x = np.array(one.array("GetContinuousStates", len(states)))
    rng = np.random.default_rng(3)
    x = x + 0.05 * rng.normal(size=len(x))
    one.states(x)
    inputs = [n for n, v in lib.variables.items() if v.causality == "input"]
    base = one.reals(inputs)
    for k, known in enumerate([*states, *inputs]):
        found = np.array(one.directional(outputs, [known], [1.0]))
        sides = []
        h = 1e-6
        for side in (h, -h):
            if k < len(states):
                one.states(x + side * np.eye(len(x))[k])
            else:
                one.set(known, base[k - len(states)] + side)
            sides.append(np.array(one.outputs() if not outputs else one.reals(outputs)))
        one.states(x)
        for n, value in zip(inputs, base, strict=True):
            one.set(n, value)
        difference = (sides[0] - sides[1]) / (2 * h)
        np.testing.assert_allclose(
            found, difference, rtol=2e-8, atol=1e-7 * (1 + abs(difference).max()), err_msg=known
        )


@pytest.mark.parametrize("name", MODELS)
def test_output_derivatives_are_those_of_the_motion(library, name):
    """d/dt of every continuous output against central differences over steps of 1e-4 s."""
    lib = library(name)
    outputs = continuous(lib)
    one = lib().start(tolerance=1e-13)
    h = 1e-4
    for _ in range(3):
        one.step(0.05)
    before = np.array(one.reals(outputs))
    one.step(h)
    values = (c_double * len(outputs))()
    orders = (c_int * len(outputs))(*[1] * len(outputs))
    one.does(
        "GetRealOutputDerivatives", one.references(outputs), c_size_t(len(outputs)), orders, values
    )
    one.step(h)
    difference = (np.array(one.reals(outputs)) - before) / (2 * h)
    np.testing.assert_allclose(
        list(values), difference, rtol=1e-5, atol=1e-6 * (1 + abs(difference).max())
    )
    text = one.refuses(
        "GetRealOutputDerivatives",
        one.references(outputs[:1]),
        c_size_t(1),
        (c_int * 1)(2),
        (c_double * 1)(),
    )
    assert "derivative 2" in text


def test_derivatives_with_respect_to_parameters_are_refused(pendulum):
    """Known are states and inputs, before also start values and parameters; unknown are outputs."""
    one = pendulum().initializing()

    def ask(unknown, known):
        return one.refuses(
            "GetDirectionalDerivative",
            one.references([unknown]),
            c_size_t(1),
            one.references([known]),
            c_size_t(1),
            (c_double * 1)(1.0),
            (c_double * 1)(),
        )

    assert "'solver.tolerance'" in ask("lambda.rod", "solver.tolerance")
    one.does("ExitInitializationMode")
    assert "'m'" in ask("lambda.rod", "m")
    assert "'m'" in ask("m", "x")


# ---------------------------------------------------------------------------- inputs


def test_an_input_goes_on_by_its_derivatives(library):
    """F = 1 + 2 t + 3 t^2 / 2 given at the start of one step: its end and the motion are those of F(t)."""
    lib = library("CartPendulum")

    def run(steps: int, order: int) -> list[float]:
        one = lib().start(tolerance=1e-12)
        h = 0.4 / steps
        for k in range(steps):
            t = k * h
            one.set("F", 1 + 2 * t + 1.5 * t * t)
            for n, value in ((1, 2 + 3 * t), (2, 3.0)):
                if n <= order:
                    one.push("F", n, value)
            one.step(h)
        found = [one.get("F"), one.get("s"), one.get("der(s)")]
        return found

    exact = run(1, 2)
    assert exact[0] == pytest.approx(1 + 2 * 0.4 + 1.5 * 0.16, rel=1e-15)
    np.testing.assert_allclose(run(7, 2), exact, rtol=1e-10)
    error = [abs(run(n, 1)[1] - exact[1]) for n in (4, 8)]
    assert 3.4 < error[0] / error[1] < 4.6  # linear interpolation: second order
    held = [abs(run(n, 0)[1] - exact[1]) for n in (4, 8)]
    assert 1.6 < held[0] / held[1] < 2.4  # held: first order


def test_input_derivatives_last_until_the_input_is_set_again(library):
    """F given without a derivative after a step with one is held; the order of the two calls is free."""
    lib = library("CartPendulum")
    one = lib().start()
    one.push("F", 1, 5.0)
    one.set("F", 1.0)
    one.step(0.1)
    assert one.get("F") == pytest.approx(1.5, rel=1e-15)
    one.step(0.1)
    assert one.get("F") == pytest.approx(2.0, rel=1e-15)
    one.set("F", 3.0)
    one.step(0.1)
    assert one.get("F") == 3.0
    assert "'F' = nan" in one.refuses("SetReal", *one.set_call("F", math.nan))
    assert one.get("F") == 3.0
    for order in (0, 3):
        bad = one.references(["F"]), c_size_t(1), (c_int * 1)(order), (c_double * 1)(1.0)
        assert f"derivative {order} of 'F'" in one.refuses("SetRealInputDerivatives", *bad)


# ---------------------------------------------------------------------------- Model Exchange


def test_model_exchange_life_cycle(pendulum):
    """Event mode first, states only in continuous-time mode, no communication steps."""
    one = pendulum(kind=EXCHANGE).start()
    step = c_double(0), c_double(0.1), 1
    assert "'event mode' of a Model Exchange instance" in one.refuses("DoStep", *step)
    x = (c_double * 4)()
    assert "'event mode'" in one.refuses("SetContinuousStates", x, c_size_t(4))
    info = one.goes_on()
    assert (info.needed, info.terminate, info.values, info.defined) == (0, 0, 0, 0)
    assert info.nominals  # those of this start: the description has sizes of its own
    assert not one.meets_event().nominals
    assert "3 values" in one.refuses("GetDerivatives", x, c_size_t(3))
    assert "'continuous-time mode'" in one.refuses("NewDiscreteStates", byref(info))
    (c_double * 4).from_buffer(x)[0] = math.nan
    text = one.refuses("SetContinuousStates", x, c_size_t(4), status=DISCARD)
    assert "state 1 is nan" in text
    assert "nan s" in one.refuses("SetTime", c_double(math.nan))
    one.does("EnterEventMode")
    one.does("EnterContinuousTimeMode")
    one.does("Terminate")


@pytest.mark.parametrize("name", ["PendulumCartesian", "Gyroscope", "SliderCrankBodies"])
def test_continuous_states_are_set_one_by_one(library, name):
    """In Continuous-Time Mode SetReal of each state is SetContinuousStates of all (section 3.1), in whatever
    order and number of calls, of quaternions too; in Event Mode and in co-simulation it is refused."""
    lib = library(name)
    one, two = lib.continuous(), lib.continuous()
    states = states_of(lib)
    begun = one.array("GetContinuousStates", len(states))
    chance = random.Random(3)
    for _ in range(3):
        moved = [x + 1e-3 * chance.uniform(-1, 1) for x in begun]
        one.states(moved)
        for k in chance.sample(range(len(states)), len(states)):
            two.set(states[k], moved[k])
            assert two.get(states[k]) == moved[k]
        found = [i.array("GetDerivatives", len(states)) for i in (one, two)]
        assert found[0] == found[1]
        assert one.outputs() == two.outputs()
    for k in range(len(states)):  # what is not set again stays, though it was evaluated
        moved[k] += 1e-3
        one.states(moved)
        two.set(states[k], moved[k])
        found = [i.array("GetDerivatives", len(states)) for i in (one, two)]
        scale = np.abs(found[0]).max()
        np.testing.assert_allclose(found[1], found[0], rtol=1e-12, atol=1e-12 * scale)
    text = two.refuses("SetReal", *two.set_call(states[0], math.nan))
    assert "expected a finite number" in text
    two.does("EnterEventMode")
    for each in (two, lib().start()):
        text = each.refuses("SetReal", *each.set_call(states[0], begun[0] + 1))
        assert "before the end of the initialization" in text


@pytest.mark.parametrize("name", MODELS)
def test_model_exchange_and_co_simulation_are_one_model(library, name):
    """At the start: states, derivatives and all outputs agree bit for bit."""
    lib = library(name)
    one, two = lib().start(), lib(kind=EXCHANGE).start()
    states = states_of(lib)
    rates = [d.variable.name for d in lib.description.derivatives]
    assert two.array("GetContinuousStates", len(states)) == one.reals(states)
    assert one.outputs() == two.outputs()
    np.testing.assert_allclose(
        two.array("GetDerivatives", len(states)), one.reals(rates), rtol=1e-13, atol=1e-13
    )
    assert all(s > 0 for s in two.array("GetNominalsOfContinuousStates", len(states)))


def test_an_event_opens_the_contact_where_the_surface_would_pull(library):
    """Past cos(theta) = 2/3 lambda is negative: the indicator says so, the event opens the contact, and
    moves nothing, for the particle is on the surface."""
    lib = library("Hemisphere")
    one = lib(kind=EXCHANGE).start()
    one.goes_on()
    r, theta, rate = 1.0, 0.85, math.sqrt(2 * 9.81 * (1 - math.cos(0.85)))
    one.does("SetTime", c_double(1.7))
    one.states([r, 0.0, theta, rate])
    (lam,) = one.array("GetEventIndicators", 1)
    assert lam == pytest.approx(one.get("lambda.surface"))
    assert lam < 0
    one.does("EnterEventMode")
    info = one.goes_on()
    assert (info.values, info.needed) == (1, 0)  # the equations changed: integrators begin anew
    assert one.array("GetContinuousStates", 4) == [r, 0.0, theta, rate]
    (gap,) = one.array("GetEventIndicators", 1)
    assert 0 < gap < 1e-6
    assert one.get("lambda.surface") == 0.0
    assert one.get("departure.surface.time") == 1.7
    assert one.get("departure.surface.theta") == theta


def test_a_state_far_off_the_constraint_is_projected_in_an_event(pendulum):
    """A rod that is 1 % too long: fmi2CompletedIntegratorStep asks for an event, which puts it right."""
    one = pendulum(kind=EXCHANGE).start()
    one.goes_on()
    x = one.array("GetContinuousStates", 4)
    assert not one.asks_for_event()
    one.states([x[0] * 1.01, x[1], x[2] * 1.01, x[3]])
    assert one.asks_for_event()
    one.does("EnterEventMode")
    assert one.events().values == 1
    assert abs(one.get("residual.rod")) < 1e-15
    assert one.events().values == 0


def test_the_drift_is_pulled_back_without_stiffness(pendulum):
    """The derivatives of a state off the rod by d lead back to it; lambda is not touched by that."""
    one = pendulum(kind=EXCHANGE).start()
    one.goes_on()
    x = one.array("GetContinuousStates", 4)
    on = one.array("GetDerivatives", 4)
    one.states([x[0] * (1 + 1e-6), x[1], x[2] * (1 + 1e-6), x[3]])
    off = one.array("GetDerivatives", 4)
    radial = (off[1] - on[1]) * x[0] + (off[3] - on[3]) * x[2]
    assert -1e-3 < radial < -1e-6
    vdot = one.reals(["der(x,2)", "der(y,2)"])
    assert abs(vdot[0] - on[1]) < 1e-4
