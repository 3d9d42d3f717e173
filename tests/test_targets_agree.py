"""One truth: what the python FMU of a model says, its native FMU says too, along whole runs.

Two values agree when they differ by less than 1e-9 of the variable's scale: its largest magnitude over
the run.  An energy is measured by the largest energy (a total may be what is left of two large ones), an
acceleration at least by the largest speed over the time of the run (it may be zero), and a residual,
which is rounding and nothing else, by the energy over the multiplier, whose ratio has its unit.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import BOTH, of_each_kind
from instance import instance
from test_models import CHANGED

from lagfmu import simulate

POINTS = 40  # communication points of a run
AGREE = 1e-9
TOLERANCE = 1e-11
CLOSER = {
    "SliderCrank": 1e-13,  # a spring of 1e6 N/m pulls by a difference of two places known to the tolerance
    "Chain": 1e-12,  # its links swing over: a small error grows, as that of the double pendulum
}
FORGETS = {  # s: changed, a speed that differs by 1e-10 changes accelerations by 1e-9 then, 1e-5 after 10 s
    "DoublePendulum": 2.0
}
TURNED = {"SliderCrank": 0.3}  # s: half a turn, for the reference engine is slow where it is stiff


def scales(run: Any) -> dict[str, float]:
    """The scale of every Real output, as the module says; of the others 0: they must be equal."""
    largest = {
        n: float(np.abs(run[n]).max()) if run[n].dtype.kind == "f" else 0.0 for n in run.dtype.names
    }
    energy = max((s for n, s in largest.items() if n.startswith("energy.")), default=0.0)
    for n in largest:
        if n.startswith("energy."):
            largest[n] = energy
        elif n.endswith(",2)"):
            speed = largest[n.replace(",2)", ")")]
            largest[n] = max(largest[n], speed / float(run["time"][-1]))
        elif n.startswith("residual."):
            multiplier = largest[n.replace("residual.", "lambda.")]
            largest[n] = energy / multiplier if multiplier else energy
        elif n.startswith(("departure.", "closing.")):  # of its coordinate
            _, _, *rate, of = n.split(".")
            largest[n] = max(largest[n], largest.get(f"der({of})" if rate else of, 0.0))
    return largest


def disagreement(expected: Any, found: Any) -> dict[str, float]:
    """Largest difference of every output in its scale; infinite if what must be equal is not."""
    worst = {}
    for n, scale in scales(expected).items():
        if n == "solver.steps":  # each has its own
            continue
        if scale:
            worst[n] = float(np.abs(expected[n] - found[n]).max()) / scale
        else:
            worst[n] = 0.0 if np.array_equal(expected[n], found[n]) else float("inf")
    return worst


def check(expected: Any, found: Any, agree: float = AGREE) -> None:
    """All outputs agree."""
    worst = disagreement(expected, found)
    assert max(worst.values()) < agree, sorted(worst.items(), key=lambda x: -x[1])[:3]


def both(python_fmu, native_fmu, name: str, values: dict[str, Any], **options: Any) -> list[Any]:
    return [simulate(fmu(name), start_values=values, **options) for fmu in (python_fmu, native_fmu)]


@pytest.mark.parametrize(
    ("name", "changed"),
    [
        *of_each_kind(BOTH, True, label="changed"),
        *of_each_kind(BOTH, False, label="described", kinds=("Hemisphere", "CartPendulum")),
    ],
)
def test_both_tell_the_same_motion(python_fmu, native_fmu, name, changed):
    """All outputs at 41 instants: positions, velocities, accelerations, lambda, Q and each constraint's
    share in it, energies, and of every contact its mode and the time, place and speed of its departure."""
    values = CHANGED[name] if changed else {}
    tolerance = CLOSER.get(name, TOLERANCE)
    stop = TURNED.get(name, float(simulate_stop(native_fmu(name))))
    if changed:
        stop = FORGETS.get(name, stop)
    run = {"tolerance": tolerance, "stop_time": stop, "step_size": stop / POINTS}
    expected, found = both(python_fmu, native_fmu, name, values, **run)
    assert expected.dtype.names == found.dtype.names
    assert len(found) == len(expected) == POINTS + 1
    check(expected, found)
    events = ("departure.", "closing.")
    ended = [n for n in found.dtype.names if n.startswith(events) and n.endswith(".time")]
    for n in ended:  # an event's time, of itself
        np.testing.assert_allclose(found[n], expected[n], rtol=AGREE)


def simulate_stop(path: Path) -> str:
    with zipfile.ZipFile(path) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    return root.find("DefaultExperiment").get("stopTime")


@pytest.mark.parametrize("name", ["Hemisphere", "RollingSphere", "Loop", "Ladder"])
def test_both_meet_the_same_events_at_coarse_and_fine_steps(python_fmu, native_fmu, name):
    """Departures are no matter of who looks when: the same count, time and state to 1e-9 whether the
    one is asked a hundred times and the other once."""
    stop = float(simulate_stop(native_fmu(name)))
    ends = []
    for path, step in ((python_fmu(name), stop), (native_fmu(name), stop / 100)):
        ends.append(simulate(path, tolerance=TOLERANCE, stop_time=stop, step_size=step)[-1])
    events = [n for n in ends[0].dtype.names if n.startswith("departure.")]
    assert any(ends[0][n] > 0 for n in events if n.endswith(".count"))
    for n in events:
        assert ends[1][n] == pytest.approx(ends[0][n], rel=AGREE, abs=AGREE), n


@pytest.mark.parametrize(
    "name", of_each_kind(["Hemisphere", "CartPendulum"], kinds=("CartPendulum",))
)
def test_both_are_stiff_alike(python_fmu, native_fmu, name):
    """At 1e-11 radau tells the same motion in both."""
    values = {"solver.method": "radau"}
    run = {"tolerance": TOLERANCE, "stop_time": 0.5, "step_size": 0.25}
    check(*both(python_fmu, native_fmu, name, values, **run))


def driven(path: Path, variable: str, drive: Any, step: float, count: int) -> Any:
    """Outputs after each step, the input being set to drive(t) before it."""
    with instance(path) as one:
        one.start({variable: drive(0.0)}, tolerance=TOLERANCE)
        seen = [one.outputs()]
        for k in range(count):
            one.set(variable, drive(k * step))
            one.step(step)
            seen.append(one.outputs())
    columns = {n: np.array([s[n] for s in seen]) for n in seen[0]}
    run = np.zeros(len(seen), dtype=[("time", float), *((n, c.dtype) for n, c in columns.items())])
    run["time"] = np.arange(count + 1) * step
    for n, c in columns.items():
        run[n] = c
    return run


def test_both_follow_an_input_that_jumps(python_fmu, native_fmu):
    """A cart pushed to and fro: the push is set anew at every communication point and held."""
    drive = ("F", lambda t: 5 * np.sin(3 * t), 0.05, 60)
    expected, found = (driven(fmu("CartPendulum"), *drive) for fmu in (python_fmu, native_fmu))
    check(expected, found)
    assert np.ptp(expected["s"]) > 0.1


def test_both_refuse_the_same_starts(python_fmu, native_fmu):
    """A pendulum at its pivot has no direction to go; both say which constraint is missed."""
    texts = []
    for fmu in (python_fmu, native_fmu):
        with instance(fmu("PendulumCartesian")) as one:
            with pytest.raises(Exception, match="status"):
                one.start({"x": 0.0, "y": 0.0})
            texts.append(next(text for status, _, text in one.log if status >= 2))
    assert "'rod' by -1" in texts[0]
    assert "'rod' by -1" in texts[1]
