"""The live page: the FMU that runs in it is the native one, it needs no network, and it tells why
it refuses a run."""

from __future__ import annotations

import json
import re
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Page
from conftest import FILES
from typer.testing import CliRunner

from lagfmu.cli.app import app
from lagfmu.live.playable import playable as playable_of
from lagfmu.live.render import Playable, render
from lagfmu.verification.simulate import read_description, simulate

pytest.importorskip("wasmtime", reason="pip install -e '.[test]'")

from wasm import Module

ROUNDING = 1e-14  # relative: the two C libraries differ in the last place of sin, cos and pow


@pytest.fixture(scope="module")
def native(native_fmu: Callable[[str], Path]) -> Callable[[str], Any]:
    """native(NAME): the native FMU's run, and how far rounding may carry each of its real outputs."""
    made: dict[str, Any] = {}

    def get(name: str) -> Any:
        if name not in made:
            run = simulate(native_fmu(name))
            made[name] = run, allowed(native_fmu(name), run)
        return made[name]

    return get


def allowed(fmu: Path, run: Any) -> dict[str, float]:
    """1e-14 of the largest output in a unit, and what changes of 1e-14 of each parameter and start value
    grow to over the run.  A residual is left out: it is nothing but rounding."""
    variables = {v.name: v for v in read_description(fmu).modelVariables}
    names = [n for n in run.dtype.names if run[n].dtype.kind == "f" and n != "time"]
    names = [n for n in names if not n.startswith("residual.")]
    sizes: dict[str, float] = {}
    for n in names:
        unit = variables[n].unit
        sizes[unit] = max(sizes.get(unit, 0.0), float(np.max(np.abs(run[n]))))
    bounds = {n: ROUNDING * sizes[variables[n].unit] for n in names}
    for v in variables.values():
        settable = v.causality == "parameter" or v.initial in ("exact", "approx")
        if settable and v.type == "Real" and not v.name.startswith("solver."):
            start = float(v.start)
            other = simulate(fmu, start_values={v.name: start + ROUNDING * (abs(start) or 1.0)})
            for n in names:
                bounds[n] += float(np.max(np.abs(other[n] - run[n])))
    return bounds


@pytest.mark.parametrize("name", FILES)
def test_the_module_is_the_native_fmu(
    name: str, playable: Callable[[str], Playable], native: Callable[[str], Any]
) -> None:
    """In wasmtime: what the module answers is what the machine's own binary answers, but for rounding in
    the C library; and it asks nothing of its host."""
    run, bounds = native(name)
    module = Module(playable(name).module, playable(name).facts)
    assert module.imports == []
    found = module.simulate(run["time"])
    assert set(found.dtype.names) == set(run.dtype.names)
    for n, bound in bounds.items():
        assert np.max(np.abs(found[n] - run[n])) <= bound, n
    for n in run.dtype.names:
        if run[n].dtype.kind in "bi":
            assert (found[n] == run[n]).all(), n


@pytest.mark.parametrize("name", FILES)
def test_the_page_runs_the_native_fmu_without_a_network(
    name: str, opened: Callable[..., Page], native: Callable[[str], Any]
) -> None:
    """In Chromium, from disk: every lambda at the end of the run is the native FMU's."""
    expected, bounds = native(name)
    run = opened(name).run()
    assert run["time"] == list(expected["time"])
    for n in (n for n in expected.dtype.names if n.startswith(("lambda.", "departure."))):
        assert run["values"][n][-1] == pytest.approx(
            expected[n][-1], abs=bounds.get(n, 0), rel=0
        ), n


def test_the_particle_leaves_at_two_thirds(opened: Callable[..., Page]) -> None:
    """cos(theta) = (2/3) cos(theta0) at the departure, for the start that a script asks for."""
    run = opened("Hemisphere").run({"start": {"theta": 0.3}, "parameters": {"m": 2.5}})
    angle = run["values"]["departure.surface.theta"][-1]
    assert np.cos(angle) == pytest.approx(2 * np.cos(0.3) / 3, rel=1e-8)
    assert run["values"]["lambda.surface"][0] == pytest.approx(2.5 * 9.81 * np.cos(0.3), rel=1e-14)
    assert any("opened at" in m["message"] for m in run["log"])


def test_a_refused_run_shows_the_reason(opened: Callable[..., Page]) -> None:
    """A mass of zero is refused in the FMU's words; names that it does not have, all at once."""
    page = opened("Hemisphere")
    assert "'m' = 0" in page.refusal({"parameters": {"m": 0}})
    told = page.refusal({"parameters": {"q": 1}, "start": {"m": 2}, "method": "euler"})
    assert all(part in told for part in ("'q'", "'m'", "'euler'", "theta", "dop853"))
    assert "stepsize" in page.refusal({"stepsize": 0.1})


