"""The README's own examples do what it says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from lagfmu import simulate, verify
from lagfmu.fmu.compiler import find_compiler
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare
from lagfmu.study.stress import parameters, starts
from lagfmu.study.stress.bench import Bench
from lagfmu.study.stress.lagrange import lay_beside
from lagfmu.study.stress.probe import WRONG, attempt, verdict

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def test_the_bead_keeps_its_energy_and_its_wire(tmp_path):
    """A bead on z = k x^2 keeps m g z + m v^2/2, also on another parabola; the wire bears it."""
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    file = tmp_path / "bead.py"
    file.write_text(blocks[0], encoding="utf-8")
    loaded = load(file)
    fmu = write(prepare(loaded.model, loaded.scenes[0]), tmp_path, loaded.closed_forms)
    assert verify(fmu).passed
    assert verify(fmu, {"k": 3.0, "z": 0.75}).passed
    result = simulate(fmu)
    assert np.abs(result["z"] - 2 * result["x"] ** 2).max() < 1e-14
    lowest = np.argmin(result["z"])
    assert result["Q.z"][lowest] > 0.1 * 9.81  # gravity and the centripetal force


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
def test_the_models_hold_at_every_parameter_and_start(tmp_path):
    """Every model of the README over 24 decades of each parameter, to k = 1e-300 where a wire is flat to
    rounding, and from starts far off: no answer is wrong."""
    blocks = [b for b in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "Model(" in b]
    assert blocks
    for k, block in enumerate(blocks):
        file = tmp_path / f"model{k}.py"
        file.write_text(block, encoding="utf-8")
        loaded = load(file)
        for scene in loaded.scenes:
            prepared = prepare(loaded.model, scene)
            fmu = write(prepared, tmp_path, loaded.closed_forms, target="native")
            lay_beside(fmu, prepared)
            with Bench(fmu, quick=True) as bench:
                probes = [*parameters.probes(bench.facts, True), *starts.probes(bench.facts, True)]
                rows = [verdict(p, attempt(p, bench), 0.0) for p in probes]
            assert len(rows) > 30
            assert [r for r in rows if r.verdict == WRONG] == []
