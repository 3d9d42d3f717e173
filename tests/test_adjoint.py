"""Adjoint derivatives: the rows of the Jacobian whose columns are the directional ones, by one solve."""

from __future__ import annotations

import math
from ctypes import byref, c_double, c_size_t

import numpy as np
import pytest
from redundant import platform

from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")

MODELS = (
    *("PendulumCartesian", "PendulumAngle", "Hemisphere", "CartPendulum"),
    *("InclineDiskMinimal", "KnifeEdge", "RotatingWire", "SliderCrank", "Gyroscope"),
)


def sides(one) -> tuple[list[str], list[str]]:
    """Unknowns that have derivatives: continuous outputs; knowns: states, inputs and time."""
    lib = one.library
    states = [d.variable.derivative.name for d in lib.description.derivatives]
    inputs = one.of(causality="input")
    unknowns = [
        n
        for n in one.of(causality="output", variability="continuous")
        if one.call("GetDirectionalDerivative", *asks(one, n, states[0])) == 0
    ]
    knowns = [n for n in (*states, *inputs, "time") if n != "energy.dissipated"]
    return unknowns, knowns


def asks(one, unknown: str, known: str, seed: float = 1.0):
    """The arguments of one derivative."""
    count = c_size_t(1)
    references = one.references([unknown]), count, one.references([known]), count
    return *references, byref(c_double(seed)), count, byref(c_double()), count


def jacobians(one) -> tuple[np.ndarray, np.ndarray]:
    """(unknowns, knowns) by columns and by rows."""
    unknowns, knowns = sides(one)
    columns = [one.derive("GetDirectionalDerivative", unknowns, [k], [1.0]) for k in knowns]
    rows = [one.derive("GetAdjointDerivative", [u], knowns, [1.0]) for u in unknowns]
    return np.array(columns).T, np.array(rows)


@pytest.mark.parametrize("name", MODELS)
def test_the_adjoint_is_the_transposed_jacobian(library3, name):
    """Row by row as column by column, to rounding of the terms; and for a seed of all unknowns at once."""
    one = library3(name)().start()
    for _ in range(3):
        one.step(0.05)
    directional, adjoint = jacobians(one)
    assert directional.size > 20
    scale = abs(directional).max()
    np.testing.assert_allclose(adjoint, directional, rtol=1e-11, atol=1e-13 * scale)
    unknowns, knowns = sides(one)
    seed = np.random.default_rng(1).normal(size=len(unknowns))
    found = one.derive("GetAdjointDerivative", unknowns, knowns, list(seed))
    np.testing.assert_allclose(found, seed @ directional, rtol=1e-11, atol=1e-11 * scale)


def test_a_constraint_runs_away_from_what_stands_still(library3):
    """phi - omega t at a given phi: -omega a second."""
    one = library3("RotatingWire")().start()
    for function in ("GetDirectionalDerivative", "GetAdjointDerivative"):
        assert one.derive(function, ["residual.drive"], ["time"], [1.0]) == [-2.0]


@pytest.mark.filterwarnings("ignore::lagfmu.testing.RedundantConstraintWarning")
def test_the_adjoint_of_redundant_rows(library3, built):
    """Where one constraint follows from others: of Q, of the motion and of what is unique."""
    one = library3(built(platform(True), fmi=3))().start()
    directional, adjoint = jacobians(one)
    assert directional.size > 20
    np.testing.assert_allclose(
        adjoint, directional, rtol=1e-10, atol=1e-11 * abs(directional).max()
    )


def test_what_has_no_derivative_has_no_adjoint(library3):
    """A parameter is no unknown and no known; a seed is a number."""
    one = library3("PendulumCartesian")().start()
    assert "derivative of 'm'" in one.refuses("GetAdjointDerivative", *asks(one, "m", "x"))
    assert "'m'" in one.refuses("GetAdjointDerivative", *asks(one, "lambda.rod", "m"))
    asked = asks(one, "lambda.rod", "x", math.nan)
    assert "seed of 'lambda.rod' is nan" in one.refuses("GetAdjointDerivative", *asked)