def test_what_an_fmu_says_is_text(
    native_fmu: Callable[[str], Path], tmp_path: Path, browser: Any
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
    page = Page(browser, out)
    assert page.run()["time"][-1] == 2.0
    assert page.tab.title().startswith("Hemisphere")
    assert page.tab.locator(".lead").inner_text().startswith(evil)
    assert page.tab.locator("main img, main script").count() == 0
    page.close()
    assert page.problems == []


def test_a_python_fmu_has_no_sources_to_compile(
    python_fmu: Callable[[str], Path], tmp_path: Path
) -> None:
    """The message says what to do."""
    fmu = str(python_fmu("Hemisphere"))
    result = CliRunner().invoke(app, ["page", fmu, "--out", str(tmp_path / "p.html")])
    assert result.exit_code == 1
    assert "--target native" in result.stderr
    assert not (tmp_path / "p.html").exists()


def test_a_page_shows_what_is_asked_for(native_fmu: Callable[[str], Path], tmp_path: Path) -> None:
    """--add-output and --outputs as in build: the pull of the rod m (g cos(theta) + L omega^2) beside lambda,
    of which it is -2 L lambda; of an FMU they are refused."""
    model = str(Path(__file__).parent.parent / "models" / "pendulum.py")
    out = tmp_path / "pull.html"
    words = ["--add-output", "pull = -2*L*lambda.rod [N]", "--outputs", "pull,lambda.rod"]
    result = CliRunner().invoke(app, ["page", model, *words, "--out", str(out)])
    assert result.exit_code == 0, result.output
    facts = json.loads(re.search(r'id="facts"[^>]*>(.*?)</script>', out.read_text(), re.DOTALL)[1])
    columns = [v["name"] for v in facts["variables"] if v["column"]]
    assert {"pull", "lambda.rod"} <= set(columns)
    assert "energy.total" not in columns
    fmu = str(native_fmu("Hemisphere"))
    result = CliRunner().invoke(app, ["page", fmu, *words, "--out", str(out)])
    assert result.exit_code == 1
    assert "--outputs and --add-output" in result.stderr


def test_a_start_off_the_constraints_gets_no_page(tmp_path: Path) -> None:
    """A rod of 1 m and a bob at 1.6 m: refused as build refuses it, with the nearest start that there is."""
    source = (Path(__file__).parent.parent / "models" / "pendulum.py").read_text(encoding="utf-8")
    file, out = tmp_path / "off.py", tmp_path / "off.html"
    file.write_text(
        source + "\nfrom dataclasses import replace\n"
        "model = replace(model, start={**model.start, next(iter(model.coordinates)): 1.6})\n",
        encoding="utf-8",
    )
    result = CliRunner().invoke(app, ["page", str(file), "--out", str(out)])
    assert result.exit_code == 1
    assert "misses the constraints" in result.stderr
    assert not out.exists()


def test_without_zig_the_message_says_what_to_do(
    native_fmu: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The system's cc knows no WebAssembly."""
    monkeypatch.setattr("lagfmu.live.wasm.find_compiler", lambda: None)
    fmu = str(native_fmu("Hemisphere"))
    result = CliRunner().invoke(app, ["page", fmu, "--out", str(tmp_path / "p.html")])
    assert result.exit_code == 1
    assert "pip install lagfmu[native]" in result.stderr


def test_a_page_is_the_same_from_model_and_fmu(
    playable: Callable[[str], Playable], native_fmu: Callable[[str], Path], tmp_path: Path
) -> None:
    """lagfmu page MODEL.py and lagfmu page of the FMU built of it: one page, byte for byte."""
    model = Path(__file__).parent.parent / "models" / "hemisphere.py"
    pages = []
    for target in (model, native_fmu("Hemisphere")):
        out = tmp_path / f"{target.suffix[1:]}.html"
        result = CliRunner().invoke(app, ["page", str(target), "--out", str(out)])
        assert result.exit_code == 0, result.output
        pages.append(out.read_bytes())
    assert pages[0] == pages[1]


@pytest.mark.parametrize("target", ["python", "native"])
def test_the_page_travels_in_the_fmu(target: str, tmp_path: Path, browser: Any) -> None:
    """lagfmu build --page: the page lies beside the documentation, which has a link to it, and the FMU
    grows by 250 kB at most; without the option it is as it was."""
    model = str(Path(__file__).parent.parent / "models" / "rolling_sphere.py")
    options = ["build", model, "--target", target, "--no-check", "--out"]
    for out, extra in (("with", ["--page"]), ("without", [])):
        result = CliRunner().invoke(app, [*options, str(tmp_path / out), *extra])
        assert result.exit_code == 0, result.output
    contents, sizes = [], []
    for out in ("with", "without"):
        path = tmp_path / out / target / "RollingSphere.fmu"
        sizes.append(path.stat().st_size)
        with zipfile.ZipFile(path) as archive:
            contents.append({n: archive.read(n) for n in archive.namelist()})
    assert sizes[0] - sizes[1] < 250e3
    live, index = contents[0].pop("documentation/play.html"), "documentation/index.html"
    assert b'href="play.html"' in contents[0].pop(index)
    assert b"play.html" not in contents[1].pop(index)
    assert contents[0] == contents[1]
    path = tmp_path / "play.html"
    path.write_bytes(live)
    page = Page(browser, path)
    assert page.run()["time"][-1] == 2.0
    page.close()
    assert page.problems == []
