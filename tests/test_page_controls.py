"""The live page in hand: sliders, time, tolerance, link and file, by mouse, keyboard and screen reader."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest
from browser import Page
from conftest import Opened, Tab

from lagfmu import simulate

Fmu = Callable[[str], Path]
REACHED = """[...document.querySelectorAll("input, select, button, summary, [tabindex]")]
    .filter((e) => e.checkVisibility())"""
UNNAMED = """() => [...document.querySelectorAll("input, select, button, [role=img], [tabindex]")]
    .filter((e) => e.checkVisibility() && !e.getAttribute("aria-label") && !e.labels?.length
                   && !e.textContent.trim())
    .map((e) => e.outerHTML)"""


TICK_ALL = """() => document.querySelectorAll("#chart-choices input")
    .forEach((box) => box.checked || box.click())"""
VALUE = """async (name) => {
    document.getElementById("values-box").open = true;
    const rows = [...document.querySelectorAll("#values tr")];
    while (!rows[0].cells[1].textContent) await new Promise(requestAnimationFrame);
    return rows.find((r) => r.cells[0].textContent === name).cells[1].textContent;
}"""


def value(page: Page, name: str) -> float:
    """What the table of all values says of an output at the time that is shown."""
    return float(page.tab.evaluate(VALUE, name))


def go_to_end(page: Page) -> None:
    page.tab.locator("#scrub").focus()
    page.tab.keyboard.press("End")


@pytest.fixture(scope="module")
def seen(tab: Tab, page_file: Any) -> Iterator[Callable[[str], Page]]:
    """seen(NAME): its page with its first run, opened once for all who only look."""
    with ExitStack() as stack:

        @cache
        def get(name: str) -> Page:
            page = stack.enter_context(tab(page_file(name)))
            page.until("lagfmu.runs")
            return page

        yield get


def events_of(page: Page) -> dict[str, tuple[float, str]]:
    """What is listed first of each kind: when [s], and all that is said of it."""
    found: dict[str, tuple[float, str]] = {}
    for text in page.tab.locator("#events li").all_inner_texts():
        time, _, what = text.partition(" s")
        found.setdefault(what.split()[0].split(",")[0], (float(time), what))
    return found


def test_the_departure_is_marked_at_its_time(seen: Any, native_fmu: Fmu) -> None:
    """The particle leaves at 1.641 s: so it stands among what happened, and a press goes there; before it is
    on the hemisphere, and among all values its departure is none yet."""
    page = seen("Hemisphere")
    time = simulate(native_fmu("Hemisphere"))["departure.surface.time"][-1]
    page.tab.locator("#scrub").focus()
    page.tab.keyboard.press("Home")
    assert page.tab.evaluate(VALUE, "departure.surface.time") == "none yet"
    mark = page.tab.locator("#events button")
    assert mark.count() == 1
    assert float(mark.inner_text().removesuffix(" s")) == pytest.approx(time, rel=1e-9)
    mark.click()
    assert float(page.tab.locator("#scrub").input_value()) == pytest.approx(time, abs=0.01)
    assert value(page, "lambda.surface") == pytest.approx(0.0, abs=0.3)
    go_to_end(page)
    assert value(page, "departure.surface.time") == pytest.approx(time, rel=1e-5)


def test_bounces_slips_and_sticks_are_told(seen: Any) -> None:
    """A ball that falls 1 m strikes the floor at 0.4515 s with m sqrt(2 g h) (1 + e) = 7.53 N s.  A block on
    a belt rides until k x = mu_s m g, x = speed t, and sticks again after its slide.  The FMU says so, and
    the page shows what it says."""
    page = seen("BouncingBall")
    first = page.tab.locator("#log li").all_text_contents()[0]
    words = first.replace(",", "").split()
    assert first.startswith("contact floor was struck at t = ")
    assert float(words[7]) == pytest.approx((2 / 9.81) ** 0.5, rel=1e-8)
    assert float(words[10]) == pytest.approx((2 * 9.81) ** 0.5 * 1.7, rel=1e-8)
    landed, said = events_of(page)["closing.floor"]
    assert landed == pytest.approx((2 / 9.81) ** 0.5, rel=1e-8)
    assert said.endswith("closing.floor, impulse 7.53006 N·s")
    told = events_of(seen("Belt"))
    slips = 0.5 * 9.81 / (100 * 0.2)
    assert told["slipping.grip"][0] == pytest.approx(slips, rel=1e-6)
    slide = (np.pi - np.arctan(0.981)) / 5  # (2/w)(pi - atan(d w/v)), d = (mu_s - mu_k) m g/k
    assert told["sticking.grip"][0] == pytest.approx(slips + slide, rel=1e-6)


KINDS = "Multipliers λ [N]; Outputs [W]; Energies [J]; Generalized forces of constraint [N]"
FRICTION = "Friction [m/s]; Friction [yes or no]; Gaps of contacts [m]"


def test_what_is_drawn_has_its_headings(seen: Any) -> None:
    """Multipliers, own outputs, forces of constraint, energies, friction and gaps, which are no residuals,
    with units; the equations; and the library that draws, with its licence."""
    page = seen("Belt")
    page.tab.evaluate(TICK_ALL)
    told = page.tab.locator("#charts figcaption").all_inner_texts()
    assert {*KINDS.split("; "), *FRICTION.split("; ")} <= set(told)
    assert page.tab.locator("math").count() >= 8
    assert "MIT" in page.tab.content()
    assert "Copyright (c)" in page.tab.content()
    assert "Residuals" not in seen("Hemisphere").tab.locator("#chart-choices").inner_text()


@pytest.mark.parametrize("name", ["Hemisphere", "Belt"])
def test_every_control_has_a_name(name: str, seen: Any) -> None:
    """What cannot be seen is told: sliders by name and value with unit, charts and picture in a sentence."""
    page = seen(name)
    assert page.tab.evaluate(UNNAMED) == []
    slider = page.tab.locator("#dials input[data-name]").first
    assert slider.get_attribute("aria-valuetext")
    told = page.tab.locator("#charts [role=img]").first.get_attribute("aria-label")
    assert "over time" in str(told)
    page.until("document.getElementById('status').textContent.includes('steps')")


def test_the_file_holds_the_run(seen: Any, tmp_path: Path) -> None:
    """The CSV file has a row a communication point, with every digit."""
    page = seen("Hemisphere")
    with page.tab.expect_download() as download:
        page.tab.locator("#csv").click()
    path = tmp_path / "run.csv"
    download.value.save_as(path)
    run = page.run()
    with path.open(encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    assert [float(r[0]) for r in rows] == run["time"]
    at = names.index("lambda.surface")
    assert [float(r[at]) for r in rows] == run["values"]["lambda.surface"]


def test_time_runs_and_stops_by_the_keyboard(opened: Opened) -> None:
    """Space runs and pauses; the arrows move the time while its slider has the focus."""
    page = opened("Hemisphere")
    page.until("lagfmu.runs")
    page.tab.keyboard.press("Space")
    page.until("Number(document.getElementById('scrub').value) > 0.2")
    page.tab.keyboard.press("Space")
    stopped = float(page.tab.locator("#scrub").input_value())
    page.tab.wait_for_timeout(200)
    assert float(page.tab.locator("#scrub").input_value()) == stopped
    page.tab.locator("#scrub").focus()
    page.tab.keyboard.press("ArrowRight")
    assert float(page.tab.locator("#scrub").input_value()) > stopped


def test_the_tolerance_buys_accuracy_with_steps(opened: Opened) -> None:
    """From 1e-4 to 1e-10 the error against the run at 1e-13 falls by far, and the steps grow."""
    page = opened("PendulumCartesian")
    found: list[tuple[float, int]] = []
    for decade in (4, 10):
        page.until("lagfmu.runs")
        page.tab.evaluate(
            """(decade) => {
                const slider = document.getElementById("tolerance");
                slider.value = decade;
                slider.dispatchEvent(new Event("input"));
            }""",
            decade,
        )
        told = page.until(
            "document.getElementById('error-shown').textContent.includes('steps')"
            " && document.getElementById('error-shown').textContent"
        )
        error, steps, _ = str(told).split(": ")[1].split(", ")
        found.append((float(error), int(steps.split()[0])))
    assert found[1][0] < 1e-4 * found[0][0]
    assert found[1][1] > found[0][1]


def test_a_refused_value_is_told_and_the_curves_stay(opened: Opened) -> None:
    """The FMU's own words, as an alert; a good value takes it away."""
    page = opened("Hemisphere")
    status = "document.getElementById('status').textContent"
    page.until(f"{status}.startsWith('Run to 2 s')")
    page.slide("m", 0)
    refused = page.tab.locator("#refused")
    assert refused.get_attribute("role") == "alert"
    assert "'m' = 0" in refused.inner_text()
    assert page.tab.locator("#charts canvas").count() > 0
    page.tab.wait_for_timeout(600)  # what is told of a run is told after 0.4 s
    assert page.tab.evaluate(f"() => {status}") == "Shown is the last run that went through."
    page.slide("m", 1.5)
    assert not refused.is_visible()
    page.until(f"{status}.startsWith('Run to 2 s')")


