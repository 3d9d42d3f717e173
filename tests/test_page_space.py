"""The page of a mechanism in space: what three.js draws is what the FMU says, and how the view is moved."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Page
from conftest import Opened, Tab

Drawn = dict[str, Any]
TO = """(part) => {
    const scrub = document.getElementById("scrub");
    scrub.value = part * scrub.max;
    scrub.dispatchEvent(new Event("input"));
    return Number(scrub.value);
}"""
PIXELS = "() => document.getElementById('space').toDataURL()"
COLOURS = """() => {
    const canvas = document.getElementById("space");
    const copy = new OffscreenCanvas(canvas.width, canvas.height);
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    const found = new Set();
    let drawn = 0;
    for (let i = 0; i < data.length; i += 4) {
        if (data[i + 3] === 255) drawn += 1;
        found.add(data[i] * 65536 + data[i + 1] * 256 + data[i + 2]);
    }
    return [(4 * drawn) / data.length, found.size];
}"""
LOSE = """() => {
    const context = document.getElementById("space").getContext("webgl2");
    context.getExtension("WEBGL_lose_context").loseContext();
}"""
PINCH = """() => {
    const root = document.getElementById("picture");
    root.setPointerCapture = () => {};
    const at = (type, id, x) =>
        root.dispatchEvent(new PointerEvent(type, { pointerId: id, clientX: x, clientY: 200, buttons: 1 }));
    at("pointerdown", 1, 150);
    at("pointerdown", 2, 250);
    at("pointermove", 2, 350);
    at("pointerup", 1, 150);
    at("pointerup", 2, 350);
}"""


@pytest.fixture(scope="module")
def page(tab: Tab, page_file: Callable[[str], Path]) -> Iterator[Page]:
    """That of a door on two hinges; a test that moves the view sets it back."""
    with tab(page_file("Door"), viewport={"width": 1280, "height": 844}) as made:
        made.until("lagfmu.runs && lagfmu.view")
        if made.tab.evaluate("lagfmu.view") != "space":
            pytest.skip("this browser has no WebGL")
        yield made


def shapes(page: Page, kind: str) -> list[Any]:
    """Matrices (4, 4) of the meshes of each shape of a kind."""
    found = page.tab.evaluate("() => lagfmu.drawn()")
    return [
        np.array(s["meshes"]).reshape(-1, 4, 4).swapaxes(1, 2) for s in found if s["kind"] == kind
    ]


def rows(page: Page, part: float) -> Callable[[str], float]:
    """The FMU's values at a part of the run, where the page is put."""
    time = page.tab.evaluate(TO, part)
    run = page.tab.evaluate("() => lagfmu.shown()")
    k = int(np.argmin(np.abs(np.array(run["time"]) - time)))
    page.tab.evaluate(TO, run["time"][k] / run["time"][-1])
    return lambda name: float(run["values"][name][k])


def matrix(e: Any) -> Any:
    """R = 1 + 2 w [v] + 2 [v]^2 of a unit quaternion."""
    w, (x, y, z) = e[0], e[1:]
    V = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * V + 2 * V @ V


@pytest.mark.parametrize("part", [0.0, 0.3, 1.0])
def test_a_body_is_drawn_where_the_fmu_has_it(page: Page, part: float) -> None:
    """The door is a box about its centre of mass, turned as the body is, with the sides of a uniform box of
    its inertia (a thickness of 0 is drawn as a fiftieth of its height); both hinges are pins along z."""
    value = rows(page, part)
    R = matrix([value(f"door.orientation.{x}") for x in "wxyz"])
    position = np.array([value(f"door.position.{x}") for x in "xyz"])
    width, height = np.sqrt(6 / 20 * (7.8 + 1.1 - 6.7)), np.sqrt(6 / 20 * (6.7 + 7.8 - 1.1))
    ((box,),) = shapes(page, "box")
    np.testing.assert_allclose(box[:3, 3], position, rtol=0, atol=1e-6)
    sides = np.abs(R.T @ box[:3, :3]).max(axis=1)
    np.testing.assert_allclose(sides, [width, height / 50, height], rtol=1e-5)
    np.testing.assert_allclose(np.abs(R.T @ box[:3, :3]).sum(), sides.sum(), rtol=1e-5)
    for (pin, _), low in zip(shapes(page, "pivot"), (-0.7, 0.7), strict=True):
        np.testing.assert_allclose(pin[:3, 3], position + R @ [-0.4, 0, low], rtol=0, atol=1e-6)
        np.testing.assert_allclose(pin[:2, 2], 0, atol=1e-6)


