"""Pictures: forces of constraint as arrows by virtual work, shapes as data, and every model's on its page."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp
from conftest import Opened, model_file
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import (
    Arrow,
    Contact,
    Disk,
    Holonomic,
    Line,
    Model,
    Parameter,
    Rod,
    Scene,
    Spline,
    Track,
    output,
)
from lagfmu.errors import BuildError, ModelError
from lagfmu.testing import (
    Moving,
    direction,
    picture_bytes,
    picture_of,
    prepare,
    read_picture,
    render,
    rotation_matrix,
)
from lagfmu.testing import pack_picture as pack
from lagfmu.testing import picture_values as values
from lagfmu.testing import playable as playable_of

x, y, theta = dynamicsymbols("x y theta")
L = sp.symbols("L", positive=True)


def model_of(name: str) -> Model:
    return model_file(name).model


def pendulum(**fields: Any) -> Model:
    return replace(model_of("pendulum"), **fields)


PHI, LENGTH = dynamicsymbols("phi"), sp.symbols("l", positive=True)
WHERE = {  # model: constraint, where its force acts in the model's coordinates, the direction
    "hemisphere": (
        "surface",
        lambda r, angle: (r * sp.sin(angle), r * sp.cos(angle)),
        (sp.sin(theta), sp.cos(theta)),
    ),
    "rotating_wire": (  # lambda is a torque: lambda/r across the wire
        "drive",
        lambda r, angle: (r * sp.cos(angle), r * sp.sin(angle)),
        (-sp.sin(PHI) / dynamicsymbols("r"), sp.cos(PHI) / dynamicsymbols("r")),
    ),
    "ladder": (  # three coordinates, two components
        "wall",
        lambda cx, cy, lean: (cx - LENGTH / 2 * sp.cos(lean), cy + LENGTH / 2 * sp.sin(lean)),
        (1, 0),
    ),
    "knife_edge": ("edge", lambda cx, cy, _: (cx, cy), (sp.sin(PHI), -sp.cos(PHI))),
}


@pytest.mark.parametrize("name", WHERE)
def test_a_force_does_the_work_of_its_constraint(name: str) -> None:
    """Radial on the hemisphere, the wire's torque over its arm, level at the ladder's end, across a blade."""
    constraint, place, expected = WHERE[name]
    model = model_of(name)
    found = direction(model, Arrow(constraint, place(*model.coordinates)))
    assert sp.simplify(sp.Matrix(found) - sp.Matrix(expected)).is_zero_matrix


def test_a_force_elsewhere_does_not_do_the_work() -> None:
    """No force at the ladder's middle turns the ladder as the wall does: a direction is asked for."""
    model = model_of("ladder")
    cx, cy, angle = model.coordinates
    with pytest.raises(ValueError, match="along="):
        direction(model, Arrow("wall", (cx + 0 * angle, cy + sp.cos(angle))))
    with pytest.raises(ValueError, match="does not move"):
        direction(model, Arrow("wall", (0, 0)))


def test_all_that_is_wrong_is_told_at_once() -> None:
    """Kinds, points, names and constraints, each with what was expected."""
    other = sp.symbols("other")
    with pytest.raises(ModelError) as caught:
        pendulum(
            picture=[
                "rod",
                Rod((0, 0), 1),
                Line((0, 0)),
                Disk((other, 0)),
                Arrow("rope", at=(x, y)),
                Disk((0, 0, 0)),
            ]
        )
    told = str(caught.value)
    for part in (
        "'rod'",
        "no point",
        "two or more",
        "other",
        "'rope'",
        "expected one of rod",
        "space",
    ):
        assert part in told, part


def test_what_cannot_be_drawn_is_named() -> None:
    """A function that the page does not have is refused when the FMU is built."""
    model = pendulum(picture=[Disk((sp.besselj(0, x), y))])
    with pytest.raises(ModelError, match="besselj"):
        picture_of(prepare(model, Scene("P")))


def test_a_point_of_a_turned_body_is_drawn() -> None:
    """A third of a turn about (1, 1, 1) takes the axes of a body round: x to y, y to z, z to x."""
    R = rotation_matrix(sp.symbols("w x y z"))
    turned = [[values(pack(e), lambda _: 0.5) for e in row] for row in R.tolist()]
    np.testing.assert_allclose(turned, [[0, 0, 1], [1, 0, 0], [0, 1, 0]], rtol=0, atol=1e-16)


def test_an_expression_keeps_its_value() -> None:
    """Packed and evaluated again, an expression has the value that SymPy gives it."""
    a, b = sp.symbols("a b")
    expression = (
        sp.sqrt(a**2 + b) * sp.atan2(a, b) - sp.Max(a, b, 2) * sp.exp(-a) / sp.Abs(b) + sp.pi
    )
    numbers = {"a": -0.7, "b": 1.9}
    expected = float(expression.subs({a: numbers["a"], b: numbers["b"]}))
    packed = json.loads(json.dumps(pack(expression)))
    assert values(packed, numbers.__getitem__) == pytest.approx(expected, rel=1e-14)


