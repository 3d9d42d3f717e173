"""Native FMUs of FMI 3.0: the simulation of FMI 2.0 behind another interface."""

from __future__ import annotations

import itertools
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
import runs
from conftest import FILES, MODELS, Fmu, of_each_kind
from fmpy.build import build_platform_binary
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from runtime import RUNTIME_FILES, compiler
from typer.testing import CliRunner

import lagfmu
from lagfmu.testing import Face, Plan, Prepared, RefusalError, Session, app, run_batch, write

COMBINATIONS = list(itertools.product((False, True), repeat=2))  # event mode, early return
COLUMNS = ("r", "theta", "der(theta)", "lambda.surface")
FEW = ("Hemisphere", "SlippingSphere", "CartPendulum")  # a contact, frictions, an input


def same_bits(a: Any, b: Any) -> bool:
    """Whether all columns of a run are those of another."""
    return a.dtype.names == b.dtype.names and all(
        a[n].tobytes() == b[n].tobytes() for n in a.dtype.names
    )


@pytest.mark.parametrize("name", of_each_kind(FILES, kinds=FEW))
def test_the_numbers_are_those_of_fmi_2(native_fmu: Fmu, fmi3_fmu: Fmu, name: str) -> None:
    """All outputs at all communication points, bit for bit."""
    assert same_bits(lagfmu.simulate(native_fmu(name)), lagfmu.simulate(fmi3_fmu(name)))


@pytest.mark.parametrize("name", of_each_kind(FILES, kinds=FEW))
def test_it_is_as_large_as_that_of_fmi_2(native_fmu: Fmu, fmi3_fmu: Fmu, name: str) -> None:
    """To 5 %: equations and their derivatives stand in both, none is written once more for adjoints."""
    assert fmi3_fmu(name).stat().st_size < 1.05 * native_fmu(name).stat().st_size


def test_inputs_act_as_in_fmi_2(native_fmu: Fmu, fmi3_fmu: Fmu) -> None:
    """A force on the cart that rises, jumps and falls."""
    force = np.array(
        [(0.0, 0.0), (0.25, 1.0), (0.25, 3.0), (1.0, 0.0)], dtype=[("time", float), ("F", float)]
    )
    runs = [
        lagfmu.simulate(fmu("CartPendulum"), 1.0, 0.05, inputs=force)
        for fmu in (native_fmu, fmi3_fmu)
    ]
    assert same_bits(*runs)
    assert np.ptp(runs[0]["s"]) > 0.1


@pytest.mark.parametrize("name", of_each_kind(FILES, kinds=FEW))
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_fmpy_simulates_it_in_each_way(fmi3_fmu: Fmu, name: str, kind: str) -> None:
    """With and without event mode, with and without early return: the same motion to the tolerance, and the
    same events; of rebounds that die out an importer's integrator may see two less."""
    path = fmi3_fmu(name)
    assert validate_fmu(str(path)) == []
    rows = []
    for event_mode, early_return in COMBINATIONS if kind == "CoSimulation" else COMBINATIONS[:1]:
        found = fmpy.simulate_fmu(
            str(path),
            fmi_type=kind,
            use_event_mode=event_mode,
            early_return_allowed=early_return,
            relative_tolerance=1e-9,
        )
        rows.append(found[-1])
    own = lagfmu.simulate(path, tolerance=1e-9)[-1]
    for row in rows:
        assert row["time"] == own["time"]
        for n in own.dtype.names or ():
            count = ".".join((*n.split(".")[:2], "count"))
            if n.startswith(("departure.", "slipping.")) and n.endswith(".count"):
                assert row[n] == own[n]
            elif n.startswith("closing.") and row[count] != own[count]:  # the last is another
                assert kind == "ModelExchange"
                assert 28 <= row[count] < own[count]
            elif not n.startswith(("solver.", "residual.")) and own[n].dtype == float:
                assert abs(row[n] - own[n]) < 1e-5 * max(1.0, abs(own[n])), n


def test_a_refusal_has_the_reason_that_it_has_in_fmi_2(native_fmu: Fmu, fmi3_fmu: Fmu) -> None:
    """A radius below zero, a time that runs backwards: the same words, and the next run goes on."""
    reasons = []
    for fmu in (native_fmu, fmi3_fmu):
        with Session(fmu("Hemisphere")) as session:
            refused = session.run([0.0, 0.1], {"a": -1.0}).refusal
            assert isinstance(refused, RefusalError)
            backwards = session.run([0.0, 0.1, 0.05]).refusal
            assert isinstance(backwards, RefusalError)
            reasons.append((refused.status, refused.message, backwards.status, backwards.message))
            assert session.run([0.0, 0.1]).refusal is None
    first, second = (re.sub(r"fmi\dSet(Real|Float64)|fmi\dDoStep", "", str(r)) for r in reasons)
    assert first == second


def test_many_runs_in_one_call_are_those_of_fmi_2(native_fmu: Fmu, fmi3_fmu: Fmu) -> None:
    """lagfmu_batch stands beside the standard's functions in both."""
    plan = Plan(
        vary=("theta",), keep=(("departure.surface.time", 0),), times=np.linspace(0.0, 2.0, 21)
    )
    found = []
    for fmu in (native_fmu, fmi3_fmu):
        with Session(fmu("Hemisphere")) as session:
            found.append(run_batch(session, plan, np.array([[0.01], [0.1], [0.3]])).result)
    assert found[0].tobytes() == found[1].tobytes()
    assert (np.diff(found[0][:, 0]) < 0).all()  # the lower it begins, the sooner it leaves


