"""A python FMU where its Python lacks SciPy: the cause in the log, and the importer's process lives."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

IN_FMPY = """
import sys
from instance import Instance
for name in [m for m in sys.modules if m.split(".")[0] == "scipy"]:
    del sys.modules[name]
sys.modules["scipy"] = None  # as if it were not installed
one = Instance(sys.argv[1])
for call in (one.fmu.setupExperiment, one.fmu.enterInitializationMode):
    try:
        call()
    except Exception as error:
        print(type(error).__name__, [text for _, _, text in one.log][-1])
one.fmu.freeInstance()
print("alive")
"""
IN_ECOS = """
import sys
from engines import load
load("ecos")
sys.modules["scipy"] = None
from ecospy import EcosSimulation, EcosSimulationStructure
structure = EcosSimulationStructure()
structure.add_model("one", sys.argv[1])
with EcosSimulation(structure=structure, step_size=0.01) as simulation:
    simulation.init()
print("alive")
"""


def run(script: str, fmu: Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", script, str(fmu)]
    here = Path(__file__).parent
    return subprocess.run(
        command, cwd=here, capture_output=True, text=True, timeout=100, check=False
    )


def test_the_first_call_names_what_is_missing(python_fmu):
    """fmi2SetupExperiment is refused with NumPy, SciPy and where Python looked; twice; then it is freed."""
    ended = run(IN_FMPY, python_fmu("Hemisphere"))
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert ended.stdout.count("needs NumPy and SciPy") == 2
    assert sys.prefix in ended.stdout
    assert "No module named 'scipy" in ended.stdout
    assert ended.stdout.strip().endswith("alive")


def test_an_engine_in_c_goes_on(python_fmu):
    """ecos, which a failed instantiation takes down by signal 11, ends in order."""
    if importlib.util.find_spec("ecospy") is None:
        pytest.skip("the engine ecospy is not installed")
    ended = run(IN_ECOS, python_fmu("Hemisphere"))
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert ended.stdout.strip().endswith("alive")
