"""The names of an FMU's variables say what they are of."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from sympy import symbols
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Contact, Holonomic, Model, Output, Parameter, Scene, multiplier, names, simulate
from lagfmu.methods import AUTO, MENU
from lagfmu.names import Subject

DOCS = Path(__file__).parent.parent / "docs"


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
        ("bob.height", Subject(names.VALUE, "", "bob.height")),
        ("crank.position.x", Subject(names.VALUE, "", "crank.position.x")),
        ("der(crank.position.x,2)", Subject(names.VALUE, "", "crank.position.x", 2)),
        ("lambda.A.x", Subject(names.MULTIPLIER, "A.x")),
        ("unique.A.x", Subject(names.UNIQUE, "A.x")),
        ("Q.crank.position.x", Subject(names.FORCE, "", "crank.position.x")),
        ("departure.A.lower.count", Subject(names.DEPARTURES, "A.lower")),
        ("closing.A.lower.impulse", Subject(names.IMPULSE, "A.lower")),
        ("peak.velocity.crank.position.x.max", Subject("peak.max", "", "der(crank.position.x)")),
        ("peak.crank.velocity.x.max", Subject("peak.max", "", "crank.velocity.x")),
        ("error.velocity.crank.position.x", Subject(names.ERROR, "", "der(crank.position.x)")),
        ("der(energy.dissipated)", Subject(names.DISSIPATION)),
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


def pendulum_of_several_words() -> Model:
    """A pendulum of 2 m and 3 kg, in names as bodies and joints have them; it may reach a wall."""
    x, y = dynamicsymbols("bob.position.x bob.position.y")
    m, L, g = symbols("bob.mass rod.length gravity", positive=True)
    return Model(
        name="Words",
        lagrangian=m * (x.diff() ** 2 + y.diff() ** 2) / 2 - m * g * y,
        coordinates={x: "m", y: "m"},
        constraints=[
            Holonomic("A.along", (x**2 + y**2 - L**2) / (2 * L)),
            Contact("wall.left", x + 3 * L),
        ],
        parameters=[Parameter(m, 3.0, "kg"), Parameter(L, 2.0, "m"), Parameter(g, 9.81, "m/s^2")],
        outputs=[
            Output("rod.pull", -multiplier("A.along"), "N"),
            Output("height.bob", y, "m"),
            Output("der(height.bob)", y.diff(), "m/s"),
            Output("der(height.bob,2)", y.diff().diff(), "m/s^2"),
        ],
        start={x: 0.0, y: -2.0, x.diff(): 1.5},
    )


@pytest.mark.parametrize("target", ["native", "python"])
def test_a_pendulum_in_names_of_several_words_pulls_as_any_other(target):
    """m (g + v^2/L) [N] at its lowest point, and m (g cos + v^2/L) all along, by the energy."""
    scene = Scene("Words", stop_time=1.0, tolerance=1e-10)
    run = simulate(pendulum_of_several_words(), scene=scene, target=target)
    m, L, g = 3.0, 2.0, 9.81
    v2 = run["der(bob.position.x)"] ** 2 + run["der(bob.position.y)"] ** 2
    assert run["rod.pull"] == pytest.approx(m * (-g * run["bob.position.y"] / L + v2 / L), rel=1e-8)
    assert run["rod.pull"][0] == pytest.approx(m * (g + 1.5**2 / L), rel=1e-12)
    assert run["lambda.A.along"] == pytest.approx(-run["rod.pull"], rel=1e-14)
    assert run["Q.bob.position.y"] == pytest.approx(
        m * (run["der(bob.position.y,2)"] + g), rel=1e-8
    )
    assert run["der(height.bob,2)"] == pytest.approx(run["der(bob.position.y,2)"], rel=1e-14)
    assert not run["contact.wall.left"].any()
    assert not {"Q.A.along.bob.position.x", "departure.wall.left.bob.position.x"} & {*run.units}


def test_of_a_mechanism_the_joints_come_first():
    """The force in each joint and how far it has turned, not the 8 multipliers and 9 places of bodies."""
    joints = [f"force.{j}.{x}" for j in "AB" for x in ("x", "y", "norm")]
    rows = [f"lambda.{j}.{x}" for j in "AB" for x in "xy"]
    moving = [n for q in ("rod.position.x", "angle.A") for n in (q, f"der({q})", f"der({q},2)")]
    assert names.of_interest([*rows, *joints, *moving]) == [
        "force.A.norm",
        "force.B.norm",
        "angle.A",
    ]
    assert names.of_interest([*rows, *moving]) == [*rows, "rod.position.x", "angle.A"]


@pytest.mark.parametrize("kind", names.OUTPUTS, ids=lambda kind: f"{kind.quantity} {kind.each}")
def test_what_an_fmu_reports_stands_in_the_documentation(kind: names.Kind) -> None:
    """Of each kind of output a page says what it is: lambda.surface, energy.total."""
    pages = "".join(
        (DOCS / name).read_text(encoding="utf-8") for name in ("variables.md", "friction.md")
    )
    one = "" if kind.each == names.MODEL else "*"
    head, _, tail = names.name(kind.quantity, one).partition(".*")
    assert f"`{head}" in pages
    assert not tail or f"`{tail}`" in pages


def test_the_page_says_of_each_method_what_its_row_says() -> None:
    """Name, number, where it can be had, and what it is for."""
    page = Path(__file__).parent.parent.joinpath("docs", "accuracy.md").read_text(encoding="utf-8")
    told = [line for line in page.splitlines() if re.match(r"\| `\w+` \(\d", line)]
    assert told == [
        f"| `{m.name}` ({m.number}{', default' * (m.name == AUTO)}{', native' * m.native_only}) | {m.use} |"
        for m in MENU
    ]
