"""Every FMU of models/ as a page: what runs in it is the native FMU, as described and after a slider has
moved, to rounding times the growth of a perturbation; its mechanism is drawn.  A page is opened once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from browser import Page
from conftest import EVERY, Tab, of_each_kind

from lagfmu.testing import (
    LAST,
    Plan,
    Playable,
    Prepared,
    Session,
    communication_points,
    picture_of,
    run_batch,
)

pytest.importorskip("wasmtime", reason="pip install -e '.[test]'")

from wasm import Module

EVENTS = ("departure.", "closing.", "slipping.", "sticking.")
SHOWN = ("Hemisphere", "KnifeEdge", "CartPendulum", "HalfCar")  # always, the others thoroughly
ROUNDING = 1e-14  # relative: the two C libraries differ in the last place of sin, cos and pow
MOVE = """() => {
    const slider = document.querySelector("#dials input[data-name]");
    return [slider.dataset.name, Number(slider.value) + 2 * Number(slider.step)];
}"""


@dataclass(frozen=True)
class Run:
    """A native FMU's run: times [s], outputs by name (points), and how far rounding may carry each."""

    time: Any
    values: dict[str, Any]
    bounds: dict[str, float]


class Native:
    """The native FMU, loaded once."""

    def __init__(self, path: Path, folder: Path) -> None:
        self.description = fmpy.read_model_description(str(path))
        self.variables = {v.name: v for v in self.description.modelVariables}
        unpacked = fmpy.extract(str(path), str(folder))
        self.session = Session(unpacked)

    def run(self, **given: float) -> Run:
        """What it answers, and 1e-14 of the largest output in a unit plus what changes of 1e-14 of each
        parameter and start value grow to over the run.  A mode or a count is the same, unless it changes with
        these (a step more or less at an instant).  A residual has no bound: it is but rounding."""
        outputs = [v for v in self.variables.values() if v.causality == "output"]
        settable = [v for v in self.variables.values() if is_set(v)]
        base = np.array([given.get(v.name, float(v.start)) for v in settable])
        moved = base + np.diag(ROUNDING * np.where(base == 0, 1.0, np.abs(base)))
        experiment = self.description.defaultExperiment
        times = communication_points(float(experiment.stopTime), float(experiment.stepSize))
        plan = Plan(
            tuple(v.name for v in settable),
            tuple((v.name, LAST) for v in outputs),
            times,
            float(experiment.tolerance),
            whole=True,
        )
        found = run_batch(self.session, plan, np.vstack([base, moved]))
        assert (found.status <= 1).all(), found.reasons
        run, *others = found.trajectory
        spread = sum(np.abs(other - run).max(axis=0) for other in others)
        sizes: dict[str, float] = {}
        for v, column in zip(outputs, run.T, strict=True):
            sizes[v.unit] = max(sizes.get(v.unit, 0.0), float(np.abs(column).max()))
        bounds = {
            v.name: (ROUNDING * sizes[v.unit] if v.type == "Real" else 0.0) + float(grown)
            for v, grown in zip(outputs, spread, strict=True)
            if not v.name.startswith("residual.")
        }
        columns = {v.name: column for v, column in zip(outputs, run.T, strict=True)}
        return Run(times, columns, bounds)


def is_set(v: Any) -> bool:
    """Parameters and start values, but those of the solver."""
    settable = v.causality == "parameter" or v.initial in ("exact", "approx")
    return settable and v.type == "Real" and not v.name.startswith("solver.")


@pytest.fixture(scope="module", params=of_each_kind(EVERY, kinds=SHOWN))
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def native(
    name: str, native_fmu: Callable[[str], Path], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Native]:
    made = Native(native_fmu(name), tmp_path_factory.mktemp("native"))
    yield made
    made.session.close()


@pytest.fixture(scope="module")
def described(native: Native) -> Run:
    """The run of the description."""
    return native.run()


@pytest.fixture(scope="module")
def page(name: str, tab: Tab, page_file: Any) -> Iterator[Page]:
    with tab(page_file(name)) as made:
        made.until("lagfmu.runs")
        yield made