def test_fixed_numbers_are_put_in_and_what_is_not_reported_is_left_out() -> None:
    """Of a scene that reports x alone, with L fixed, only shapes of x and L are drawn."""
    length = pendulum().parameters[2].symbol
    model = pendulum(picture=[Disk((x, length)), Disk((x, y))])
    picture = picture_of(prepare(model, Scene("P", outputs=("x",), fixed=("L",))))
    assert picture == {"dimensions": 2, "shapes": [{"kind": "disk", "center": ["x", 1.0]}]}


def test_a_picture_may_show_what_the_fmu_reports() -> None:
    """output(name) stands for a variable of the FMU; a curve runs over a symbol of its own."""
    s = sp.symbols("s")
    shapes = [Track((s, s**2), s, -1, output("energy.total")), Rod((0, 0), (output("tension"), 0))]
    picture = picture_of(prepare(pendulum(picture=shapes), Scene("P")))
    assert picture is not None
    assert picture["shapes"][0]["range"] == [-1.0, "energy.total"]
    assert read_picture(picture_bytes(picture)) == picture


@pytest.mark.parametrize(
    "text",
    [
        b"[]",
        b"{}",
        b'{"dimensions": 2, "shapes": [{"kind": "rod"}]}',
        b'{"dimensions": 2, "shapes": [{"kind": "script", "points": []}]}',
        b'{"dimensions": 2, "shapes": [{"kind": "disk", "center": [["eval", "x"], 0]}]}',
        b'{"dimensions": 2, "shapes": [{"kind": "disk", "center": [NaN, 0]}]}',
        b'{"dimensions": 9, "shapes": []}',
        b'{"dimensions": 2, "shapes": [{"kind": "disk", "center": ' + b"[" * 9000,
    ],
)
def test_a_forged_picture_is_refused(text: bytes) -> None:
    """What stands in an FMU is data that is looked at, never run."""
    with pytest.raises(BuildError, match="picture"):
        read_picture(text)


def test_the_arrow_is_as_long_as_the_force(opened: Opened) -> None:
    """At rest on top of the hemisphere the arrow says m g cos(theta0), upward; in flight there is none."""
    page = opened("Hemisphere")
    page.until("lagfmu.runs")
    label = page.tab.locator("#picture .force")
    assert label.text_content() == "surface 9.81 N"
    shaft = page.tab.locator("#picture .arrow")
    assert float(shaft.get_attribute("y2")) < float(shaft.get_attribute("y1"))
    page.tab.locator("#scrub").focus()
    page.tab.keyboard.press("End")
    assert not shaft.is_visible()


NO_WEBGL = "HTMLCanvasElement.prototype.getContext = ((get) => function (kind, ...more) {"
NO_WEBGL += " return kind === '2d' ? get.call(this, kind, ...more) : null; }"
NO_WEBGL += ")(HTMLCanvasElement.prototype.getContext);"
AXIS = 26  # pixels
AXES = """() => {
    const names = [...document.querySelectorAll("#picture .axis-name")].map((e) => e.textContent);
    return [...document.querySelectorAll("#picture .axis")].map((line, k) => {
        const [x1, y1, x2, y2] = ["x1", "y1", "x2", "y2"].map((n) => Number(line.getAttribute(n)));
        return [names[k], x2 - x1, y1 - y2];
    });
}"""


def test_without_webgl_a_picture_in_space_is_projected(tmp_path: Path, opened: Opened) -> None:
    """A spherical pendulum: z stays upward on the screen as the view is turned, and so does its axis in the
    corner; those of x and y turn.  The page says that it is flat."""

    z = dynamicsymbols("z")
    m, g = sp.symbols("m g", positive=True)
    speed = x.diff() ** 2 + y.diff() ** 2 + z.diff() ** 2
    model = Model(
        name="Spherical",
        lagrangian=m * speed / 2 - m * g * z,
        coordinates={x: "m", y: "m", z: "m"},
        constraints=[Holonomic("rod", x**2 + y**2 + z**2 - L**2)],
        parameters=[Parameter(m, 1, "kg"), Parameter(g, 9.81, "m/s^2"), Parameter(L, 1, "m")],
        start={x: 0.6, z: -0.8, y.diff(): 1.0},
        picture=[
            Rod((0, 0, 0), (x, y, z)),
            Disk((x, y, z), trace=True),
            Arrow("rod", at=(x, y, z)),
        ],
    )
    out = tmp_path / "spherical.html"
    out.write_text(render(playable_of(prepare(model, Scene("Spherical")))), encoding="utf-8")
    page = opened(out, script=NO_WEBGL)
    page.until("lagfmu.runs && lagfmu.view === 'flat'")
    assert "WebGL" in page.tab.locator("#flat-note").inner_text()
    assert not page.tab.locator("#nearer").is_visible()
    places, axes = [], []
    for angle in (-60, 30):
        page.tab.evaluate(
            """(angle) => {
                const turn = document.getElementById("turn");
                turn.value = angle;
                turn.dispatchEvent(new Event("input"));
            }""",
            angle,
        )
        bar = page.tab.locator("#picture .rod")
        places.append([float(str(bar.get_attribute(k))) for k in ("x1", "y1", "x2", "y2")])
        assert places[-1][3] > places[-1][1]  # the bob hangs below the pivot
        axes.append(page.tab.evaluate(AXES))
    assert places[0] != places[1]
    assert [name for name, *_ in axes[0]] == ["x", "y", "z"]
    assert axes[0][0] != axes[1][0]
    assert axes[0][2] == axes[1][2] == ["z", 0, pytest.approx(AXIS * np.cos(0.42))]


