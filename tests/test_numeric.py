"""What every build asks of the numeric form at the start: accelerations, closed contacts, nominals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array
from sympy import cos, sin, symbols
from sympy.physics.mechanics import dynamicsymbols
from zoo import point_mass

from lagfmu import Contact, Friction, Model, Nonholonomic, Parameter, multiplier
from lagfmu.testing import StepFailureError, prepare, solve_at_start

g = 9.81  # m/s^2
x, y, theta = dynamicsymbols("x y theta")
m, k, L, G, mu, alpha = symbols("m k L g mu alpha", positive=True)
SPRING = point_mass(
    "Spring",
    "x",
    energy=-k * x**2 / 2 + m * G * x,
    mass=2.0,
    parameters=[Parameter(k, 50.0, "N/m"), Parameter(G, g, "m/s^2")],
    start={x: 2.0 * g / 50.0},
)
PENDULUM = Model(
    "Pendulum",
    lagrangian=m * L**2 * theta.diff() ** 2 / 2 + m * G * L * cos(theta),
    coordinates={theta: "rad"},
    parameters=[Parameter(m, 2.0, "kg"), Parameter(L, 0.7, "m"), Parameter(G, g, "m/s^2")],
    start={theta: 0.3},
)
BLOCK = point_mass(
    "Block",
    "x y",
    [
        Contact("floor", y - L),
        Nonholonomic("foot", x.diff()),
        Friction("grip", of=["foot"], normal=multiplier("floor"), static=mu),
    ],
    energy=m * G * (x * sin(alpha) - y * cos(alpha)),
    mass=2.0,
    parameters=[
        Parameter(G, g, "m/s^2"),
        Parameter(mu, 0.4, "1"),
        Parameter(alpha, 0.6, "rad"),
        Parameter(L, 1.5, "m"),
    ],
)


def test_the_rate_of_a_spring_at_rest_is_its_frequency():
    """Where weight and spring balance nothing accelerates: sqrt(k/m) is what a displacement tells."""
    assert prepare(SPRING).structure.start.rate == pytest.approx(5.0, rel=1e-6)


def test_the_rate_of_a_pendulum_let_go_is_that_of_its_fall():
    """sqrt(theta''/theta0) = sqrt(g sin(theta0)/(L theta0))."""
    expected = np.sqrt(g * np.sin(0.3) / (0.7 * 0.3))
    assert prepare(PENDULUM).structure.start.rate == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("slip", [0.0, 3.0, -3.0])
@pytest.mark.parametrize("slope", [0.3, 0.6])
def test_a_block_on_an_incline_sticks_or_slips_for_its_nominals(slope, slip):
    """From rest it sticks up to tan(alpha) = mu; beyond, and while it slips, its rate is that of
    a = g (sin(alpha) -+ mu cos(alpha)) through L = 1.5 m, the height of the floor."""
    parameters = [replace(p, value=slope) if p.symbol == alpha else p for p in BLOCK.parameters]
    start = prepare(
        replace(BLOCK, parameters=parameters, start={y: 1.5, x.diff(): slip})
    ).structure.start
    assert start.closed == (True,)
    a = g * (np.sin(slope) - (np.sign(slip) or 1.0) * 0.4 * np.cos(slope))
    if slip == 0.0 and np.tan(slope) <= 0.4:
        a = 2 * g * np.cos(slope)  # it rests: weight and floor, before they cancel
    assert start.rate == pytest.approx(np.sqrt(abs(a) / 1.5), rel=1e-12)


@pytest.mark.parametrize("inertia", [3e-3, 1e-9, 1e-20, 1e-30, 1e-300, 0.0])
def test_a_light_carrier_hides_no_teeth(inertia):
    """A planetary gear whose ring is held, with Willis' equation besides: i = 3.5 turns of the sun are one of
    the carrier, J carrier'' = i tau with J = J_c + i^2 J_s + k^2 J_p; without J_c that is the limit."""
    M = csr_array(np.diag([2e-4, 1e-4, inertia, 5e-3]))
    teeth = [[2, 1.5, -3.5, 0], [0, -1.5, -3.5, 5], [2, 0, -7, 5], [0, 0, 0, 1.0]]
    rows = csr_array(np.array(teeth))
    found, _ = solve_at_start(M, np.array([0.5, 0, 0, 0]), rows, np.zeros(4))
    carrier = 3.5 * 0.5 / (inertia + 3.5**2 * 2e-4 + (7 / 3) ** 2 * 1e-4)
    expected = [3.5 * carrier, -7 / 3 * carrier, carrier, 0]
    assert found == pytest.approx(expected, rel=2e-8, abs=1e-8 * carrier)


@pytest.mark.parametrize("mass", [1e-12, 1.0, 1e12])
def test_a_doubled_row_shares_its_force_and_a_contrary_one_is_refused(mass):
    """A weight on two equal supports: m g / 2 each; where they ask for different accelerations, none."""
    M, b = csr_array(np.eye(2) * mass), np.array([0.0, -mass * g])
    rows = csr_array(np.array([[0, 1.0], [0, 1.0]]))
    found, lam = solve_at_start(M, b, rows, np.zeros(2))
    assert lam == pytest.approx(mass * g / 2, rel=1e-12)
    assert np.abs(found).max() < 1e-12 * g
    with pytest.raises(StepFailureError, match="contradict each other"):
        solve_at_start(M, b, rows, np.array([0.0, g]))
    nearest, _ = solve_at_start(M, 0 * b, rows, np.array([0.0, g]), nearest=True)
    assert nearest == pytest.approx([0, g / 2], rel=1e-12)
