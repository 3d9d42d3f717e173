"""docs/closed_loop.py: a controller beside CartPendulum.fmu, in Python and as an SSP of two FMUs."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fmpy.ssp.ssd import read_ssd

from lagfmu import build_fmu, simulate
from lagfmu.testing import find_compiler

PROGRAM = Path(__file__).parent.parent / "docs" / "closed_loop.py"

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
READERS = {
    "ecospy": """
import engines
engines.load("ecos")
from ecospy import EcosSimulation
with EcosSimulation(ssp_path=PATH, step_size=STEP) as one:
    one.init()
    one.step(COUNT)
    print(one.get_real("plant::s"))
""",
    "libcosimpy": """
import os
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimObserver import CosimObserver
one = CosimExecution.from_ssp_file(PATH, int(round(STEP * 1e9)))
seen = CosimObserver.create_last_value()
one.add_observer(seen)
assert one.simulate_until(int(round(COUNT * STEP * 1e9)))
place = {s.name: s.index for s in one.slave_infos()}[b"plant"]
reference = {v.name: v.reference for v in one.slave_variables(place)}[b"s"]
print(seen.last_real_values(place, [reference])[0], flush=True)
os._exit(0)
""",
}


@pytest.fixture(scope="module")
def loop():
    """The program's names."""
    spec = importlib.util.spec_from_file_location("closed_loop", PROGRAM)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def orders(errors) -> np.ndarray:
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def test_a_held_force_costs_the_first_order_and_one_passed_on_the_second(loop, tmp_path):
    """Half the communication step: half the error, and a quarter of it."""
    _, held, passed = np.array(loop.errors(str(tmp_path))).T
    assert orders(held) == pytest.approx(1, abs=0.15)
    assert orders(passed)[1:] == pytest.approx(2, abs=0.15)
    assert held[2] == pytest.approx(8.6e-3, rel=0.05)
    assert passed[2] == pytest.approx(2.0e-4, rel=0.05)


def test_the_ssp_is_the_loop(loop, tmp_path):
    """Two components and two wires; in fmpy at least of the first order, against one model of both."""
    path = loop.ssp(str(tmp_path))
    assert [c.name for c in read_ssd(str(path)).system.elements] == ["plant", "controller"]
    errors = [off for _, off in loop.of_ssp(path, str(tmp_path))]
    assert errors[-1] < 1e-3
    assert (orders(errors) > 0.9).all()


@pytest.mark.parametrize("reader", READERS)
def test_other_engines_read_the_ssp(loop, tmp_path, reader):
    """ecos and libcosim bring the cart to where one model of both has it, to the order of their step."""
    if importlib.util.find_spec(reader) is None:
        pytest.skip(f"pip install {reader}")
    path, step, count = loop.ssp(str(tmp_path)), 0.001, 1500
    program = READERS[reader]
    for name, value in {"PATH": str(path), "STEP": step, "COUNT": count}.items():
        program = program.replace(name, json.dumps(value))
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    found = float(done.stdout.split()[-1])
    one = build_fmu(loop.whole(loop.controller()), tmp_path, check=False)
    exact = simulate(one, count * step, step_size=step, tolerance=1e-12)["s"]
    assert found == pytest.approx(exact[-1], abs=5e-3 * np.abs(exact).max())
