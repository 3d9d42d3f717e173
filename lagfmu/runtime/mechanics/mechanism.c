/* mechanism.c -- a system at one state:  M vdot = F + G^T lambda ,  G vdot = gamma  on the rows
 * that act (index 1: the constraints differentiated twice). Source: Hairer & Wanner, Solving
 * Ordinary Differential Equations II, sect. VII.1, eq. (1.48). */
#include "mechanism.h"

#include <float.h>

#include "digits.h"
#include "numbers.h"

static const double AGREES = 1e-11; /* what rounding leaves of rows that follow from others, relative to its terms */

void mechanism_layout(Mechanism *b, Arena *arena, const System *s, Why *why,
                      const Sliding *sliding) {
    b->system = s;
    b->why = why;
    b->dependent = b->stage = 0;
    b->basis = NULL;
    b->given = NULL;
    b->M = arena_doubles(arena, s->masses);
    b->F = arena_doubles(arena, s->nv);
    b->G = arena_doubles(arena, s->entries);
    b->nu = arena_doubles(arena, s->m);
    b->gamma = arena_doubles(arena, s->m);
    b->vdot = arena_doubles(arena, s->nv);
    b->lambda = arena_doubles(arena, s->m);
    b->f = arena_doubles(arena, s->m);
    b->terms = arena_doubles(arena, s->m);
    b->dq = arena_doubles(arena, s->nv);
    b->reach = arena_doubles(arena, s->nv);
    b->place = arena_doubles(arena, s->nv);
    b->trial = arena_doubles(arena, s->nq);
    b->nearer = arena_doubles(arena, s->nq);
    b->fixed = arena_ints(arena, s->m);
    b->pulls = arena_ints(arena, s->m);
    b->none = arena_ints(arena, s->m);
    for (int k = 0; k < s->m && b->none != NULL; k++) b->none[k] = 0;
    if (s->kinematics != NULL) KINEMATICS->layout(b, arena);
    linear_layout(&b->linear, arena, s, why);
    b->sliding = s->frictions > 0 ? sliding : NULL;
    if (b->sliding != NULL) b->sliding->layout(b, arena);
}

/* 0, or not a number. */
static inline double zero(int count, const double *x) {
    double sum = 0;
    for (int i = 0; i < count; i++) sum += 0 * x[i];
    return sum;
}

static int holds_no_nan(int count, const double *x) { return zero(count, x) == 0; }

static Status not_evaluated(Mechanism *b, Instant at, const char *what) {
    Digits t = digits(at.t);
    return fail(b->why,
                "the equations cannot be evaluated at t = %s s (%s not finite at this state: take other inputs, start values or parameters)",
                t.text, what);
}

static Status check_values(Mechanism *b, Instant at) {
    const System *s = b->system;
    if (s->kinematics != NULL && !(holds_no_nan(s->rates, b->B) & holds_no_nan(s->nq, b->drift)))
        return not_evaluated(b, at, "a rate of a coordinate is");
    if (zero(s->masses, b->M) + zero(s->nv, b->F) + zero(s->entries, b->G) + zero(s->m, b->nu) +
            zero(s->m, b->gamma) ==
        0)
        return OK;
    if (!(holds_no_nan(s->masses, b->M) & holds_no_nan(s->nv, b->F)))
        return not_evaluated(b, at, "a mass or a force is");
    return not_evaluated(b, at, "a constraint or its derivative is");
}

static void evaluate_functions(Mechanism *b, Instant at, const double *q, const double *v) {
    b->evaluations += 1;
    b->system->dynamics(at.t, q, v, at.u, at.p, b->M, b->F, b->G, b->nu, b->gamma);
    mechanism_kinematics(b, at, q);
}

Status mechanism_evaluate(Mechanism *b, Instant at, const double *q, const double *v) {
    evaluate_functions(b, at, q, v);
    return check_values(b, at);
}

Status mechanism_residual(Mechanism *b, Instant at, const double *q, double *f) {
    const System *s = b->system;
    s->residual(at.t, q, at.u, at.p, f);
    if (holds_no_nan(s->m, f)) return OK;
    int k = 0;
    while (holds_no_nan(1, &f[k])) k++;
    Digits t = digits(at.t);
    return fail(b->why, "the constraints cannot be evaluated at t = %s s ('%s' is not finite)",
                t.text, s->rows[k].name);
}

/* M vdot = F + G^T lambda with the multipliers that are given. */
static Status motion_given(Mechanism *b) {
    const System *s = b->system;
    double *force = b->dq;
    memcpy(force, b->F, (size_t)s->nv * sizeof *force);
    for (int k = 0; k < s->m; k++) mechanism_push(b, k, b->given[k], force);
    if (linear_factor(&b->linear, b->M, b->G, b->none) != OK ||
        linear_solve(&b->linear, force, b->gamma, b->vdot, b->lambda) != OK)
        return FAILED;
    memcpy(b->lambda, b->given, (size_t)s->m * sizeof *b->lambda);
    return OK;
}

/* Where the functions have been evaluated; `basis`: see linear_factor_kept(). */
static Status motion_evaluated(Mechanism *b, Instant at, const double *q, const double *v, const int *active,
                               const int *basis) {
    if (b->given != NULL) {
        if (motion_given(b) == OK && (b->sliding == NULL || b->sliding->given(b, at, q, v, active) == OK)) return OK;
    } else if (b->sliding != NULL) {
        if (b->sliding->motion(b, at, q, v, active) == OK) return OK;
    } else if (linear_factor_kept(&b->linear, b->M, b->G, active, basis) == OK &&
               linear_solve(&b->linear, b->F, b->gamma, b->vdot, b->lambda) == OK) {
        return OK; /* linear.h: what it solves is finite */
    }
    (void)check_values(b, at); /* the cause, if it is the equations */
    return FAILED;
}

