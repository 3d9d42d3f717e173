"""The live page and the page in an FMU on a phone, on a desk and read aloud: what is where, and how large."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import Opened, of_each_kind

from lagfmu.testing import Prepared, with_figures
from lagfmu.testing import documentation_page as documentation

PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
LYING = {**PHONE, "viewport": {"width": 844, "height": 390}}
SLID = ("Hemisphere", "SliderCrank", "Gyroscope")
SEEN = """async () => {
    const seen = (e) => {
        const box = e.getBoundingClientRect();
        const at = document.elementFromPoint(box.x + box.width / 2, box.y + box.height / 2);
        return box.top >= 0 && box.bottom <= innerHeight && e.contains(at);
    };
    const found = [];
    for (const e of document.querySelectorAll("#dials input[type=range], #tolerance")) {
        e.focus();
        await new Promise(requestAnimationFrame);
        const parts = ["#picture", "#lead .plot", "#scrub"].map((q) => document.querySelector(q));
        if (![e, ...parts].every(seen)) found.push(e.dataset.name || e.id);
    }
    return found;
}"""
UNFOLD = "() => document.querySelectorAll('details').forEach((d) => (d.open = true))"
SMALL = """() => [...document.querySelectorAll("input, select, button, summary")]
    .filter((e) => e.checkVisibility())
    .map((e) => [e.outerHTML, (e.type === "checkbox" ? e.labels[0] : e).getBoundingClientRect()])
    .filter(([, box]) => box.width < 24 || box.height < 24)
    .map(([text]) => text)"""


@pytest.mark.parametrize(
    ("name", "screen"),
    [
        *of_each_kind(SLID, PHONE, label="upright", kinds=SLID),
        *of_each_kind(SLID, LYING, label="lying", kinds=("Gyroscope",)),
    ],
)
def test_who_moves_a_slider_sees_the_motion(name: str, screen: Any, opened: Opened) -> None:
    """On a phone, whichever slider has the focus: it, the whole picture, a curve and the time are on the
    screen together, and nothing lies over them."""
    page = opened(name, **screen)
    page.until("lagfmu.runs")
    page.tab.evaluate(UNFOLD)
    assert (
        page.tab.evaluate("() => document.querySelectorAll('#dials input[type=range]').length") > 5
    )
    assert page.tab.evaluate(SEEN) == []


COVERED = """() => {
    const scrub = document.getElementById("scrub");
    const labels = () => [...document.querySelectorAll("#picture .force")].filter((e) => e.checkVisibility());
    const found = [];
    for (let part = 0; part <= 1; part += 0.05) {
        scrub.value = part * scrub.max;
        scrub.dispatchEvent(new Event("input"));
        const boxes = labels().map((e) => e.getBBox());
        const disks = [...document.querySelectorAll("#picture .disk, #picture .particle")];
        for (const [k, b] of boxes.entries()) {
            for (const d of disks) {
                const [x, y, r] = ["cx", "cy", "r"].map((n) => Number(d.getAttribute(n)));
                const dx = Math.max(b.x - x, 0, x - b.x - b.width);
                const dy = Math.max(b.y - y, 0, y - b.y - b.height);
                if (Math.hypot(dx, dy) < r - 2) found.push([part, labels()[k].textContent]);
            }
            for (const o of boxes.slice(k + 1)) {
                const across = Math.max(o.x - b.x - b.width, b.x - o.x - o.width);
                const up = Math.max(o.y - b.y - b.height, b.y - o.y - o.height);
                if (Math.max(across, up) < -3) found.push([part, labels()[k].textContent]);
            }
        }
    }
    return found;
}"""


@pytest.mark.parametrize(
    "name",
    of_each_kind(["Bowling", "HalfCar", "RollingSphere", "Chain"], kinds=("HalfCar", "Chain")),
)
def test_no_label_stands_on_a_body(name: str, opened: Opened) -> None:
    """At every time the names and values of the arrows stand beside disks and bobs, and beside each other."""
    page = opened(name, viewport={"width": 1280, "height": 844})
    page.until("lagfmu.runs")
    assert page.tab.evaluate(COVERED) == []


@pytest.mark.parametrize(("name", "width"), [("Belt", 390), ("Belt", 1280), ("Gyroscope", 390)])
def test_a_finger_meets_every_control(name: str, width: int, opened: Opened) -> None:
    """Each is 24 pixels high and wide at least (WCAG 2.2, 2.5.8); of a box to tick its label counts."""
    page = opened(name, viewport={"width": width, "height": 844})
    page.until("lagfmu.runs")
    page.tab.evaluate(UNFOLD)
    assert page.tab.evaluate(SMALL) == []


def test_the_curve_beside_the_picture_is_the_readers_choice(opened: Opened) -> None:
    """At first it is the first lambda; a truth is drawn in steps and told as a word."""
    page = opened("Belt")
    page.until("lagfmu.runs")
    shown = page.tab.locator("#lead-name option:checked")
    assert shown.inner_text().startswith("lambda.")
    page.tab.locator("#lead-name").select_option(label="sticks.grip")
    assert page.tab.locator("#lead-value").inner_text() == "yes"
    told = page.tab.locator("#lead .plot").get_attribute("aria-label")
    assert str(told).startswith("sticks.grip over time: sticks.grip from no to yes")


def test_residuals_are_drawn_for_those_who_ask(opened: Opened) -> None:
    """They are rounding, 1e-16: at first no chart has them, and a tick brings it."""
    page = opened("PendulumCartesian")
    page.until("lagfmu.runs")
    captions = page.tab.locator("#charts figcaption")
    assert not any(t.startswith("Residuals") for t in captions.all_inner_texts())
    page.tab.get_by_label("Residuals, zero where a constraint acts").check()
    assert any(t.startswith("Residuals") for t in captions.all_inner_texts())


INK = """() => {
    const canvas = document.querySelector("#charts canvas");
    const copy = new OffscreenCanvas(canvas.width, canvas.height);
    const context = copy.getContext("2d", { willReadFrequently: true });
    context.drawImage(canvas, 0, 0);
    const { data } = context.getImageData(0, 0, canvas.width, canvas.height);
    let darkest = 255;
    for (let i = 0; i < data.length; i += 4) {
        if (data[i + 3] > 200) darkest = Math.min(darkest, Math.max(data[i], data[i + 1], data[i + 2]));
    }
    const paper = getComputedStyle(document.body).backgroundColor;
    return [darkest, Math.min(...paper.match(/\\d+/g).map(Number))];
}"""


def test_on_paper_ink_is_dark(opened: Opened) -> None:
    """Printed from the dark theme, paper is white, and curves and figures are drawn anew in dark colours; the
    picture and the curves have the whole width."""
    page = opened("Hemisphere", color_scheme="dark", viewport={"width": 1280, "height": 900})
    page.until("lagfmu.runs")
    assert page.tab.evaluate(INK)[1] < 60
    page.tab.emulate_media(media="print", color_scheme="dark")
    page.until("document.getElementById('charts').clientWidth > 1000")
    ink, paper = page.tab.evaluate(INK)
    assert paper > 240
    assert ink < 120
    assert not page.tab.locator("#dials").is_visible()


DOTS = """() => [...document.querySelectorAll("mover")].map((m) => {
    const [letter, dots] = [...m.children].map((e) => getComputedStyle(e));
    return parseFloat(dots.fontSize) / parseFloat(letter.fontSize) * (dots.fontWeight >= 700);
})"""


def test_one_dot_is_told_from_two(opened: Opened) -> None:
    """The dots of velocities and accelerations are bold and larger than a script: x with a dot and x with two
    differ at arm's length."""
    found = opened("PendulumCartesian").tab.evaluate(DOTS)
    assert len(found) > 3
    assert min(found) > 0.75


