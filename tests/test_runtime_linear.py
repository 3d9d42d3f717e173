"""The linear algebra of the C runtime (linear.h) held against exact rational arithmetic, and against
the Python target's on random systems."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from ctypes import POINTER, c_char_p, c_double, c_int, c_void_p
from fractions import Fraction
from pathlib import Path

import mpmath
import numpy as np
import pytest
import test_linear as python
from hypothesis import given, settings
from hypothesis import strategies as st
from runtime import SANITIZE, compile_library, compiler

from lagfmu.solver.linear import solve
from lagfmu.solver.solution import Solution
from lagfmu.testing import StepFailureError, plan

SOURCES = [
    "cod.c",
    "condition.c",
    "dependent.c",
    "kkt.c",
    "ldlt.c",
    "leastnorm.c",
    "linear.c",
    "lu.c",
    "nullspace.c",
    "orthogonal.c",
    "refinement.c",
    "schur.c",
    "stiffened.c",
    "status.c",
    "system.c",
    "weighted.c",
]
SCHUR, KKT, ORTHOGONAL, LEAST_NORM = range(4)

# A System and its Linear in one block of memory that the test owns.
DOOR = """
#include "condition.h"
#include "doubled.h"
#include "lu.h"
#include "schur.h"
#include <stdlib.h>
#include <string.h>

typedef struct {
    System system;
    Plan plan;
    Linear linear;
    Why why;
    void *memory;
    size_t bytes;
} Bench;

static int *ints(const int *from, int count) {
    int *copy = malloc((size_t)(count + 1) * sizeof(int));
    if (copy != NULL && count > 0) memcpy(copy, from, (size_t)count * sizeof(int));
    return copy;
}

Bench *bench(int n, int m, int masses, int entries, const int *mass_row, const int *mass_column,
             const int *entry_row, const int *entry_column, const int *row_start, int formulation,
             const char *const *names, const Row *rows, const int *plan_ints);
Bench *bench(int n, int m, int masses, int entries, const int *mass_row, const int *mass_column,
             const int *entry_row, const int *entry_column, const int *row_start, int formulation,
             const char *const *names, const Row *rows, const int *plan_ints) {
    Bench *b = calloc(1, sizeof *b);
    if (b == NULL) return NULL;
    b->system.n = n;
    b->system.m = m;
    b->system.masses = masses;
    b->system.entries = entries;
    b->system.coordinates = names;
    b->system.rows = rows;
    b->system.mass_row = ints(mass_row, masses);
    b->system.mass_column = ints(mass_column, masses);
    b->system.entry_row = ints(entry_row, entries);
    b->system.entry_column = ints(entry_column, entries);
    b->system.row_start = ints(row_start, m + 1);
    b->system.formulation = (Formulation)formulation;
    b->system.plan = &b->plan;
    const int *next = plan_ints; /* scalars as they are, arrays as length and elements */
    b->plan.diagonal = *next++;
    b->plan.massless = *next++;
#define ARRAY(member) (b->plan.member = ints(next + 1, *next), next += 1 + *next)
#define ELIMINATION(part)                                                                        \\
    (b->plan.part.size = *next++, b->plan.part.forest = *next++, b->plan.part.widest = *next++,  \\
     ARRAY(part.order), ARRAY(part.start), ARRAY(part.column), ARRAY(part.overlap))
    ELIMINATION(mass);
    ARRAY(mass_diagonal);
    ARRAY(mass_value);
    ARRAY(w_start);
    ARRAY(w_column);
    ARRAY(w_value);
    ELIMINATION(schur);
    ARRAY(pair_start);
    ARRAY(pair_a);
    ARRAY(pair_b);
    Arena count = {NULL, 0};
    linear_layout(&b->linear, &count, &b->system, &b->why);
    b->bytes = count.used;
    b->memory = malloc(count.used + 1); /* not cleared: nothing may rely on it */
    if (b->memory == NULL) return NULL;
    memset(b->memory, 0xff, count.used);
    Arena take = {b->memory, 0};
    linear_layout(&b->linear, &take, &b->system, &b->why);
    return b;
}

