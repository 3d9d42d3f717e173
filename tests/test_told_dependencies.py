"""Dependencies in the description, and derivatives that the FMU tells, against what moves."""

from __future__ import annotations

import random
from collections.abc import Iterator
from ctypes import c_bool, c_double, c_size_t
from typing import Any

import numpy as np
import pytest
from conftest import EVERY
from fmi2 import EXCHANGE, Library, Single

FEW = ("Hemisphere", "Ladder", "Gyroscope", "Door", "Bowling", "SliderCrankBodies", "CartPendulum")
ALL = [
    pytest.param(name, marks=() if name in FEW else pytest.mark.thorough) for name in sorted(EVERY)
]
STEP = 1e-6  # of a size
APART = (0.0, 1e-3, 3e-2)  # of a size, off the start and the constraints
MOVES, AGREES = 1e-6, 1e-4  # relative to what all columns make of an unknown


class States:
    """An instance for model exchange, its states and what may depend on them."""

    def __init__(self, library: Library) -> None:
        self.one: Single = library.continuous()
        found = library.description.derivatives
        self.names = [u.variable.derivative.name for u in found]
        self.derivatives = [u.variable.name for u in found]
        self.count = len(self.names)
        self.told = {
            u.variable.name: None if u.dependencies is None else {v.name for v in u.dependencies}
            for u in (*found, *library.description.outputs)
        }
        reals = [u.variable for u in library.description.outputs if u.variable.type == "Real"]
        discrete = ("discrete", "fixed")
        self.outputs = [v.name for v in reals if v.variability not in discrete]
        self.start = np.array(self.one.array("GetContinuousStates", self.count))
        nominal = self.one.array("GetNominalsOfContinuousStates", self.count)
        self.size = np.maximum(np.maximum(np.abs(self.start), nominal), 1e-3)

    def set(self, x: Any) -> None:
        self.one.does("SetContinuousStates", (c_double * self.count)(*x), c_size_t(self.count))

    def rates(self, x: Any) -> Any:
        self.set(x)
        return np.array(self.one.array("GetDerivatives", self.count))

    def values(self, x: Any) -> Any:
        self.set(x)
        return np.array([self.one.get(n) for n in self.outputs])

    def places(self) -> Iterator[Any]:
        """States at the start, and off the constraints."""
        chance = random.Random(1)
        for off in APART:
            away = [chance.uniform(-1, 1) for _ in range(self.count)]
            yield self.start + off * self.size * np.array(away)

    def slopes(self, of: Any, x: Any) -> Any:
        """Central differences by all states, times their sizes."""
        columns = []
        for j in range(self.count):
            e = np.zeros(self.count)
            e[j] = STEP * self.size[j]
            columns.append((of(x + e) - of(x - e)) / (2 * STEP))
        return np.array(columns).T


def undeclared(states: States, names: list[str], of: Any) -> set[tuple[str, str]]:
    """Pairs (unknown, state) of which one moves by the other, and nobody says so."""
    found, told_somewhere = set(), False
    for x in states.places():
        try:
            value, slopes = of(x), states.slopes(of, x)
        except AssertionError:
            continue  # where dependent rows contradict each other multipliers are refused
        told_somewhere = True
        whole = np.abs(slopes).max(axis=1) + np.abs(value)
        for i, j in zip(*np.nonzero(np.abs(slopes) > MOVES * whole[:, None]), strict=True):
            told = states.told[names[i]]
            if told is not None and states.names[j] not in told:
                found.add((names[i], states.names[j]))
    assert told_somewhere
    return found


@pytest.mark.parametrize("name", ALL)
def test_nothing_moves_by_a_state_of_which_it_is_not_said_to_depend(
    library: Any, name: str
) -> None:
    """Derivatives of states, with what leads back onto the constraints and the norm of quaternions, and all
    outputs, at states on the constraints and off them."""
    states = States(library(name))
    assert undeclared(states, states.derivatives, states.rates) == set()
    assert undeclared(states, states.outputs, states.values) == set()


@pytest.mark.parametrize("name", ALL)
def test_directional_derivatives_are_those_of_what_is_integrated(library: Any, name: str) -> None:
    """Along each state the derivatives of GetDerivatives, on the constraints and off them, where rows depend
    on each other, and for quaternions whose norm is not 1; GetReal reads what is integrated."""
    of = library(name)
    if not of.description.modelExchange.providesDirectionalDerivative:
        pytest.skip("its scene has no derivatives of outputs: it rubs")
    states = States(of)
    one, n = states.one, states.count
    for x in states.places():
        rates, slopes = states.rates(x), states.slopes(states.rates, x)
        whole = np.abs(slopes).max(axis=1) + np.abs(rates)
        states.set(x)
        for j in range(n):
            told = one.directional(states.derivatives, [states.names[j]], [1.0])
            off = np.abs(np.array(told) * states.size[j] - slopes[:, j])
            assert (off <= AGREES * whole).all(), states.names[j]
        states.set(x)
        read = [one.get(v) for v in states.derivatives]
        assert read == pytest.approx(rates.tolist(), rel=1e-12, abs=1e-12 * np.abs(rates).max())


