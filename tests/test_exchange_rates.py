"""Model exchange makes nothing stiff: how quickly drift dies, against the motion's own rates."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from conftest import EVERY, KINDS, of_each_kind
from fixed_step import euler, rk4, run
from fmi2 import Single
from numpy.typing import NDArray

from lagfmu import simulate
from lagfmu.testing import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
Vector = NDArray[np.float64]


def started(library) -> tuple[Single, list[str], Vector, Vector]:
    """In continuous-time mode: coordinates and velocities by name, their values and nominal values."""
    one = library.continuous()
    rates = [v for v in library.variables.values() if v.derivative is not None]
    names = [v.derivative.name for v in rates]
    count = len(names)
    values = np.array(one.array("GetContinuousStates", count))
    nominals = np.array(one.array("GetNominalsOfContinuousStates", count))
    order = {name: k for k, name in enumerate(names)}
    assert len(order) == count
    return one, names, values, nominals


def jacobian(rate: Callable[[Vector], Vector], x: Vector, sizes: Vector) -> Vector:
    """By central differences."""
    steps = np.diag(1e-6 * np.maximum(np.abs(x), sizes))
    return np.array([(rate(x + h) - rate(x - h)) / (2 * h.sum()) for h in steps]).T


def eigenvalues(library) -> tuple[Vector, Vector, Single, list[str]]:
    """Of the derivatives as an importer's integrator gets them, and of the accelerations as they are read."""
    one, names, x, sizes = started(library)
    rates = [v.name for v in library.variables.values() if v.derivative is not None]

    def given(at: Vector) -> Vector:
        one.states(list(at))
        return np.array(one.array("GetDerivatives", len(at)))

    def read(at: Vector) -> Vector:
        one.states(list(at))
        return np.array(one.reals(rates))

    stepped, own = (np.linalg.eigvals(jacobian(f, x, sizes)) for f in (given, read))
    one.states(list(x))
    return stepped, own, one, names


# off its constraints the accelerations of the redundant slider-crank contradict each other: refused, not read
READ = [name for name in EVERY if name != "SliderCrankSpace"]


@pytest.mark.parametrize("name", of_each_kind(READ, kinds={*KINDS, "Crane", "Belt", "Gyroscope"}))
def test_no_stabilization_is_quicker_than_the_motion(name, library):
    """No eigenvalue of what the importer integrates lies left of -4 times the largest rate that the motion
    has by itself: its own eigenvalues, the speed at which it turns, sqrt(|acceleration|/size)."""
    stepped, own, one, names = eigenvalues(library(name))
    variables = library(name).variables
    places = [v for v in variables.values() if v.causality == "parameter" and v.unit == "m"]
    lengths = [abs(float(v.start)) for v in places if float(v.start)]
    rates = [np.abs(own).max()]
    for q in (n for n in names if f"der({n},2)" in variables):
        size = 1.0 if variables[q].unit == "rad" else max(lengths, default=np.inf)
        rates.append(np.sqrt(abs(one.get(f"der({q},2)")) / size))
        rates.append(abs(one.get(f"der({q})")) if variables[q].unit == "rad" else 0.0)
    rates += [abs(one.get(w)) for w in names if variables[w].unit == "rad/s"]  # bodies in space
    assert stepped.real.min() >= -4 * max(rates) - 1e-3


@pytest.mark.parametrize(
    ("name", "largest"), [("Crane", 6.0), ("Belt", 0.1), ("SlippingSphere", 8)]
)
def test_small_speeds_make_no_large_rates(name, largest, library):
    """A crane's load swings at 1.7 1/s, a block that rides on a belt changes nothing: that g divided by their
    speeds is 98 1/s says nothing of them (drift died at up to 589 1/s)."""
    stepped, *_ = eigenvalues(library(name))
    assert stepped.real.min() > -largest


def test_the_stiffness_of_a_slider_crank_is_its_springs(library):
    """At the dead centre y'' = -(k y + c y')/M: its eigenvalues, -9899 and -101 1/s at k = 1e6 N/m and
    c = 1e4 N s/m, are those of the accelerations as they are; what leads back onto the rod is no quicker
    than 3.4 times the crank's 10 rad/s."""
    stepped, own, *_ = eigenvalues(library("SliderCrank"))
    spring = np.sort(np.roots([1.0, 1e4, 1e6]).real)
    np.testing.assert_allclose(np.sort(own.real)[:2], spring, rtol=1e-4)
    np.testing.assert_allclose(np.sort(stepped.real)[:2], spring, rtol=1e-4)
    assert np.sort(stepped.real)[2] > -34


@pytest.mark.parametrize(("method", "step"), [(euler, 1e-3), (rk4, 1e-2)])
@pytest.mark.parametrize(
    ("name", "start", "allowed"),
    [("Crane", {}, (3e-3, 1e-7)), ("SliderCrank", {"k": 400.0, "c": 20.0}, (4e-2, 2e-4))],
)
def test_coarse_steps_run(name, start, allowed, method, step, library, native_fmu):
    """Euler's method at 1 ms and Runge's at 10 ms, to their own accuracy: the crane's load, and a slider-
    crank whose spring is as soft as such steps ask for."""
    quantity = {"Crane": "x", "SliderCrank": "phi"}[name]
    ours = simulate(native_fmu(name), 1.0, 1.0, tolerance=1e-10, start_values=start)
    ended = run(library(name), method, round(1.0 / step), 1.0, [quantity], start)
    assert ended[quantity] == pytest.approx(ours[quantity][-1], abs=allowed[method is rk4])