size_t bench_bytes(const Bench *b);
size_t bench_bytes(const Bench *b) { return b->bytes; }
int bench_factor(Bench *b, const double *M, const double *G, const int *active);
int bench_factor(Bench *b, const double *M, const double *G, const int *active) {
    return linear_factor(&b->linear, M, G, active);
}
int bench_solve(Bench *b, const double *rhs, const double *c, double *x, double *lambda);
int bench_solve(Bench *b, const double *rhs, const double *c, double *x, double *lambda) {
    return linear_solve(&b->linear, rhs, c, x, lambda);
}
int bench_rung(const Bench *b);
int bench_rung(const Bench *b) { return (int)b->linear.rung; }
const int *bench_unique(const Bench *b);
const int *bench_unique(const Bench *b) { return b->linear.unique; }
const char *bench_why(const Bench *b);
const char *bench_why(const Bench *b) { return b->why.text; }
double bench_condition(const Bench *b);
double bench_condition(const Bench *b) { return schur_of(&b->linear)->condition; }

typedef struct {
    int n, pivots[20];
    double lu[400];
} Dense;
static void solve_dense(void *context, double *x) {
    Dense *d = context;
    lu_solve(d->n, d->lu, d->pivots, x);
}
double bench_inverse_norm(int n, const double *A);
double bench_inverse_norm(int n, const double *A) {
    Dense d = {n, {0}, {0}};
    double work[40];
    memcpy(d.lu, A, (size_t)(n * n) * sizeof(double));
    lu_factor(n, d.lu, d.pivots);
    return inverse_norm(n, solve_dense, &d, work);
}

void bench_exact(double a, double b, double *out);
void bench_exact(double a, double b, double *out) {
    Doubled sum = two_sum(a, b), product = two_product(a, b);
    out[0] = sum.high;
    out[1] = sum.low;
    out[2] = product.high;
    out[3] = product.low;
}

void bench_active(int m, const Row *rows, int contacts, const int *contact, const int *closed,
                  int *active);
void bench_active(int m, const Row *rows, int contacts, const int *contact, const int *closed,
                  int *active) {
    System s = {0};
    s.m = m;
    s.rows = rows;
    s.contacts = contacts;
    s.contact = contact;
    system_active(&s, closed, active);
}

