"""Model exchange with importers that locate no event: fixed steps, at whose ends it is seen."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest
from fixed_step import euler, rk4, run

from lagfmu import simulate
from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

# what is looked at and when, how fast it moves at most, and what happens on the way
CASES = {
    "Belt": ("x", 1.0, 0.4, {"slipping.grip.count": 2}),
    "Hemisphere": ("theta", 1.4, 4.0, {"departure.surface.count": 1}),
    "BouncingBall": ("y", 1.6, 4.5, {}),
    "Ladder": ("theta", 0.75, 4.0, {"departure.wall.count": 1, "departure.floor.count": 0}),
    "SlippingSphere": (
        "theta",
        1.9,
        4.0,
        {"slipping.grip.count": 1, "departure.surface.count": 1},
    ),
    "HalfCar": ("z", 0.9, 0.5, {"departure.front.count": 1, "departure.rear.count": 1}),
}
STEPS = {euler: (4e-3, 1e-3, 1.25e-4), rk4: (1e-2, 2e-3, 2.5e-4)}
STARTS = {"Hemisphere": {"theta": 0.1}}


@pytest.mark.parametrize("method", [euler, rk4])
@pytest.mark.parametrize("name", CASES)
def test_an_importer_that_brackets_events_to_a_step_converges(name, method, library, native_fmu):
    """Euler's and Runge's steps of h: at every h the error is at most one and a half of h times the
    speed, and the same slips and departures are met as in co-simulation.  An event is over in its step."""
    quantity, stop, speed, happened = CASES[name]
    start = STARTS.get(name, {})
    ours = simulate(native_fmu(name), stop, stop, tolerance=1e-11, start_values=start)
    rows = []
    for h in STEPS[method]:
        ended = run(library(name), method, round(stop / h), stop, [quantity, *happened], start)
        error = float(abs(ended[quantity] - ours[quantity][-1]))
        rows.append((h, error, ended.events))
        assert {n: ended[n] for n in happened} == happened
    order = np.log(rows[0][1] / rows[-1][1]) / np.log(rows[0][0] / rows[-1][0])
    told = [f"h = {h:g} s: {error:.1e} in {events} events" for h, error, events in rows]
    print(name, method.__name__, *told, f"order {order:.1f}", sep="; ")
    assert all(error < 1.5 * speed * h for h, error, _ in rows), rows
    assert rows[-1][2] < 100, rows


@pytest.mark.parametrize(
    ("name", "stop"), [("BouncingBall", 1.6), ("Ladder", 1.2), ("FallingRod", 0.7)]
)
def test_what_is_lost_is_counted(name, stop, library):
    """Runge's method conserves energy to the fourth order of its step, and so do energy.total and
    energy.dissipated together: through impacts, slides, and all that is set back at an event."""
    quantities = ["energy.total", "energy.dissipated"]
    before = run(library(name), rk4, 0, stop, quantities)
    after = run(library(name), rk4, 1000, stop, quantities)
    assert before["energy.dissipated"] == 0
    assert after["energy.dissipated"] > 0.005
    assert sum(after.values.values()) == pytest.approx(before["energy.total"], rel=1e-9)


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_each_bounce_takes_its_part_of_the_energy(e, native_fmu):
    """m v^2/2 (1 - e^2) with the speed v before it, e^k sqrt(2 g h): of a ball from 1 m, two bounces
    in a second leave e^4 of the energy."""
    ours = simulate(native_fmu("BouncingBall"), 1.0, 0.01, start_values={"e": e})
    expected = 9.81 * (1 - e**4)
    assert ours["energy.dissipated"][-1] == pytest.approx(expected, rel=1e-9, abs=1e-12)
    assert (np.diff(ours["energy.dissipated"]) >= -1e-14).all()
    total = ours["energy.total"] + ours["energy.dissipated"]
    np.testing.assert_allclose(total, 9.81, rtol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-5, 1e-9])
@pytest.mark.parametrize("name", ["HalfCar", "Ladder", "FallingRod"])
def test_an_importers_integrator_counts_what_co_simulation_counts(name, tolerance, native_fmu):
    """fmpy's CVODE: what carries a load does not open because the velocities have drifted."""
    path = native_fmu(name)
    ours = simulate(path, tolerance=1e-9)
    counts = [n for n in ours.dtype.names if n.endswith(".count")]
    theirs = fmpy.simulate_fmu(
        str(path),
        fmi_type="ModelExchange",
        stop_time=ours["time"][-1],
        output_interval=0.01,
        relative_tolerance=tolerance,
        output=counts,
    )
    assert sum(ours[n][-1] for n in counts) > 0
    assert {n: theirs[n][-1] for n in counts} == {n: ours[n][-1] for n in counts}
