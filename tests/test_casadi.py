"""CasADi's DaeBuilder as importer: values, first and second derivatives, and docs/swing_up.py, an optimal
control by collocation on the FMU."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
import pytest

from lagfmu.testing import find_compiler

ca = pytest.importorskip("casadi", reason="pip install -e '.[test]'")
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
PROGRAM = Path(__file__).parent.parent / "docs" / "swing_up.py"
M, m, g, L, c = 2.0, 1.0, 9.81, 1.0, 0.1  # of models/cart_pendulum.py


@pytest.fixture(scope="module")
def swing():
    """The program's names."""
    spec = importlib.util.spec_from_file_location("swing_up", PROGRAM)
    module = importlib.util.module_from_spec(spec)
    sys.modules["swing_up"] = module  # dataclasses look there
    spec.loader.exec_module(module)
    return module


@pytest.fixture(params=[2, 3])
def fmu(request, native_fmu, fmi3_fmu):
    """fmu(NAME): of either version."""
    return native_fmu if request.param == 2 else fmi3_fmu


def opened(path: Path, folder: Path):
    return ca.DaeBuilder("one", str(fmpy.extract(str(path), str(folder))))


def columns(function, x, h=1e-5) -> np.ndarray:
    """Central differences by x."""
    sides = [[np.array(function(x + s * h * e)).ravel() for s in (1, -1)] for e in np.eye(len(x))]
    return np.array([(a - b) / (2 * h) for a, b in sides]).T


def test_derivatives_of_the_states_and_lambda_are_those_of_the_closed_form(fmu, tmp_path):
    """M s'' = F - c s' - 2 d lambda, m x'' = 2 d lambda, m y'' = -m g + 2 y lambda, d = x - s, where
    f'' = 0 of the rod says what lambda is."""
    dae = opened(fmu("CartPendulum"), tmp_path)
    dae.set_y(["lambda.rod"])
    f = dae.create("f", ["x", "u"], ["ode"])
    out = dae.create("out", ["x", "u"], ["y"])
    for angle, rate, speed, F in ((0.7, -1.3, 0.4, 2.0), (2.5, 3.0, -0.6, -5.0)):
        d, y = np.sin(angle), -np.cos(angle)
        way, up = rate * np.cos(angle), rate * np.sin(angle)
        state = {"s": 0.3, "x": 0.3 + d, "y": y}
        state |= {"der(s)": speed, "der(x)": speed + way, "der(y)": up}
        free = -d * (F - c * speed) / M - y * g + way**2 + up**2
        force = -free / (2 * d**2 * (1 / m + 1 / M) + 2 * y**2 / m)
        rates = {"der(s)": (F - c * speed - 2 * d * force) / M, "der(x)": 2 * d * force / m}
        rates |= {"der(y)": -g + 2 * y * force / m, "s": speed, "x": speed + way, "y": up}
        x = [state[n] for n in dae.x()]
        expected = [rates[n] for n in dae.x()]
        np.testing.assert_allclose(np.array(f(x, F)).ravel(), expected, rtol=1e-12, atol=1e-12)
        assert float(out(x, F)) == pytest.approx(force, rel=1e-12)


@pytest.mark.parametrize("name", ["CartPendulum", "DoublePendulum", "Gyroscope"])
def test_jacobians_and_second_derivatives_are_those_of_differences(fmu, tmp_path, name):
    """By states, off the constraints and off a quaternion's norm too; a Hessian times a direction, for which
    CasADi takes differences of what the FMU says along the multipliers of an optimizer."""
    dae = opened(fmu(name), tmp_path)
    f = dae.create("f", ["x", "u"], ["ode"])
    u = np.full(len(dae.u()), 0.7)
    x = np.array([float(dae.start(n)[0]) for n in dae.x()])
    x += 0.01 * np.cos(np.arange(len(x)))
    jacobian = f.factory("J", ["x", "u"], ["jac:ode:x"])
    A = np.array(jacobian(x, u))
    expected = columns(lambda z: f(z, u), x)
    np.testing.assert_allclose(A, expected, atol=1e-7 * np.abs(expected).max())
    w, v = np.cos(np.arange(len(x))), np.sin(1.0 + np.arange(len(x)))
    X, V = ca.MX.sym("x", len(x)), ca.MX.sym("v", len(x))
    along = ca.jtimes(ca.gradient(ca.dot(w, f(X, u)), X), X, V)
    found = np.array(ca.Function("hv", [X, V], [along])(x, v)).ravel()
    wanted = columns(lambda a: np.array(jacobian(x + a[0] * v, u)).T @ w, np.zeros(1)).ravel()
    np.testing.assert_allclose(found, wanted, atol=1e-5 * np.abs(wanted).max())


@pytest.mark.parametrize("fmi", [2, 3])
def test_the_pole_swings_up(swing, tmp_path, fmi):
    """From hanging to upright: the FMU in fmpy, with the force that was found, ends there, and lambda is what
    the optimizer said.  What is left falls with the fifth power of the interval, as Radau's points do."""
    path = swing.build(tmp_path, fmi)
    dae = swing.opened(path, tmp_path / "unzipped")
    errors = []
    for intervals in (20, 40):
        found = swing.plan(dae, intervals)
        ran = swing.run(path, found)
        assert found.states["y"][-1] == pytest.approx(1, abs=1e-4)
        assert np.abs(found.force).max() <= swing.MOST * (1 + 1e-7)
        largest = np.abs(found.multiplier).max()
        errors.append(np.abs(ran["lambda.rod"] - found.multiplier)[1:].max() / largest)
    assert ran["y"][-1] == pytest.approx(1, abs=1e-6)
    assert ran["x"][-1] == pytest.approx(ran["s"][-1], abs=3e-4)
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] > 2**4


def test_the_program_runs(swing):
    """As docs/importers.md has it."""
    done = subprocess.run(
        [sys.executable, swing.__file__], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert "ends at y = 1.0000" in done.stdout


def test_the_lines_of_the_documentation_load_an_fmu(native_fmu, tmp_path, monkeypatch):
    """As they stand in docs/importers.md, with the FMU where they look: six states, one input, one force."""
    page = (PROGRAM.parent / "importers.md").read_text(encoding="utf-8")
    (block,) = (b for b in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "DaeBuilder" in b)
    (path,) = re.findall(r'"(\S+\.fmu)"', block)
    (tmp_path / path).parent.mkdir(parents=True)
    shutil.copy(native_fmu("CartPendulum"), tmp_path / path)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(block, names)
    assert (names["f"].size1_in(0), names["f"].size1_in(1)) == (6, 1)
    assert names["force"].size1_out(0) == 1


def test_casadi_knows_no_structural_parameters(fmi3_dae, tmp_path):
    """So it cannot load an FMU that is built with `dae`, for the standard's switch is one; when it can, this
    test is to become one of DAE mode."""
    with pytest.raises(RuntimeError, match="No such enum: 'structuralParameter'"):
        opened(fmi3_dae, tmp_path)


@pytest.fixture
def fmi3_dae(built, prepared):
    """CartPendulum with DAE mode."""
    return built(prepared("CartPendulum").model, fmi=3, dae=True)