void bench_free(Bench *b);
void bench_free(Bench *b) {
    const int *arrays[] = {b->system.mass_row, b->system.mass_column, b->system.entry_row,
                           b->system.entry_column, b->system.row_start, b->plan.mass.order,
                           b->plan.mass.start, b->plan.mass.column, b->plan.mass.overlap,
                           b->plan.mass_diagonal, b->plan.mass_value, b->plan.w_start,
                           b->plan.w_column, b->plan.w_value, b->plan.schur.order,
                           b->plan.schur.start, b->plan.schur.column, b->plan.schur.overlap,
                           b->plan.pair_start, b->plan.pair_a, b->plan.pair_b};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) free((void *)(size_t)arrays[i]);
    free(b->memory);
    free(b);
}
"""


class Row(ctypes.Structure):
    _fields_ = [("name", c_char_p), ("kind", c_int), ("while_closed", c_int), ("friction", c_int)]


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    flags = SANITIZE if "LAGFMU_SANITIZE" in os.environ else ()
    return declare(compile_library(tmp_path_factory.mktemp("linear"), SOURCES, DOOR, flags))


def declare(lib):
    lib.bench.restype = c_void_p
    lib.bench_bytes.restype = ctypes.c_size_t
    lib.bench_unique.restype = POINTER(c_int)
    lib.bench_why.restype = c_char_p
    lib.bench_condition.restype = lib.bench_inverse_norm.restype = c_double
    return lib


def flat(table):
    """A Plan as ints: scalars as they are, arrays as length and elements, in the order of plan.h."""
    ints = []
    for value in vars(table).values():
        if isinstance(value, int):
            ints.append(value)
        elif isinstance(value, tuple):
            ints += [len(value), *value]
        else:
            ints += flat(value)
    return ints


def integers(values):
    values = [int(a) for a in values]
    return (c_int * max(1, len(values)))(*values)


def doubles(values):
    values = [float(a) for a in values]
    return (c_double * max(1, len(values)))(*values)


class Bench:
    """Patterns of M's lower triangle and of G, and the C memory for them."""

    def __init__(self, lib, n, m, mass, jacobian, formulation=0):
        self.lib, self.n, self.m = lib, n, m
        self.mass, self.jacobian = sorted(mass), sorted(jacobian)
        self.plan = plan(n, m, self.mass, self.jacobian)
        start = np.searchsorted([k for k, _ in self.jacobian], range(m + 1))
        names = [f"q{i}" for i in range(n)]
        self.names = (c_char_p * n)(*(name.encode() for name in names))
        self.rows = (Row * max(1, m))(*(Row(f"rod{k}".encode(), 0, -1) for k in range(m)))
        self.handle = c_void_p(
            lib.bench(
                n,
                m,
                len(self.mass),
                len(self.jacobian),
                integers(i for i, _ in self.mass),
                integers(j for _, j in self.mass),
                integers(k for k, _ in self.jacobian),
                integers(j for _, j in self.jacobian),
                integers(start),
                formulation,
                self.names,
                self.rows,
                integers(flat(self.plan)),
            )
        )

    def __del__(self):
        self.lib.bench_free(self.handle)

    def check(self, status):
        if status:
            raise StepFailureError(self.lib.bench_why(self.handle).decode())

    def factor(self, M, G, active=None):
        """Factors the matrices; the values at the patterns are all that C sees."""
        active = np.ones(self.m) if active is None else active
        self.kept = (
            doubles(M[i, j] for i, j in self.mass),
            doubles(G[k, j] for k, j in self.jacobian),
            integers(active),
        )
        self.check(self.lib.bench_factor(self.handle, *self.kept))

    def solve(self, b, c):
        x, lam = doubles(np.full(self.n, np.nan)), doubles(np.full(self.m, np.nan))
        b = None if b is None else doubles(b)
        self.check(self.lib.bench_solve(self.handle, b, doubles(c), x, lam))
        unique = np.array([self.lib.bench_unique(self.handle)[k] for k in range(self.m)], bool)
        x, lam = np.array(x)[: self.n], np.array(lam)[: self.m]
        assert np.isfinite(x).all()
        assert np.isfinite(lam).all()
        return Solution(x, lam, unique)

    def answer(self, M, b, G, c, active=None):
        """Factors and solves."""
        self.factor(M, G, active)
        return self.solve(b, c)

    @property
    def rung(self):
        """The rung that answered last."""
        return self.lib.bench_rung(self.handle)


def patterns(M, G):
    """Structural non-zeros; a zero on M's diagonal is none."""
    return (
        [(int(i), int(j)) for i, j in np.argwhere(np.tril(M) != 0)],
        [(int(k), int(j)) for k, j in np.argwhere(G != 0)],
    )


def solver_of(library, formulation):
    def by_c(M, b, G, c):
        bench = Bench(library, len(b), len(c), *patterns(M, G), formulation)
        return bench.answer(M, b, G, c)

    return by_c


@pytest.fixture(scope="module")
def ladder(library):
    """solve(M, b, G, c) by the C ladder."""
    return solver_of(library, 0)


@pytest.fixture(scope="module", params=["multipliers", "nullspace"])
def solver(request, library):
    """The same, or with lambda eliminated first."""
    return solver_of(library, int(request.param == "nullspace"))


def condition(M, G):
    """Condition number of the KKT matrix, its rows and columns scaled until the largest element of
    each is 1."""
    m = len(G)
    K = np.block([[M, G.T], [G, np.zeros((m, m))]])
    for _ in range(50):
        d = 1 / np.sqrt(np.abs(K).max(axis=1))
        K = K * d * d[:, None]
    return np.linalg.cond(K)


@pytest.mark.parametrize("slope", [(0.0, -1.0), (0.6, -0.8)], ids=["hanging", "slanting"])
@pytest.mark.parametrize("ratio", python.RATIOS)
def test_a_light_mass_between_heavy_ones(solver, ratio, slope):
    """On a straight chain heavy - light - heavy every rod's lambda is right to 1e-12, mass ratios to
    1e12 both ways."""
    python.test_a_light_mass_between_heavy_ones(solver, ratio, slope)


@pytest.mark.parametrize("ratio", python.RATIOS)
def test_a_long_chain_of_unequal_masses(solver, ratio):
    """On six links each rod carries what hangs below it and keeps it on its circle."""
    python.test_a_long_chain_of_unequal_masses(solver, ratio)