def test_the_module_is_the_native_fmu(
    name: str, playable: Callable[[str], Playable], described: Run
) -> None:
    """In wasmtime: what the module answers is what the machine's own binary answers, but for rounding in
    the C library; and it asks nothing of its host."""
    module = Module(playable(name).module, playable(name).facts)
    assert module.imports == []
    found = module.simulate(described.time)
    assert set(found.dtype.names) == {"time", *described.values}
    for n, expected in described.values.items():
        if n in described.bounds:
            assert np.abs(found[n].astype(float) - expected).max() <= described.bounds[n], n


def check_end(shown: dict[str, Any], expected: Run) -> None:
    """Every lambda at the end, and every event."""
    assert shown["time"] == list(expected.time)
    for n in expected.values:
        if n.startswith(("lambda.", *EVENTS, "energy.total")):
            end, bound = shown["values"][n][-1], expected.bounds.get(n, 0.0)
            assert end == pytest.approx(expected.values[n][-1], abs=bound, rel=0), n


def test_a_page_is_small(name: str, page_file: Callable[[str], Path]) -> None:
    """Solver, pictures, curves and equations in less than 320 kB, of a mechanism whose joints rub in less
    than 500 kB; three.js is in the page of a picture in space alone, which is below 1 MB."""
    size, text = page_file(name).stat().st_size, page_file(name).read_text(encoding="utf-8")
    in_space = '"dimensions":3' in text
    assert ('id="three"' in text) == ("three.js authors" in text) == in_space
    most = 500_000 if name == "CrankWithBearingFriction" else 320_000
    assert size < (1_000_000 if in_space else most)


def test_the_page_shows_the_native_fmus_run(page: Page, described: Run) -> None:
    """In Chromium, from disk, without a network: every lambda at the end is the native FMU's, and each event
    that has a time is listed at it."""
    shown = page.tab.evaluate("() => lagfmu.shown()")
    check_end(shown, described)
    listed = [e["time"] for e in shown["events"]]
    for n, column in described.values.items():
        if n.endswith(".time") and n.startswith(EVENTS) and column[-1] > 0:
            assert min(abs(t - column[-1]) for t in listed) <= described.bounds[n], n


def test_the_mechanism_is_drawn(name: str, page: Page, prepared: Callable[[str], Prepared]) -> None:
    """At the start, in the middle and at the end every shape has its place on the screen; the picture that
    came by the FMU is the model's."""
    picture = picture_of(prepared(name))
    assert picture is not None
    facts = "() => JSON.parse(document.getElementById('facts').textContent).picture"
    assert page.tab.evaluate(facts) == picture
    for key in ("Home", "PageUp", "End"):
        page.tab.locator("#scrub").focus()
        page.tab.keyboard.press(key)
        drawn = page.tab.evaluate("() => document.getElementById('picture').innerHTML")
        assert "NaN" not in drawn
        assert "Infinity" not in drawn
    count = page.tab.evaluate("() => document.querySelectorAll('#picture *').length")
    assert count >= len(picture["shapes"])


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_it_fits_the_screen(width: int, theme: str, page: Page) -> None:
    """At 400 pixels and on a desktop nothing is cut off sideways, and the theme is the reader's."""
    page.tab.set_viewport_size({"width": width, "height": 900})
    page.tab.emulate_media(color_scheme=theme)
    # charts follow in the next frame
    page.until(f"document.documentElement.scrollWidth <= {width}")
    paper = page.tab.evaluate("() => getComputedStyle(document.body).backgroundColor")
    light = sum(int(c) for c in paper.removeprefix("rgb(").removesuffix(")").split(",")) > 384
    assert light == (theme == "light")


def test_a_slider_moves_the_fmu(page: Page, native: Native) -> None:
    """With its first parameter or start value moved by the slider, what the page shows at the end is what
    the native FMU answers with that value."""
    moved, to = page.tab.evaluate(MOVE)
    page.slide(moved, to)
    shown = page.tab.evaluate("() => lagfmu.shown()")
    given = {
        k: v
        for kind in ("parameters", "start", "inputs")
        for k, v in shown["settings"][kind].items()
    }
    assert list(given) == [moved]
    check_end(shown, native.run(**given))
