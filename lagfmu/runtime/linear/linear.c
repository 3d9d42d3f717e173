/* linear.c -- the ladder:  M x = b + G^T lambda ,  G x = c  on the rows that act.
 *
 * Factoring takes the first rung that is safe at this state; solving climbs on if refinement does
 * not settle.  For a small system with all rows acting the first rung is written out in model.c.  The
 * dense rungs need (n + m)^2 numbers and are there up to n + m = DENSE_MOST; beyond, the Schur
 * complement is refined with residuals in doubled precision, and what that cannot settle is refused. */
#include "linear.h"

#include <math.h>

#include "dependent.h"
#include "kkt.h"
#include "numbers.h"
#include "refinement.h"
#include "schur.h"
#include "square.h"
#include "stiffened.h"
#include "thresholds.h"

double linear_rank_threshold(const Linear *l) {
    return fmax(RANK, fmin(RANK_TURNED * l->off, RANK_LOOSEST));
}

/* The square of that: what the condition of the rungs below tells. */
static double loose(const Linear *l) {
    const double angle = fmin(RANK_TURNED * l->off, RANK_LOOSEST);
    return l->dense != NULL && DEPENDENT != NULL ? angle * angle : 0;
}

void linear_layout(Linear *l, Arena *arena, const System *s, Why *why) {
    int n = s->nv, m = s->m;
    l->system = s;
    l->why = why;
    l->M = l->G = NULL;
    l->active = l->some = NULL;
    l->rung = RUNG_SCHUR;
    l->unique = arena_ints(arena, m);
    l->zero = arena_doubles(arena, n);
    for (int i = 0; i < n && l->zero != NULL; i++) l->zero[i] = 0;
    schur_layout(l, arena);
    refinement_layout(l, arena);
    stiffened_layout(l, arena);
    l->square = NULL;
    if (s->square != NULL) s->square->layout(l, arena);
    l->dense = NULL;
    l->pivots = NULL;
    l->nearest = 0;
    l->off = 0;
    if (n + m > DENSE_MOST) return;
    size_t doubles = kkt_doubles(n, m), ints = (size_t)kkt_ints(n, m);
    if (DEPENDENT != NULL) {
        doubles = larger_size(doubles, DEPENDENT->doubles(n, m));
        ints = larger_size(ints, DEPENDENT->ints(n, m));
    }
    l->dense = arena_take(arena, doubles, sizeof(double));
    l->pivots = arena_take(arena, ints, sizeof(int));
}

static int all_finite(const double *a, int count) {
    double sum = 0;
    for (int i = 0; i < count; i++) sum += 0 * a[i]; /* 0, or not a number */
    return sum == 0;
}

/* The rows of `values` that act; start == NULL: one value a row. */
static int finite_rows(const Linear *l, const double *values, const int *start) {
    for (int k = 0; k < l->system->m; k++) {
        if (!l->active[k]) continue;
        int from = start != NULL ? start[k] : k, to = start != NULL ? start[k + 1] : k + 1;
        if (!all_finite(values + from, to - from)) return 0;
    }
    return 1;
}

static Status check_factored(const Linear *l) {
    if (!all_finite(l->M, l->system->masses))
        return fail(l->why, "a mass or a force is not finite at this state");
    if (!finite_rows(l, l->G, l->system->row_start))
        return fail(l->why, "a constraint or its derivative is not finite at this state");
    return OK;
}

static Status check_right(const Linear *l, const double *b, const double *c) {
    if (b != NULL && !all_finite(b, l->system->nv))
        return fail(l->why, "a mass or a force is not finite at this state");
    if (!finite_rows(l, c, NULL))
        return fail(l->why, "a constraint or its derivative is not finite at this state");
    return OK;
}

