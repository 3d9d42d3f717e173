"""The page of a model: which sliders, curves and ranges its live page shows at first."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from browser import Page as Opened
from conftest import model_file
from sympy import Symbol
from sympy.physics.mechanics import dynamicsymbols

from lagfmu import Model, Page, Scene
from lagfmu.errors import BuildError, ModelError
from lagfmu.testing import PRESET, Prepared, prepare, preset_of, read_preset, told_by

SHOWN = """() => ({
    sliders: [...document.querySelectorAll("#dials details[open] input[data-name]")]
        .map((e) => [e.dataset.name, Number(e.min), Number(e.max)]),
    lead: document.querySelector("#lead-name option:checked").textContent,
    captions: [...document.querySelectorAll("#charts figcaption")].map((e) => e.textContent),
    ticked: [...document.querySelectorAll("#chart-choices input:checked")].length,
    all: document.querySelectorAll("#dials input[data-name]").length,
})"""


def bead(page: object) -> Model:
    return replace(model_file("hemisphere").model, page=page)


def test_a_page_shows_first_what_its_model_names(opened: Callable[..., Opened]) -> None:
    """Four sliders of the hemisphere in their order, with their ends; lambda beside the picture, a chart
    for each unit of the curves; all others are there, folded away."""
    page = opened("Hemisphere")
    page.until("lagfmu.runs")
    found = page.tab.evaluate(SHOWN)
    names = [n for n, *_ in found["sliders"]]
    assert names == ["theta", "der(theta)", "a", "m"]
    assert found["sliders"][0][1:] == [0, 1.2]
    assert found["sliders"][2][1:] == [0.2, 2]
    assert found["all"] == 7
    assert found["lead"] == "lambda.surface"
    assert found["captions"] == [f"Of interest [{unit}]" for unit in ("N", "rad", "J")]
    assert found["ticked"] == 1


def test_the_page_of_a_model_travels_in_its_fmu(
    native_fmu: Callable[[str], Path], prepared: Callable[[str], Prepared]
) -> None:
    """A page that is made of the FMU is that of the model."""
    made = preset_of(prepared("Belt"))
    assert made is not None
    assert made["curves"][0] == "lambda.ride"
    assert told_by(native_fmu("Belt")).preset == made
    with zipfile.ZipFile(native_fmu("Belt")) as archive:
        assert PRESET in archive.namelist()


def test_a_scene_leaves_out_what_its_fmu_does_not_have() -> None:
    """Sliders of parameters that are fixed, and curves that no importer reads."""
    scene = Scene("Some", outputs=["lambda.surface", "theta"], fixed=["m"])
    made = preset_of(prepare(model_file("hemisphere").model, scene))
    assert made is not None
    assert made["sliders"] == ["theta", "der(theta)", "a"]
    assert made["curves"] == ["lambda.surface", "theta"]


@pytest.mark.parametrize(
    ("name", "narrower", "left"),
    [
        ("slider_crank", {"outputs": ["phi"]}, ["x", "y"]),
        ("belt", {"frictions": []}, ["lambda.ride", "x"]),
    ],
)
def test_a_narrower_scene_keeps_what_it_can_of_the_page(name, narrower, left) -> None:
    """An FMU without outputs of the model's own, one without those of frictions: the page names both."""
    made = preset_of(prepare(model_file(name).model, Scene("Some", **narrower)))
    assert made is not None
    assert made["curves"] == left


def test_names_that_are_none_are_told_with_those_that_are_meant() -> None:
    """All at once, each with what may have been meant; a pattern means all that fit."""
    wrong = Page(
        sliders=["thetta", "lambda.surface"], curves=["lambda.surfce"], ranges={"n": (0, 1)}
    )
    with pytest.raises(ModelError) as caught:
        preset_of(prepare(bead(wrong), Scene("Wrong")))
    told = str(caught.value)
    assert "slider 'thetta' is unknown; did you mean 'theta'" in told
    assert "slider 'lambda.surface' is unknown" in told
    assert "curve 'lambda.surfce' is unknown; did you mean 'lambda.surface'" in told
    assert "range 'n' is unknown" in told
    made = preset_of(prepare(bead(Page(curves=["energy.?o*", "theta"])), Scene("Right")))
    assert made is not None
    assert made["curves"] == ["energy.potential", "energy.total", "theta"]


def test_what_no_page_can_be_is_told_when_it_is_written() -> None:
    """Ranges that are none, that go beyond the bounds, that leave the model's value out; no lists."""
    m, theta = Symbol("m", positive=True), dynamicsymbols("theta")
    ranges = {m: (-1, 3), "a": (2, 3), theta: (1, 1), "g": 9.81}
    with pytest.raises(ModelError) as caught:
        bead(Page(sliders="m", curves=[1.5], ranges=ranges))
    told = str(caught.value)
    for part in (
        "sliders = 'm', expected e.g. sliders=[m, 'lambda.wire']",
        "curves hold 1.5",
        "the range of m is (-1, 3), beyond its bounds [0, None]",
        "the range of a is (2, 3) without its own value 1.0",
        "the range of theta is (1, 1), expected the lower number first",
        "the range of g is 9.81, expected two numbers",
    ):
        assert part in told
    with pytest.raises(ModelError, match=re.escape("expected Page(")):
        bead(["theta"])


@pytest.mark.parametrize(
    "text", ["[]", "{}", '{"sliders": [], "curves": [], "ranges": {"m": [3, 1]}}', "no"]
)
def test_a_forged_page_is_refused(text: str) -> None:
    """An FMU may come from anywhere."""
    with pytest.raises(BuildError, match=re.escape("page.json is no page")):
        read_preset(text.encode())
    kept = {"sliders": ["<b>"], "curves": [], "ranges": {"m": [0, 1]}}
    assert read_preset(json.dumps(kept).encode()) == kept