def test_arrows_are_as_long_as_the_forces(page: Page) -> None:
    """From foot to tip each is the force that the door receives, at every time in the same length a newton,
    the one that the page tells."""
    legend = page.tab.locator("#picture .legend").text_content()
    square, newtons = (float(w) for w in str(legend).split() if w.replace(".", "").isdigit())
    for part in (0.2, 0.9):
        value = rows(page, part)
        for arrow, joint in zip(shapes(page, "arrow"), ("lower", "upper"), strict=True):
            shaft, _, head, _ = arrow
            foot = shaft[:3, 3] - shaft[:3, 2] / 2
            tip = head[:3, 3] + head[:3, 2] / 2
            force = [value(f"force.{joint}.{x}") * square / newtons for x in "xyz"]
            np.testing.assert_allclose(tip - foot, force, rtol=0, atol=1e-6)
            assert np.linalg.norm(force) > 0.1  # m


def test_the_accuracy_of_a_mechanism_is_that_of_its_joints_forces_first(page: Page) -> None:
    """The menu begins as the curves do; the multipliers of its rows come after."""
    menu = page.tab.locator("#quantity option").all_text_contents()
    assert menu[:2] == ["force.lower.norm", "force.upper.norm"]
    assert "lambda.lower.x" in menu[2:]


def test_something_is_to_be_seen(page: Page) -> None:
    """Bodies cover a part of the canvas, lit in many shades; at another time it is another picture."""
    seen = []
    for part in (0.0, 0.5):
        page.tab.evaluate(TO, part)
        covered, colours = page.tab.evaluate(COLOURS)
        assert 0.005 < covered < 0.9
        assert colours > 100
        seen.append(page.tab.evaluate(PIXELS))
    assert seen[0] != seen[1]


MOVES: dict[str, Callable[[Page], Any]] = {
    "key": lambda page: page.tab.keyboard.press("ArrowLeft"),
    "key zoom": lambda page: page.tab.keyboard.press("+"),
    "key shift": lambda page: page.tab.keyboard.press("Shift+ArrowUp"),
    "wheel": lambda page: page.tab.mouse.wheel(0, -300),
    "drag": lambda page: dragged(page),
    "pinch": lambda page: page.tab.evaluate(PINCH),
    "slider": lambda page: page.tab.locator("#tilt").press("ArrowRight"),
    "button": lambda page: page.tab.locator("#farther").click(),
}


def dragged(page: Page) -> None:
    page.tab.mouse.down()
    page.tab.mouse.move(250, 260, steps=3)
    page.tab.mouse.up()


@pytest.mark.parametrize("move", MOVES)
def test_the_view_is_moved_and_set_back(page: Page, move: str) -> None:
    """By keys, wheel, mouse, fingers, sliders and buttons; 0 brings back what was there."""
    picture = page.tab.locator("#picture")
    picture.focus()
    box = picture.bounding_box()
    page.tab.mouse.move(box["x"] + 150, box["y"] + 100)
    before = page.tab.evaluate(PIXELS)
    MOVES[move](page)
    page.until(f"document.getElementById('space').toDataURL() !== {before!r}")
    picture.focus()
    page.tab.keyboard.press("0")
    page.until(f"document.getElementById('space').toDataURL() === {before!r}")


def test_what_is_lost_is_drawn_flat(opened: Opened) -> None:
    """Where the graphics card takes WebGL away, the flat projection stands in, and the page says so."""
    page = opened("Gyroscope")
    page.until("lagfmu.runs && lagfmu.view === 'space'")
    assert not page.tab.locator("#picture .solid").is_visible()
    page.tab.evaluate(LOSE)
    page.until("!document.getElementById('flat-note').hidden")
    assert page.tab.locator("#picture .solid").is_visible()
    assert page.tab.locator("#picture .arrow").is_visible()


def test_of_three_js_is_there_what_is_used() -> None:
    """The library is made of the names that the page's scripts mention, of no more and no fewer."""
    web = files("lagfmu").joinpath("studio", "live", "web")
    scripts = (
        web.joinpath(f"{name}.js").read_text(encoding="utf-8") for name in ("meshes", "space")
    )
    used = re.findall(r"THREE\.(\w+)", "".join(scripts))
    made = web.joinpath("vendor", "three.js").read_text(encoding="utf-8")
    lists = re.findall(r"export \{([^}]*)\}", made)
    assert set(used) == set(re.findall(r"\w+", " ".join(lists)))
    library = web.joinpath("vendor", "three.min.js").read_text(encoding="utf-8")
    assert all(f"{name}:()=>" in library for name in used)


def test_paper_shows_the_picture_in_light_colours(opened: Opened) -> None:
    """Who reads in the dark prints what others print, without the controls of the view."""
    shown = []
    for scheme in ("light", "dark"):
        page = opened("Gyroscope", color_scheme=scheme, viewport={"width": 700, "height": 700})
        page.until("lagfmu.runs && lagfmu.view === 'space'")
        dark = page.tab.evaluate(PIXELS)
        page.tab.emulate_media(media="print", color_scheme=scheme)
        assert not page.tab.locator("#turn").is_visible()
        page.tab.wait_for_timeout(300)
        shown.append(page.tab.evaluate(PIXELS))
    assert shown[0] == shown[1] != dark
