/* dependent.c -- the rungs that only constraints need, as linear.c climbs them. */
#include "dependent.h"

#include "leastnorm.h"
#include "nullspace.h"
#include "orthogonal.h"
#include "weighted.h"

static size_t larger(size_t a, size_t b) { return a > b ? a : b; }

static size_t doubles(int n, int m) {
    return larger(weighted_doubles(n, m), least_norm_doubles(n, m));
}

static size_t ints(int n, int m) {
    return larger((size_t)weighted_ints(n, m), (size_t)least_norm_ints(n, m));
}

static int factor_nullspace(Linear *l) {
    if (!nullspace_factor(l)) return 0;
    l->rung = RUNG_NULLSPACE;
    return 1;
}

static Status factor(Linear *l) {
    l->rung = RUNG_ORTHOGONAL;
    if (orthogonal_factor(l)) return OK;
    l->rung = RUNG_LEAST_NORM;
    return least_norm_factor(l);
}

static Status solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    if (l->rung == RUNG_ORTHOGONAL) return orthogonal_solve(l, b, c, x, lambda);
    if (l->rung == RUNG_LEAST_NORM) return least_norm_solve(l, b, c, x, lambda);
    nullspace_solve(l, b, c, x, lambda);
    return OK;
}

static const Dependent ALL = {doubles, ints, factor_nullspace, factor, solve};
const Dependent *const DEPENDENT = &ALL;
