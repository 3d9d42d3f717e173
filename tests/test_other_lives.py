"""What an instance has lived through before leaves no trace: not where it takes over another's state, and
not after a reset."""

from __future__ import annotations

from ctypes import c_double

import pytest
from fmi2 import Single
from single import ERROR
from zoo.forces import candle

LIVES = {  # when the state is saved [s], and another life: its parameters and how long it lasts [s]
    "BouncingBall": (0.6, {"e": 0.0, "y": 0.2}, 2.0),  # rises again; lies on the floor
    "Hemisphere": (0.5, {"theta": 0.5}, 2.0),  # slides; has left
    "CartPendulum": (0.4, {"L": 2.0}, 0.9),
    "SlippingSphere": (0.3, {"theta": 0.6}, 1.0),
}


def warnings(one: Single) -> int:
    return sum("prescribed motion" in text for _, _, text in one.log)


@pytest.mark.parametrize("name", LIVES)
def test_a_state_goes_on_alike_wherever_it_is_taken_over(library, name):
    """By an instance in another mode, at another time, of another tolerance and other parameters: the same
    bits at each of ten points."""
    moment, values, age = LIVES[name]
    one = library(name)().start(tolerance=1e-8)
    other = library(name)().start(values, tolerance=1e-4)
    one.step(moment)
    one.outputs()
    other.step(age)
    other.outputs()
    other.takes_over(one)
    for _ in range(10):
        assert other.outputs() == one.outputs()
        for each in (one, other):
            each.step(0.11)


def test_a_run_that_must_not_pass_its_stop_time_does_so_nowhere(built, library):
    """Its force is not defined beyond 1 s: not in an instance either whose own experiment had no end."""
    burning = library(built(candle()))
    one, other = burning().start(None, 1e-9, 1.0), burning().start(None, 1e-9, 100.0)
    for each in (one, other):
        each.step(0.25)
    other.takes_over(one)
    for _ in range(3):
        for each in (one, other):
            each.step(0.25)
        assert other.outputs() == one.outputs()


def test_half_an_inputs_polynomial_is_completed_where_its_state_is(library):
    """F = 3 + 4 t + 5 t^2/2: of what belongs to one point of time the rest is set after the state was taken
    over; as if all had been set at once."""
    one, other, right = (library("CartPendulum")().start() for _ in range(3))
    for each in (one, right):
        each.step(0.2)
        each.set("F", 3.0)
        each.push("F", 1, 4.0)
    other.takes_over(one)
    for each in (one, other, right):
        each.push("F", 2, 5.0)
        each.step(0.4)
    assert one.outputs() == right.outputs()
    assert other.outputs() == right.outputs()


def move(one: Single, rates: bool) -> None:
    """The crane's rope as it should be at this time, with its rates or without, and a step."""
    time = one.time
    one.set("l", 1.0 + 0.1 * time + 0.3 * time**2)
    if rates:
        one.set("der(l)", 0.1 + 0.6 * time)
        one.set("der(l,2)", 0.6)
    one.step(0.125)


def test_a_warning_that_was_given_belongs_to_the_state(library):
    """A rope whose rates are not connected is warned of once; a state from before brings that back, one
    from behind it does not; and a rope that is connected is never warned of, wherever its state goes on."""
    one, fresh = (library("Crane")().start({"l": 1.0}) for _ in range(2))
    before = one.saved()
    move(one, rates=False)
    move(one, rates=False)
    assert warnings(one) == 1
    fresh.takes_over(one)
    move(fresh, rates=False)
    assert warnings(fresh) == 0
    one.does("SetFMUstate", before)
    one.time = 0.0
    move(one, rates=False)
    move(one, rates=False)
    assert warnings(one) == 2
    right, other = (library("Crane")().start({"l": 1.0, "der(l)": 0.1}) for _ in range(2))
    move(right, rates=True)
    move(right, rates=True)
    other.takes_over(right)
    move(other, rates=True)
    assert warnings(right) == warnings(other) == 0


def test_settings_that_were_set_belong_to_the_state(library):
    """solver.tolerance and solver.step read as they were where the state was saved."""
    one = library("PendulumCartesian")().start({"solver.tolerance": 1e-4, "solver.step": 0.01})
    other = library("PendulumCartesian")().start({"solver.tolerance": 1e-9})
    other.takes_over(one)
    assert other.reals(["solver.tolerance", "solver.step"]) == [1e-4, 0.01]


def test_a_reset_leaves_nothing_of_the_experiment_before(library):
    """Neither stop time, nor tolerance, nor settings of the solver: the bits of a new instance."""
    used, new = (library("PendulumCartesian")() for _ in range(2))
    used.start({"solver.method": "rk4", "solver.step": 0.01}, tolerance=1e-3, stop=0.5)
    used.step(0.5)
    used.does("Reset")
    for one in (used, new):
        one.does("SetupExperiment", 0, c_double(0), c_double(0), 0, c_double(0))
        one.does("EnterInitializationMode")
        one.does("ExitInitializationMode")
        one.time = 0.0
        one.step(1.0)
    assert used.outputs() == new.outputs()


def test_a_motion_that_was_looked_at_does_not_reopen_what_has_ended(library):
    """The rope is set anew and its force read, the run is ended and the state saved: no step follows."""
    one = library("Crane")().start({"l": 1.0})
    one.step(0.1)
    one.set("l", 1.05)
    one.outputs()
    one.does("Terminate")
    one.saved()
    assert one.call("DoStep", c_double(one.time), c_double(0.1), 1) == ERROR


def test_an_input_set_after_a_look_moves_the_start(library):
    """In initialization mode the rope is given another length, before or after its force was read."""
    found = []
    for look in (False, True):
        one = library("Crane")()
        one.initializing()
        if look:
            one.outputs()
        one.set("l", 1.4)
        found.append(one.outputs())
        one.does("ExitInitializationMode")
        found.append(one.outputs())
    assert all(seen == found[0] for seen in found)


def test_an_input_goes_on_from_the_start_of_the_experiment(library):
    """F = 3 + 4 (t - 5 s) in an experiment that begins at 5 s moves the cart as F = 3 + 4 t does from 0."""
    ends = []
    for begin in (0.0, 5.0):
        one = library("CartPendulum")()
        one.initializing(begin=begin)
        one.set("F", 3.0)
        one.push("F", 1, 4.0)
        one.does("ExitInitializationMode")
        one.step(0.5)
        ends.append(one.outputs())
    assert ends[1] == pytest.approx(ends[0], rel=1e-8, abs=1e-8)
