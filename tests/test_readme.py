"""The README's own examples do what it says."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from lagfmu import simulate, verify
from lagfmu.fmu.write import write
from lagfmu.model.file import load
from lagfmu.prepare.prepare import prepare

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
