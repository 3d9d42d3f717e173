"""The one loop that runs an FMU, whoever asks for it."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

import lagfmu
from lagfmu import Input, Model, Parameter
from lagfmu.testing import RefusalError, Session

t = dynamicsymbols._t


@pytest.fixture(scope="module")
def path(native_fmu):
    return native_fmu("Hemisphere")


@pytest.fixture(scope="module")
def pushed() -> Model:
    """A free mass under a force F: m x'' = F."""
    m, F, x = sp.Symbol("m", positive=True), dynamicsymbols("F"), dynamicsymbols("x")
    return Model(
        "Pushed",
        coordinates={x: "m"},
        lagrangian=m * x.diff(t) ** 2 / 2,
        forces={x: F},
        parameters=[Parameter(m, 2.0, "kg")],
        inputs=[Input(F, "N")],
    )


def test_a_session_goes_on_after_a_refusal(path):
    """A run that cannot start tells why, and the next one of the same session has its rows."""
    with Session(path) as session:
        times = [0.0, 0.1, 0.2]
        assert len(session.run(times, {"theta": 0.3}).rows) == 3
        refused = session.run(times, {"a": -1.0})
        assert isinstance(refused.refusal, RefusalError)
        assert "outside its bounds" in refused.refusal.message
        assert len(refused.rows) == 0
        again = session.run(times, {"theta": 0.3})
    assert again.refusal is None
    assert again.rows["theta"][0] == 0.3


@pytest.mark.parametrize("target", ["native", "python"])
def test_a_force_that_jumps_between_points_acts_from_there(pushed, target):
    """F = 0 until 0.25 s, then 3 N, with points every 0.1 s: x = F/(2 m) (t - 0.25 s)^2 at all of them."""
    force = np.array(
        [(0.0, 0.0), (0.25, 0.0), (0.25, 3.0), (1.0, 3.0)], dtype=[("time", float), ("F", float)]
    )
    run = lagfmu.simulate(pushed, 1.0, 0.1, 1e-10, inputs=force, target=target)
    assert len(run) == 11
    exact = 0.75 * np.maximum(run["time"] - 0.25, 0.0) ** 2
    assert np.abs(run["x"] - exact).max() < 1e-12


def test_an_fmu_of_model_exchange_alone_is_refused(path, tmp_path):
    """A session takes communication steps: an FMU that has none is told so."""
    alone = tmp_path / "Alone.fmu"
    with zipfile.ZipFile(path) as old, zipfile.ZipFile(alone, "w") as new:
        for name in old.namelist():
            new.writestr(name, old.read(name).replace(b"CoSimulation", b"Other"))
    with pytest.raises(lagfmu.LagfmuError, match="has no co-simulation"):
        lagfmu.simulate(alone, 0.5)


def test_a_name_that_the_fmu_does_not_have_is_a_refusal(path):
    """It is told with the nearest one, and the session goes on."""
    with Session(path) as session:
        run = session.run([0.0, 0.1], {"thta": 0.3})
        assert run.refusal is not None
        assert "did you mean 'theta'?" in run.refusal.message
        assert session.run([0.0, 0.1], {"theta": 0.3}).refusal is None


def test_rows_end_where_a_run_does(path):
    """There is no step of 0 s: what was reached before it is there, with the cause."""
    with Session(path) as session:
        run = session.run([0.0, 0.1, 0.1], {"theta": 0.3})
    assert run.rows["time"].tolist() == [0.0, 0.1]
    assert run.refusal is not None
    assert "communication step is 0.0 s" in run.refusal.message
    assert run.refusal.time == 0.1
