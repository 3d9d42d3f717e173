"""The live page: how it is made, what it needs, that texts of an FMU stay texts, and why it refuses a run."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from conftest import MODELS, Opened
from typer.testing import CliRunner

from lagfmu.testing import Playable, app, live_play, render
from lagfmu.testing import playable as playable_of


def test_a_script_runs_the_page_or_is_told_why_not(opened: Opened) -> None:
    """cos(theta) = (2/3) cos(theta0) at the departure, for the start that it asks for; a mass of zero is
    refused in the FMU's words, and names that it does not have, all at once."""
    page = opened("Hemisphere")
    run = page.run({"start": {"theta": 0.3}, "parameters": {"m": 2.5}})
    angle = run["values"]["departure.surface.theta"][-1]
    assert np.cos(angle) == pytest.approx(2 * np.cos(0.3) / 3, rel=1e-8)
    assert run["values"]["lambda.surface"][0] == pytest.approx(2.5 * 9.81 * np.cos(0.3), rel=1e-14)
    assert any("opened at" in m["message"] for m in run["log"])
    assert "'m' = 0" in page.refusal({"parameters": {"m": 0}})
    told = page.refusal({"parameters": {"q": 1}, "start": {"m": 2}, "method": "euler"})
    assert all(part in told for part in ("'q'", "'m'", "'euler'", "theta", "dop853"))
    assert "stepsize" in page.refusal({"stepsize": 0.1})


def test_what_an_fmu_says_is_text(
    native_fmu: Callable[[str], Path], tmp_path: Path, opened: Opened
) -> None:
    """A description with markup in it is shown as it is written, and runs nothing."""
    evil = "<img src=x onerror=alert(1)></script><script>document.title='taken'</script>"
    source = native_fmu("Hemisphere")
    path = tmp_path / "Evil.fmu"
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            text = old.read(name)
            if name == "modelDescription.xml":
                mark = evil.replace("<", "&lt;").replace(">", "&gt;").encode()
                text = text.replace(b"radius of the hemisphere", mark)
                text = text.replace(b"Particle that slides", mark)
            if name == "documentation/index.html":
                text = text.replace(b"<math", b"<script>document.title='taken'</script><math", 1)
            new.writestr(name, text)
    out = tmp_path / "evil.html"
    out.write_text(render(playable_of(path)), encoding="utf-8")
    page = opened(out)
    assert page.run()["time"][-1] == 2.0
    assert page.tab.title().startswith("Hemisphere")
    assert page.tab.locator(".lead").inner_text().startswith(evil)
    assert page.tab.locator("main img, main script").count() == 0


def test_a_python_fmu_has_no_sources_to_compile(
    python_fmu: Callable[[str], Path], tmp_path: Path
) -> None:
    """The message says what to do."""
    fmu = str(python_fmu("Hemisphere"))
    result = CliRunner().invoke(app, ["page", fmu, "--out", str(tmp_path / "p.html")])
    assert result.exit_code == 3
    assert "--target native" in result.stderr
    assert not (tmp_path / "p.html").exists()


def test_a_page_shows_what_is_asked_for(native_fmu: Callable[[str], Path], tmp_path: Path) -> None:
    """--add-output and --outputs as in build: the pull of the rod m (g cos(theta) + L omega^2) beside lambda,
    of which it is -2 L lambda; of an FMU they are refused.  A folder gets a file of the model's name."""
    model = str(MODELS / "pendulum.py")
    words = ["--add-output", "pull = -2*L*lambda.rod [N]", "--outputs", "pull,lambda.rod"]
    result = CliRunner().invoke(app, ["page", model, *words, "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    [out] = tmp_path.iterdir()
    assert out.suffix == ".html"
    facts = json.loads(re.search(r'id="facts"[^>]*>(.*?)</script>', out.read_text(), re.DOTALL)[1])
    names = {name for name, *_ in facts["variables"]}
    assert {"pull", "lambda.rod"} <= names
    assert "energy.total" not in names
    fmu = str(native_fmu("Hemisphere"))
    result = CliRunner().invoke(app, ["page", fmu, *words, "--out", str(out)])
    assert result.exit_code == 2
    assert "--outputs and --add-output" in result.stderr


def test_a_start_off_the_constraints_gets_no_page(tmp_path: Path) -> None:
    """A rod of 1 m and a bob at 1.6 m: refused as build refuses it, with the nearest start that there is."""
    source = (MODELS / "pendulum.py").read_text(encoding="utf-8")
    file, out = tmp_path / "off.py", tmp_path / "off.html"
    file.write_text(
        source + "\nfrom dataclasses import replace\n"
        "model = replace(model, start={**model.start, next(iter(model.coordinates)): 1.6})\n",
        encoding="utf-8",
    )
    result = CliRunner().invoke(app, ["page", str(file), "--out", str(out)])
    assert result.exit_code == 3
    assert "misses the constraints ('rod' by 1.85 m²)" in result.stderr
    assert not out.exists()


def test_without_zig_the_message_says_what_to_do(
    native_fmu: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The system's cc knows no WebAssembly."""
    monkeypatch.setattr(live_play, "find_compiler", lambda: None)
    fmu = str(native_fmu("Hemisphere"))
    result = CliRunner().invoke(app, ["page", fmu, "--out", str(tmp_path / "p.html")])
    assert result.exit_code == 3
    assert "pip install ziglang" in result.stderr


def test_a_page_is_the_same_from_model_and_fmu(
    playable: Callable[[str], Playable], native_fmu: Callable[[str], Path], tmp_path: Path
) -> None:
    """lagfmu page MODEL.py and lagfmu page of the FMU built of it: one page, byte for byte."""
    model = MODELS / "hemisphere.py"
    pages = []
    for target in (model, native_fmu("Hemisphere")):
        out = tmp_path / f"{target.suffix[1:]}.html"
        result = CliRunner().invoke(app, ["page", str(target), "--out", str(out)])
        assert result.exit_code == 0, result.output
        pages.append(out.read_bytes())
    assert pages[0] == pages[1]


@pytest.mark.parametrize("target", ["native", pytest.param("python", marks=pytest.mark.thorough)])
def test_the_page_travels_in_the_fmu(
    target: str, tmp_path: Path, opened: Opened, request: pytest.FixtureRequest
) -> None:
    """lagfmu build --page: the page lies beside the documentation, which has a link to it, and the FMU
    grows by 250 kB at most; without the option it is as it was (but for the icon, which the FMUs that tests
    share do not have)."""
    model = str(MODELS / "rolling_sphere.py")
    words = f"--scene RollingSphere --target {target} --no-check --page --out {tmp_path}"
    result = CliRunner().invoke(app, ["build", model, *words.split()])
    assert result.exit_code == 0, result.output
    plain = request.getfixturevalue(f"{target}_fmu")("RollingSphere")
    contents, sizes = [], []
    for path in (tmp_path / target / "RollingSphere.fmu", plain):
        sizes.append(path.stat().st_size)
        with zipfile.ZipFile(path) as archive:
            told = [n for n in archive.namelist() if not n.startswith("terminalsAndIcons/")]
            contents.append({n: archive.read(n) for n in told})
    assert sizes[0] - sizes[1] < 250e3
    live, index = contents[0].pop("documentation/play.html"), "documentation/index.html"
    assert b'href="play.html"' in contents[0].pop(index)
    assert b"play.html" not in contents[1].pop(index)
    assert contents[0] == contents[1]
    path = tmp_path / "play.html"
    path.write_bytes(live)
    page = opened(path)
    assert page.run()["time"][-1] == 2.0
