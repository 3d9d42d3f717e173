"""M x = b + G^T lambda, G x = c in the cases where one or another solver fails, held against exact
rational arithmetic on the very same floating-point numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from lagfmu.solver.linear import solve, solve_nullspace
from lagfmu.solver.solution import Solution
from lagfmu.solver.straight import solver_of
from lagfmu.testing import HOLONOMIC, Row, StepFailureError, System

SOLVERS = pytest.mark.parametrize("solver", [solve, solve_nullspace])


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


RATIOS = [1e-12, 1e-6, 1e-3, 1.0, 1e3, 1e6, 1e12]


@SOLVERS
@pytest.mark.parametrize("ratio", RATIOS)
@pytest.mark.parametrize("slope", [(0.0, -1.0), (0.6, -0.8)], ids=["hanging", "slanting"])
def test_a_light_mass_between_heavy_ones(solver, ratio, slope):
    """On a straight chain heavy - light - heavy every rod's lambda is right to 1e-12, where the Schur
    complement loses up to all digits: mass ratios to 1e12 both ways."""
    system = hanging_chain([1.0, ratio, 1.0], slope)
    check(solver(*system), *system)


@SOLVERS
@pytest.mark.parametrize("ratio", RATIOS)
def test_a_long_chain_of_unequal_masses(solver, ratio):
    """The same on six links with masses 1, ratio, 1, ratio, ...: each rod carries what hangs below it
    and keeps it on its circle."""
    masses = [1.0, ratio] * 3
    system = hanging_chain(masses, spin=2.0)
    found = solver(*system)
    below = [
        sum(m * (9.81 + 4.0 * (j + 1)) for j, m in enumerate(masses) if j >= k) for k in range(6)
    ]
    np.testing.assert_allclose(found.lam, -np.array(below) / 2, rtol=1e-12)
    check(found, *system)


@SOLVERS
def test_no_mass_ratio_falls_between_the_rungs(solver):
    """Also where one solver hands over to the next, lambda is right to 1e-12."""
    for ratio in 10.0 ** np.arange(-6, 6.01, 0.25):
        for slope in ((0.0, -1.0), (0.6, -0.8)):
            system = hanging_chain([1.0, ratio, 1.0], slope, spin=2.0)
            np.testing.assert_allclose(solver(*system).lam, exact(*system)[1], rtol=1e-12)


@SOLVERS
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_units_of_constraints_and_masses_do_not_matter(solver, scale):
    """A constraint written in nanometres beside one in metres: x the same, lambda in the inverse
    unit, to 1e-12."""
    M, b, G, c = hanging_chain([2.0, 0.5, 1.0], (0.6, -0.8))
    unit = np.array([scale, 1.0, 1 / scale])
    found, plain = solver(M, b, G * unit[:, None], c * unit), solver(M, b, G, c)
    np.testing.assert_allclose(found.x, plain.x, rtol=1e-12)
    np.testing.assert_allclose(found.lam * unit, plain.lam, rtol=1e-12)


@SOLVERS
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


@SOLVERS
def test_scaled_copies_share_their_force_equally_too(solver):
    """f = 0 and 1000 f = 0 are the same rod: in comparable units they carry the same share, so the
    multiplier of the second is a thousandth."""
    M, b, G, c = hanging_chain([1.0])
    unit = np.array([1.0, 1000.0])
    one = solver(M, b, G, c)
    found = solver(M, b, G[[0, 0]] * unit[:, None], c[[0, 0]] * unit)
    np.testing.assert_allclose(found.lam, one.lam / (2 * unit), rtol=1e-13)
    assert not found.unique.any()


@SOLVERS
def test_three_supports_of_a_beam_share_its_weight(solver):
    """A rigid beam on three supports: the middle one and the ends cannot be told apart, but each
    carries a third in the least-norm answer and the total is the weight."""
    M, b = np.diag([3.0, 0.5]), np.array([-3.0 * 9.81, 0.0])
    G = np.array([[1.0, -1.0], [1.0, 0.0], [1.0, 1.0]])  # y - l phi, y, y + l phi
    found = solver(M, b, G, np.zeros(3))
    assert found.lam.sum() == pytest.approx(3 * 9.81, rel=1e-12)
    assert found.lam[0] == pytest.approx(found.lam[2], rel=1e-12)
    assert not found.unique.any()
    np.testing.assert_allclose(found.x, 0, atol=1e-12)


@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-6, 1e-8])
def test_nearly_parallel_constraints_keep_nine_digits(angle):
    """Two walls at an angle of 1e-8 rad still determine the accelerations to nine digits."""
    assert worst_at(angle, solve) < 1e-9


@SOLVERS
@pytest.mark.parametrize("angle", [1e-6, 1e-8, 1e-10])
def test_nearly_parallel_constraints_lose_no_more_than_their_angle(solver, angle):
    """An angle between two walls is known to eps, and so the motion between them to eps / angle."""
    assert worst_at(angle, solver) < 100 * np.finfo(float).eps / angle


def worst_at(angle, solver):
    """Largest relative error of x over twenty pairs of walls at `angle` [rad] in space."""
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(20):
        M, b = np.diag(rng.uniform(1, 5, 3)), rng.normal(size=3)
        Q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        G = np.array([Q[0], np.cos(angle) * Q[0] + np.sin(angle) * Q[1]])
        c = G @ rng.normal(size=3)  # what a real motion asks of both
        x, _ = exact(M, b, G, c)
        found = solver(M, b, G, c)
        worst = max(worst, np.abs(found.x - x).max() / np.abs(x).max())
        assert found.unique.all()
    return worst


@SOLVERS
def test_a_coordinate_without_mass(solver):
    """A massless point tied to a mass by y = 2 x: the constraint gives its acceleration, and its own
    force must be carried by lambda."""
    M, b = np.diag([2.0, 0.0]), np.array([1.0, 3.0])
    G, c = np.array([[-2.0, 1.0]]), np.array([0.5])
    found = solver(M, b, G, c)
    x, lam = exact(M, b, G, c)
    np.testing.assert_allclose(lam, [-3.0])
    np.testing.assert_allclose(found.x, x, rtol=1e-14)
    np.testing.assert_allclose(found.lam, lam, rtol=1e-14)
    assert found.unique.all()


@SOLVERS
def test_a_massless_link_in_a_chain(solver):
    """A hanging chain whose middle mass is exactly zero: the two rods beside it carry the same."""
    M, b, G, c = hanging_chain([1.0, 0.0, 1.0], spin=0.0)
    # sideways the middle point has no mass and no constraint: hold it by the line between the others
    middle = np.array([[0.5, 0.0, -1.0, 0.0, 0.5, 0.0]])
    G, c = np.vstack([G, middle]), np.append(c, 0.0)
    found = solver(M, b, G, c)
    x, lam = exact(M, b, G, c)
    np.testing.assert_allclose(found.lam, lam, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(found.x, x, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found.lam[1], found.lam[2], rtol=1e-13)


@SOLVERS
def test_contradictory_constraints_are_refused(solver):
    """The same row asked to accelerate at 1 and at 2 m/s^2: there is no such motion."""
    M, b = np.diag([1.0, 2.0]), np.zeros(2)
    G, c = np.array([[1.0, 1.0], [1.0, 1.0]]), np.array([1.0, 2.0])
    with pytest.raises(StepFailureError, match="contradict each other"):
        solver(M, b, G, c)


@SOLVERS
def test_contradictory_constraints_on_a_massless_coordinate_are_refused(solver):
    """Also where M has a zero on its diagonal."""
    M, b = np.diag([1.0, 0.0]), np.zeros(2)
    G, c = np.array([[1.0, 1.0], [2.0, 2.0], [0.0, 1.0]]), np.array([1.0, 3.0, 0.0])
    with pytest.raises(StepFailureError, match="contradict each other"):
        solver(M, b, G, c)


@SOLVERS
@pytest.mark.parametrize(
    "constraint", [np.zeros((0, 2)), np.array([[1.0, 0.0]])], ids=["free", "elsewhere"]
)
def test_neither_mass_nor_constraint(solver, constraint):
    """A coordinate without mass that nothing constrains has no acceleration: refused by name."""
    M, b = np.diag([1.0, 0.0]), np.array([0.0, 1.0])
    with pytest.raises(StepFailureError, match="mass matrix is singular"):
        solver(M, b, constraint, np.zeros(len(constraint)))


@pytest.mark.parametrize("which", ["M", "b", "G", "c"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
@SOLVERS
def test_what_is_not_finite_is_refused(solver, which, value):
    """No NaN and no infinity goes in or comes out, and the message says where it came from."""
    terms = dict(zip("MbGc", hanging_chain([1.0, 2.0]), strict=True))
    terms[which].flat[0] = value
    what = "mass or a force" if which in "Mb" else "constraint or its derivative"
    with (
        np.errstate(all="ignore"),
        pytest.raises(StepFailureError, match=f"{what}.* not finite"),
    ):
        solver(*terms.values())


@pytest.mark.parametrize("seed", range(20))
def test_eliminating_lambda_gives_the_same(seed):
    """With lambda eliminated (Z^T (M x - b) = 0) and with it solved for, x and lambda are the same to
    1e-12, and those of exact arithmetic."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    m = int(rng.integers(0, n + 1))
    A = rng.normal(size=(n, n))
    M = A @ A.T + n * np.eye(n)
    Q, _ = np.linalg.qr(rng.normal(size=(n, n)))
    G = Q[:m] * rng.uniform(0.5, 2, size=(m, 1))
    b, c = rng.normal(size=n), rng.normal(size=m)
    x, lam = exact(M, b, G, c)
    for solver in (solve, solve_nullspace):
        found = solver(M, b, G, c)
        np.testing.assert_allclose(found.x, x, rtol=0, atol=1e-12 * np.abs(x).max())
        np.testing.assert_allclose(
            found.lam, lam, rtol=0, atol=1e-12 * max(np.abs(lam).max(initial=0), 1e-300)
        )
        np.testing.assert_allclose(M @ found.x - G.T @ found.lam, b, atol=1e-11)


