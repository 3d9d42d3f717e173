"""docs/bearing_force.md, followed literally: from bodies and joints to the largest force in a bearing."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from conftest import MODELS, model_file
from typer.testing import CliRunner

import lagfmu
from lagfmu.testing import app

PAGE = (MODELS.parent / "docs" / "bearing_force.md").read_text(encoding="utf-8")
COMMANDS = [c.split() for c in re.findall(r"^    lagfmu (.*)$", PAGE, re.MULTILINE)]


@pytest.fixture
def printed(tmp_path, monkeypatch):
    """What a command of the page prints, in a folder with the models."""
    (tmp_path / "models").symlink_to(MODELS)
    monkeypatch.chdir(tmp_path)

    def run(name: str) -> str:
        (command,) = (c for c in COMMANDS if c[0] == name)
        done = CliRunner().invoke(app, command)
        assert done.exit_code == 0, done.output
        return done.output

    return run


def test_the_mechanism_of_the_page_is_that_of_the_file():
    """The same forces along the motion, under the page's own name."""
    told: dict = {}
    exec(re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)[1], told)
    runs = [
        lagfmu.simulate(source, stop_time=0.5, step_size=0.01)
        for source in (told["model"], model_file("slider_crank_bodies").model)
    ]
    for name in ("force.A.norm", "force.B.norm"):
        assert (runs[0][name] == runs[1][name]).all()


@pytest.mark.thorough
def test_the_figures_of_the_page_are_those_of_the_commands(printed, tmp_path):
    """The outputs of the FMU, the largest forces of the plot, and what a kilogram takes from the bearing."""
    assert "N = n - rank G = 9 - 8 = 1" in printed("show")
    lacks = "18 of 19 closed forms were not checked: this FMU leaves out what they need"
    assert lacks in " ".join(printed("build").split())
    fmu = tmp_path / "dist" / "native" / "SliderCrankBodies.fmu"
    run = lagfmu.simulate(fmu, step_size=0.001)
    assert set(run.dtype.names) >= {"force.A.norm", "force.B.norm", "torque.D.z", "angle.A"}
    force, turns = run["force.A.norm"], run["angle.A"] / (2 * np.pi)
    tops = (
        np.flatnonzero((force[1:-1] > np.maximum(force[:-2], force[2:])) & (force[1:-1] > 50)) + 1
    )
    assert force[tops] == pytest.approx([141, 169] * 4, rel=5e-3)
    assert np.diff(turns[tops[1::2]]) == pytest.approx(1.0, abs=0.02)
    assert run["force.B.norm"].max() == pytest.approx(110, rel=1e-2)
    text = printed("sensitivity")
    table = re.findall(r"(\w+\.mass) +([+-][\d.]+) +([\d.]+)", text)
    told = re.findall(r"^     (\w+\.mass) +([+-][\d.]+) +([\d.]+)", PAGE, re.MULTILINE)
    assert [row[0] for row in table] == [row[0] for row in told]
    for (_, *found), (_, *said) in zip(table, told, strict=True):
        assert [float(x) for x in found] == pytest.approx([float(x) for x in said], rel=1e-5)
    printed("report")
    assert "force.A.norm" in (tmp_path / "crank_report.html").read_text(encoding="utf-8")


def test_the_pictures_of_the_page_are_there():
    """Each with a text for whoever does not see it."""
    pictures = re.findall(r"!\[([^\]]{20,})\]\((\w+\.png)\)", PAGE)
    assert len(pictures) == 2
    for _, name in pictures:
        assert Path(MODELS.parent, "docs", name).stat().st_size < 50_000
