"""terminalsAndIcons/: what belongs together where FMUs are coupled, and what the FMU looks like."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy
import matplotlib.image
from coupled_model import absorber
from lxml import etree

from lagfmu import build_fmu
from lagfmu.testing import Prepared, icon, prepare, terminals

SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi3" / "fmi3TerminalsAndIcons.xsd"


def members(prepared: Prepared) -> dict[str, dict[str, tuple[str, str]]]:
    """Of each terminal: its members, with their variables and kinds."""
    text = terminals(prepared)
    assert text is not None
    etree.XMLSchema(etree.parse(SCHEMA)).assertValid(etree.fromstring(text))
    return {
        t.get("name", ""): {
            m.get("memberName", ""): (m.get("variableName", ""), m.get("variableKind", ""))
            for m in t
        }
        for t in fromstring(text).iter("Terminal")
    }


def test_a_prescribed_motion_is_one_with_the_force_of_its_drive() -> None:
    """u - p = 0 moves p: its multiplier is what the absorber pushes back with, and flows out of it."""
    assert members(prepare(absorber)) == {
        "u": {
            "position": ("u", "signal"),
            "velocity": ("der(u)", "signal"),
            "acceleration": ("der(u,2)", "signal"),
            "force": ("lambda.tie", "outflow"),
        }
    }


def test_a_multiplier_that_is_no_force_is_left_out(prepared: Callable[[str], Prepared]) -> None:
    """x^2 + y^2 - l^2 = 0: the drive of the rope's length pulls with 2 l lambda, not with lambda."""
    assert members(prepared("Crane"))["l"].keys() == {"position", "velocity", "acceleration"}


def test_each_joint_is_one(prepared: Callable[[str], Prepared]) -> None:
    """The wrench that it transmits, and the angle or the way that it leaves free."""
    found = members(prepared("SliderCrankBodies"))
    assert list(found) == ["A", "B", "C", "D"]
    assert found["A"]["force.x"] == ("force.A.x", "signal")
    assert found["A"]["rate.angle"] == ("der(angle.A)", "signal")
    assert found["D"]["position"] == ("position.D", "signal")


def test_there_is_none_without(prepared: Callable[[str], Prepared]) -> None:
    """A particle on a hemisphere has neither joint nor drive."""
    assert terminals(prepared("Hemisphere")) is None


def test_the_icon_is_the_picture_at_the_start(
    prepared: Callable[[str], Prepared], tmp_path: Path
) -> None:
    """A pendulum hangs to one side; what is drawn does not depend on the coordinates that are stepped."""
    drawn = icon(prepared("PendulumCartesian"))
    shown = matplotlib.image.imread(io.BytesIO(drawn["terminalsAndIcons/icon.png"]))
    assert shown.shape == (128, 128, 4)
    assert 0 < (shown[..., 3] > 0).mean() < 0.5  # lines on nothing
    assert fromstring(drawn["terminalsAndIcons/icon.svg"]).tag.endswith("svg")
    assert icon(prepared("PendulumAngle")) == drawn
    assert icon(prepare(absorber)) == {}
    assert icon(prepared("BouncingBall")).keys() == drawn.keys()  # a point above its floor
    model = prepared("PendulumCartesian").model
    with zipfile.ZipFile(build_fmu(model, tmp_path, target="python", check=False)) as fmu:
        found = fromstring(fmu.read("terminalsAndIcons/terminalsAndIcons.xml"))
        assert drawn.keys() < set(fmu.namelist())
    assert found.find("GraphicalRepresentation/Icon") is not None