@pytest.mark.parametrize("name", ALL)
def test_nothing_begins_elsewhere_by_a_parameter_that_is_not_told(library: Any, name: str) -> None:
    """Each initial unknown against each parameter and exact start value."""
    of = library(name)
    unknowns = [u for u in of.description.initialUnknowns if u.variable.type == "Real"]
    knowns = [
        v
        for v in of.variables.values()
        if v.type == "Real"
        and v.start is not None
        and v.initial == "exact"
        and "solver" not in v.name
    ]

    def begun(**start: float) -> Any:
        one = of(kind=EXCHANGE)
        one.start(start, tolerance=1e-8)
        return np.array([one.get(u.variable.name) for u in unknowns])

    base, missing = begun(), set()
    for known in knowns:
        at = float(known.start)
        try:
            there = begun(**{known.name: at * (1 + 1e-4) if at else 1e-4})
        except AssertionError:
            continue  # it is refused
        moved = np.abs(there - base) > 1e-7 * (np.abs(base) + 1e-3 * np.abs(base).max(initial=0))
        for u in (u for u, m in zip(unknowns, moved, strict=True) if m):
            if u.dependencies is not None and known.name not in {v.name for v in u.dependencies}:
                missing.add((u.variable.name, known.name))
    assert missing == set()


def test_derivatives_during_the_initialization_are_those_of_the_start(library: Any) -> None:
    """At rest lambda = m g cos theta on the hemisphere: d lambda/d theta = -m g sin theta, d lambda/d m =
    g cos theta; with the speed w, d lambda/d w = -2 m a w.  What was set stays to the bit."""
    one = library("Hemisphere")().initializing()
    one.set("theta", 0.3)
    one.set("der(theta)", 0.7)
    m, g, a, w = (one.get(n) for n in ("m", "g", "a", "der(theta)"))
    before = one.get("lambda.surface")
    assert before == pytest.approx(m * (g * np.cos(0.3) - a * w**2))
    expected = {
        "theta": -m * g * np.sin(0.3),
        "m": g * np.cos(0.3) - a * w**2,
        "der(theta)": -2 * m * a * w,
    }
    for known, slope in expected.items():
        (told,) = one.directional(["lambda.surface"], [known], [1.0])
        assert told == pytest.approx(slope, rel=1e-9), known
    (both,) = one.directional(["lambda.surface"], ["theta", "m"], [2.0, 3.0])
    assert both == pytest.approx(2 * expected["theta"] + 3 * expected["m"], rel=1e-9)
    assert one.get("lambda.surface") == before


@pytest.mark.parametrize("name", ["SliderCrankBodies", "PendulumCartesian", "Loop"])
def test_the_start_is_differentiated_through_its_projection(
    library: Any, library3: Any, name: str
) -> None:
    """By each parameter all multipliers change as starts beside it do, by FMI 2.0 and, adjoint too, 3.0."""
    of = library(name)
    lam = [n for n in of.variables if n.startswith("lambda.")]
    known = [
        n
        for n, v in of.variables.items()
        if v.causality == "parameter" and v.type == "Real" and "solver" not in n
    ]

    def begun(**start: float) -> Any:
        one = of().initializing()
        for n, value in start.items():
            one.set(n, value)
        return np.array([one.get(n) for n in lam])

    one, three = of().initializing(), library3(name)()
    three.does(
        "EnterInitializationMode",
        c_bool(False),
        c_double(0),
        c_double(0),
        c_bool(False),
        c_double(0),
    )
    for n in known:
        at = float(of.variables[n].start)
        h = 1e-5 * (abs(at) or 1)
        slopes = (begun(**{n: at + h}) - begun(**{n: at - h})) / (2 * h)
        size = np.abs(slopes).max() + 1e-9 * np.abs(begun()).max() / (abs(at) or 1)
        assert one.directional(lam, [n], [1.0]) == pytest.approx(
            slopes.tolist(), abs=1e-5 * size + 1e-7
        ), n
        forward = three.derive("GetDirectionalDerivative", lam, [n], [1.0])
        assert forward == pytest.approx(slopes.tolist(), abs=1e-5 * size + 1e-7), n
        (adjoint,) = three.derive("GetAdjointDerivative", lam, [n], [1.0] * len(lam))
        assert adjoint == pytest.approx(sum(forward), rel=1e-9, abs=1e-9 * size + 1e-9), n
