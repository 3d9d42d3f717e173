"""The names of an FMU's variables say what they are of."""

from __future__ import annotations

import pytest

from lagfmu import names
from lagfmu.names import Subject


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("theta", Subject(names.VALUE, "", "theta")),
        ("der(theta)", Subject(names.VALUE, "", "theta", 1)),
        ("der(theta,2)", Subject(names.VALUE, "", "theta", 2)),
        ("lambda.rod", Subject(names.MULTIPLIER, "rod")),
        ("Q.x", Subject(names.FORCE, "", "x")),
        ("Q.rod.x", Subject(names.FORCE, "rod", "x")),
        ("energy.total", Subject(names.TOTAL)),
        ("departure.rod.count", Subject(names.DEPARTURES, "rod")),
        ("departure.rod.x", Subject(names.DEPARTURE, "rod", "x")),
        ("departure.rod.velocity.x", Subject(names.DEPARTURE, "rod", "x", 1)),
        ("closing.rod.impulse", Subject(names.IMPULSE, "rod")),
        ("closing.rod.velocity.x", Subject(names.CLOSING, "rod", "x", 1)),
        ("sticking.grip.count", Subject(names.STICKINGS, "grip")),
        ("peak.lambda.rod.max", Subject("peak.max", "", "lambda.rod")),
        ("peak.velocity.x.min_time", Subject("peak.min_time", "", "der(x)")),
        ("peak.acceleration.x.max", Subject("peak.max", "", "der(x,2)")),
        ("peak.velocity.max", Subject("peak.max", "", "velocity")),
        ("slipping.grip.time", Subject(names.SLIP_TIME, "grip")),
        ("solver.tolerance", Subject(names.TOLERANCE)),
        ("error.lambda.rod", Subject(names.ERROR, "", "lambda.rod")),
        ("bob.height", Subject(names.OWN, "", "bob.height")),
    ],
)
def test_a_name_tells_of_which_constraint_and_coordinate_a_variable_is(
    text: str, meant: Subject
) -> None:
    """Who reads an FMU's description knows what each variable is of, as DESIGN section 4 names them."""
    assert names.read(text) == meant
    assert meant.name == text


def test_a_bar_is_of_one_variable():
    """The bar of a velocity has a structured name; an acceleration, which has none, does not take it."""
    assert names.bar("der(x)") == "error.velocity.x"
    assert names.bar("der(x,2)") not in (names.bar("der(x)"), names.bar("x"))
    assert names.barred(names.bar("der(x)")) == "der(x)"
