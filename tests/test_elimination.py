"""The order and pattern of the sparse elimination, held against dense matrices."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lagfmu.testing import Elimination, eliminate, plan


@st.composite
def graphs(draw):
    """A size and pairs of indices below it."""
    size = draw(st.integers(1, 9))
    index = st.integers(0, size - 1)
    return size, draw(st.lists(st.tuples(index, index), max_size=16))


def factor(A):
    """L and D of A = L D L^T."""
    C = np.linalg.cholesky(A)
    return C / np.diagonal(C), np.diagonal(C) ** 2


def definite(size, pairs, seed):
    """A positive definite matrix with non-zeros at `pairs` and on the diagonal."""
    rng = np.random.default_rng(seed)
    A = np.zeros((size, size))
    for i, j in pairs:
        if i != j:
            A[i, j] = A[j, i] = rng.uniform(-1, 1)
    return A + np.diag(np.abs(A).sum(axis=1) + 0.1)


def dense(e: Elimination):
    """The pattern of L as a matrix of truths."""
    pattern = np.eye(e.size, dtype=bool)
    for p in range(e.size):
        assert list(e.row(p)) == sorted(e.row(p))
        pattern[p, list(e.row(p))] = True
    return pattern


@settings(max_examples=200, deadline=None, derandomize=True)
@given(graphs())
def test_the_factor_has_the_pattern_that_was_found(graph):
    """L of P A P^T is non-zero exactly where the pattern says, each index eliminated once."""
    size, pairs = graph
    e = eliminate(size, pairs)
    assert sorted(e.order) == list(range(size))
    order = list(e.order)
    L, _ = factor(definite(size, pairs, 0)[np.ix_(order, order)])
    np.testing.assert_array_equal(np.abs(L) > 1e-14, dense(e))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(graphs())
def test_no_more_rows_overlap_than_counted(graph):
    """Of the rows of L^-1 that enter a row of L, no more than `overlap` are non-zero in one column; in
    a forest they never meet, and there is no fill."""
    size, pairs = graph
    e = eliminate(size, pairs)
    order = list(e.order)
    L, _ = factor(definite(size, pairs, 1)[np.ix_(order, order)])
    inverse = np.abs(np.linalg.inv(L)) > 1e-14
    meet = [inverse[list(e.row(p))].sum(axis=0).max(initial=0) for p in range(size)]
    assert all(m <= o for m, o in zip(meet, e.overlap, strict=True))
    assert e.forest == int(max(e.overlap) <= 1)
    if e.forest:
        assert len(e.column) == len({frozenset(p) for p in pairs if len(set(p)) == 2})


@settings(max_examples=200, deadline=None, derandomize=True)
@given(graphs())
def test_the_widest_row_bounds_the_norm(graph):
    """Scaled to a unit diagonal the matrix has a norm of at most `widest`."""
    size, pairs = graph
    A = definite(size, pairs, 2)
    d = 1 / np.sqrt(np.diagonal(A))
    assert np.linalg.norm(A * d * d[:, None], 2) <= eliminate(size, pairs).widest * (1 + 1e-12)


@st.composite
def systems(draw):
    """Patterns of M and G: each coordinate has its mass, and some pairs couple."""
    n, pairs = draw(graphs())
    m = draw(st.integers(0, 5))
    entry = st.tuples(st.integers(0, m - 1), st.integers(0, n - 1))
    jacobian = draw(st.lists(entry, max_size=12, unique=True)) if m else []
    mass = {(max(p), min(p)) for p in pairs} | {(i, i) for i in range(n)}
    return n, m, sorted(mass), sorted(jacobian)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(systems())
def test_the_plan_assembles_the_schur_complement(system):
    """Values of M and G put where the plan says, and products summed over its pairs, give
    P M P^T, W = L^-1 P G^T and S = G M^-1 G^T."""
    n, m, mass, jacobian = system
    found = plan(*system)
    M = definite(n, mass, 3)
    G = np.zeros((m, n))
    rng = np.random.default_rng(4)
    for k, j in jacobian:
        G[k, j] = rng.uniform(1, 2)
    M_values = [M[i, j] for i, j in mass]
    if found.diagonal:
        assert len(mass) == n
        L, D, W, columns, start = np.eye(n), M.diagonal(), G.T, [j for _, j in jacobian], None
        values = [G[k, j] for k, j in jacobian]
    else:
        order = list(found.mass.order)
        L, D = factor(M[np.ix_(order, order)])
        assert [M_values[a] for a in found.mass_diagonal] == [M[i, i] for i in order]
        places = [(order[p], order[q]) for p in range(n) for q in found.mass.row(p)]
        for (i, j), a in zip(places, found.mass_value, strict=True):
            assert M[i, j] == (0 if a < 0 else M_values[a])
        W = np.linalg.solve(L, G.T[order])
        columns, start = found.w_column, found.w_start
        values = [W[j, k] for k in range(m) for j in columns[start[k] : start[k + 1]]]
        filled = np.zeros((n, m), dtype=bool)
        for k in range(m):
            filled[list(columns[start[k] : start[k + 1]]), k] = True
            for j, a in zip(
                columns[start[k] : start[k + 1]],
                found.w_value[start[k] : start[k + 1]],
                strict=True,
            ):
                assert (a < 0 and G[k, order[j]] == 0) or jacobian[a] == (k, order[j])
        assert not (np.abs(W) > 1e-13)[~filled].any()
    S = W.T @ (W / D[:, None])
    rows = list(found.schur.order)
    S = S[np.ix_(rows, rows)]
    outside = np.tril(~dense(found.schur))
    assert np.abs(S[outside]).max(initial=0) < 1e-13
    where = ((p, q) for p in range(m) for q in found.schur.row(p))
    for e, (p, q) in enumerate(where):
        pairs = range(found.pair_start[e], found.pair_start[e + 1])
        total = 0.0
        for i in pairs:
            a, b = found.pair_a[i], found.pair_b[i]
            assert columns[a] == columns[b]
            total += values[a] * values[b] / D[columns[a]]
        assert total == pytest.approx(S[p, q], abs=1e-12)


def test_a_chain_in_blocks_stays_sparse():
    """With masses coupled within each body alone (x, y, phi of a rod) nothing couples beyond the
    neighbouring joints: W and S have a fixed number of non-zeros a joint."""
    bodies = 40
    n, m = 3 * bodies, 2 * bodies
    mass = [(3 * b + i, 3 * b + j) for b in range(bodies) for i in range(3) for j in range(i + 1)]
    jacobian = [
        (2 * b + r, 3 * body + i)
        for b in range(bodies)
        for r in range(2)
        for body in (b - 1, b)
        if body >= 0
        for i in range(3)
    ]
    found = plan(n, m, sorted(mass), sorted(jacobian))
    assert len(found.mass.column) == 3 * bodies
    assert found.w_start[-1] == len(jacobian)
    assert len(found.schur.column) <= 6 * m