/* The Schur complement failed and the model is too large for the dense rungs. */
static Status too_large(const Linear *l) {
    const System *s = l->system;
    const Schur *schur = schur_of(l);
    if (s->plan->massless || schur->doubtful_mass >= 0)
        return fail(l->why,
                    "the mass matrix is singular, or nearly so, at this state%s%s, and with %d "
                    "coordinates and %d constraints the model is too large (more than %d together) "
                    "for the solution that allows it: give every coordinate a mass of its own",
                    schur->doubtful_mass >= 0 ? ": coordinate " : "",
                    schur->doubtful_mass >= 0 ? s->speeds[schur->doubtful_mass] : "", s->nv,
                    s->m, DENSE_MOST);
    return fail(l->why,
                "the constraints depend on each other, or nearly so, or masses differ too much, at "
                "this state%s%s, and with %d coordinates and %d constraints the model is too large "
                "(more than %d together) for the solution that allows it: remove redundant "
                "constraints, or bring the masses closer together",
                schur->doubtful_row >= 0 ? ": constraint " : "",
                schur->doubtful_row >= 0 ? s->rows[schur->doubtful_row].name : "", s->nv, s->m,
                DENSE_MOST);
}

static void none_shared(Linear *l) {
    for (int k = 0; k < l->system->m; k++) l->unique[k] = 1;
}

/* The rungs above the Schur complement. */
static Status climb(Linear *l) {
    if (check_factored(l) != OK) return FAILED;
    if (l->dense == NULL) return too_large(l);
    if (kkt_factor(l, loose(l))) {
        l->rung = RUNG_KKT;
        return OK;
    }
    if (DEPENDENT != NULL) return DEPENDENT->factor(l);
    (void)fail(l->why, "the mass matrix is singular at this state: a coordinate has no mass");
    if (schur_of(l)->doubtful_mass >= 0)
        why_append(l->why, " (%s)", l->system->speeds[schur_of(l)->doubtful_mass]);
    return FAILED;
}

/* By the plan's lists, or a rung above. */
static Status factor_lists(Linear *l) {
    l->rung = RUNG_SCHUR;
    int safe = schur_factor(l);
    if (!safe && !schur_of(l)->definite && stiffened_masses(l)) safe = schur_factor(l);
    return safe && schur_of(l)->condition * loose(l) <= 1 ? OK : climb(l);
}

/* By rows that stand for all. */
static int factor_kept(Linear *l, const int *basis) {
    if (basis == NULL || l->dense == NULL || DEPENDENT == NULL) return 0;
    if (DEPENDENT->keep(l, basis) && schur_of(l)->condition * loose(l) <= 1) {
        l->rung = RUNG_KEPT;
        return 1;
    }
    none_shared(l);
    return 0;
}

Status linear_factor_kept(Linear *l, const double *M, const double *G, const int *active, const int *basis) {
    int all = 1;
    l->M = M;
    l->G = G;
    l->active = active;
    l->stiffened = 0;
    none_shared(l);
    for (int k = 0; k < l->system->m; k++) all &= active[k];
    l->some = all ? NULL : active;
    if (factor_kept(l, basis)) return OK;
    if (all && l->system->solve != NULL && !(l->off > 0)) {
        l->rung = RUNG_WRITTEN_OUT; /* it factors and solves at once */
        return OK;
    }
    if (all && l->system->square != NULL && l->system->square->small && !(l->off > 0) && l->system->square->factor(l)) {
        l->rung = RUNG_SQUARE;
        return OK;
    }
    if (l->system->formulation == NULLSPACE && l->dense != NULL && DEPENDENT != NULL &&
        DEPENDENT->nullspace(l))
        return OK;
    return factor_lists(l);
}

Status linear_factor(Linear *l, const double *M, const double *G, const int *active) {
    return linear_factor_kept(l, M, G, active, NULL);
}

Status linear_contradicted(Linear *l) {
    const char *comma = "";
    (void)fail(l->why, "the constraints contradict each other at this state: ");
    for (int k = 0; k < l->system->m; k++) {
        if (l->unique[k]) continue;
        why_append(l->why, "%s'%s'", comma, l->system->rows[k].name);
        comma = ", ";
    }
    why_append(l->why, " depend on each other and ask for different accelerations (the configuration is "
                       "singular if elsewhere they do not)");
    return FAILED;
}

