"""The linear algebra of the C runtime (linear.h) held against exact rational arithmetic, and against
singular values on random systems."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from linear_bench import (
    DOOR,
    SOURCES,
    Bench,
    RefusedError,
    declare,
    patterns,
    solver_of,
)
from runtime import SANITIZE, compile_library, compiler

SCHUR, KKT, ORTHOGONAL, LEAST_NORM, _, KEPT = range(6)


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    flags = SANITIZE if "LAGFMU_SANITIZE" in os.environ else ()
    return declare(compile_library(tmp_path_factory.mktemp("linear"), SOURCES, DOOR, flags))


@pytest.fixture(scope="module")
def ladder(library):
    """solve(M, b, G, c) by the C ladder."""
    return solver_of(library, 0)


@pytest.fixture(scope="module", params=["multipliers", "nullspace"])
def solver(request, library):
    """The same, or with lambda eliminated first."""
    return solver_of(library, int(request.param == "nullspace"))


def exact(M, b, G, c):
    """x and lambda by Gauss's elimination in fractions; M and G of full rank together."""
    n, m = len(b), len(c)
    rows = [[Fraction(float(a)) for a in M[i]] for i in range(n)]
    rows = [r + [-Fraction(float(a)) for a in G[:, i]] for i, r in enumerate(rows)]
    rows += [[Fraction(float(a)) for a in G[k]] + [Fraction(0)] * m for k in range(m)]
    rows = [[*r, Fraction(float(a))] for r, a in zip(rows, [*b, *c], strict=True)]
    size = n + m
    for i in range(size):
        p = next(k for k in range(i, size) if rows[k][i])
        rows[i], rows[p] = rows[p], rows[i]
        rows[i] = [a / rows[i][i] for a in rows[i]]
        for k in range(size):
            if k != i and rows[k][i]:
                rows[k] = [a - rows[k][i] * e for a, e in zip(rows[k], rows[i], strict=True)]
    z = np.array([float(r[-1]) for r in rows])
    return z[:n], z[n:]


def hanging_chain(masses, slope=(0.0, -1.0), spin=1.0, g=9.81):
    """Masses [kg] on links along one straight line from a fixed point; all turn with `spin` [rad/s].
    Coordinates x1, y1, x2, ...; constraints |r_k - r_(k-1)|^2 = 1."""
    n = len(masses)
    M = np.diag(np.repeat(np.array(masses, dtype=float), 2))
    b = np.zeros(2 * n)
    b[1::2] = -np.array(masses) * g
    G = np.zeros((n, 2 * n))
    for k in range(n):
        G[k, 2 * k : 2 * k + 2] = 2 * np.array(slope)
        if k:
            G[k, 2 * k - 2 : 2 * k] = -2 * np.array(slope)
    return M, b, G, np.full(n, -2 * spin**2 * np.dot(slope, slope))


def check(found, M, b, G, c):
    """lambda to 1e-12, each for itself; M x and G x to 1e-12 of the largest terms.  (x itself is worse
    determined where a mass is light: the last bit of a rod's direction moves it sideways.)"""
    x, lam = exact(M, b, G, c)
    np.testing.assert_allclose(found.lam, lam, rtol=1e-12)
    force = np.abs(b) + np.abs(G.T) @ np.abs(lam)
    assert np.abs(M @ (found.x - x)).max() <= 1e-12 * force.max()
    assert np.abs(G @ found.x - c).max() <= 1e-12 * (np.abs(G) @ np.abs(x)).max()
    assert found.unique.all()


def judged(M, b, G, c):
    """x, the force G^T lambda, lambda and which of it are unique, from the singular values of the KKT matrix;
    or the words of the refusal.  For well-conditioned numbers of size 1."""
    n, m = G.shape[1], len(G)
    K = np.block([[M, -G.T], [G, np.zeros((m, m))]])
    U, s, V = np.linalg.svd(K)
    rank = int((s > 1e-9 * s[0]).sum())
    free = np.abs(V[rank:]).max(axis=0, initial=0) > 1e-9  # what the equations leave open
    if free[:n].any():
        return "mass matrix is singular"
    right = U.T @ np.r_[b, c]
    if np.abs(right[rank:]).max(initial=0) > 1e-9:
        return "contradict each other"
    z = V[:rank].T @ (right[:rank] / s[:rank])
    return z[:n], G.T @ z[n:], z[n:], ~free[n:]


def condition(M, G):
    """Condition number of the KKT matrix, its rows and columns scaled until the largest element of
    each is 1."""
    m = len(G)
    K = np.block([[M, G.T], [G, np.zeros((m, m))]])
    for _ in range(50):
        d = 1 / np.sqrt(np.abs(K).max(axis=1))
        K = K * d * d[:, None]
    return np.linalg.cond(K)