def in_straight_lines(M, b, G, c):
    """What straight.py says of the matrices, whose zeros are structural."""
    mass = [(i, j) for i, j in zip(*np.nonzero(M), strict=True) if i >= j]
    entries = list(zip(*np.nonzero(G), strict=True))
    n, m = len(b), len(c)
    system = System(
        tuple(f"q{i}" for i in range(n)),
        tuple(Row(f"r{k}", HOLONOMIC) for k in range(m)),
        tuple(zip(*mass, strict=True)),
        tuple(zip(*entries, strict=True)) or ((), ()),
        *(None,) * 4,
    )
    solve = solver_of(system, range(m))
    values = [float(M[place]) for place in mass], [float(G[place]) for place in entries]
    return solve and solve(values[0], b.tolist(), values[1], c.tolist())


@pytest.mark.parametrize("slope", [(0.0, -1.0), (0.6, -0.8)], ids=["hanging", "slanting"])
@pytest.mark.parametrize("count", [1, 2, 4])
def test_straight_lines_give_the_same_chain(slope, count):
    """A chain of equal masses, whose rods carry all that hangs below them, solved term by term over the
    entries that are not zero: lambda to 1e-12."""
    system = hanging_chain([1.0] * count, slope)
    x, lam = in_straight_lines(*system)
    check(Solution(np.array(x), np.array(lam), np.ones(count, dtype=bool)), *system)


def test_straight_lines_leave_to_the_ladder_what_needs_it():
    """A light mass between heavy ones, a constraint given twice, a force that is no number, a mass whose
    principal axes nearly vanish: the short way says nothing."""
    assert in_straight_lines(*hanging_chain([1.0, 1e-3, 1.0])) is None
    M, b, G, c = hanging_chain([1.0])
    assert in_straight_lines(M, b, np.vstack([G, G]), np.append(c, c)) is None
    assert in_straight_lines(M, np.array([np.inf, 0.0]), G, c) is None
    assert in_straight_lines(M, b, G, np.array([np.nan])) is None
    tied = np.array([[1.0, 1 - 1e-4], [1 - 1e-4, 1.0]])
    assert in_straight_lines(tied, b, G, c) is None
    assert in_straight_lines(tied * [[1, -1], [-1, 1]] * 1e-3 + np.eye(2), b, G, c) is not None
