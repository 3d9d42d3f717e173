"""What a notebook shows: mathematics of models, tables of results, lambda as a formula."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import MODELS
from sympy import cos, simplify, sin, symbols
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols
from typer.testing import CliRunner

import lagfmu
from lagfmu import derive
from lagfmu.errors import DerivationError
from lagfmu.testing import app, known, load


@pytest.mark.parametrize("name", ["hemisphere", "knife_edge", "rotating_wire"])
def test_lambda_as_a_formula_is_the_lambda_of_the_simulation(name):
    """Evaluated along the simulated motion, the formula gives the multiplier that the solver found."""
    file = load(MODELS / f"{name}.py")
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
    found = derive(load(MODELS / "incline_disk.py").model).multipliers()["rolling"]
    named = {str(s): s for s in found.free_symbols}
    expected = -named["M"] * named["g"] * sin(named["alpha"]) / 3
    assert simplify(found - expected) == 0


def test_a_formula_that_would_be_no_help_is_refused():
    """A chain of many links: the message says how large, and what to do."""
    with pytest.raises(DerivationError, match="for small systems"):
        derive(load(MODELS / "chain.py").model).multipliers()


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
    run = lagfmu.simulate(load(MODELS / "incline_disk.py").model, 1.0, 0.25)
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
    model = load(MODELS / "hemisphere.py").model
    assert "<math" in model._repr_html_()
    assert "\\lambda" in derive(model)._repr_latex_()
    x, y = dynamicsymbols("x y")
    found = lagfmu.classify([y * x.diff() + x * y.diff()], [x, y])
    assert "const" in found._repr_html_()
    shown = lagfmu.show(model)
    assert "Degrees of freedom" in repr(shown)
    assert "<math" in shown._repr_html_()


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