@pytest.mark.parametrize("links", [3, 6])
@pytest.mark.parametrize("slope", [(0.0, -1.0), (0.6, -0.8)], ids=["hanging", "slanting"])
def test_a_light_mass_between_heavy_ones(solver, slope, links):
    """On a straight chain heavy - light - heavy every rod's lambda is right to 1e-12, where the Schur
    complement loses up to all digits: mass ratios to 1e12 both ways, and no gap where one solver hands over
    to the next."""
    for decade in [-12, *np.arange(-6, 6.01, 0.25 if links == 3 else 3.0), 12]:
        system = hanging_chain([1.0, 10.0**decade, 1.0] * (links // 3), slope, spin=2.0)
        check(solver(*system), *system)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_units_of_constraints_do_not_matter(solver, scale):
    """A constraint written in nanometres beside one in metres: x the same, lambda in the inverse
    unit, to 1e-12."""
    M, b, G, c = hanging_chain([2.0, 0.5, 1.0], (0.6, -0.8))
    unit = np.array([scale, 1.0, 1 / scale])
    found, plain = solver(M, b, G * unit[:, None], c * unit), solver(M, b, G, c)
    np.testing.assert_allclose(found.x, plain.x, rtol=1e-12)
    np.testing.assert_allclose(found.lam * unit, plain.lam, rtol=1e-12)


@pytest.mark.parametrize("copies", [2, 3])
@pytest.mark.parametrize("ratio", [1e-6, 1.0, 1e6])
def test_a_duplicated_constraint_shares_its_force_equally(solver, copies, ratio):
    """The same rod given two or three times: none of its multipliers is unique, each carries an equal
    share, their sum and the force G^T lambda are those of one rod; the other rods stay unique."""
    M, b, G, c = hanging_chain([1.0, ratio, 1.0], (0.6, -0.8))
    one = solver(M, b, G, c)
    rows = [0, *[1] * copies, 2]
    many = solver(M, b, G[rows], c[rows])
    np.testing.assert_allclose(many.lam[1 : 1 + copies], one.lam[1] / copies, rtol=1e-10)
    np.testing.assert_allclose(many.lam[[0, -1]], one.lam[[0, 2]], rtol=1e-10)
    force = G.T @ one.lam
    assert np.abs(M @ (many.x - one.x)).max() <= 1e-10 * np.abs(force).max()
    np.testing.assert_allclose(
        G[rows].T @ many.lam, force, rtol=0, atol=1e-10 * np.abs(force).max()
    )
    assert many.unique.tolist() == [True, *[False] * copies, True]


@pytest.mark.parametrize("angle", [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10])
@pytest.mark.parametrize("formulation", [0, 1])
def test_nearly_parallel_constraints_lose_no_more_than_their_angle(library, formulation, angle):
    """Of twenty pairs of walls an angle is known to eps, and so the motion between them to eps / angle; with
    multipliers two walls at 1e-8 rad still determine the accelerations to nine digits."""
    rng = np.random.default_rng(0)
    allowed = 100 * np.finfo(float).eps / angle
    if formulation == 0 and angle >= 1e-8:
        allowed = min(allowed, 1e-9)
    for _ in range(20):
        M, b = np.diag(rng.uniform(1, 5, 3)), rng.normal(size=3)
        Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        G = np.array([Q[0], np.cos(angle) * Q[0] + np.sin(angle) * Q[1]])
        c = G @ rng.normal(size=3)  # what a real motion asks of both
        x, _ = exact(M, b, G, c)
        found = solver_of(library, formulation)(M, b, G, c)
        assert np.abs(found.x - x).max() < allowed * np.abs(x).max()
        assert found.unique.all()


def rungs():
    """Small systems and the rung of the ladder that each needs."""
    M, b, G, c = hanging_chain([1.0, 2.0], (0.6, -0.8))
    coupled = M.copy()
    coupled[1, 0] = coupled[0, 1] = 0.3
    light = hanging_chain([1.0, 1e-12, 1.0], (0.6, -0.8))
    massless = np.diag([2.0, 0.0]), np.array([1.0, 3.0]), np.array([[-2.0, 1.0]]), np.array([0.5])
    both = (
        np.diag([1.0, 0.0]),
        np.array([1.0, 2.0]),
        np.array([[1.0, 1.0], [2.0, 2.0], [0.0, 1.0]]),
        np.array([1.0, 2.0, 0.0]),
    )
    return {
        "diagonal": ((M, b, G, c), SCHUR),
        "coupled": ((coupled, b, G, c), SCHUR),
        "light": (light, KKT),
        "massless": (massless, KKT),
        "duplicated": ((M, b, G[[0, 1, 1]], c[[0, 1, 1]]), ORTHOGONAL),
        "both": (both, LEAST_NORM),
    }


RUNGS = rungs()


@pytest.mark.parametrize("case", RUNGS)
def test_the_ladder_takes_the_first_rung_that_is_safe(library, case):
    """Schur where masses are alike; KKT for masses that differ by 1e12 or vanish; orthogonal
    decomposition for dependent rows, of the KKT matrix where a mass vanishes too."""
    (M, b, G, c), rung = RUNGS[case]
    bench = Bench(library, len(b), len(c), *patterns(M, G))
    bench.factor(M, G)
    found = bench.solve(b, c)
    assert bench.rung == rung
    assert found.unique.all() == (rung in (SCHUR, KKT))
    force = np.abs(b) + np.abs(G.T) @ np.abs(found.lam)
    np.testing.assert_allclose(M @ found.x, b + G.T @ found.lam, atol=1e-12 * force.max())
    np.testing.assert_allclose(G @ found.x, c, atol=1e-12 * np.abs(found.x).max())


@pytest.mark.parametrize("case", RUNGS)
def test_one_factorization_serves_many_right_hand_sides(library, case):
    """x and lambda are linear in (b, c) while M and G stay, and b = 0 may be left out."""
    (M, b, G, c), _ = RUNGS[case]
    bench = Bench(library, len(b), len(c), *patterns(M, G))
    bench.factor(M, G)
    one, two = bench.solve(b, c), bench.solve(3 * b, 2 * c)
    none, still = bench.solve(None, c), bench.solve(b, 0 * c)
    size = np.abs(one.x).max(), np.abs(one.lam).max()
    for k, part in enumerate(("x", "lam")):
        sums = 3 * getattr(still, part) + 2 * getattr(none, part)
        np.testing.assert_allclose(getattr(two, part), sums, atol=1e-11 * size[k])


@pytest.mark.parametrize("case", RUNGS)
@pytest.mark.parametrize("formulation", [0, 1])
def test_a_row_that_does_not_act_is_not_there(library, case, formulation):
    """An open contact's row changes nothing, whatever it holds, NaN included; its lambda is 0 and
    counts as unique."""
    (M, b, G, c), _ = RUNGS[case]
    n, m = len(b), len(c)
    wider = np.vstack([G, np.ones((2, n))])[[m, *range(m), m + 1]]
    there = Bench(library, n, m, *patterns(M, G), formulation)
    there.factor(M, G)
    expected = there.solve(b, c)
    bench = Bench(library, n, m + 2, *patterns(M, wider), formulation)
    wider[0], wider[-1] = np.nan, np.inf
    bench.factor(M, wider, [0, *[1] * m, 0])
    found = bench.solve(b, np.array([np.nan, *c, np.inf]))
    assert found.lam[0] == found.lam[-1] == 0
    assert found.unique[[0, -1]].all()
    np.testing.assert_array_equal(found.unique[1:-1], expected.unique)
    np.testing.assert_allclose(found.lam[1:-1], expected.lam, rtol=1e-13)
    np.testing.assert_allclose(found.x, expected.x, rtol=1e-13, atol=1e-15)


@pytest.mark.parametrize("case", ["coupled", "massless", "duplicated", "both"])
def test_what_is_not_finite_is_refused(solver, case):
    """No NaN and no infinity goes in or comes out, and the message says where it came from: where M has
    blocks, a coordinate has no mass, or rows depend on each other."""
    for which, value in itertools.product("MbGc", (np.nan, np.inf, -np.inf)):
        terms = {name: a.copy() for name, a in zip("MbGc", RUNGS[case][0], strict=True)}
        terms[which][(0,) * terms[which].ndim] = value
        what = "mass or a force" if which in "Mb" else "constraint or its derivative"
        with pytest.raises(RefusedError, match=f"{what}.* not finite"):
            solver(*terms.values())


@pytest.mark.parametrize("case", ["diagonal", "coupled", "light", "duplicated"])
def test_units_scale_lambda_as_its_own_unit_says(solver, case):
    """With f = |r|^2 - L^2 in m^2, lambda is in N/m = kg/s^2: it scales as kilogram / second^2 to
    1e-12, whatever the units of mass, length and time."""
    M, b, G, c = RUNGS[case][0]
    plain = solver(M, b, G, c)
    size = np.abs(plain.x).max()
    units = itertools.product((1e-200, 1e-9, 1e9, 1e200), (1e-9, 1e9), (1e-9, 1e9))
    for kilogram, metre, second in units:
        acceleration = metre / second**2
        force = kilogram * acceleration
        found = solver(M * kilogram, b * force, G * metre, c * metre * acceleration)
        np.testing.assert_allclose(found.lam * second**2 / kilogram, plain.lam, rtol=1e-12)
        np.testing.assert_allclose(found.x / acceleration, plain.x, rtol=1e-12, atol=1e-12 * size)
        np.testing.assert_array_equal(found.unique, plain.unique)


@pytest.mark.parametrize("inertia", [3e-3, 1e-20, 1e-30, 1e-100, 1e-300])
@pytest.mark.parametrize("light", ["carrier", "ring"])
def test_a_light_carrier_hides_no_teeth(ladder, light, inertia):
    """A planetary gear whose ring is held, with Willis' equation besides: i = 3.5 turns of the sun are one
    of the carrier, J carrier'' = i tau with J = J_c + i^2 J_s + k^2 J_p; without J_c that is the limit."""
    sun, planet, teeth, ring = 2e-4, 1e-4, 2.0, 5e-3
    carrier_own, ring = (inertia, ring) if light == "carrier" else (3e-3, inertia)
    M, b = np.diag([sun, planet, carrier_own, ring]), np.array([0.5, 0, 0, 0])
    G = np.array([[teeth, 1.5, -3.5, 0], [0, -1.5, -3.5, 5], [teeth, 0, -7, 5], [0, 0, 0, 1]])
    found = ladder(M, b, G, np.zeros(4))
    i, k = 3.5, 7 / 3
    carrier = i * 0.5 / (carrier_own + i**2 * sun + k**2 * planet)
    np.testing.assert_allclose(
        found.x, [i * carrier, -k * carrier, carrier, 0], rtol=1e-9, atol=1e-9
    )
    assert list(found.unique) == [False, False, False, True]


@pytest.mark.parametrize("seed", range(10))
def test_masses_from_picograms_to_gigagrams_in_one_chain(solver, seed):
    """Eight links, masses anywhere between 1e-12 and 1e12: lambda to 1e-12 times the condition number
    of the KKT matrix in rows and columns scaled alike."""
    rng = np.random.default_rng(seed)
    masses = 10 ** rng.uniform(-12, 12, 8)
    M, b, _, c = hanging_chain(masses)
    G = np.zeros((8, 16))
    for k, angle in enumerate(np.cumsum(rng.normal(0, 0.5, 8))):
        G[k, 2 * k : 2 * k + 2] = 2 * np.sin(angle), -2 * np.cos(angle)
        if k:
            G[k, 2 * k - 2 : 2 * k] = -G[k, 2 * k : 2 * k + 2]
    found = solver(M, b, G, c)
    _, lam = exact(M, b, G, c)
    bound = 1e-12 * condition(M, G) * np.abs(lam).max()
    assert np.abs(found.lam - lam).max() <= bound


@pytest.mark.parametrize("seed", range(8))
def test_a_full_mass_matrix(solver, seed):
    """Where every coordinate couples with every other, x and lambda are exact to 1e-12 too."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    m = int(rng.integers(0, n + 1))
    A = rng.normal(size=(n, n))
    M = A @ A.T + n * np.eye(n)
    Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
    G = Q[:m] * rng.uniform(0.5, 2, size=(m, 1))
    b, c = rng.normal(size=n), rng.normal(size=m)
    x, lam = exact(M, b, G, c)
    found = solver(M, b, G, c)
    np.testing.assert_allclose(found.x, x, rtol=0, atol=1e-12 * np.abs(x).max())
    np.testing.assert_allclose(
        found.lam, lam, rtol=0, atol=1e-12 * max(np.abs(lam).max(initial=0), 1e-300)
    )


def test_an_indefinite_mass_matrix_is_made_definite_by_the_constraint_that_holds_it(library):
    """A mass matrix with a negative eigenvalue has no Cholesky factor; where the constraint takes that
    direction away the motion is determined all the same (stiffened.c)."""
    M, b = np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([1.0, 2.0])
    G, c = np.array([[1.0, -1.0]]), np.array([0.0])
    bench = Bench(library, 2, 1, *patterns(M, G))
    bench.factor(M, G)
    found = bench.solve(b, c)
    assert bench.rung == SCHUR
    np.testing.assert_allclose(found.x, [0.5, 0.5])
    np.testing.assert_allclose(found.lam, [0.5])


@pytest.mark.parametrize("inertia", [1.0, 2.0**-60])
@pytest.mark.parametrize("spin", [1.3, 3.1, 5.7, 11.9])
def test_a_needle_that_spins_has_the_force_of_its_small_inertia(library, spin, inertia):
    """In Euler parameters p a body that turns steadily about an axis has p'' = -w^2 p / 4 and
    lambda = -A w^2, A its inertia about that axis: to rounding, though about the others it has 2^20 times as
    much, and whatever the unit of mass."""
    thin, p = 2.0**-20 * inertia, np.full(4, 0.5)  # all sums of the mass matrix are exact
    E = np.array([[-0.5, 0.5, 0.5, -0.5], [-0.5, -0.5, 0.5, 0.5], [-0.5, 0.5, -0.5, 0.5]])
    M, G = 4 * E.T @ np.diag([thin, inertia, inertia]) @ E, 2 * p[None, :]
    bench = Bench(library, 4, 1, *patterns(M, G))
    bench.factor(M, G)
    found = bench.solve(2 * thin * spin**2 * p, np.array([-(spin**2) / 2]))
    np.testing.assert_allclose(found.x, -(spin**2) / 4 * p, rtol=1e-13)
    np.testing.assert_allclose(found.lam, [-thin * spin**2], rtol=1e-13)


def test_where_a_torque_acts_a_length_that_pulls_at_nothing_is_no_reason_for_another_rung(library):
    """A ball of 1 kg m^2 that a torque of 5 N m sets spinning: the lambda of its Euler parameters' length is
    nothing beside the torque, and need not be told to its own digits."""
    p, torque = np.full(4, 0.5), np.array([5.0, -5.0, 0.0, 0.0])
    M, G, spin = 4 * (np.eye(4) - np.outer(p, p)), 2 * p[None, :], 1.3
    bench = Bench(library, 4, 1, *patterns(M, G))
    bench.factor(M, G)
    found = bench.solve(torque, np.array([-(spin**2) / 2]))
    assert bench.rung == SCHUR
    np.testing.assert_allclose(found.x, -(spin**2) / 4 * p + torque / 4, atol=1e-14)
    np.testing.assert_allclose(found.lam, [0.0], atol=1e-14)


NUMBERS = st.sampled_from([-2.0, -1.0, 0.5, 1.0, 3.0])


@st.composite
def systems(draw):
    """Sparse M (positive definite or, now and then, massless somewhere), sparse G with rows that may
    depend on each other, the rows that act, and a right-hand side that may or may not fit them."""
    n = draw(st.integers(1, 6))
    m = draw(st.integers(0, 5))
    M = np.zeros((n, n))
    for i in range(n):
        for j in range(i):
            if draw(st.integers(0, 3)) == 0:
                M[i, j] = M[j, i] = draw(NUMBERS)
    M[np.diag_indices(n)] = np.abs(M).sum(axis=1) + [abs(draw(NUMBERS)) for _ in range(n)]
    if draw(st.integers(0, 4)) == 0:
        bare = draw(st.integers(0, n - 1))
        M[bare] = M[:, bare] = 0
    G = np.zeros((m, n))
    for k in range(m):
        for j in range(n):
            if draw(st.booleans()):
                G[k, j] = draw(NUMBERS)
    active = np.array([draw(st.integers(0, 3)) > 0 for _ in range(m)], dtype=int)
    b = np.array([draw(NUMBERS) for _ in range(n)])
    fits = draw(st.booleans())
    c = G @ b[::-1] if fits else np.array([draw(NUMBERS) for _ in range(m)])
    return M, b, G, c, active


@settings(max_examples=400, deadline=None, derandomize=True)
@given(systems(), st.sampled_from([0, 1]))
def test_any_pattern_is_solved_or_refused(library, system, formulation):
    """On systems of any pattern, with dependent rows, open contacts and vanishing masses, x, the forces, what
    is unique and the multipliers that are so are those of the singular values, or the refusal is."""
    M, b, G, c, active = system
    acting = np.flatnonzero(active)
    bench = Bench(library, len(b), len(c), *patterns(M, G), formulation)
    expected = judged(M, b, G[acting], c[acting])
    if isinstance(expected, str):
        with pytest.raises(RefusedError, match=expected):
            bench.answer(M, b, G, c, active)
        return
    found = bench.answer(M, b, G, c, active)
    x, force, lam, unique = expected
    np.testing.assert_array_equal(found.unique[acting], unique)
    np.testing.assert_allclose(found.x, x, atol=1e-11 * max(1.0, np.abs(x).max()))
    size = max(1.0, np.abs(force).max(), np.abs(lam).max(initial=0))
    np.testing.assert_allclose(G[acting].T @ found.lam[acting], force, atol=1e-11 * size)
    np.testing.assert_allclose(found.lam[acting][unique], lam[unique], atol=1e-11 * size)
    assert not np.delete(found.lam, acting).any()


def long_chain(links, angles, masses=None):
    """Patterns and values of a chain: rod k from mass k - 1 to mass k at `angles[k]` [rad]."""
    masses = np.ones(links) if masses is None else masses
    M = np.repeat(masses, 2)
    jacobian, G = [], []
    for k in range(links):
        d = 2 * np.sin(angles[k]), -2 * np.cos(angles[k])
        if k:
            jacobian += [(k, 2 * k - 2), (k, 2 * k - 1)]
            G += [-d[0], -d[1]]
        jacobian += [(k, 2 * k), (k, 2 * k + 1)]
        G += d
    b = np.zeros(2 * links)
    b[1::2] = -9.81 * masses
    return [(i, i) for i in range(2 * links)], jacobian, M, G, b, np.full(links, -2.0)


class Sparse:
    """Looks like a matrix where Bench reads it: values at the pattern."""

    def __init__(self, pattern, values):
        self.values = dict(zip(pattern, values, strict=True))

    def __getitem__(self, at):
        return self.values[at]


def chain_bench(library, links, angles, masses=None):
    mass, jacobian, M, G, b, c = long_chain(links, angles, masses)
    bench = Bench(library, 2 * links, links, mass, jacobian)
    bench.factor(Sparse(mass, M), Sparse(jacobian, G))
    return bench, M, G, b, c


def chain_lambda(M, G, b, c):
    """lambda of a chain from its tridiagonal S in 40 digits."""
    with mpmath.workdps(40):
        rows = [
            [mpmath.mpf(g) for g in ([0, 0, *G[:2]] if k == 0 else G[4 * k - 2 : 4 * k + 2])]
            for k in range(len(c))
        ]
        inverse = [1 / mpmath.mpf(a) for a in [1, 1, *M]]
        y = [mpmath.mpf(a) * i for a, i in zip([0, 0, *b], inverse, strict=True)]
        diagonal, right, beside = [], [], [mpmath.mpf(0)]
        for k, g in enumerate(rows):
            w = inverse[2 * k : 2 * k + 4]
            diagonal.append(sum(a * a * i for a, i in zip(g, w, strict=True)))
            right.append(c[k] - sum(a * i for a, i in zip(g, y[2 * k : 2 * k + 4], strict=True)))
            if k:
                above = rows[k - 1]
                beside.append(g[0] * above[2] * w[0] + g[1] * above[3] * w[1])
        for k in range(1, len(c)):
            factor = beside[k] / diagonal[k - 1]
            diagonal[k] -= factor * beside[k]
            right[k] -= factor * right[k - 1]
        lam = [mpmath.mpf(0)] * (len(c) + 1)
        for k in reversed(range(len(c))):
            after = beside[k + 1] * lam[k + 1] if k + 1 < len(c) else 0
            lam[k] = (right[k] - after) / diagonal[k]
        return np.array([float(a) for a in lam[:-1]])


ANGLES = {
    "straight": lambda k: np.full(k, 0.3),
    "arc": lambda k: 0.01 * np.arange(k),
    "coil": lambda k: 0.9 * np.arange(k),
}


@pytest.mark.parametrize("shape", ANGLES)
@pytest.mark.parametrize("links", [1, 2, 64, 512])
def test_a_chain_of_512_links(library, links, shape):
    """lambda of a chain is right to 1e-12 of the largest, from one link to 512, by the sparse rung,
    though 512 straight links have a condition number of 1e5."""
    bench, M, G, b, c = chain_bench(library, links, ANGLES[shape](links))
    found = bench.solve(b, c)
    assert bench.rung == SCHUR
    lam = chain_lambda(M, G, b, c)
    assert np.abs(found.lam - lam).max() <= 1e-12 * np.abs(lam).max()
    assert found.unique.all()


@pytest.mark.parametrize("ratio", [1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9])
def test_light_and_heavy_masses_in_a_chain_too_long_for_the_dense_rungs(library, ratio):
    """256 links of masses 1, ratio, 1, ...: refined by residuals in doubled precision, lambda is right
    to 1e-12 of the largest, or the chain is refused."""
    masses = np.where(np.arange(256) % 2, ratio, 1.0)
    bench, M, G, b, c = chain_bench(library, 256, ANGLES["coil"](256), masses)
    found = bench.solve(b, c)
    assert bench.rung == SCHUR
    lam = chain_lambda(M, G, b, c)
    assert np.abs(found.lam - lam).max() <= 1e-12 * np.abs(lam).max()


def test_memory_grows_linearly_with_a_long_chain(library):
    """Beyond the dense rungs twice the links take twice the memory, to 1 %."""
    benches = [chain_bench(library, links, ANGLES["coil"](links))[0] for links in (256, 512, 1024)]
    sizes = [library.bench_bytes(bench.handle) for bench in benches]
    assert sizes[1] == pytest.approx(2 * sizes[0], rel=0.01)
    assert sizes[2] == pytest.approx(2 * sizes[1], rel=0.01)


def test_a_long_chain_with_a_rod_twice_is_refused_by_name(library):
    """What the sparse rung cannot tell in a model too large for the dense ones is refused, with the
    constraint's name, the cause and the remedy."""
    mass, jacobian, M, G, b, c = long_chain(256, ANGLES["coil"](256))
    jacobian = [*jacobian, *((256, j) for k, j in jacobian if k == 255)]
    bench = Bench(library, 512, 257, mass, jacobian)
    with pytest.raises(RefusedError, match=r"depend on each other.*constraint rod.*remove"):
        bench.answer(Sparse(mass, M), b, Sparse(jacobian, [*G, *G[-4:]]), [*c, c[-1]])


def test_a_long_chain_with_a_massless_link_is_refused_by_name(library):
    """The same where a mass is zero."""
    mass, jacobian, M, G, _, _ = long_chain(256, ANGLES["coil"](256))
    M[7] = 0.0
    bench = Bench(library, 512, 256, mass, jacobian)
    with pytest.raises(RefusedError, match=r"mass matrix is singular.*q7.*mass of its own"):
        bench.factor(Sparse(mass, M), Sparse(jacobian, G))


@pytest.mark.parametrize("seed", range(30))
def test_the_bound_of_the_condition_number_is_never_below_it(library, seed):
    """The bound that guards the Schur complement is never below the condition number k of S scaled to a
    unit diagonal; for a chain of m links it is 3 trace(C^-1) <= 3 m k."""
    rng = np.random.default_rng(seed)
    if seed < 15:
        links = int(rng.integers(2, 40))
        angles = np.cumsum(rng.normal(0, 0.2, links))
        _, jacobian, M, G, _, _ = long_chain(links, angles, 10 ** rng.uniform(-1, 1, links))
        full = np.diag(M)
        rows = np.zeros((links, 2 * links))
        rows[tuple(np.array(jacobian).T)] = G
    else:
        n, m = 8, int(rng.integers(2, 8))
        full = np.diag(10 ** rng.uniform(-2, 2, n))
        rows = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.6)
        rows[:, 0] = 1.0
    bench = Bench(library, len(full), len(rows), *patterns(full, rows))
    bench.factor(full, rows)
    S = rows @ np.linalg.inv(full) @ rows.T
    d = 1 / np.sqrt(np.diagonal(S))
    true = np.linalg.cond(S * d * d[:, None])
    bound = library.bench_condition(bench.handle)
    assert bound >= true * (1 - 1e-9)
    if seed < 15:
        inverse = np.linalg.inv(S * d * d[:, None])
        assert bound == pytest.approx((3 if links > 2 else 2) * np.trace(inverse), rel=1e-9)


def chain_in_space(links, rows_of_one, seed=3):
    """M (n, n) and G (m, n) of bodies in a row, each held to the one before by so many rows; and C, the Schur
    complement scaled to a unit diagonal."""
    rng, w = np.random.default_rng(seed), rows_of_one
    rows = np.zeros((w * links, w * links))
    for k in range(links):
        across, _ = np.linalg.qr(rng.normal(size=(w, w)))
        rows[w * k : w * k + w, w * k : w * k + w] = across
        if k > 0:
            rows[w * k : w * k + w, w * k - w : w * k] = -across
    full = np.diag(10 ** rng.uniform(-0.5, 0.5, w * links))
    S = rows @ np.linalg.inv(full) @ rows.T
    d = 1 / np.sqrt(np.diagonal(S))
    return full, rows, S * d * d[:, None]


def test_a_chain_of_bodies_in_space_is_as_well_conditioned_as_it_is(library):
    """Three rows a link, all on the same bodies: the condition is told by trace(C^-1), which grows like the
    square of the length, and by no factor of three a link."""
    full, rows, scaled = chain_in_space(40, 3)
    bench = Bench(library, len(full), len(rows), *patterns(full, rows))
    bench.factor(full, rows)
    bound = np.abs(scaled).sum(axis=1).max() * np.trace(np.linalg.inv(scaled))
    assert library.bench_condition(bench.handle) == pytest.approx(bound, rel=1e-9)
    assert np.linalg.cond(scaled) < bound < 1e6


@pytest.mark.parametrize("seed", range(10))
def test_the_condition_of_an_arm_is_bounded_without_its_trace(library, seed):
    """Six bodies, six rows a joint: the bound that costs next to nothing is above trace(C^-1), and below 1e6,
    beyond which lambda would be refined."""
    full, rows, scaled = chain_in_space(6, 6, seed)
    bench = Bench(library, len(full), len(rows), *patterns(full, rows))
    bench.factor(full, rows)
    least = np.abs(scaled).sum(axis=1).max() * np.trace(np.linalg.inv(scaled))
    assert least < library.bench_condition(bench.handle) < 1e6


def redundant(seed, more, off=0.0):
    """M of two bodies in space, five rows, `more` that follow from them but for a part `off` of their own;
    some of the rows touch one body alone: not all multipliers are in doubt.  -> M, b, G, c and a basis."""
    rng = np.random.default_rng(seed)
    n, kept = 12, 5
    half = rng.standard_normal((2, 3, 3))
    M = np.zeros((n, n))
    for k, factor in enumerate(half):
        at = slice(6 * k, 6 * k + 3)
        M[at, at] = 10 ** rng.uniform(-2, 2) * np.eye(3)
        M[6 * k + 3 : 6 * k + 6, 6 * k + 3 : 6 * k + 6] = factor @ factor.T + 0.1 * np.eye(3)
    G = rng.standard_normal((kept, n)) * 10 ** rng.uniform(-2, 2, (kept, 1))
    G[:3, 6:] = 0
    mixed = rng.standard_normal((more, 3)) / np.linalg.norm(G[:3], axis=1)
    c = rng.standard_normal(kept)
    own = off * rng.standard_normal((more, n))
    order = rng.permutation(kept + more)
    basis = (np.arange(kept + more) < kept)[order]
    return (
        M,
        rng.standard_normal(n),
        np.vstack((G, mixed @ G[:3] + own))[order],
        np.concatenate((c, mixed @ c[:3]))[order],
        basis,
    )


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("more", [1, 3])
def test_rows_that_stand_for_all_share_forces_as_the_decomposition_of_all_does(library, seed, more):
    """The multipliers of least norm, and which of them are unique, are facts of all rows: known rows that
    stand for them, whichever, change neither, nor the accelerations."""
    M, b, G, c, basis = redundant(seed, more)
    bench = Bench(library, len(b), len(c), *patterns(M, G))
    whole = bench.answer(M, b, G, c)
    assert bench.rung == ORTHOGONAL
    by_basis = bench.answer(M, b, G, c, basis=basis)
    assert bench.rung == KEPT
    np.testing.assert_array_equal(by_basis.unique, whole.unique)
    assert 0 < whole.unique.sum() < len(c)
    np.testing.assert_allclose(by_basis.x, whole.x, rtol=0, atol=1e-10 * np.abs(whole.x).max())
    size = np.sqrt(np.einsum("ki,ij,kj->k", G, np.linalg.inv(M), G))
    least = np.abs(size * whole.lam).max()
    np.testing.assert_allclose(size * by_basis.lam, size * whole.lam, rtol=0, atol=1e-10 * least)


@pytest.mark.parametrize("off", [1e-11, 1e-9, 1e-6])
def test_rows_that_no_longer_stand_for_all_are_not_taken_for_it(library, off):
    """A row that stands out by more than rounding is independent: no multiplier is in doubt."""
    M, b, G, c, basis = redundant(0, 1, off)
    bench = Bench(library, len(b), len(c), *patterns(M, G))
    assert bench.answer(M, b, G, c, basis=basis).unique.all()
    assert bench.rung != KEPT


def test_rows_that_contradict_those_that_stand_for_them_are_refused(library):
    """Whoever asks of a body to accelerate by two numbers is told which rows do."""
    M, b, G, c, basis = redundant(1, 1)
    bench = Bench(library, len(b), len(c), *patterns(M, G))
    with pytest.raises(RefusedError, match="contradict each other"):
        bench.answer(M, b, G, c + ~basis * np.abs(c).max(), basis=basis)


@pytest.mark.thorough
@pytest.mark.skipif("LAGFMU_SANITIZE" in os.environ, reason="this is the run under the sanitizers")
def test_clean_under_the_sanitizers():
    """The whole set once more with every memory access and every undefined operation watched."""
    found = subprocess.run(
        [compiler(), "-print-file-name=libasan.so"], capture_output=True, text=True, check=True
    )
    sanitizer = found.stdout.strip()
    if not Path(sanitizer).is_absolute():
        pytest.skip("the compiler has no address sanitizer")
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-n0", "-qs", "-p", "no:cacheprovider", __file__],
        env={
            **os.environ,
            "LAGFMU_SANITIZE": "1",
            "LD_PRELOAD": sanitizer,
            "ASAN_OPTIONS": "detect_leaks=0",
        },
        capture_output=True,
        text=True,
        timeout=500,
    )
    assert run.returncode == 0, run.stdout[-3000:] + run.stderr[-3000:]
