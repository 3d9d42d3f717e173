"""Chain of n bobs, through fmpy on the built FMU of four links and in this process for other n."""

from __future__ import annotations

import re
import runpy
from dataclasses import replace

import fmpy
import numpy as np
import pytest
import sympy as sp
from conftest import MODELS
from fmpy import calloc
from instance import instance
from runs import evenly
from scipy.integrate import solve_ivp
from scipy.special import roots_laguerre
from zoo.linkages import hinged

from lagfmu import derive, simulate
from lagfmu.testing import Form, System, lower, prepare, sources_of

G, MASS, LENGTH = 9.81, 0.1, 0.25


MODULE = runpy.run_path(str(MODELS / "chain.py"))
chain, multipliers = MODULE["chain"], MODULE["multipliers"]


def places(angles):
    """Start values x1, y1, ... of links at these angles from the downward vertical."""
    x, y = np.cumsum(LENGTH * np.sin(angles)), np.cumsum(-LENGTH * np.cos(angles))
    return {f"{c}{k + 1}": float(p[k]) for k in range(len(angles)) for c, p in (("x", x), ("y", y))}


def hang(path, angles, stop, points=1, tolerance=1e-12):
    return evenly(path, stop, points, tolerance, places(angles))


@pytest.mark.parametrize("n", [1, 3, 20])
def test_every_link_of_any_chain_at_rest(n):
    """Hanging straight down the tension of link k is (n - k + 1) m g: lambda = -T/(2 l), whatever n."""
    result = simulate(chain(n), 0.1, 0.1, start_values=places(np.zeros(n)))
    for k in range(1, n + 1):
        tension = (n - k + 1) * MASS * G
        assert result[f"lambda.link{k}"][-1] == pytest.approx(-tension / (2 * LENGTH), rel=1e-11)


def test_a_start_takes_hardly_more_evaluations_for_a_longer_chain(monkeypatch):
    """A bob pulls at its neighbours most: what brings bobs back that are far apart is told by displacing them
    at once.  From 64 coordinates on twice as many take hardly more evaluations, which are Newton's."""
    taken = []
    assemble = System.assemble_sparse

    def counted(self, *arguments):
        taken.append(self.nv)
        return assemble(self, *arguments)

    monkeypatch.setattr(System, "assemble_sparse", counted)
    for n in (32, 64):
        assert prepare(chain(n)).structure.degrees_of_freedom == n
    assert taken.count(64) > 64
    assert taken.count(128) < taken.count(64) + 64 / 4


def mode(n, j):
    """z_j, the j-th zero of the Laguerre polynomial L_n, and the small angles of the links in it.

    With s the distance from the lower end in links, the bobs are displaced by L_s(z) and hang, from
    the support (s = n, L_n(z) = 0) on, at the differences L_s-1(z) - L_s(z).
    """
    z = roots_laguerre(n)[0][j]
    s = [float(sp.laguerre(k, sp.Float(z, 30))) for k in range(n, -1, -1)]
    return z, np.diff(s)


@pytest.mark.parametrize("j", range(4))
def test_small_oscillations_have_the_frequencies_of_laguerre(native_fmu, j):
    """Hung from one end, n equal bobs have the modes x_k = L_n-k(z) with w^2 = z g/l, L_n(z) = 0: after
    half a period all are on the other side, after a whole one where they were."""
    z, angles = mode(4, j)
    period = 2 * np.pi / np.sqrt(z * G / LENGTH)
    result = hang(native_fmu("Chain"), 1e-5 * angles / np.abs(angles).max(), 2 * period, 4)
    for k in range(1, 5):
        x = result[f"x{k}"]
        np.testing.assert_allclose(x, x[0] * np.array([1, -1, 1, -1, 1]), atol=3e-8 * LENGTH * 1e-2)


