"""What a notebook shows: mathematics of models, tables of results, lambda as a formula; and the texts of
docs/ that are notebooks."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MODELS, model_file
from sympy import cos, simplify, sin, symbols
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols
from typer.testing import CliRunner

import lagfmu
from lagfmu import derive
from lagfmu.errors import DerivationError
from lagfmu.testing import app, known

DOCS = MODELS.parent / "docs"
LESSONS = sorted((DOCS / "mechanics").glob("*.md"))
WORDS = {  # what a lesson prints besides equal numbers and True
    "hemisphere": ["it would slip at 38 degrees"],
    "hoop": ["critical: 7.004 rad/s"],
    "incline": [
        "N N.m",
        "holonomic | nonholonomic",
        "nonholonomic: the coefficient of dy ^ dphi ^ dx in d(omega) ^ omega is -1, not 0",
    ],
    "ladder": [
        "0.250 of the weight",
        "0.250 of the weight",
        "mu = 0.196: theta ends at 1.200",
        "mu = 0.192: theta ends at 1.164",
    ],
    "pendulum": [],
    "sphere_in_cylinder": [
        "nonholonomic: the coefficient of dB ^ dC ^ dphi ^ dz in d(omega_1) ^ omega_1 ^ omega_2 is "
        "-a*b*sin(B(t)), not 0 (by 20 digits of it at random points); the derived flag has the ranks 2 > 0"
    ],
}


@pytest.mark.parametrize("name", ["hemisphere", "knife_edge", "rotating_wire"])
def test_lambda_as_a_formula_is_the_lambda_of_the_simulation(name):
    """Evaluated along the simulated motion, the formula gives the multiplier that the solver found."""
    file = model_file(name)
    formulas = derive(file.model).multipliers()
    run = lagfmu.simulate(file.model, 0.5, 0.05)
    t = symbols("t")
    values = {p.symbol: p.value for p in file.model.parameters}
    for constraint, formula in formulas.items():
        rows = []
        for row in run:
            state = {t: row["time"]}
            for q in file.model.coordinates:
                n = q.func.__name__
                state |= {q.diff(): row[f"der({n})"], q: row[n]}
            rows.append(float(formula.subs(state).subs(values)))
        lam = run[f"lambda.{constraint}"]
        assert np.abs(lam - rows).max() <= 1e-9 * np.abs(lam).max()


def test_the_disk_on_the_incline_holds_a_third_of_its_weight():
    """lambda = -M g sin(alpha) / 3, in symbols."""
    found = derive(model_file("incline_disk").model).multipliers()["rolling"]
    named = {str(s): s for s in found.free_symbols}
    expected = -named["M"] * named["g"] * sin(named["alpha"]) / 3
    assert simplify(found - expected) == 0


def test_a_formula_that_would_be_no_help_is_refused():
    """A chain of many links: the message says how large, and what to do."""
    with pytest.raises(DerivationError, match="for small systems"):
        derive(model_file("chain").model).multipliers()


def test_two_calls_lead_from_a_lagranges_method_to_a_figure(tmp_path):
    """A pendulum that someone wrote for SymPy."""
    theta = dynamicsymbols("theta")
    m, g, L = symbols("m g L", positive=True)
    T, V = m * L**2 * theta.diff() ** 2 / 2, -m * g * L * cos(theta)
    model = lagfmu.from_lagranges_method(
        LagrangesMethod(T - V, [theta]),
        name="Borrowed",
        coordinates={theta: "rad"},
        parameters=[
            lagfmu.Parameter(m, 1.0, "kg"),
            lagfmu.Parameter(g, 9.81, "m/s^2"),
            lagfmu.Parameter(L, 1.0, "m"),
        ],
        start={theta: 0.5},
    )
    path = lagfmu.simulate(model).plot(out=tmp_path / "theta.svg")
    assert "theta" in path.read_text()


def test_a_result_is_an_array_with_units():
    """Columns by name; a short table; pandas and xarray keep the units."""
    run = lagfmu.simulate(model_file("incline_disk").model, 1.0, 0.25)
    text = repr(run)
    assert max(map(len, text.splitlines())) <= 80
    assert "lambda.rolling" in text
    assert type(run["y"]) is np.ndarray
    assert run[run["time"] > 0.4]["y"].shape == (3,)
    assert run.units["lambda.rolling"] == "N"
    assert "<table>" in run._repr_html_()
    frame = run.to_dataframe()
    assert (frame["y"].to_numpy() == run["y"]).all()
    assert frame.index.name == "time"
    assert run.to_xarray()["Q.y"].attrs["units"] == "N"
    assert len(run.plot("y").axes) == 1


def test_models_typeset_themselves():
    """The equations as MathML and LaTeX; a classification with its integral."""
    model = model_file("hemisphere").model
    assert "<math" in model._repr_html_()
    assert "\\lambda" in derive(model)._repr_latex_()
    x, y = dynamicsymbols("x y")
    found = lagfmu.classify([y * x.diff() + x * y.diff()], [x, y])
    assert "const" in found._repr_html_()
    shown = lagfmu.show(model)
    assert "Degrees of freedom" in repr(shown)
    assert "<math" in shown._repr_html_()


@pytest.mark.parametrize(
    ("formulation", "own"), [("minimal", "Reduced equation"), ("nullspace", "Equations without")]
)
def test_show_tells_each_equation_once_in_its_formulation(formulation, own):
    """The pendulum in x and y: the equations of its formulation stand there as mathematics, and below them
    the rest as text."""
    pendulum = model_file("pendulum").model
    shown = lagfmu.show(pendulum, lagfmu.Scene("Pendulum", formulation=formulation))
    mathematics, text = shown._repr_html_().split("<pre>")
    for title in ("Constraints as accelerations", own):
        assert title in mathematics
        assert title in repr(shown)
        assert title not in text
    assert "Degrees of freedom" in text


@pytest.mark.parametrize("words", [["bead"], ["bead.py", "--from", "pendulum"]])
def test_a_new_model_builds_as_it_is(tmp_path, monkeypatch, words):
    """The commented template and a copy: written once, never over a file, and right at once."""
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["new", *words])
    assert done.exit_code == 0, done.output
    assert lagfmu.verify("bead.py").passed
    again = CliRunner().invoke(app, ["new", *words])
    assert again.exit_code == 2
    assert "is there already" in again.output


def test_the_models_come_with_the_package():
    """All of them; a name that is none is told with those that are."""
    assert known() == sorted(p.stem for p in MODELS.glob("*.py"))
    done = CliRunner().invoke(app, ["new", "x.py", "--from", "hemispher"])
    assert done.exit_code == 2
    assert "hemisphere" in done.output


def run_through(text: Path, folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """What the cells of a text in Markdown give, run in `folder` one after the other."""
    jupytext = pytest.importorskip("jupytext")
    nbclient = pytest.importorskip("nbclient")
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    cells = nbclient.NotebookClient(
        jupytext.read(text),
        timeout=300,
        kernel_name="python3",
        resources={"metadata": {"path": str(folder)}},
    ).execute()["cells"]
    found = [o for c in cells if c["cell_type"] == "code" for o in c["outputs"]]
    assert [o for o in found if o.get("name") == "stderr"] == []
    return found


def printed(found: list[Any]) -> list[str]:
    """The lines that Python printed, not the shell."""
    texts = [o["text"] for o in found if o["output_type"] == "stream" and "wrote" not in o["text"]]
    return "".join(texts).strip().splitlines()


def shown(found: list[Any]) -> set[str]:
    """Whether figures, mathematics and live pages are shown."""
    data = [o["data"] for o in found if o["output_type"] in ("execute_result", "display_data")]
    pages = "".join(d.get("text/html", "") for d in data)
    figures = {"figure"} if any("image/png" in d for d in data) else set()
    return figures | {k for k in ("math", "iframe") if f"<{k} " in pages}


@pytest.mark.thorough
def test_the_tutorial_runs_as_a_notebook(tmp_path, monkeypatch):
    """Cell by cell: lambda = -M g sin(alpha)/3, which the FMU obeys; equations as mathematics, a figure."""
    found = run_through(DOCS / "tutorial.md", tmp_path, monkeypatch)
    assert printed(found) == ["-M*g*sin(alpha)/3", "True"]
    assert shown(found) == {"figure", "math"}


@pytest.mark.thorough
@pytest.mark.parametrize("lesson", LESSONS, ids=lambda path: path.stem)
def test_a_lesson_derives_what_the_simulation_does(lesson, tmp_path, monkeypatch):
    """Where two numbers stand beside each other the first is the simulation's, the second the answer's; what
    is claimed is True.  There is a page in which the system runs."""
    found = run_through(lesson, tmp_path, monkeypatch)
    lines = printed(found)
    numbers = [line for line in lines if re.fullmatch(r"(-?[\d.]+(e-?\d+)?( |$)){2}", line)]
    for line in numbers:
        simulated, derived = map(float, line.split())
        assert simulated == pytest.approx(derived, rel=1e-5), line
    claims = [line for line in lines if set(line.split()) <= {"True", "False"}]
    assert "False" not in " ".join(claims)
    assert [line for line in lines if line not in numbers + claims] == WORDS[lesson.stem]
    assert len(numbers) >= 2
    assert len(lines) >= 5
    assert "iframe" in shown(found)


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda path: path.stem)
def test_each_question_of_a_lesson_has_its_answer(lesson):
    """Numbered, and folded below it."""
    _, *parts = re.split(r"^\*\*(\d+)\. ", lesson.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert [int(k) for k in parts[::2]] == list(range(1, len(parts) // 2 + 1))
    folded = ['<details markdown="1"><summary>Answer</summary>', "</details>"]
    assert {tuple(part.count(tag) for tag in folded) for part in parts[1::2]} == {(1, 1)}
    assert len(parts) >= 12
