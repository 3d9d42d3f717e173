"""The elimination written out as C: the same x and lambda as a dense solution, or an honest no."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest
from runtime import compile_library

from lagfmu.testing import solve_source, sparsity

EPS = np.finfo(float).eps
DOUBLES = ctypes.POINTER(ctypes.c_double)


def chain(links):
    """Entries of G of a chain of point masses in the plane: each rod ties a mass to the one before."""
    return [
        (k, 2 * i + axis)
        for k in range(links)
        for i in ((k - 1, k) if k else (0,))
        for axis in (0, 1)
    ]


SYSTEMS = {
    "a rod": (2, [(0, 0), (0, 1)]),
    "no constraint": (3, []),
    "a chain of five": (10, chain(5)),
    "a closed loop": (6, sorted({*chain(3), (3, 0), (3, 1), (3, 4), (3, 5)})),
    "all in all": (5, [(k, j) for k in range(3) for j in range(5)]),
    "two that do not meet": (4, [(0, 0), (0, 1), (1, 2), (1, 3)]),
}


class Solve:
    """solve() of a pattern, as a function of M's diagonal, b, a dense G and c."""

    def __init__(self, folder, n, entries):
        self.n, self.entries = n, entries
        self.m = 1 + max((k for k, _ in entries), default=-1)
        plan = sparsity.plan(n, self.m, [(i, i) for i in range(n)], entries)
        text = solve_source("solve", n, entries, plan)
        assert text is not None
        assert all(len(line) <= 100 for line in text.splitlines())
        door = (
            "int door(const double *M, const double *b, const double *G, const double *c, double *x, "
            "double *lambda);\nint door(const double *M, const double *b, const double *G, const "
            "double *c, double *x, double *lambda) { return solve(M, b, G, c, x, lambda); }\n"
        )
        self.door = compile_library(folder, (), text + door).door

    def __call__(self, M, b, G, c):
        values = np.array([G[e] for e in self.entries] or [0.0])
        x, lam = np.full(self.n, np.nan), np.full(max(1, self.m), np.nan)
        arrays = [np.array(a, float) if len(a) else np.zeros(1) for a in (M, b, values, c)]
        pointers = [a.ctypes.data_as(DOUBLES) for a in (*arrays, x, lam)]
        return self.door(*pointers), x, lam[: self.m]


@pytest.fixture(scope="module", params=SYSTEMS.values(), ids=SYSTEMS.keys())
def solve(request, tmp_path_factory):
    """The written-out elimination of each pattern."""
    return Solve(tmp_path_factory.mktemp("csolve"), *request.param)


def condition(G, M):
    """Of the Schur complement, scaled to a unit diagonal."""
    if not len(G):
        return 1.0
    S = (G / M) @ G.T
    d = 1 / np.sqrt(S.diagonal())
    return np.linalg.cond(S * d * d[:, None])


def drawn(solve, rng):
    M = 10.0 ** rng.uniform(-1, 1, solve.n)
    G = np.zeros((solve.m, solve.n))
    for e in solve.entries:
        G[e] = rng.normal()
    return M, rng.normal(size=solve.n), G, rng.normal(size=solve.m)


def test_x_and_lambda_solve_the_equations(solve):
    """M x - G^T lambda = b and G x = c to rounding of the terms, wherever the answer is yes."""
    rng, yes = np.random.default_rng(1), 0
    for _ in range(50):
        M, b, G, c = drawn(solve, rng)
        good, x, lam = solve(M, b, G, c)
        if not good:
            continue
        yes += 1
        forces = np.abs(b) + np.abs(G).T @ np.abs(lam)
        assert (np.abs(M * x - b - G.T @ lam) <= 8 * EPS * forces).all()
        terms = np.abs(c) + (np.abs(G) / M) @ forces
        assert (np.abs(G @ x - c) <= 8 * EPS * condition(G, M) * terms).all()
    assert yes >= 40


def test_it_says_no_where_the_ladder_must_decide(solve):
    """A massless coordinate, a mass or a force that is not finite, dependent rows: 0, never a number."""
    rng = np.random.default_rng(2)
    M, b, G, c = drawn(solve, rng)
    assert solve(M, b, G, c)[0]
    for bad in (0.0, -1.0, np.nan):
        assert not solve(np.r_[bad, M[1:]], b, G, c)[0]
    for bad in (np.nan, np.inf):
        assert not solve(M, np.r_[bad, b[1:]], G, c)[0]
    if solve.m:
        assert not solve(M, b, 0 * G, c)[0]
        G[0, np.nonzero(G[0])[0][0]] = np.nan
        assert not solve(M, b, G, c)[0]


def test_nearly_dependent_rows_are_left_to_the_ladder(tmp_path):
    """Two rods whose directions differ by 1e-2 lose too many digits here; at 1 rad they do not."""
    solve = Solve(tmp_path, 2, [(0, 0), (0, 1), (1, 0), (1, 1)])
    for angle, expected in ((1.0, 1), (1e-2, 0), (1e-9, 0)):
        G = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
        assert solve([1.0, 1.0], [0.0, -9.81], G, [0.0, 0.0])[0] == expected


def test_only_small_plain_systems_are_written_out():
    """A long chain stays with its lists, and so does a mass matrix that couples coordinates."""
    for links, small in ((16, True), (128, False)):
        entries = chain(links)
        n = 2 * links
        plan = sparsity.plan(n, links, [(i, i) for i in range(n)], entries)
        assert (solve_source("solve", n, entries, plan) is not None) == small
    coupled = sparsity.plan(2, 1, [(0, 0), (1, 0), (1, 1)], [(0, 0), (0, 1)])
    assert solve_source("solve", 2, [(0, 0), (0, 1)], coupled) is None