def test_a_link_brings_the_settings(opened: Opened, page_file: Any) -> None:
    """Opened by its link, the page is as it was left."""
    page = opened("Hemisphere")
    page.slide("theta", 0.3)
    page.tab.locator("#link").click()
    address = page.tab.locator("#link-text").input_value()
    other = opened(address)
    other.until("lagfmu.runs")
    go_to_end(other)
    end = value(other, "departure.surface.theta")
    assert np.cos(end) == pytest.approx(2 * np.cos(0.3) / 3, rel=1e-7)
    wrong = quote(json.dumps({"values": {"<b>q</b>": 1}}))
    other = opened(f"file://{page_file('Hemisphere')}#{wrong}")
    other.until("lagfmu.runs")
    assert "<b>q</b>" in other.tab.locator("#link-problem").inner_text()


def test_a_slider_has_the_bounds_and_the_unit_of_its_variable(opened: Opened) -> None:
    """Restitution lies in 0..1, a mass is at least 0 kg: so do the ends of their sliders; the number beside
    takes what is typed, and the run follows."""
    page = opened("BouncingBall")
    page.until("lagfmu.runs")
    ends = """(name) => {
        const slider = document.querySelector(`input[data-name="${name}"]`);
        const unit = slider.closest(".dial").querySelector(".unit").textContent;
        return [Number(slider.min), Number(slider.max), unit];
    }"""
    assert page.tab.evaluate(ends, "e") == [0, 1, ""]
    assert page.tab.evaluate(ends, "m")[::2] == [0, "kg"]
    before = page.until("lagfmu.runs")
    page.tab.locator("#dials input[type=number][aria-label^='y, as a number']").fill("0.5")
    page.until(f"lagfmu.runs > {before}")
    assert page.tab.evaluate("() => lagfmu.shown().values.y[0]") == 0.5