def test_no_mass_ratio_falls_between_the_rungs(solver):
    """Also where one solver hands over to the next, lambda is right to 1e-12."""
    python.test_no_mass_ratio_falls_between_the_rungs(solver)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_units_of_constraints_do_not_matter(solver, scale):
    """A constraint in nanometres beside one in metres: x the same, lambda in the inverse unit."""
    python.test_units_of_constraints_and_masses_do_not_matter(solver, scale)


@pytest.mark.parametrize("copies", [2, 3])
@pytest.mark.parametrize("ratio", [1e-6, 1.0, 1e6])
def test_a_duplicated_constraint_shares_its_force_equally(solver, copies, ratio):
    """The same rod given two or three times: equal shares, none unique, the right sum and force."""
    python.test_a_duplicated_constraint_shares_its_force_equally(solver, copies, ratio)


def test_scaled_copies_share_their_force_equally_too(solver):
    """f = 0 and 1000 f = 0 are the same rod and carry the same share in comparable units."""
    python.test_scaled_copies_share_their_force_equally_too(solver)


def test_three_supports_of_a_beam_share_its_weight(solver):
    """A rigid beam on three supports: each carries a third, the total is the weight."""
    python.test_three_supports_of_a_beam_share_its_weight(solver)


@pytest.mark.parametrize("angle", [1e-2, 1e-4, 1e-6, 1e-8])
def test_nearly_parallel_constraints_keep_nine_digits(ladder, angle):
    """Two walls at an angle of 1e-8 rad still determine the accelerations to nine digits."""
    assert python.worst_at(angle, ladder) < 1e-9


@pytest.mark.parametrize("angle", [1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10])
def test_nearly_parallel_constraints_lose_no_more_than_their_angle(solver, angle):
    """An angle between two walls is known to eps, and so the motion between them to eps / angle."""
    assert python.worst_at(angle, solver) < 100 * np.finfo(float).eps / angle


def test_a_coordinate_without_mass(solver):
    """A massless point tied to a mass: the constraint gives its acceleration."""
    python.test_a_coordinate_without_mass(solver)


def test_a_massless_link_in_a_chain(solver):
    """A hanging chain whose middle mass is exactly zero: the rods beside it carry the same."""
    python.test_a_massless_link_in_a_chain(solver)


def test_contradictory_constraints_are_refused(solver):
    """The same row asked to accelerate at 1 and at 2 m/s^2: there is no such motion."""
    python.test_contradictory_constraints_are_refused(solver)


def test_contradictory_constraints_on_a_massless_coordinate_are_refused(solver):
    """Also where M has a zero on its diagonal."""
    python.test_contradictory_constraints_on_a_massless_coordinate_are_refused(solver)


@pytest.mark.parametrize(
    "constraint", [np.zeros((0, 2)), np.array([[1.0, 0.0]])], ids=["free", "elsewhere"]
)
def test_neither_mass_nor_constraint(solver, constraint):
    """A coordinate without mass that nothing constrains has no acceleration: refused by name."""
    python.test_neither_mass_nor_constraint(solver, constraint)


@pytest.mark.parametrize("which", ["M", "b", "G", "c"])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_what_is_not_finite_is_refused(solver, which, value):
    """No NaN and no infinity goes in or comes out, and the message says where it came from."""
    python.test_what_is_not_finite_is_refused(solver, which, value)