static Status solve_dense(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    if (check_right(l, b, c) != OK) return FAILED;
    if (l->rung != RUNG_KKT) return DEPENDENT->solve(l, b, c, x, lambda);
    kkt_solve(l, b, c, x, lambda);
    return OK;
}

/* By a rung above, where that of the factors does not settle. */
static Status solve_above(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    if (check_right(l, b, c) != OK || climb(l) != OK) return FAILED;
    return solve_dense(l, b, c, x, lambda);
}

Status linear_solve(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    const double *forces = b;
    const int told = lambda != NULL, asked = told && b != NULL;
    if (lambda == NULL) lambda = schur_of(l)->lambda;
    if (l->rung == RUNG_WRITTEN_OUT) {
        if (l->system->solve(l->M, b != NULL ? b : l->zero, l->G, c, x, lambda)) return OK;
        if (factor_lists(l) != OK) return FAILED;
    }
    if (l->stiffened) b = stiffened_forces(l, b, c);
    Status status = OK;
    if (l->rung == RUNG_SQUARE) {
        l->system->square->solve(l, b, c, x, told ? lambda : NULL);
        for (int k = 0; k < l->system->m && !told; k++) lambda[k] = 0;
    } else if (l->rung == RUNG_KEPT) {
        if (!DEPENDENT->solve_kept(l, b, c, x, lambda)) {
            none_shared(l);
            status = solve_above(l, b, c, x, lambda);
        }
    } else if (l->rung != RUNG_SCHUR) {
        status = solve_dense(l, b, c, x, lambda);
    } else if (!schur_solve(l, b, c, x, lambda)) {
        status = solve_above(l, b, c, x, lambda);
    } else if (l->stiffened && asked && l->dense != NULL && !stiffened_tells(l, forces, c, lambda)) {
        stiffened_undo(l);
        if (climb(l) != OK) return FAILED;
        status = solve_dense(l, forces, c, x, lambda);
    }
    if (status == OK && !(all_finite(x, l->system->nv) && all_finite(lambda, l->system->m)))
        status = check_right(l, b, c) != OK
                     ? FAILED
                     : fail(l->why, "the accelerations overflow at this state");
    return status;
}

Status linear_nearest(Linear *l, const double *b, const double *c, double *x, double *lambda) {
    l->nearest = 1;
    const Status status = linear_solve(l, b, c, x, lambda);
    l->nearest = 0;
    return status;
}

double linear_apart(const Linear *l) {
    return l->rung == RUNG_WRITTEN_OUT || l->rung == RUNG_SQUARE || l->rung == RUNG_NULLSPACE ? 1 : schur_of(l)->apart;
}

double linear_furthest_apart(const Linear *l) {
    return l->rung == RUNG_ORTHOGONAL ? DEPENDENT->apart(l) : linear_apart(l);
}

int linear_plain(const Linear *l) {
    return l->rung == RUNG_SCHUR || l->rung == RUNG_WRITTEN_OUT || l->rung == RUNG_SQUARE || l->rung == RUNG_NULLSPACE;
}

int linear_basis(Linear *l, int *basis) {
    for (int k = 0; k < l->system->m; k++) basis[k] = l->active[k];
    if (l->rung != RUNG_ORTHOGONAL && l->rung != RUNG_LEAST_NORM && l->rung != RUNG_KEPT) return 0;
    return DEPENDENT->basis(l, basis);
}

Status linear_project(Linear *l, const double *M, const double *G, const int *active,
                      const double *c, double *x) {
    l->nearest = 1;
    Status status = linear_factor(l, M, G, active);
    if (status == OK) status = linear_solve(l, NULL, c, x, NULL);
    l->nearest = 0;
    return status;
}
