"""Two FMUs of FMI 3.0 that a master couples, a rubbing block and the drive of its belt, against one."""

from __future__ import annotations

import numpy as np
import pytest
from coupled_belt import STOP, block, drive, whole
from master import Coupling, error

from lagfmu import simulate
from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


@pytest.fixture(scope="module")
def truth(built):
    """The run of both as one model."""
    return simulate(built(whole), stop_time=STOP, step_size=STOP, tolerance=1e-12)


@pytest.fixture(scope="module")
def sides(built, library3):
    """The two FMUs."""
    return tuple(library3(built(model, fmi=3)) for model in (drive, block))


def order(steps, errors) -> float:
    """The slope of log(error) over log(step) by least squares."""
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def test_with_event_mode_the_coupling_has_the_order_of_what_it_exchanges(sides, truth):
    """The force between the FMUs is a straight line in each step: the error falls with h^2, across a slip and
    a stick too."""
    steps = 0.016, 0.008, 0.004
    x = truth["x"][-1]
    errors = [error(sides, x, STOP, h, events=True, places=1) for h in steps]
    assert order(steps, errors) == pytest.approx(2, abs=0.1)
    assert errors[-1] < 1e-5 * truth["slipping.grip.x"][-1]


def test_without_event_mode_a_jump_of_the_friction_costs_an_order(sides, truth):
    """The line leads over the jump from mu_s N to mu_k N: the error falls with h alone."""
    steps = 0.016, 0.008, 0.004
    x = truth["x"][-1]
    errors = [error(sides, x, STOP, h, events=False, places=4) for h in steps]
    assert order(steps, errors) == pytest.approx(1, abs=0.2)
    assert errors[-1] > 1000 * error(sides, x, STOP, steps[-1], events=True, places=1)


def test_both_stop_at_the_events_of_one(sides, truth):
    """The master meets the slip and the stick of the monolith once each, at their times to the coupling's
    error, and both FMUs stand there."""
    coupling = Coupling(*sides, events=True)
    coupling.run(STOP, 0.004, first=0.004)
    times = [truth[f"{event}.grip.time"][-1] for event in ("slipping", "sticking")]
    assert coupling.met == pytest.approx(times, abs=1e-6)
    assert coupling.drive.one.time == coupling.block.one.time
    for event in ("slipping", "sticking"):
        assert (
            truth[f"{event}.grip.count"][-1] == coupling.block.one.get(f"{event}.grip.count") == 1
        )