Status mechanism_motion(Mechanism *b, Instant at, const double *q, const double *v,
                        const int *active) {
    evaluate_functions(b, at, q, v);
    return motion_evaluated(b, at, q, v, active, NULL);
}

/* b->vdot leaves nothing of the rows that stand in no basis. */
static int others_agree(Mechanism *b, const int *active) {
    const System *s = b->system;
    mechanism_at_work(b, b->place, b->reach);
    for (int k = 0; k < s->m; k++) {
        if (!active[k] || b->basis[k]) continue;
        const double size = mechanism_row_size(b, k, b->reach) + fabs(b->gamma[k]);
        if (!(fabs(mechanism_row(b, k, b->vdot) - b->gamma[k]) <= AGREES * size)) return 0;
    }
    return 1;
}

int mechanism_motion_kept(Mechanism *b, Instant at, const double *q, const double *v, const int *active) {
    if (b->basis == NULL) return 0;
    for (int k = 0; k < b->system->m; k++)
        if (b->basis[k] && !active[k]) return 0;
    return mechanism_motion(b, at, q, v, b->basis) == OK && linear_plain(&b->linear) && others_agree(b, active);
}

void mechanism_at_work(const Mechanism *b, double *forces, double *reach) {
    const System *s = b->system;
    for (int j = 0; j < s->nv; j++) {
        forces[j] = fabs(b->F[j]);
        reach[j] = fabs(b->vdot[j]);
    }
    for (int e = 0; e < s->entries; e++)
        forces[s->entry_column[e]] += fabs(b->G[e] * b->lambda[s->entry_row[e]]);
    for (int e = 0; e < s->masses; e++) {
        const int j = s->mass_row[e];
        if (s->mass_column[e] == j && b->M[e] > 0) reach[j] = fmax(reach[j], forces[j] / b->M[e]);
    }
}

void mechanism_terms(Mechanism *b, Instant at, const double *q) {
    const System *s = b->system;
    for (int k = 0; k < s->m; k++) b->terms[k] = 0;
    if (s->terms == NULL) return;
    s->terms(at.t, q, at.u, at.p, b->terms);
    for (int k = 0; k < s->m; k++)
        if (!(b->terms[k] <= DBL_MAX)) b->terms[k] = 0;
}

double mechanism_square(const Mechanism *b, const double *x) {
    double sum = 0;
    for (int e = 0; e < b->system->masses; e++) {
        const int i = b->system->mass_row[e], j = b->system->mass_column[e];
        const double part = b->M[e] * x[i] * x[j];
        sum += part != 0 ? (i == j ? part : 2 * part) : 0;
    }
    return sum;
}

/* The largest |f - offset| of the rows, relative to the terms of G size. */
static Status find_off(Mechanism *b, Instant at, const double *q, const int *active,
                       const double *offset, const double *span, double *off) {
    const System *s = b->system;
    *off = 0;
    if (mechanism_residual(b, at, q, b->f) != OK) return FAILED;
    for (int i = 0; i < s->nv; i++) b->reach[i] = fmax(mechanism_reach(b, q, i), span[i]);
    for (int k = 0; k < s->m; k++) {
        if (!active[k] || s->rows[k].kind == NONHOLONOMIC) continue;
        double reach = 0;
        for (int e = s->row_start[k]; e < s->row_start[k + 1]; e++)
            reach += fabs(b->G[e]) * b->reach[s->entry_column[e]];
        if (reach > 0) *off = fmax(*off, fabs(b->f[k] - offset[k]) / reach);
    }
    return OK;
}

Status mechanism_motion_near(Mechanism *b, Instant at, const double *q, const double *v,
                             const int *active, const double *offset, const double *span) {
    double off;
    if (!b->dependent) return mechanism_motion(b, at, q, v, active);
    if (mechanism_evaluate(b, at, q, v) != OK) return FAILED;
    if (find_off(b, at, q, active, offset, span, &off) != OK) return FAILED;
    b->linear.off = off;
    const Status status = motion_evaluated(b, at, q, v, active, b->basis);
    b->linear.off = 0;
    return status;
}

double mechanism_largest_alike(const System *s, int dimension, const double *x) {
    double largest = 0;
    for (int i = 0; i < s->nv; i++)
        if (s->speed_dimension[i] == dimension) largest = larger(largest, fabs(x[i]));
    return largest;
}

void mechanism_motion_speeds(const Mechanism *b, const double *speed, double *shared) {
    const System *s = b->system;
    const int *dimension = s->speed_dimension;
    double momentum = 0;
    for (int e = 0; e < s->masses; e++)
        if (s->mass_row[e] == s->mass_column[e] && b->M[e] > 0)
            momentum = larger(momentum, sqrt(b->M[e]) * fabs(speed[s->mass_row[e]]));
    for (int j = 0; j < s->nv; j++) shared[j] = -1; /* not known yet */
    for (int j = 0; j < s->nv; j++) {
        double heaviest = 0;
        if (shared[j] >= 0) continue;
        for (int e = 0; e < s->masses; e++)
            if (s->mass_row[e] == s->mass_column[e] && dimension[s->mass_row[e]] == dimension[j])
                heaviest = larger(heaviest, b->M[e]);
        const double own = heaviest > 0 ? momentum / sqrt(heaviest) : 0;
        const double largest = larger(own, mechanism_largest_alike(s, dimension[j], speed));
        for (int i = j; i < s->nv; i++)
            if (dimension[i] == dimension[j]) shared[i] = largest;
    }
}
