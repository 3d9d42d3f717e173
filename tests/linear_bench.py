"""The linear algebra of the C runtime (linear.h) in a library of its own, for single solves."""

from __future__ import annotations

import ctypes
from ctypes import POINTER, c_char_p, c_double, c_int, c_void_p
from typing import NamedTuple

import numpy as np

from lagfmu.testing import plan


class RefusedError(Exception):
    """What the runtime said where it found no solution."""


class Solution(NamedTuple):
    """x (n), lambda (m), and whether each lambda is unique (m)."""

    x: np.ndarray
    lam: np.ndarray
    unique: np.ndarray


SOURCES = [
    "cod.c",
    "condition.c",
    "dependent.c",
    "kept.c",
    "kkt.c",
    "ldlt.c",
    "leastnorm.c",
    "linear.c",
    "lu.c",
    "orthogonal.c",
    "refinement.c",
    "schur.c",
    "stiffened.c",
    "status.c",
    "system.c",
    "weighted.c",
]

# A System and its Linear in one block of memory that the test owns.
DOOR = """
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
             const char *const *names, const Row *rows, const int *plan_ints) {
    Bench *b = calloc(1, sizeof *b);
    if (b == NULL) return NULL;
    b->system.nq = b->system.nv = n;
    b->system.m = m;
    b->system.masses = masses;
    b->system.entries = entries;
    b->system.coordinates = b->system.speeds = names;
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

size_t bench_bytes(const Bench *b) { return b->bytes; }
int bench_factor(Bench *b, const double *M, const double *G, const int *active, const int *basis) {
    return linear_factor_kept(&b->linear, M, G, active, basis);
}
int bench_solve(Bench *b, const double *rhs, const double *c, double *x, double *lambda) {
    return linear_solve(&b->linear, rhs, c, x, lambda);
}
int bench_rung(const Bench *b) { return (int)b->linear.rung; }
const int *bench_unique(const Bench *b) { return b->linear.unique; }
const char *bench_why(const Bench *b) { return b->why.text; }
double bench_condition(const Bench *b) { return schur_of(&b->linear)->condition; }

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


def declare(lib):
    lib.bench.restype = c_void_p
    lib.bench_bytes.restype = ctypes.c_size_t
    lib.bench_unique.restype = POINTER(c_int)
    lib.bench_why.restype = c_char_p
    lib.bench_condition.restype = c_double
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
            raise RefusedError(self.lib.bench_why(self.handle).decode())

    def factor(self, M, G, active=None, basis=None):
        """Factors the matrices, by the rows of a basis if it is known; C sees the values at the patterns
        alone."""
        active = np.ones(self.m) if active is None else active
        self.kept = (
            doubles(M[i, j] for i, j in self.mass),
            doubles(G[k, j] for k, j in self.jacobian),
            integers(active),
            None if basis is None else integers(basis),
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

    def answer(self, M, b, G, c, active=None, basis=None):
        """Factors and solves."""
        self.factor(M, G, active, basis)
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
