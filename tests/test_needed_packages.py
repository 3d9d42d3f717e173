"""A python FMU where its Python lacks NumPy or SciPy: the cause is told, and the importer's process lives."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest
from fmpy import extract, read_model_description
from runtime import INCLUDES, compiler

IN_FMPY = """
import math, sys
from instance import Instance
for name in [m for m in sys.modules if m.split(".")[0] == "scipy"]:
    del sys.modules[name]
sys.modules["scipy"] = None  # as if it were not installed
one = Instance(sys.argv[1]).start({"theta": 0.3, "solver.method": 2})
assert math.isnan(one.get("lambda.surface")) and math.isnan(one.get("theta"))
assert one.get("contact.surface") in (0, False) and one.get("departure.surface.count") == 0
state = one.fmu.getFMUState()
for _ in range(12):
    try:
        one.fmu.doStep(0.0, 0.01)
    except Exception as error:
        print(type(error).__name__, [text for _, _, text in one.log][-1])
one.fmu.setFMUState(state)
one.fmu.reset()
one.fmu.terminate()
one.fmu.freeInstance()
print("alive")
"""
IN_ECOS = """
import sys
from engines import load
load("ecos")
sys.modules[MISSING] = None
from ecospy import EcosSimulation, EcosSimulationStructure
structure = EcosSimulationStructure()
structure.add_model("one", sys.argv[1])
with EcosSimulation(structure=structure, step_size=0.01) as simulation:
    simulation.init()
    simulation.step(2)
    print("value", simulation.get_real("one::lambda.surface"))
print("alive")
"""
IN_LIBCOSIM = """
import sys
from engines import load
load("libcosim")
from libcosimpy._internal import get_last_error_message
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
sys.modules[MISSING] = None
execution = CosimExecution.from_step_size(10_000_000)
observer = CosimObserver.create_last_value()
execution.add_observer(observer)
execution.add_local_slave(CosimLocalSlave(fmu_path=sys.argv[1], instance_name="one"))
print(execution.simulate_until(2_000_000_000), get_last_error_message())
print("alive")
"""
CAUSE = "needs NumPy and SciPy, but the Python"


def run(script: str, fmu: Path, missing: str = "scipy") -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", script.replace("MISSING", repr(missing)), str(fmu)]
    here = Path(__file__).parent
    return subprocess.run(
        command, cwd=here, capture_output=True, text=True, timeout=100, check=False
    )


def test_no_number_comes_and_each_step_names_what_is_missing(python_fmu):
    """Every Real is NaN, so that none is taken for a result; fmi2DoStep is refused with NumPy, SciPy and
    where Python looked, as often as it is called; states, reset and the end are in order."""
    ended = run(IN_FMPY, python_fmu("Hemisphere"))
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert ended.stdout.count(CAUSE) == 12
    assert sys.prefix in ended.stdout
    assert "No module named 'scipy" in ended.stdout
    assert ended.stdout.strip().endswith("alive")
    assert ended.stderr.count(CAUSE) == 1  # whoever asks for no log is told, too


def test_ecos_goes_on_without_a_number(python_fmu):
    """ecos looks at no status and asks for no log: it is told on the error stream, lambda is NaN."""
    if importlib.util.find_spec("ecospy") is None:
        pytest.skip("the engine ecospy is not installed")
    ended = run(IN_ECOS, python_fmu("Hemisphere"), "scipy")
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert CAUSE in ended.stderr
    assert "value nan" in ended.stdout
    assert ended.stdout.strip().endswith("alive")


def test_libcosim_ends_the_simulation_not_the_process(python_fmu):
    """Any error before the first step would end the process (signal 6): the step says False, and why."""
    if importlib.util.find_spec("libcosimpy") is None:
        pytest.skip("the engine libcosimpy is not installed")
    ended = run(IN_LIBCOSIM, python_fmu("Hemisphere"), "numpy")
    assert ended.returncode == 0, ended.stderr[-2000:]
    (told,) = [line for line in ended.stdout.splitlines() if line.startswith("False ")]
    assert told.startswith("False Simulation error: one: ")
    assert CAUSE in ended.stdout
    assert "alive" in ended.stdout.splitlines()


@pytest.mark.skipif(sys.platform != "linux", reason="libpython is preloaded")
def test_a_simulator_in_c_whose_python_is_bare(python_fmu, tmp_path):
    """A host that is not Python, with the library of a Python without packages: from a first line of NaN
    it goes to the refused step and ends by itself, with the cause on the error stream."""
    library = Path(str(sysconfig.get_config_var("LIBDIR")), sysconfig.get_config_var("INSTSONAME"))
    if not library.is_file() or library.suffix == ".a":
        pytest.skip("this Python has no shared library")
    program, bare = tmp_path / "host", tmp_path / "bare"
    source = str(Path(__file__).parent / "host.c")
    subprocess.run([compiler(), *INCLUDES, source, "-o", str(program), "-ldl"], check=True)
    venv.create(bare, symlinks=True)
    path = python_fmu("Hemisphere")
    folder = Path(extract(str(path), str(tmp_path / "fmu")))
    description = read_model_description(str(path))
    of = {v.name: str(v.valueReference) for v in description.modelVariables}
    binary = str(folder / "binaries" / "linux64" / "Hemisphere.so")
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    environment |= {
        "PATH": f"{bare / 'bin'}{os.pathsep}{os.environ['PATH']}",
        "LD_PRELOAD": str(library),
        "RESOURCES": (folder / "resources").as_uri(),
    }
    command = [str(program), binary, description.guid, "1", "0.1", of["lambda.surface"]]
    ended = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=100, check=False
    )
    assert ended.returncode == 4, ended.stderr  # the host's own exit after a refused call
    assert ended.stdout.split() == ["0", "nan"]
    assert ended.stderr.splitlines()[-1] == "fmi2DoStep: status 4"
    assert f"{CAUSE} {sys.version.split()[0]} at '{bare}'" in ended.stderr