def test_many_runs_in_one_call_meet_their_events_themselves(
    prepared: Callable[[str], Prepared], tmp_path: Path
) -> None:
    """An importer of an FMU with clocks handles events; in many runs nobody does, and a departure at the very
    end of a run has happened (rounding decides which of several starts lead there).  Afterwards the importer
    is told of its own again."""
    path = write(prepared("Hemisphere"), tmp_path, target="native", face=Face(3, clocks=True))

    def last(of: str, theta: float, times: Any) -> float:
        plan = Plan(vary=("theta",), keep=((f"departure.surface.{of}", 0),), times=times)
        return float(run_batch(session, plan, np.array([[theta]])).result[0, 0])

    def to_the_departure(theta: float) -> Any:
        departure = last("time", theta, np.linspace(0.0, 2.0, 21))
        return np.append(np.arange(0.0, departure, 0.1), departure)

    with Session(path) as session:
        runs = {theta: to_the_departure(theta) for theta in np.linspace(0.1, 0.3, 9)}
        theta = next(theta for theta, times in runs.items() if last("count", theta, times) == 1)
        session.run(runs[theta].tolist(), {"theta": theta})
        assert session.instance.told[0].value


def test_an_array_holds_what_its_members_are(
    prepared: Callable[[str], Prepared], tmp_path: Path
) -> None:
    """Q.N is (Q.x, Q.y), at each point, beside scalars in one call; nothing can be set in it."""
    face = Face(3, arrays=True)
    path = write(prepared("PendulumCartesian"), tmp_path, target="native", face=face)
    run = fmpy.simulate_fmu(str(path), fmi_type="CoSimulation", stop_time=1.0)
    assert run["Q.N"].shape == (len(run), 2)
    assert run["Q.N"].tobytes() == np.stack([run["Q.x"], run["Q.y"]], axis=1).tobytes()
    assert run["lambda.'N/m'"][:, 0].tobytes() == run["lambda.rod"].tobytes()
    with Session(path) as session:
        session.begin()
        assert "Q.N" not in session.outputs
        slave, array = session.instance, session.reference["Q.N"]
        found = list(slave.getFloat64([array, array, session.reference["Q.x"]], nValues=5))
        assert found == [*found[:2], *found[:2], found[0]]
        assert 0.0 not in found
        with pytest.raises(FMICallException):
            slave.setFloat64([array], [1.0, 2.0])
        with pytest.raises(FMICallException):
            slave.getFloat64([array], nValues=1)


def test_verify_holds_its_closed_forms(fmi3_fmu: Fmu) -> None:
    """Those that a FMU of FMI 3.0 carries are the same statements."""
    found = lagfmu.verify(fmi3_fmu("Hemisphere"))
    assert found.passed
    assert found.closed_forms > 3


def test_its_functions_are_defined_as_the_standard_declares_them(fmi3_fmu: Fmu) -> None:
    """A compiler that sees both, tests/fmi3_functions.h and the sources, finds no difference."""
    folder, _ = runs.unpacked(fmi3_fmu("Hemisphere"), whole=True)
    declared = Path(__file__).parent / "fmi3_functions.h"
    flags = ("-std=c99", "-fsyntax-only", f"-I{RUNTIME_FILES['fmi3.h'].parent}", "-include")
    command = [compiler(), *flags, str(declared), str(Path(folder, "sources", "all.c"))]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr[-2000:]


@pytest.mark.thorough
def test_fmpy_compiles_it_from_its_sources(fmi3_fmu: Fmu, tmp_path: Path) -> None:
    """By sources/buildDescription.xml: the same numbers as those of the binary that it came with."""
    if shutil.which("cmake") is None or shutil.which("cc") is None:
        pytest.skip("cmake and cc are needed")
    original = fmi3_fmu("Hemisphere")
    folder = Path(fmpy.extract(str(original), str(tmp_path)))
    shutil.rmtree(folder / "binaries")
    build_platform_binary(folder, cmake_options={"CMAKE_SHARED_LINKER_FLAGS:STRING": "-lm"})
    anew, run = (
        fmpy.simulate_fmu(str(path), stop_time=1.0, relative_tolerance=1e-10, output=COLUMNS)
        for path in (folder, original)
    )
    for n in COLUMNS:
        np.testing.assert_allclose(anew[n], run[n], rtol=1e-12, atol=1e-12)


def test_fmutool_reports_no_error(fmi3_fmu: Fmu) -> None:
    """fmutool -check (fmu-manipulation-toolbox): schema and rules of FMI 3.0."""
    code = "from fmu_manipulation_toolbox.cli.fmutool import fmutool\nfmutool()"
    command = [sys.executable, "-c", code, "-input", str(fmi3_fmu("Hemisphere")), "-check"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    text = run.stdout + run.stderr
    assert run.returncode == 0, text
    assert "compliant with FMI-3.0" in text
    assert not re.search(r"\b(ERROR|FATAL|CRITICAL|WARNING)\b", text), text


def test_the_command_builds_it_beside_that_of_fmi_2(tmp_path: Path) -> None:
    """build --fmi 3: in a folder of its own, verified; what there is none of is wrong usage."""
    build = ["build", str(MODELS / "atwood.py"), "--out", str(tmp_path)]
    run = CliRunner().invoke(app, [*build, "--fmi", "3"])
    assert run.exit_code == 0, run.output
    (made,) = tmp_path.rglob("*.fmu")
    assert made == tmp_path / "native-fmi3" / "Atwood.fmu"
    assert fmpy.read_model_description(str(made)).fmiVersion == "3.0"
    for wrong, told in (
        (["--fmi", "3", "--target", "python"], "the target python has FMI 2.0 alone"),
        (["--fmi", "4"], "expected 2 or 3"),
        (["--clocks"], "FMI 2.0 has none"),
    ):
        run = CliRunner().invoke(app, [*build, *wrong])
        assert run.exit_code == 2
        assert told in " ".join(run.output.split())
