"""The examples of the README and of docs/ do what these say."""

from __future__ import annotations

import importlib.util
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import typer.main
from conftest import EVERY, Fmu, model_file, of_each_kind
from typer.testing import CliRunner

import lagfmu
from lagfmu import Arrow, simulate, verify
from lagfmu.testing import (
    WRONG,
    Bench,
    app,
    attempt,
    find_compiler,
    lay_beside,
    load,
    prepare,
    probes,
    verdict,
    write,
)

REPOSITORY = Path(__file__).parent.parent
README = (REPOSITORY / "README.md").read_text(encoding="utf-8")
PAGES = sorted((REPOSITORY / "docs").glob("*.md"))
LESSONS = sorted((REPOSITORY / "docs" / "mechanics").glob("*.md"))
TEXT = "\n".join([README, *(page.read_text(encoding="utf-8") for page in PAGES)])
GALLERY = (REPOSITORY / "docs" / "gallery.md").read_text(encoding="utf-8")
TUTORIAL = (REPOSITORY / "docs" / "tutorial.md").read_text(encoding="utf-8")


def commands(text: str) -> list[list[str]]:
    """Those of a text, in words."""
    found = re.findall(r"^    lagfmu ([^#\n]*?) *(?:#.*)?$", text, re.MULTILINE)
    return [shlex.split(c) for c in dict.fromkeys(found)]


BLOCKS = list(dict.fromkeys(re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)))
VARIED = ("parameters", "starts")
TRIED_ELSEWHERE = (
    "lagfmu.fit",
    "scipy.optimize",
    "fmpy",
    "libcosimpy",
    "ecospy",
    "optuna",
    "pymoo",
)  # with FMUs, as printed
# studies, and what writes files that are there already: tried in tests of their own
LONG = ("new", "tradeoff", "stress", "sweep", "sensitivity", "fit", "report", "page")


def quick(command: list[str]) -> bool:
    """Whether a command takes seconds: pages, films, choices and statements have tests of their own."""
    slow = {"all", "--accuracy", "--page", "--animate", "--statements"}
    long = slow & set(command) or command[0] in LONG
    return not long and Path(command[1]).suffix in (".py", ".fmu") and command[1] != "model.py"


@pytest.mark.parametrize("command", commands(TEXT), ids=" ".join)
def test_every_command_has_the_options_that_the_readme_gives_it(command):
    """The command line is read without a complaint, and the model files of the repository exist."""
    name, *arguments = command
    typer.main.get_command(app).commands[name].make_context(name, arguments)
    for word in arguments:
        if word.startswith(("models/", "tests/")):
            assert list(REPOSITORY.glob(word)), word


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
@pytest.mark.parametrize(
    "pages", [0, pytest.param(len(PAGES), marks=pytest.mark.thorough)], ids=["readme", "docs"]
)
def test_the_commands_run_as_printed(tmp_path, monkeypatch, pages):
    """In a folder with bead.py, crank.py and the repository's models, one after the other."""
    for name, block in zip(("bead.py", "crank.py"), [BLOCKS[0], BLOCKS[1]], strict=True):
        (tmp_path / name).write_text(block, encoding="utf-8")
    for folder in ("models", "tests"):
        (tmp_path / folder).symlink_to(REPOSITORY / folder)
    monkeypatch.chdir(tmp_path)
    done = [c for c in commands(TEXT if pages else README) if quick(c)]
    assert len(done) >= (20 if pages else 5)
    for command in done:
        ended = CliRunner().invoke(app, command)
        assert ended.exit_code == 0, (command, ended.output[-1000:])


def test_the_examples_run_as_printed(tmp_path, monkeypatch, native_fmu, built):
    """The lines of Python that simulate FMUs, beside those that were built before."""
    monkeypatch.chdir(tmp_path)
    Path("dist/native").mkdir(parents=True)
    absorber = built(load(REPOSITORY / "tests" / "absorber.py").model)
    for fmu in (native_fmu("Hemisphere"), native_fmu("CartPendulum"), absorber):
        shutil.copy(fmu, "dist/native")
    blocks = [b for b in BLOCKS if "import fmpy" in b or "import EcosSimulation" in b]
    elsewhere = "native-fmi3", "casadi"  # test_fmi3_importers.py and test_casadi.py run them
    blocks = [b for b in blocks if not any(w in b for w in elsewhere)]
    assert len(blocks) == 2
    for block in blocks:
        if "ecospy" in block:
            if importlib.util.find_spec("ecospy") is None:
                continue
            libtbb = f"import sys\nsys.path.insert(0, {str(REPOSITORY / 'tests')!r})\n"
            block = f"{libtbb}from engines import load\nload('ecos')\n{block}"
        run = subprocess.run(
            [sys.executable, "-c", block], capture_output=True, text=True, timeout=200, check=False
        )
        assert run.returncode == 0, run.stderr[-2000:]