def test_a_slack_string_hangs(tmp_path: Path, opened: Opened) -> None:
    """A bob on a string of 1 m, thrown up from 0.5 m below its peg: until it falls into the string that hangs
    below the straight line and is as long as ever, and at the end it is straight; in a film, too."""
    model = point_mass(
        "Thrown",
        "x y",
        [Contact("string", L**2 - x**2 - y**2)],
        up=y,
        parameters=[Parameter(L, 1, "m")],
        start={x: 0.3, y: -0.5, y.diff(): 1.0},
        picture=[Line((0, 0), (x, y), length=L), Disk((x, y))],
    )
    prepared = prepare(model, Scene("Thrown", stop_time=0.7, step_size=0.01))
    out = tmp_path / "thrown.html"
    out.write_text(render(playable_of(prepared)), encoding="utf-8")
    page = opened(out)
    page.until("lagfmu.runs")
    lengths, drops = [], []
    for key in ("Home", "End"):
        page.tab.locator("#scrub").focus()
        page.tab.keyboard.press(key)
        text = str(page.tab.locator("#picture .line").get_attribute("points"))
        points = np.array([[float(n) for n in p.split(",")] for p in text.split()])
        lengths.append(np.hypot(*np.diff(points, axis=0).T).sum())
        drops.append(points[:, 1].max() - points[[0, -1], 1].max())  # pixels, down
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-3)
    assert drops[0] > 10
    assert drops[1] < 1
    picture = picture_of(prepared)
    assert picture is not None
    assert read_picture(picture_bytes(picture)) == picture
    (string, _) = (
        Moving(s, {"x": 0.3, "y": -0.5, "L": 1.0}.__getitem__, 1) for s in picture["shapes"]
    )
    hung = np.array(string.points)[:, 0]
    assert np.hypot(*np.diff(hung, axis=0).T).sum() == pytest.approx(1.0, rel=1e-5)
    assert hung[:, 1].min() < -0.55


def test_a_length_is_that_of_a_string_between_two_points() -> None:
    """A line through three points has none."""
    with pytest.raises(ModelError, match="3 points and a length, expected two"):
        pendulum(picture=[Line((0, 0), (x, y), (1, 1), length=L)])


@pytest.mark.parametrize("ends", ["natural", "periodic"])
def test_a_table_is_drawn_as_it_is(ends: str) -> None:
    """A road in a picture has the table's height between, at and beyond its points, also read from an FMU."""
    road = Spline("road", [0, 1, 2.5, 4], [0, 0.1, -0.2, 0], "m", "m", ends=ends)
    line = {"kind": "disk", "center": [pack(road(2 * sp.Symbol("s"))), 0.0]}
    found = read_picture(picture_bytes({"dimensions": 2, "shapes": [line]}))["shapes"][0]["center"][
        0
    ]
    places = np.array([-3.0, 0.0, 0.4, 0.5, 1.1, 1.25, 2.0, 5.0])
    heights = values(found, lambda name: places)
    assert heights == pytest.approx([road.table(2 * p) for p in places], abs=1e-15)
    wrong = {"kind": "disk", "center": [["spline", 0.0, 0.0, 1.0, 2.0], 0.0]}
    text = picture_bytes({"dimensions": 2, "shapes": [wrong]})
    with pytest.raises(BuildError, match="five a row"):
        read_picture(text)


def test_the_road_passes_below_the_car(opened: Opened, tmp_path: Path) -> None:
    """The page draws the table as a curve that is finite everywhere, and moves it along with s."""
    page = opened("HalfCar")
    page.until("lagfmu.runs")
    drawn = []
    for key in ("Home", "End"):
        page.tab.locator("#scrub").focus()
        page.tab.keyboard.press(key)
        page.tab.wait_for_timeout(100)
        page.tab.screenshot(path=str(tmp_path / f"{key}.png"))
        drawn.append(page.tab.locator("#picture .path").get_attribute("points"))
    assert "NaN" not in drawn[0] + drawn[1]
    assert drawn[0] != drawn[1]
