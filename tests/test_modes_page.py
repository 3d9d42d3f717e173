"""lagfmu linearize --page: the modes of a mechanism as moving pictures."""

from __future__ import annotations

import base64
import json
import re
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MODELS, Opened
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from typer.testing import CliRunner

from lagfmu import Arrow, Disk, Holonomic, Model, Parameter, Rod, Spring, linearize
from lagfmu.errors import UsageError
from lagfmu.testing import app

pytestmark = pytest.mark.skipif("not __import__('shutil').which('cc')", reason="no C compiler")

m, M, g, L, k = symbols("m M g L k", positive=True)
MASS, OTHER, GRAVITY, LENGTH, STIFF = 1.0, 2.0, 9.81, 0.8, 3.0  # kg, kg, m/s^2, m, N/m
PARAMETERS = [
    Parameter(m, MASS, "kg"),
    Parameter(M, OTHER, "kg"),
    Parameter(g, GRAVITY, "m/s^2"),
    Parameter(L, LENGTH, "m"),
    Parameter(k, STIFF, "N/m"),
]


def coupled(drawn: bool = True) -> Model:
    """Two pendulums of one length and unlike masses, a spring between the bobs' sideways places."""
    a, b = dynamicsymbols("a b")
    one, two = (L * sin(a), -L * cos(a)), (L + L * sin(b), -L * cos(b))
    return Model(
        "Coupled",
        lagrangian=L**2 * (m * a.diff() ** 2 + M * b.diff() ** 2) / 2
        + g * L * (m * cos(a) + M * cos(b))
        - k * (L * sin(a) - L * sin(b)) ** 2 / 2,
        coordinates={a: "rad", b: "rad"},
        parameters=PARAMETERS,
        picture=[Rod((0, 0), one), Rod((L, 0), two), Spring(one, two), Disk(one), Disk(two)]
        if drawn
        else [],
    )


def hanging() -> Model:
    """A double pendulum in Cartesian coordinates."""
    x, y, u, v = dynamicsymbols("x y u v")
    return Model(
        "Hanging",
        lagrangian=(m * (x.diff() ** 2 + y.diff() ** 2) + M * (u.diff() ** 2 + v.diff() ** 2)) / 2
        - g * (m * y + M * v),
        coordinates={x: "m", y: "m", u: "m", v: "m"},
        constraints=[
            Holonomic("upper", x**2 + y**2 - L**2),
            Holonomic("lower", (u - x) ** 2 + (v - y) ** 2 - L**2),
        ],
        parameters=PARAMETERS[:-1],
        start={x: 0.0, y: -LENGTH, u: 0.0, v: -2 * LENGTH},
        picture=[
            Rod((0, 0), (x, y)),
            Rod((x, y), (u, v)),
            Arrow("upper", at=(x, y)),
            Disk((u, v)),
        ],
    )


def recorded(page: Path) -> tuple[dict[str, Any], list[dict[str, np.ndarray]]]:
    """Facts of a page, and its runs: columns by name."""
    text = page.read_text(encoding="utf-8")
    facts, packed = (
        re.search(f'id="{what}">(.*?)</script>', text, re.DOTALL).group(1)
        for what in ("facts", "recording")
    )
    facts = json.loads(facts)
    column = [key for key, _ in facts["usual"]].index("column")
    rows = [[*v, *[None] * (column + 1 - len(v))] for v in facts["variables"]]
    names = ["time", *(v[0] for v in rows if v[column] is None)]
    numbers = np.frombuffer(zlib.decompress(base64.b64decode(packed)), dtype="<f8")
    runs = numbers.reshape(len(facts["modes"]), len(names), -1)
    return facts, [dict(zip(names, run, strict=True)) for run in runs]


def test_coupled_pendulums_swing_in_phase_and_against_each_other(tmp_path):
    """w^2 = g/L with a = b, and g/L + k/m + k/M with m a = -M b: in every frame of a mode, which lasts one
    period and swings as far one way as the other."""
    page = tmp_path / "modes.html"
    found = linearize(coupled(), equilibrium=True, page=page)
    facts, runs = recorded(page)
    squares = GRAVITY / LENGTH, GRAVITY / LENGTH + STIFF / MASS + STIFF / OTHER
    for run, square, ratio, told, column in zip(
        runs, squares, (1.0, -MASS / OTHER), facts["modes"], (0, 2), strict=True
    ):
        w = np.sqrt(square)
        assert run["time"][-1] == pytest.approx(2 * np.pi / w, rel=1e-10)
        assert told["title"] == f"{w / (2 * np.pi):.4g} Hz"
        np.testing.assert_allclose(run["b"], ratio * run["a"], atol=1e-10 * abs(run["a"]).max())
        shape = dict(zip(found.coordinates, found.shapes[:, column], strict=True))
        assert shape["b"] / shape["a"] == pytest.approx(ratio, rel=1e-10)
        np.testing.assert_allclose(run["a"], run["a"][0] * np.cos(w * run["time"]), atol=1e-12)
        assert 0.02 < max(abs(run["a"][0]), abs(run["b"][0])) < 0.36