def test_the_pieces_of_a_model_are_what_they_say(tmp_path, monkeypatch):
    """The blocks of Python that are part of a file: with the bead of the README, and with symbols of the
    names that they take from the text around them, each one runs."""
    from sympy import Abs, sqrt, symbols
    from sympy.physics.mechanics import dynamicsymbols

    (tmp_path / "bead.py").write_text(BLOCKS[0], encoding="utf-8")
    rows = ["way,height", *(f"{k},{0.01 * k}" for k in range(5))]
    (tmp_path / "road.csv").write_text("\n".join(rows), encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    around = {name: getattr(lagfmu, name) for name in lagfmu.__all__}
    around |= {str(s.func): s for s in dynamicsymbols("x y z s theta u v")}
    around |= {str(s): s for s in symbols("R L F k m t mu_s mu_k eps mu r", positive=True)}
    around |= {
        "Abs": Abs,
        "sqrt": sqrt,
        "Path": Path,
        "__file__": str(tmp_path / "model.py"),
        "lagfmu": lagfmu,
    }
    around |= {"damper": lagfmu.Spline("damper", [-1, 1], [-2, 2], "m/s", "N")}
    around["model"] = load(REPOSITORY / "models" / "hemisphere.py").model
    pieces = [b for b in BLOCKS if b not in TUTORIAL and not any(w in b for w in TRIED_ELSEWHERE)]
    assert len(pieces) >= 12
    for piece in pieces:
        exec(piece, dict(around))


def test_the_bead_keeps_its_energy_and_its_wire(tmp_path):
    """A bead on z = k x^2 keeps m g z + m v^2/2, also on another parabola; the wire bears it."""
    blocks = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    file = tmp_path / "bead.py"
    file.write_text(blocks[0], encoding="utf-8")
    loaded = load(file)
    fmu = write(prepare(loaded.model, loaded.scenes[0]), tmp_path, loaded.closed_forms)
    assert verify(fmu).passed
    assert verify(fmu, {"k": 3.0, "z": 0.75}).passed
    result = simulate(fmu)
    assert np.abs(result["z"] - 2 * result["x"] ** 2).max() < 1e-14
    lowest = np.argmin(result["z"])
    assert result["Q.z"][lowest] > 0.1 * 9.81  # gravity and the centripetal force


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
def test_the_models_hold_at_every_parameter_and_start(tmp_path):
    """Every model of the README over twelve decades of each parameter, and from starts far off: no answer is
    wrong."""
    blocks = [b for b in re.findall(r"```python\n(.*?)```", README, re.DOTALL) if "Model(" in b]
    assert blocks
    for k, block in enumerate(blocks):
        file = tmp_path / f"model{k}.py"
        file.write_text(block, encoding="utf-8")
        loaded = load(file)
        for scene in loaded.scenes:
            prepared = prepare(loaded.model, scene)
            fmu = write(prepared, tmp_path, loaded.closed_forms, target="native")
            lay_beside(fmu, prepared)
            with Bench(fmu, quick=True) as bench:
                chosen = [p for p in probes(bench.facts, False) if p.family in VARIED]
                rows = [verdict(p, attempt(p, bench), 0.0) for p in chosen]
            assert len(rows) > 30
            assert [r for r in rows if r.verdict == WRONG] == []


def test_the_readme_is_read_in_five_minutes():
    """Fewer than 1,200 words, each page of docs/ 1,700, and all of them 20,900; every page that it points to
    is there.  The lessons of docs/mechanics/ have words of their own, 4,700 in all and 900 each: nobody reads
    them to learn the tool, one fills an hour."""
    assert len(README.split()) < 1200
    words, lessons = (
        {page.stem: len(page.read_text(encoding="utf-8").split()) for page in pages}
        for pages in (PAGES, LESSONS)
    )
    assert max(words.values()) < 1_700
    assert sum(words.values()) < 20_900
    assert max(lessons.values()) < 900
    assert sum(lessons.values()) < 4_700
    for link in re.findall(r"\]\((docs/[\w.]+)\)", README):
        assert (REPOSITORY / link).is_file(), link


def test_every_public_name_stands_in_the_reference():
    """What can be imported from lagfmu is documented under its name, once."""
    told = re.findall(
        r"^::: \S+\.(\w+)$", (REPOSITORY / "docs/reference.md").read_text(), re.MULTILINE
    )
    assert sorted(told) == sorted(lagfmu.__all__)


def test_the_gallery_names_every_model():
    """In the repository each row opens the model's file."""
    rows = re.findall(r"^\| \[[^\]]+\]\(\.\./(\S+)\) \| (.*) \|$", GALLERY, re.MULTILINE)
    files = sorted(p.relative_to(REPOSITORY) for p in (REPOSITORY / "models").glob("*.py"))
    assert [Path(path) for path, _ in rows] == files
    assert {f.stem for f in files} == set(EVERY.values())


@pytest.mark.parametrize(
    "name",
    of_each_kind(
        sorted({*EVERY.values()}),
        kinds={*EVERY.values()}
        - {"arm", "bennett", "double_wishbone", "slider_crank_space", "stewart"},
    ),
)
def test_a_model_file_holds_what_is_said_and_drawn_of_it(name: str) -> None:
    """Its scenes are among the FMUs that tests go over, the gallery says what the model says of itself, and
    its picture shows its body and at least one force."""
    file = model_file(name)
    assert {s.name for s in file.scenes} == {scene for scene in EVERY if EVERY[scene] == name}
    assert f"/models/{name}.py) | {file.model.description} |" in GALLERY
    assert {isinstance(s, Arrow) for s in file.model.picture} == {True, False}


def test_links_of_the_pages_lead_somewhere():
    """In the repository as it is cloned, before any site is built."""
    for page in [REPOSITORY / "README.md", *PAGES, *LESSONS]:
        for link in re.findall(r"\]\(([^)#]+?)(?:#[\w-]+)?\)", page.read_text(encoding="utf-8")):
            assert "://" in link or (page.parent / link).exists(), (page.name, link)


def headings(page: Path) -> set[str]:
    """The anchors of a page that are the same on a forge and on the site, whose anchors are ASCII."""
    found = re.findall(r"^##+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    words = (re.sub(r"[^\w\s-]", "", text.lower()).split() for text in found)
    return {"-".join(w) for w in words if "".join(w).isascii()}


def test_links_into_pages_lead_to_headings():
    """On a forge and on the site."""
    for page in [REPOSITORY / "README.md", *PAGES, *LESSONS]:
        text = page.read_text(encoding="utf-8")
        for file, anchor in re.findall(r"\]\(([^)#:]*)#([^)\s]+)\)", text):
            at = page.parent / file if file else page
            assert anchor in headings(at), (page.name, file, anchor)


def test_the_readme_tells_every_extra_and_no_message_names_an_index() -> None:
    """lagfmu is installed from a clone: pip knows `.[study]` there, and `lagfmu[study]` nowhere."""
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    readme = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    for extra in project["optional-dependencies"]:
        assert re.search(rf'^\| `pip install (-e )?"\.\[{extra}\]"`', readme, re.MULTILINE), extra
    texts = [*(REPOSITORY / "lagfmu").rglob("*.py"), *PAGES, REPOSITORY / "README.md"]
    for path in texts:
        assert not re.search(r"pip install \S*lagfmu\[", path.read_text(encoding="utf-8")), path


def test_the_tolerance_divided_by_ten_holds_for_twenty_periods(native_fmu: Fmu) -> None:
    """At 1e-8 the pendulum's multiplier is right to 1e-7 for 40 s, off by 6e-5 after 1000 s and by some four
    times that after 2000 s: the rule of the README names its horizon."""
    fmu, name = native_fmu("PendulumCartesian"), "lambda.rod"

    def off(seconds: float) -> float:
        runs = [simulate(fmu, seconds, 0.5, tolerance) for tolerance in (1e-8, 1e-13)]
        ours, right = (run[name][-80:] for run in runs)
        return float(np.abs(ours - right).max() / np.abs(right).max())

    assert off(40.0) < 1e-7
    long = off(1000.0)
    assert 2e-5 < long < 2e-4
    assert 2.5 < off(2000.0) / long < 6
