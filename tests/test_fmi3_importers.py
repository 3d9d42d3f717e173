"""FMUs of FMI 3.0 in importers that are not ours: the event, seen from outside."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import importers
import mpmath
import numpy as np
import pytest
from conftest import Fmu

from lagfmu.testing import Face, Prepared, write

G, THETA = 9.81, 0.01  # m/s^2, rad: of the hemisphere, a = 1 m
TIGHT = 1e-12


def departure() -> float:
    """When the particle leaves [s]: cos theta = (2/3) cos theta0 in
    t = sqrt(a/g) int du / sqrt(1 - k^2 cosh^2 u), k = sin(theta0/2), k cosh u = sin(theta/2)."""
    theta, k = mpmath.mpf(THETA), mpmath.sin(mpmath.mpf(THETA) / 2)
    last = mpmath.acosh(mpmath.sin(mpmath.acos(2 * mpmath.cos(theta) / 3) / 2) / k)
    area = mpmath.quad(
        lambda u: 1 / mpmath.sqrt(1 - (k * mpmath.cosh(u)) ** 2), [0, last / 2, last]
    )
    return float(area / mpmath.sqrt(mpmath.mpf(G)))


def test_fmpy_stops_at_the_departure(fmi3_fmu: Fmu) -> None:
    """With a communication step of 0.1 s there is a point at the departure: lambda = 0, and free flight from
    there."""
    run = fmpy.simulate_fmu(
        str(fmi3_fmu("Hemisphere")),
        fmi_type="CoSimulation",
        use_event_mode=True,
        early_return_allowed=True,
        output_interval=0.1,
        relative_tolerance=TIGHT,
    )
    off = run["time"] / 0.1 % 1.0
    (at,) = set(run["time"][np.minimum(off, 1 - off) > 1e-6])
    assert abs(at - departure()) < 1e-12 * at
    before, after = run[run["time"] == at]  # it is read before the event and after it
    assert bool(before["contact.surface"])
    assert not after["contact.surface"]
    assert abs(before["lambda.surface"]) < 1e-14 * 9.81  # rounding of m g
    assert after["lambda.surface"] == 0.0
    flight = run[run["time"] >= at][1:]
    x = flight["r"] * np.sin(flight["theta"])
    speed = after["der(theta)"] * after["r"] * np.cos(after["theta"])
    assert np.abs(x - x[0] - speed * (flight["time"] - at)).max() < 1e-10
    assert len(flight) > 3


def test_a_clock_ticks_at_the_departure(
    prepared: Callable[[str], Prepared], tmp_path: Path
) -> None:
    """fmuloader drives the clock: in event mode at the departure it is active once, and the contact is closed
    before and open after."""
    fmi3 = pytest.importorskip("fmuloader.fmi3")
    face = Face(3, clocks=True)
    path = write(prepared("Hemisphere"), tmp_path, target="native", face=face)
    description = fmpy.read_model_description(str(path))
    of = {v.name: v.valueReference for v in description.modelVariables}
    slave = fmi3.Fmi3Slave(path, model_identifier="Hemisphere")
    slave.instantiate_co_simulation(
        "hemisphere",
        instantiation_token=description.guid,
        event_mode_used=True,
        early_return_allowed=True,
    )
    slave.enter_initialization_mode(start_time=0.0, tolerance=TIGHT)
    slave.exit_initialization_mode()

    def go_on() -> None:
        while slave.update_discrete_states().discrete_states_need_update:
            pass
        slave.enter_step_mode()

    go_on()
    time, ticks = 0.0, []
    while time < 2.0 - 1e-9:
        step = slave.do_step(time, min(0.1, 2.0 - time))
        time = step.last_successful_time
        if step.event_handling_needed:
            closed = slave.get_boolean([of["contact.surface"]])
            slave.enter_event_mode()
            active = slave.get_clock([of["clock.surface"]])
            go_on()
            ticks.append((time, closed, active, slave.get_boolean([of["contact.surface"]])))
    slave.terminate()
    slave.free_instance()
    ((at, closed, active, still),) = ticks
    assert abs(at - departure()) < 1e-12 * at
    assert (closed, active, still) == ([True], [True], [False])


def test_ecos_gives_the_numbers_of_fmi_2(native_fmu: Fmu, fmi3_fmu: Fmu) -> None:
    """A C++ engine that imports both: the same values at the same points."""
    read = [("h", n) for n in ("theta", "lambda.surface", "departure.surface.time")]
    found = [
        importers.run("ecos", {"h": fmu("Hemisphere")}, read, 0.01, 200, {"h": {"theta": 0.3}})
        for fmu in (native_fmu, fmi3_fmu)
    ]
    for n in read:
        assert found[0][n].tobytes() == found[1][n].tobytes()
    assert found[0][read[2]][-1] > 0.4


def test_a_change_of_the_equations_begins_an_integrator_anew(fmi3_fmu: Fmu) -> None:
    """Model exchange: where the particle leaves, its states stay; they are said to have changed all
    the same, for fmusim's CVODE goes on from beyond the event otherwise, by the old equations, and fails."""
    fmi3 = pytest.importorskip("fmuloader.fmi3")
    path = fmi3_fmu("Hemisphere")
    description = fmpy.read_model_description(str(path))
    of = {v.name: v.valueReference for v in description.modelVariables}
    model = fmi3.Fmi3Slave(path, model_identifier="Hemisphere")
    model.instantiate_model_exchange("hemisphere", instantiation_token=description.guid)
    model.enter_initialization_mode(start_time=0.0)
    model.exit_initialization_mode()
    while model.update_discrete_states().discrete_states_need_update:
        pass
    model.enter_continuous_time_mode()
    beyond = 0.85  # rad: cos theta < 2/3
    speed = np.sqrt(2 * G * (np.cos(THETA) - np.cos(beyond)))
    model.set_time(1.65)
    model.set_continuous_states([1.0, 0.0, beyond, speed])
    model.enter_event_mode()
    assert model.update_discrete_states().values_of_continuous_states_changed
    assert model.get_boolean([of["contact.surface"]]) == [False]
    assert model.get_continuous_states(4) == [1.0, 0.0, beyond, speed]
    assert not model.update_discrete_states().values_of_continuous_states_changed
    model.terminate()
    model.free_instance()


