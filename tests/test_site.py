"""The site that mkdocs builds of docs/: strictly, with what its hooks add, and for every reader."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import Opened
from once import once
from PIL import Image

REPOSITORY = Path(__file__).parent.parent

pytestmark = pytest.mark.thorough


@pytest.fixture(scope="module")
def site(shared_folder: Path) -> Path:
    """The site with the live pages of two models."""
    pytest.importorskip("mkdocs")

    def make(place: Path) -> None:
        command = [
            sys.executable,
            "-m",
            "mkdocs",
            "build",
            "--strict",
            "-q",
            "-d",
            str(place / "site"),
        ]
        run = subprocess.run(
            command,
            cwd=REPOSITORY,
            env={**os.environ, "LAGFMU_GALLERY": "hemisphere,hoop"},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )
        assert run.returncode == 0, run.stderr[-2000:]

    return once(shared_folder / "site", make) / "site"


def test_the_site_builds_strictly(site: Path) -> None:
    """Every page in the navigation, no broken link, every name of the reference documented; the gallery
    holds live pages (of two models here), which lessons link, tutorial and lessons are there as notebooks."""
    assert "lagfmu" in (site / "gallery" / "hoop.html").read_text(encoding="utf-8")
    assert 'href="hemisphere.html"' in (site / "gallery" / "index.html").read_text(encoding="utf-8")
    assert (site / "tutorial.ipynb").is_file()
    assert 'href="../tutorial.ipynb"' in (site / "tutorial" / "index.html").read_text("utf-8")
    made = json.loads((site / "mechanics" / "hoop.ipynb").read_text(encoding="utf-8"))
    assert made["metadata"]["kernelspec"]["name"] == "python3"  # else Jupyter asks for it
    assert 'href="../gallery/hoop.html"' in (site / "mechanics" / "index.html").read_text("utf-8")
    lesson = (site / "mechanics" / "hemisphere" / "index.html").read_text("utf-8")
    assert 'href="../hemisphere.ipynb"' in lesson
    assert "<details>\n<summary>Answer</summary>\n<p>" in lesson


SHOWN = """() => [...document.querySelectorAll("picture img")].map((e) => [
    new URL(e.currentSrc).pathname, e.naturalWidth > 100, new URL(e.closest("a").href).pathname])"""


@pytest.mark.parametrize("wish", ["no-preference", "reduce"])
@pytest.mark.parametrize(
    ("name", "files"),
    [("", ["hemisphere"]), ("mechanics/", ["hoop"]), ("gallery/", ["hemisphere", "hoop"])],
)
def test_mechanisms_move_unless_the_reader_wants_none(
    wish: str, name: str, files: list[str], site: Path, opened: Opened
) -> None:
    """The first page, the lecturer's and each model of the gallery have a film of many frames, which opens
    the live page; who asks for less motion has one picture in its place."""
    page = opened(site / name / "index.html", reduced_motion=wish)
    page.until("[...document.querySelectorAll('picture img')].every((e) => e.complete)")
    shown = page.tab.evaluate(SHOWN)
    assert [Path(file).stem for file, *_ in shown] == files
    assert len(shown) == len(files)
    for file, drawn, target in shown:
        assert drawn
        assert Path(target).is_file()
        assert file.endswith(".webp") == (wish != "reduce")
        if wish != "reduce":
            with Image.open(file) as film:
                assert film.n_frames > 10


@pytest.mark.parametrize(
    "name", ["", "gallery/", "tutorial/", "live/", "mechanics/", "mechanics/hoop/"]
)
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_nothing_of_the_site_keeps_a_reader_out(
    name: str, theme: str, site: Path, opened: Opened
) -> None:
    """axe-core finds nothing: contrast, headings, heads of tables, links told by more than colour."""
    page = opened(
        site / name / "index.html",
        color_scheme=theme,
        viewport={"width": 800, "height": 900},
    )
    page.until("document.querySelector('[data-md-component=container]')")
    assert page.violations() == []
    page.problems.clear()  # axe asks for the style sheets, which a page that is a file may not