@pytest.mark.parametrize(
    ("name", "width", "theme"),
    [
        ("Belt", 390, "light"),
        pytest.param("Belt", 1280, "dark", marks=pytest.mark.thorough),
        ("Gyroscope", 390, "dark"),
    ],
)
def test_nothing_of_a_page_keeps_a_reader_out(
    name: str, width: int, theme: str, opened: Opened
) -> None:
    """axe-core finds nothing in the live page, everything unfolded and drawn: headings in order, contrast,
    names, sizes."""
    page = opened(
        name, viewport={"width": width, "height": 844}, color_scheme=theme, bypass_csp=True
    )
    page.until("lagfmu.runs")
    page.tab.evaluate(UNFOLD)
    assert page.violations() == []


@pytest.mark.parametrize("theme", of_each_kind(["light", "dark"], kinds=("dark",)))
def test_nothing_of_the_documentation_keeps_a_reader_out(
    theme: str, prepared: Callable[[str], Prepared], opened: Opened, tmp_path: Path
) -> None:
    """axe-core finds nothing in the page of an FMU with contacts, frictions and its verification, on a phone:
    wide tables scroll by keys."""
    path = tmp_path / "index.html"
    figures = [("energy", "1e-9", "1e-8", "21", "pass"), ("force", "1", "1e-8", "21", "FAIL")]
    path.write_text(with_figures(documentation(prepared("Belt")), figures), encoding="utf-8")
    page = opened(path, viewport={"width": 390, "height": 844}, color_scheme=theme)
    assert page.violations() == []
