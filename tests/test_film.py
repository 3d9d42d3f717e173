"""Films of a run: lagfmu simulate --animate, for FMUs of either target and for model files."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import Opened
from PIL import Image
from typer.testing import CliRunner

from lagfmu import simulate
from lagfmu.testing import Prepared, app, film, shapes, told_by, view

Fmu = Callable[[str], Path]


def animate(target: Path, out: Path, *options: str) -> Any:
    return CliRunner().invoke(app, ["simulate", str(target), "--animate", str(out), *options])


def places(image: Image.Image, colour: str) -> Any:
    """Pixels (row, column) of about that colour."""
    wanted = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
    return np.argwhere(
        np.abs(np.asarray(image.convert("RGB")).astype(int) - wanted).sum(axis=2) < 60
    )


def test_the_mass_falls_in_the_film(native_fmu: Fmu, tmp_path: Path) -> None:
    """Atwood's machine: a film of 1 s has 25 frames a second; the heavier mass, on the left, goes down, and
    the string pulls both upward."""
    out = tmp_path / "atwood.gif"
    result = animate(native_fmu("Atwood"), out)
    assert result.exit_code == 0, result.output
    with Image.open(out) as image:
        assert image.n_frames == 26
        assert image.info["duration"] == 40
        lowest = []
        for frame in (0, 20):
            image.seek(frame)
            bob = places(image, view.BOB)
            left = bob[bob[:, 1] < bob[:, 1].mean()]
            lowest.append(left[:, 0].max())
            assert len(places(image, view.FORCE)) > 0
        assert lowest[1] > lowest[0] + 10


def test_a_film_is_cut_to_the_motion_and_tells_the_value_of_each_arrow(
    native_fmu: Fmu, tmp_path: Path
) -> None:
    """The particle on the hemisphere: it and the surface take most of the picture; arrow and label are whole
    in every frame, and below the title; on the curve beside, the dot goes right, and falls with lambda."""
    out = tmp_path / "hemisphere.gif"
    assert animate(native_fmu("Hemisphere"), out, "--stop-time", "1.6").exit_code == 0
    dots = []
    with Image.open(out) as image:
        across = image.width - round(100 * film.BESIDE)
        title = round(100 * film.TITLE)
        for frame in range(0, image.n_frames, 5):
            image.seek(frame)
            panel = image.crop((0, 0, across, image.height))
            force = places(panel, view.FORCE)
            assert force[:, 0].min() > title
            assert force[:, 1].min() > 2
            assert force[:, 1].max() < across - 3
            label = force[:, 1].max() - force[:, 1].min()
            assert label > 60  # pixels: a name and a value, beside the arrow, which is upright
            drawn = places(panel, view.INK)
            drawn = drawn[drawn[:, 0] > title]
            assert np.ptp(drawn[:, 1]) > 0.75 * across
            beside = image.crop((across, 0, image.width, image.height))
            dots.append(places(beside, view.FORCE).mean(axis=0))
    rows, columns = np.array(dots).T
    assert (np.diff(columns) > 0).all()
    assert rows[-1] > rows[0] + 60


def volume(facets: list[Any], frame: int) -> float:
    """A third of the flux of r out of the facets: positive where all of them look outward."""
    fans = [f[frame][[0, k, k + 1]] for f in facets for k in range(1, f.shape[1] - 1)]
    return float(np.linalg.det(np.array(fans)).sum() / 6)


def test_facets_enclose_their_solid() -> None:
    """By Gauss: a b c of a box, of a cylinder and a ball that of polygons in place of circles; of a box three
    facets are seen, and the upper one is the lightest."""
    center = np.array([[0.0, 0, 0], [1, -2, 3]])
    turned = [np.array([[0.36, 0.48, -0.8]] * 2), np.array([[-0.8, 0.6, 0]] * 2)]
    turned.append(np.cross(*turned))
    box = shapes.box(center, np.array([[2.0, 3, 5]] * 2), turned)
    assert [volume(box, k) for k in (0, 1)] == pytest.approx([30, 30])
    n = shapes.ROUND
    way = np.array([0.3, 0.4, 1.2])
    rod = shapes.cylinder(center, center + way, np.array([0.5, 0.1]))
    polygon = n / 2 * np.sin(2 * np.pi / n)
    expected = [1.3 * polygon * 0.25, 1.3 * polygon * 0.01]
    assert [volume(rod, k) for k in (0, 1)] == pytest.approx(expected)
    assert volume(shapes.ball(center, np.array([2.0, 1.0])), 0) == pytest.approx(
        32 * np.pi / 3, rel=0.05
    )
    upright = shapes.box(center, np.ones((2, 3)), [np.array([e] * 2, float) for e in np.eye(3)])
    shades = [shapes.shade(f[0], shapes.TOWARDS) for f in upright]
    seen = [light for light in shades if light is not None]
    assert len(seen) == 3
    assert max(seen) == shades[4]  # facing z


def test_a_film_without_a_title_is_a_thumbnail(
    prepared: Callable[[str], Prepared], tmp_path: Path
) -> None:
    """The mechanism alone, at most 240 pixels wide and high, 4 s long, some kilobytes."""
    run = simulate(prepared("Atwood"))
    out = film.film(told_by(prepared("Atwood")), run, {}, tmp_path / "atwood.webp", "")
    with Image.open(out) as image:
        assert max(image.size) <= 240
        assert 2 < image.n_frames <= film.SMALL_MOST + 1
    assert out.stat().st_size < 100_000


def test_a_path_is_as_round_as_the_run_tells_it(prepared: Callable[[str], Prepared]) -> None:
    """A particle in the loop, twelve frames of a second: the path that it leaves behind stays within 1 % of
    the loop, where a straight way from frame to frame would cut the corner by 4 %."""
    run = simulate(prepared("Loop"), 0.9, 0.005, start_values={"der(x)": 7.1})
    told = told_by(prepared("Loop"))
    stage = film.Stage(told.picture, run, {"a": 1.0}, np.linspace(0.0, 0.9, 12), labels=False)
    (particle,) = (s for s in stage.shapes if s.shape.get("trace"))
    path = particle.path_to(11)
    assert np.linalg.norm(path, axis=1) == pytest.approx(1.0, abs=0.01)
    assert path[-1] == pytest.approx([run["x"][-1], run["y"][-1]], abs=1e-12)
    assert len(particle.path_to(0)) == 1
    between = (particle.points[0][1:] + particle.points[0][:-1]) / 2
    assert np.linalg.norm(between, axis=1).min() < 0.97


def test_a_recorded_run_plays_without_the_fmu(
    python_fmu: Fmu, tmp_path: Path, opened: Opened
) -> None:
    """A python FMU has no C sources; its run is played all the same, with the departure marked and the
    value that was set."""
    out = tmp_path / "run.html"
    result = animate(python_fmu("Hemisphere"), out, "--set", "theta=0.3", "--set", "m=2")
    assert result.exit_code == 0, result.output
    page = opened(out)
    page.until("lagfmu.runs")
    run = page.run()
    assert run["values"]["lambda.surface"][0] == pytest.approx(2 * 9.81 * np.cos(0.3), rel=1e-12)
    angle = run["values"]["departure.surface.theta"][-1]
    assert np.cos(angle) == pytest.approx(2 * np.cos(0.3) / 3, rel=1e-7)
    assert page.tab.locator("#events button").count() == 1
    assert not page.tab.locator("#dials").is_visible()
    assert page.tab.locator("#picture .arrow").is_visible()


def test_what_cannot_be_filmed_is_told(
    native_fmu: Fmu, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another ending, a model without a picture, and .mp4 without ffmpeg: each with the remedy."""
    fmu = native_fmu("Atwood")
    assert ".gif, .mp4, .html" in animate(fmu, tmp_path / "film.avi").stderr
    monkeypatch.setattr(film.shutil, "which", lambda name: None)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    told = animate(fmu, tmp_path / "film.mp4")
    assert told.exit_code == 3
    assert "pip install imageio-ffmpeg" in told.stderr
    plain = tmp_path / "plain.py"
    text = (Path(__file__).parent.parent / "models" / "bouncing_ball.py").read_text(
        encoding="utf-8"
    )
    plain.write_text(
        re.sub(r"    picture=\[.*?\n    \],\n", "", text, flags=re.DOTALL), encoding="utf-8"
    )
    assert "picture=[" in animate(plain, tmp_path / "film.gif", "--stop-time", "0.1").stderr
    assert list(tmp_path.glob("film.*")) == []