def test_the_chain_in_angles_moves_the_same(native_fmu):
    """m l sum_j min(n-j, n-k) (cos(a_k - a_j) a_j'' + sin(a_k - a_j) a_j'^2) + (n-k) m g sin a_k = 0 for
    the absolute angles, j, k = 0, ..., n - 1, integrated alone: the same bobs."""
    n = 4
    index = np.arange(n)
    count = n - np.maximum.outer(index, index)

    def rhs(_, s):
        a, rate = s[:n], s[n:]
        d = a[:, None] - a[None, :]
        M = LENGTH * count * np.cos(d)
        right = -LENGTH * (count * np.sin(d)) @ rate**2 - (n - index) * G * np.sin(a)
        return np.concatenate([rate, np.linalg.solve(M, right)])

    start = np.concatenate([np.full(n, 1.0), np.zeros(n)])
    times = np.linspace(0, 1.5, 16)
    found = solve_ivp(rhs, (0, 1.5), start, "DOP853", t_eval=times, rtol=1e-13, atol=1e-13)
    x = np.cumsum(LENGTH * np.sin(found.y[:n]), axis=0)
    y = np.cumsum(-LENGTH * np.cos(found.y[:n]), axis=0)
    result = hang(native_fmu("Chain"), np.full(n, 1.0), 1.5, 15)
    for k in range(n):
        assert np.abs(result[f"x{k + 1}"] - x[k]).max() < 1e-8
        assert np.abs(result[f"y{k + 1}"] - y[k]).max() < 1e-8


@pytest.mark.parametrize("n", [1, 5])
def test_the_closed_form_of_the_multipliers_is_exact(n):
    """The tridiagonal solution satisfies G M^-1 (F + G^T lambda) = gamma at any state."""
    eom = derive(chain(n))
    rng = np.random.default_rng(3)
    system = lower(Form(eom))
    q, v = rng.normal(size=2 * n), rng.normal(size=2 * n)
    # lengths that differ are no chain: take a state on the constraints
    angles, rates = rng.uniform(-3, 3, n), rng.normal(size=n)
    q[0::2], q[1::2] = np.cumsum(LENGTH * np.sin(angles)), np.cumsum(-LENGTH * np.cos(angles))
    v[0::2] = np.cumsum(LENGTH * np.cos(angles) * rates)
    v[1::2] = np.cumsum(LENGTH * np.sin(angles) * rates)
    p = [MASS, G, LENGTH]
    M, F, jacobian, _, gamma = system.assemble(0.0, q, v, [], p)
    table = dict(zip((*eom.q, *eom.v), (*q, *v), strict=True))
    table |= dict(zip((q.symbol for q in eom.model.parameters), p, strict=True))
    found = [float(eom.plain(e).subs(table)) for e in multipliers(n)]
    rest = jacobian @ np.linalg.solve(M, F + jacobian.T @ found) - gamma
    assert np.abs(rest).max() < 1e-10 * np.abs(gamma).max()


def test_the_angle_of_a_hinge_is_a_matter_of_its_two_bodies():
    """Its rate holds the upper one's about the axis, and the lower one's three, the ground none: those of all
    angles are known by as many evaluations in a chain of 8 as in one of 4."""
    counts = []
    for n in (4, 8):
        text = sources_of(prepare(hinged(n, "xy"))).generated["model.c"].decode()
        names = ("joint_count", "joint_rates", "joint_groups")
        counts.append([int(re.findall(rf"\.{name} = (\d+)", text)[0]) for name in names])
    assert [(count, rates) for count, rates, _ in counts] == [(4, 3 + 4 * 3), (8, 3 + 4 * 7)]
    assert counts[0][2] == counts[1][2] <= 6


@pytest.mark.thorough
def test_an_instance_of_a_long_chain_asks_for_memory_in_proportion(built, monkeypatch):
    """From where no dense matrix stands by, 64 bodies: 96 have half as much again, to n^1.1."""
    asked = []

    def counted(count, size):
        asked.append(count * size)
        return calloc(count, size)

    monkeypatch.setattr(fmpy, "calloc", counted)
    for n in (64, 96):
        with instance(built(hinged(n, "xy"))) as one:
            one.start()
    shorter, longer = sorted({*asked})  # of each the build made an instance too
    assert longer <= shorter * 1.5**1.1


@pytest.mark.thorough
def test_an_energy_of_thousands_of_terms_has_a_value():
    """That of 500 bodies has 3,000, more than Python's compiler takes in one sum: 3,500 harmonics of 1 J each
    have 3,500 J at the place where all have their crest."""
    one = derive(chain(1))
    waves = sp.Add(*(sp.cos(j * one.q[0]) for j in range(1, 3501)))
    energies = lower(Form(replace(one, potential=waves))).energies
    assert energies(0.0, [0.0, -LENGTH], [0.0, 0.0], [], [MASS, G, LENGTH])[1] == 3500