def test_rods_keep_their_length_in_each_frame(tmp_path):
    """What the mode leaves of the constraints is taken away, and the amplitudes remain those of the mode but
    for the square of the displacement."""
    page = tmp_path / "modes.html"
    found = linearize(hanging(), equilibrium=True, page=page)
    facts, runs = recorded(page)
    assert not any(s["kind"] == "arrow" for s in facts["picture"]["shapes"])
    for run, column in zip(runs, (0, 2), strict=True):
        x, y, u, v = (run[n] for n in "xyuv")
        np.testing.assert_allclose(np.hypot(x, y), LENGTH, rtol=1e-13)
        np.testing.assert_allclose(np.hypot(u - x, v - y), LENGTH, rtol=1e-13)
        shape = dict(zip(found.coordinates, found.shapes[:, column], strict=True))
        assert u[0] / x[0] == pytest.approx((shape["u"] / shape["x"]).real, rel=0.02)
        far = max(np.hypot(u - u[24], v - v[24]).max(), np.hypot(x - x[24], y - y[24]).max())
        assert 0.05 < far / (2 * LENGTH) < 0.2


def test_a_real_mode_decays(tmp_path):
    """A crane's trolley that comes to rest: e^(s t), over four of its times."""
    page = tmp_path / "modes.html"
    found = linearize(MODELS / "crane.py", equilibrium=True, page=page)
    _, runs = recorded(page)
    (rate,) = (s.real for s in found.poles.values if s.imag == 0)
    time, s = runs[0]["time"], runs[0]["s"] - found.point["s"]
    assert time[-1] == pytest.approx(-4 / rate)
    np.testing.assert_allclose(s, s[0] * np.exp(rate * time), rtol=1e-9)


def test_the_page_plays_a_mode_over_and_over(tmp_path, opened: Opened):
    """Its menu names the modes, beside it stand damping and amplitudes, below the table of poles; a period
    after the other is shown."""
    page = tmp_path / "modes.html"
    linearize(coupled(), equilibrium=True, page=page)
    seen = opened(page)
    seen.until("lagfmu.runs")
    titles = seen.tab.locator("#mode option").all_inner_texts()
    squares = GRAVITY / LENGTH, GRAVITY / LENGTH + STIFF / MASS + STIFF / OTHER
    assert titles == [f"{np.sqrt(w2) / (2 * np.pi):.4g} Hz" for w2 in squares]
    assert "damping 0.0000" in seen.tab.inner_text("#mode-words")
    assert seen.tab.locator("#picture .arrow").count() == 0
    seen.tab.select_option("#mode", index=1)
    seen.until("lagfmu.runs > 1")
    assert "against" in seen.tab.inner_text("#mode-words")
    run = seen.run()
    assert run["values"]["b"][0] == pytest.approx(-run["values"]["a"][0] / 2)
    seen.tab.select_option("#speed", "5")
    seen.tab.click("#play-button")
    clock = "Number(document.getElementById('scrub').value)"
    seen.until(f"{clock} > 0.9")
    seen.until(f"{clock} < 0.5")
    assert seen.tab.inner_text("#play-button") == "Pause"
    assert seen.tab.locator("table", has_text="frequency [Hz]").locator("tbody tr").count() == 2
    assert seen.violations() == []
    assert seen.problems == []


def test_without_a_picture_there_are_words_and_curves(tmp_path, opened: Opened):
    """It says that there is none."""
    page = tmp_path / "modes.html"
    linearize(coupled(drawn=False), equilibrium=True, page=page)
    seen = opened(page)
    seen.until("lagfmu.runs")
    assert "the model has no picture" in seen.tab.inner_text("main")
    assert seen.tab.locator("#picture").count() == 0
    assert seen.problems == []


def test_what_has_no_modes_has_no_page(tmp_path):
    """The wheel of an axle that turns freely: told, and nothing is written."""
    (turn,) = dynamicsymbols("turn,")
    free = Model(
        "Free",
        lagrangian=m * L**2 * turn.diff() ** 2 / 2,
        coordinates={turn: "rad"},
        parameters=[PARAMETERS[0], PARAMETERS[3]],
    )
    with pytest.raises(UsageError, match="Free has no modes to show"):
        linearize(free, page=tmp_path / "modes.html")
    assert not [*tmp_path.iterdir()]


def test_the_command_writes_the_page(native_fmu, tmp_path):
    """Of an FMU as of a model."""
    page = tmp_path / "modes.html"
    words = ["linearize", str(native_fmu("Crane")), "--equilibrium", "--page", str(page)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "modes.html" in done.output
    assert len(recorded(page)[1]) == 2
