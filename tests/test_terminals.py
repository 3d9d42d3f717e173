"""terminalsAndIcons.xml: what belongs together where FMUs are coupled."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import fromstring

import fmpy
from coupled_model import absorber
from lxml import etree

from lagfmu.testing import Prepared, prepare, terminals

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