@pytest.mark.parametrize("which", ["M", "b", "G", "c"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("case", ["coupled", "massless", "duplicated", "both"])
def test_what_is_not_finite_is_refused_on_every_rung(solver, case, which, value):
    """The same where M has blocks, a coordinate has no mass, or rows depend on each other."""
    M, b, G, c = RUNGS[case][0]
    terms = {"M": M.copy(), "b": b.copy(), "G": G.copy(), "c": c.copy()}
    terms[which][(0,) * terms[which].ndim] = value
    what = "mass or a force" if which in "Mb" else "constraint or its derivative"
    with pytest.raises(StepFailureError, match=f"{what}.* not finite"):
        solver(*terms.values())


def rungs():
    """Small systems and the rung of the ladder that each needs."""
    M, b, G, c = python.hanging_chain([1.0, 2.0], (0.6, -0.8))
    coupled = M.copy()
    coupled[1, 0] = coupled[0, 1] = 0.3
    light = python.hanging_chain([1.0, 1e-12, 1.0], (0.6, -0.8))
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
    reference = solve(M, b, G, c)
    np.testing.assert_allclose(found.lam, reference.lam, rtol=1e-12, atol=1e-14)
    np.testing.assert_array_equal(found.unique, reference.unique)
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
def test_lambda_need_not_be_asked_for(library, case):
    """x is the same, bit for bit, where lambda is not wanted."""
    (M, b, G, c), _ = RUNGS[case]
    bench = Bench(library, len(b), len(c), *patterns(M, G))
    bench.factor(M, G)
    x = doubles(b)
    bench.check(library.bench_solve(bench.handle, doubles(b), doubles(c), x, None))
    np.testing.assert_array_equal(np.array(x), bench.solve(b, c).x)


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


@pytest.mark.parametrize("case", ["diagonal", "coupled", "light", "duplicated"])
@pytest.mark.parametrize("kilogram", [1e-200, 1e-9, 1e9, 1e200])
@pytest.mark.parametrize("metre", [1e-9, 1e9])
@pytest.mark.parametrize("second", [1e-9, 1e9])
def test_units_scale_lambda_as_its_own_unit_says(solver, case, kilogram, metre, second):
    """With f = |r|^2 - L^2 in m^2, lambda is in N/m = kg/s^2: it scales as kilogram / second^2 to
    1e-12, whatever the units of mass, length and time."""
    M, b, G, c = RUNGS[case][0]
    acceleration = metre / second**2
    plain = solver(M, b, G, c)
    found = solver(M * kilogram, b * kilogram * acceleration, G * metre, c * metre * acceleration)
    np.testing.assert_allclose(found.lam * second**2 / kilogram, plain.lam, rtol=1e-12)
    size = np.abs(plain.x).max()
    np.testing.assert_allclose(found.x / acceleration, plain.x, rtol=1e-12, atol=1e-12 * size)
    np.testing.assert_array_equal(found.unique, plain.unique)


@pytest.mark.parametrize("inertia", [3e-3, 1e-20, 1e-30, 1e-100, 1e-300])
@pytest.mark.parametrize("light", ["carrier", "ring"])
@pytest.mark.parametrize("engine", ["C", "python"])
def test_a_light_carrier_hides_no_teeth(ladder, engine, light, inertia):
    """A planetary gear whose ring is held, with Willis' equation besides: i = 3.5 turns of the sun are one
    of the carrier, J carrier'' = i tau with J = J_c + i^2 J_s + k^2 J_p; without J_c that is the limit."""
    sun, planet, teeth, ring = 2e-4, 1e-4, 2.0, 5e-3
    carrier_own, ring = (inertia, ring) if light == "carrier" else (3e-3, inertia)
    M, b = np.diag([sun, planet, carrier_own, ring]), np.array([0.5, 0, 0, 0])
    G = np.array([[teeth, 1.5, -3.5, 0], [0, -1.5, -3.5, 5], [teeth, 0, -7, 5], [0, 0, 0, 1]])
    find = ladder if engine == "C" else solve
    found = find(M, b, G, np.zeros(4))
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
    M, b, _, c = python.hanging_chain(masses)
    G = np.zeros((8, 16))
    for k, angle in enumerate(np.cumsum(rng.normal(0, 0.5, 8))):
        G[k, 2 * k : 2 * k + 2] = 2 * np.sin(angle), -2 * np.cos(angle)
        if k:
            G[k, 2 * k - 2 : 2 * k] = -G[k, 2 * k : 2 * k + 2]
    found = solver(M, b, G, c)
    _, lam = python.exact(M, b, G, c)
    bound = 1e-12 * condition(M, G) * np.abs(lam).max()
    assert np.abs(found.lam - lam).max() <= bound


@pytest.mark.parametrize("seed", range(20))
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
    x, lam = python.exact(M, b, G, c)
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
def test_the_two_targets_agree(library, system, formulation):
    """On systems of any pattern, with dependent rows, open contacts and vanishing masses, the C runtime
    gives the Python target's x, lambda and flags, or refuses in the same words."""
    M, b, G, c, active = system
    acting = np.flatnonzero(active)
    bench = Bench(library, len(b), len(c), *patterns(M, G), formulation)
    try:
        expected = solve(M, b, G[acting], c[acting])
    except StepFailureError as refusal:
        with pytest.raises(StepFailureError, match=str(refusal)[:40]):
            bench.answer(M, b, G, c, active)
        return
    found = bench.answer(M, b, G, c, active)
    np.testing.assert_array_equal(found.unique[acting], expected.unique)
    size = max(1.0, np.abs(expected.x).max())
    np.testing.assert_allclose(found.x, expected.x, atol=1e-11 * size)
    size = max(1.0, np.abs(expected.lam).max(initial=0))
    np.testing.assert_allclose(found.lam[acting], expected.lam, atol=1e-11 * size)
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
    with pytest.raises(StepFailureError, match=r"depend on each other.*constraint rod.*remove"):
        bench.answer(Sparse(mass, M), b, Sparse(jacobian, [*G, *G[-4:]]), [*c, c[-1]])


def test_a_long_chain_with_a_massless_link_is_refused_by_name(library):
    """The same where a mass is zero."""
    mass, jacobian, M, G, _, _ = long_chain(256, ANGLES["coil"](256))
    M[7] = 0.0
    bench = Bench(library, 512, 256, mass, jacobian)
    with pytest.raises(StepFailureError, match=r"mass matrix is singular.*q7.*mass of its own"):
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


@pytest.mark.parametrize("seed", range(20))
def test_the_estimate_of_an_inverse_norm(library, seed):
    """Hager's estimate of the 1-norm of A^-1 is a lower bound, and within a factor of three."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 20))
    A = rng.normal(size=(n, n))
    A = A + A.T
    norm = np.abs(np.linalg.inv(A)).sum(axis=0).max()
    estimate = library.bench_inverse_norm(n, doubles(A.ravel()))
    assert norm / 3 <= estimate <= norm * (1 + 1e-9)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    st.floats(-1e100, 1e100, allow_subnormal=False).filter(lambda a: a == 0 or abs(a) > 1e-100),
    st.floats(-1e100, 1e100, allow_subnormal=False).filter(lambda a: a == 0 or abs(a) > 1e-100),
)
def test_sums_and_products_without_rounding_error(library, a, b):
    """high + low is a + b, and a * b, exactly, and high is the rounded result."""
    out = (c_double * 4)()
    library.bench_exact(c_double(a), c_double(b), out)
    assert Fraction(out[0]) + Fraction(out[1]) == Fraction(a) + Fraction(b)
    assert Fraction(out[2]) + Fraction(out[3]) == Fraction(a) * Fraction(b)
    assert out[0] == a + b
    assert out[2] == a * b


def test_the_plan_as_printed_is_the_plan(library, tmp_path):
    """A Plan printed as C and the same Plan filled in number by number solve alike, bit for bit."""
    M, b, G, c = RUNGS["coupled"][0]
    mass, jacobian = patterns(M, G)
    text = plan(4, 2, mass, jacobian).c_text("the_plan")
    assert max(map(len, text.splitlines())) <= 100
    printed = compile_library(
        tmp_path,
        SOURCES,
        DOOR + text + "const Plan *bench_plan(void);\n"
        "const Plan *bench_plan(void) { return &the_plan; }\n"
        "void bench_use(Bench *b);\nvoid bench_use(Bench *b) { b->system.plan = &the_plan; }\n",
    )
    declare(printed)
    one, two = Bench(library, 4, 2, mass, jacobian), Bench(printed, 4, 2, mass, jacobian)
    printed.bench_use(two.handle)
    one.factor(M, G)
    two.factor(M, G)
    np.testing.assert_array_equal(one.solve(b, c).x, two.solve(b, c).x)


@pytest.mark.parametrize("closed", [(0, 0), (1, 0), (0, 1), (1, 1)])
def test_rows_act_as_their_contacts_stand(library, closed):
    """A contact acts while closed, rolling on it too, everything else always."""
    kinds = [(0, -1), (2, -1), (1, 1), (1, -1), (2, -1), (0, 4)]
    rows = (Row * 6)(*(Row(b"row", kind, contact) for kind, contact in kinds))
    active = (c_int * 6)()
    library.bench_active(6, rows, 2, integers([1, 4]), integers(closed), active)
    first, second = closed
    assert list(active) == [1, first, first, 1, second, second]


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
