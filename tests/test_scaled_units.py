"""Numbers given in g, mm, deg or rpm: the model, and what importers are told of them."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import pytest
from sympy import cos, symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Input, Model, Output, Parameter, Scene, Spline
from lagfmu.errors import ModelError, UnitError
from lagfmu.testing import METRE, model_description, parse_quantity, parse_unit, prepare

theta, w = dynamicsymbols("theta w")
m, L, g = symbols("m L g", positive=True)


def pendulum(angle: str, mass: str, length: str, speed: str, start: dict, values: tuple) -> Model:
    """Driven by a torque that is proportional to the speed w of a motor."""
    return Model(
        "Pendulum",
        coordinates={theta: angle},
        lagrangian=m * L**2 * theta.diff() ** 2 / 2 + m * g * L * cos(theta),
        forces={theta: m * L**2 * w},
        parameters=[
            Parameter(m, values[0], mass, min=values[1]),
            Parameter(L, values[2], length),
            Parameter(g, 9.81, "m/s2"),
        ],
        inputs=[Input(w, speed, start=values[3])],
        start=start,
        outputs=[Output("depth", L * cos(theta), length)],
    )


@pytest.fixture(scope="module")
def scaled() -> Model:
    return pendulum("deg", "g", "mm", "deg/s2", {theta: 30, theta.diff(): 6}, (200, 1, 300, 18))


def test_a_pendulum_of_200_g_and_300_mm_is_one_of_a_fifth_of_a_kilogram(scaled: Model) -> None:
    """30 deg is pi/6, 6 deg/s is pi/30 rad/s: the equations and numbers are those of coherent SI."""
    plain = pendulum(
        "rad",
        "kg",
        "m",
        "rad/s2",
        {theta: 30 * (pi / 180), theta.diff(): 6 * (pi / 180)},
        (0.2, 0.001, 0.3, 18 * (pi / 180)),
    )
    assert replace(scaled, display_units={}) == plain
    assert replace(scaled, name="Other").display_units == scaled.display_units


def test_importers_are_told_the_unit_to_show(scaled: Model) -> None:
    """unit kg, displayUnit g with 1 kg = 1000 g; every start value stays SI."""
    prepared = prepare(scaled, Scene("Pendulum"))
    xml = model_description(prepared.table, prepared.scene, scaled, "", {}, b"").decode()
    for text in (
        '<DisplayUnit name="g" factor="1000.0" />',
        '<DisplayUnit name="mm" factor="1000.0" />',
        '<Real unit="kg" displayUnit="g" min="0.001" start="0.2"',
        '<Real unit="m" displayUnit="mm" min="0.0" start="0.3"',
    ):
        assert text in xml, text
    shown = {v.name: v.display.name for v in prepared.table.variables if v.display is not None}
    assert shown["depth"] == "mm"
    assert shown["der(theta)"] == "deg/s"
    assert "Q.theta" not in shown


def test_a_table_in_millimetres_is_one_in_metres() -> None:
    """y(x) = x**2 in mm: 3 mm is 0.003 m, and so is what it gives."""
    road = Spline("road", [0, 1, 2, 3], [0, 1, 4, 9], "mm", "mm")
    same = Spline("road", [0, 0.001, 0.002, 0.003], [0, 0.001, 0.004, 0.009], "m", "m")
    assert (road.x, road.y, road.x_unit, road.y_unit) == (same.x, same.y, METRE, METRE)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.2", "kg", 0.2),
        ("200g", "kg", 0.2),
        ("2e2 g", "kg", 0.2),
        ("180deg", "rad", pi),
        ("60rpm", "rad/s", 2 * pi),
        ("-3.5e-1 kN", "N", -350.0),
        ("5", "1", 5.0),
    ],
)
def test_a_quantity_is_converted(text: str, unit: str, value: float) -> None:
    """60 turns a minute are 2 pi rad/s."""
    assert parse_quantity(text, parse_unit(unit, "m"), "m") == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "says"), [("200 mm", "has unit m, expected kg"), ("wide", "is no number")]
)
def test_a_length_is_no_mass(text: str, says: str) -> None:
    """Another dimension, and what is no number, are refused by name."""
    with pytest.raises(UnitError, match=says):
        parse_quantity(text, parse_unit("kg", "m"), "parameter 'm'")


def test_a_fixed_parameter_may_have_a_unit(scaled: Model) -> None:
    """`m=100 g` is a tenth of a kilogram in the code; a length in its place is refused."""
    prepared = prepare(scaled, Scene("Light", fixed=["m=100 g"]))
    assert prepared.numbers["m"] == pytest.approx(0.1, rel=1e-15)
    with pytest.raises(ModelError, match=r"fixed parameter 'm' = '100 mm' has unit m, expected kg"):
        prepare(scaled, Scene("Long", fixed=["m=100 mm"]))