@pytest.mark.parametrize(
    "way", ["cs", "cs --event-mode-used --early-return-allowed", "me --solver cvode"]
)
def test_fmusim_finds_the_departure(fmi3_fmu: Fmu, tmp_path: Path, way: str) -> None:
    """fmusim (Reference-FMUs, to be built from its sources), where it is on the path."""
    program = shutil.which("fmusim")
    if program is None:
        pytest.skip("fmusim is not on the path")
    table = tmp_path / "out.csv"
    settings = "--tolerance 1e-10 --output-interval 0.1 --output-variable departure.surface.time"
    command = [program, "--interface-type", *way.split(), *settings.split()]
    command += ["--output-file", str(table), str(fmi3_fmu("Hemisphere"))]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    rows = np.genfromtxt(table, delimiter=",", names=True)
    assert rows["time"][-1] == 2.0
    assert abs(rows["departuresurfacetime"][-1] - departure()) < 1e-8


def test_the_example_of_the_documentation_stops_at_the_departure(
    fmi3_fmu: Fmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The lines of docs/fmi3.md, as they stand, with the FMU where they look: they print the points at
    1.6 s, twice at the departure, and at 1.7 s."""
    text = (Path(__file__).parent.parent / "docs" / "fmi3.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    (path,) = re.findall(r'"(.*\.fmu)"', block)
    (tmp_path / path).parent.mkdir(parents=True)
    shutil.copy(fmi3_fmu("Hemisphere"), tmp_path / path)
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    exec(block, names)
    shown = names["result"][16:20]
    np.testing.assert_allclose(shown["time"], [1.6, departure(), departure(), 1.7], rtol=1e-9)
    assert np.abs(shown["lambda.surface"][1:]).max() < 1e-13
    assert shown["contact.surface"].tolist() == [True, True, False, False]