def test_a_start_value_that_is_moved_says_so(opened: Opened) -> None:
    """A bob that is put at x = 0.6 m hangs on a rod of 1 m: y becomes -0.8 m, whatever its slider says."""
    page = opened("PendulumCartesian")
    page.until("lagfmu.runs")
    told = page.tab.locator(".dial:has(input[data-name='y']) .moved")
    assert told.inner_text() == ""
    page.slide("x", 0.6)
    assert told.inner_text() == "the constraints make it -0.8 m"
    assert page.tab.locator(".dial:has(input[data-name='x']) .moved").inner_text() == ""


def test_another_method_is_another_run(opened: Opened) -> None:
    """The menu of methods is the FMU's: radau takes other steps, and says so."""
    page = opened("PendulumCartesian")
    page.until("lagfmu.runs")
    script = "() => lagfmu.shown().values['solver.steps'].at(-1)"
    steps, before = page.tab.evaluate(script), page.until("lagfmu.runs")
    page.tab.locator("#method").select_option("radau")
    page.until(f"lagfmu.runs > {before}")
    assert page.tab.evaluate(script) != steps
    assert page.tab.evaluate("() => lagfmu.shown().settings.method") == "radau"


def test_the_page_goes_on_while_the_fmu_computes(opened: Opened) -> None:
    """The computation is in a worker: during a run of an hour the page's own thread has its turns."""
    page = opened("PendulumCartesian")
    page.until("lagfmu.runs")
    turns = page.tab.evaluate(
        """async () => {
            let turns = 0, done = false;
            const run = lagfmu.run({ stopTime: 3600, stepSize: 1 }).then(() => (done = true));
            while (!done) {
                await new Promise((next) => setTimeout(next, 1));
                turns++;
            }
            await run;
            return turns;
        }"""
    )
    assert turns > 5


def test_twice_the_speed_is_half_the_time(opened: Opened) -> None:
    """At a speed of 5 the run of 2 s is over in 0.4 s and stops at its end; at 1/20 it has hardly begun."""
    page = opened("Hemisphere")
    page.until("lagfmu.runs")
    page.tab.locator("#speed").select_option("5")
    page.tab.locator("#play-button").click()
    page.until("document.getElementById('play-button').textContent === 'Run'")
    assert float(page.tab.locator("#scrub").input_value()) == 2.0
    page.tab.locator("#speed").select_option("0.05")
    page.tab.locator("#play-button").click()
    page.tab.wait_for_timeout(300)
    assert 0 < float(page.tab.locator("#scrub").input_value()) < 1.0


def test_the_keyboard_reaches_everything_in_the_order_of_the_page(opened: Opened) -> None:
    """Tab goes from the run button through time, speed and every slider to the equations and around: each
    control that is seen has its turn, in the order of the text, and shows that it has it."""
    page = opened("Hemisphere")
    page.until("lagfmu.runs")
    expected = page.tab.evaluate(f"() => {REACHED}.length")
    found = []
    for _ in range(expected):
        page.tab.keyboard.press("Tab")
        place, outline = page.tab.evaluate(
            f"""() => [{REACHED}.indexOf(document.activeElement),
                       getComputedStyle(document.activeElement).outlineStyle]"""
        )
        found.append(place)
        assert outline != "none", place
    assert found == list(range(expected))
