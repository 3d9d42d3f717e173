/* sliding.c -- the equations of sliding,
 *
 *   M vdot = F - sum_f mu_f N_f d_f + G^T lambda ,  G vdot = gamma ,   d_f = G_t^T s/|s| ,
 *
 * with N = sign (load + c lambda) of the same instant, are linear: with (x0, lambda0) for F alone and
 * (x_f, lambda_f) for d_f alone, from the ladder of linear.c, lambda = lambda0 - sum_f mu_f N_f lambda_f and
 *
 *   (1 + A) N = sign (load + c lambda0) ,   A_fg = sign_f mu_g c_f lambda_g .
 *
 * 1 + A is G_n M^-1 (G_n^T - sign mu G_t^T s/|s|) over G_n M^-1 G_n^T; where it is not positive there is no
 * acceleration, or there are several (Painleve 1895; Genot & Brogliato 1999): refused by name. */
#include "friction.h"

#include <string.h>

#include "digits.h"
#include "thresholds.h"

static const double FRICTION_HELD = 1e-12; /* of the acceleration that a push gives without constraints: none */
static const double FRICTION_STILL = 1e-9; /* of the accelerations at work: a slip that does not change */

static void layout_sliding(Mechanism *b, Arena *arena) {
    const System *s = b->system;
    const int n = s->nv, m = s->m, count = s->frictions;
    struct FrictionForces *f = arena_take(arena, 1, sizeof *f), counted;
    if (f == NULL) f = &counted; /* the pass that only counts */
    f->stick_slip = NULL;
    f->acting = arena_ints(arena, m);
    f->loaded = arena_ints(arena, count);
    f->held = arena_ints(arena, count);
    f->mu = arena_doubles(arena, 2 * count);
    f->part_load = arena_doubles(arena, s->normal_parts);
    f->part_c = arena_doubles(arena, s->normal_rows);
    f->load = arena_doubles(arena, count);
    f->c = arena_doubles(arena, s->normal_rows);
    f->normal = arena_doubles(arena, count);
    f->slip = arena_doubles(arena, 2 * count);
    f->tangential = arena_doubles(arena, 2 * count);
    f->towards = arena_doubles(arena, 2 * count);
    f->reserve = arena_doubles(arena, count);
    f->sliding = arena_ints(arena, count);
    f->d = arena_doubles(arena, n);
    f->zero = arena_doubles(arena, m);
    f->first = arena_doubles(arena, m);
    f->right = arena_doubles(arena, count);
    f->answer = arena_doubles(arena, count * n);
    f->pushed = arena_doubles(arena, count * m);
    f->A = arena_doubles(arena, count * count);
    f->minor = arena_doubles(arena, count * count);
    f->norms = arena_take(arena, norms_doubles(s), sizeof(double));
    f->nonunique = arena_take(arena, nonunique_doubles(s), sizeof(double));
    for (int k = 0; k < m && f->zero != NULL; k++) f->zero[k] = 0;
    b->friction = f == &counted ? NULL : f;
}

/* f->loaded for contacts and constraints that act as in `active`. */
static void find_loaded(Mechanism *b, const int *active) {
    const System *s = b->system;
    for (int i = 0; i < s->frictions; i++) {
        const Friction *law = &s->friction[i];
        int on = !law->gated;
        for (int k = law->first; k < law->first + law->normals; k++) on |= active[s->normal_row[k]];
        b->friction->loaded[i] = on;
    }
}

static const int *acting(Mechanism *b, const int *active) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    find_loaded(b, active);
    memcpy(f->acting, active, (size_t)s->m * sizeof *active);
    for (int i = 0; i < s->frictions; i++)
        for (int r = 0; r < s->friction[i].rows; r++)
            f->acting[s->friction[i].row[r]] = f->loaded[i] && f->stick_slip[i].sticks;
    return f->acting;
}

void friction_coefficients(Mechanism *b, Instant at, const double *q, const double *v) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    s->coulomb(at.t, q, v, at.u, at.p, f->mu, f->part_load, f->part_c);
    for (int i = 0; i < s->frictions; i++) f->load[i] = f->part_load[s->friction[i].part];
    memcpy(f->c, f->part_c, (size_t)s->normal_rows * sizeof *f->c);
}

/* Coefficients at the state. */
static Status find_coefficients(Mechanism *b, Instant at, const double *q, const double *v) {
    const System *s = b->system;
    const struct FrictionForces *f = b->friction;
    friction_coefficients(b, at, q, v);
    for (int i = 0; i < s->frictions; i++) {
        if (0 <= f->mu[2 * i + 1] && f->mu[2 * i + 1] <= f->mu[2 * i] && f->mu[2 * i] < HUGE_VAL)
            continue;
        return fail(b->why,
                    "friction '%s' has the coefficients static = %s and kinetic = %s at t = %s s, "
                    "expected 0 <= kinetic <= static",
                    s->friction[i].name, digits(f->mu[2 * i]).text, digits(f->mu[2 * i + 1]).text,
                    digits(at.t).text);
    }
    return OK;
}

/* d = G_t^T e of friction i. */
static void find_push(Mechanism *b, int i) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    for (int j = 0; j < s->nv; j++) f->d[j] = 0;
    for (int r = 0; r < s->friction[i].rows; r++) mechanism_push(b, s->friction[i].row[r], f->towards[2 * i + r], f->d);
}

/* Does friction i, whose push f->d alone accelerates the bodies by `answer` (nv), stand still by the rows that
 * act?  Its row depends on them: the push gives it nothing of d M^-1 d, which it would without them; and its slip
 * does not change, as it does at the dead centre of a crank that turns: |d vdot|^2 <= d M^-1 d F M^-1 F. */
static int is_held(const Mechanism *b, int i, const double *answer) {
    const System *s = b->system;
    const struct FrictionForces *f = b->friction;
    const int k = s->friction[i].row[0];
    double gives = 0, alone = 0, drive = 0;
    if (s->friction[i].rows > 1 || !(fabs(f->slip[2 * i]) <= f->stick_slip[i].noise)) return 0;
    for (int j = 0; j < s->nv; j++) gives += f->d[j] * answer[j];
    for (int e = 0; e < s->masses; e++) {
        const int j = s->mass_row[e];
        if (s->mass_column[e] != j || !(b->M[e] > 0)) continue;
        alone += f->d[j] * f->d[j] / b->M[e];
        drive += b->F[j] * b->F[j] / b->M[e];
    }
    const double floor = FRICTION_STILL * (fabs(b->gamma[k]) + sqrt(alone) * sqrt(drive));
    return fabs(gives) <= FRICTION_HELD * alone && fabs(mechanism_row(b, k, b->vdot) - b->gamma[k]) <= floor;
}

/* The normal forces of the first `count` that slip, which are linear, and what they add to vdot and lambda. */
static Status solve_linear(Mechanism *b, double t, int count, double *determinant) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    const int n = s->nv, m = s->m;
    for (int h = 0; h < count; h++) {
        const int i = f->sliding[h];
        f->right[h] = f->stick_slip[i].sign * friction_normal(b, i, b->lambda);
        for (int g = 0; g < count; g++) {
            const double own = friction_normal(b, i, f->pushed + g * m) - f->load[i];
            f->A[h * count + g] = f->stick_slip[i].sign * friction_sliding(f, f->sliding[g]) * own;
        }
        const double own = f->A[h * count + h];
        const double least = s->friction[i].gated ? 1 + own : 1 - fabs(own);
        if (!(least > PAINLEVE_SAFE)) return painleve_paradox(b, t, &i, 1, least);
        f->A[h * count + h] += 1;
    }
    memcpy(f->minor, f->A, (size_t)(count * count) * sizeof *f->A);
    *determinant = painleve_eliminate(count, f->A, f->right);
    if (!(*determinant > PAINLEVE_SAFE)) return painleve_paradox(b, t, f->sliding, count, *determinant);
    for (int g = 0; g < count; g++) {
        const int i = f->sliding[g];
        const double strength = friction_sliding(f, i) * f->right[g];
        f->normal[i] = f->right[g];
        for (int j = 0; j < n; j++) b->vdot[j] -= strength * f->answer[g * n + j];
        for (int k = 0; k < m; k++) b->lambda[k] -= strength * f->pushed[g * m + k];
    }
    return OK;
}

/* The normal forces of those that slip, the first `linear` of `count` without norms, and what they add. */
static Status solve_sliding(Mechanism *b, double t, int linear, int count) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    double determinant;
    for (int g = 0; g < count; g++) {
        find_push(b, f->sliding[g]);
        if (linear_solve(&b->linear, f->d, f->zero, f->answer + g * s->nv, f->pushed + g * s->m) != OK)
            return FAILED;
        f->held[f->sliding[g]] = is_held(b, f->sliding[g], f->answer + g * s->nv);
    }
    if (solve_linear(b, t, linear, &determinant) != OK) return FAILED;
    if (count > linear && norms_slide(b, t, linear, count, &determinant) != OK) return FAILED;
    for (int g = 0; g < count; g++) {
        const int i = f->sliding[g];
        for (int r = 0; r < s->friction[i].rows; r++)
            b->lambda[s->friction[i].row[r]] =
                -friction_sliding(f, i) * f->normal[i] * f->towards[2 * i + r];
    }
    return painleve_departures(b, t, count, determinant);
}

/* Are the multipliers of a friction that sticks the only ones? */
static int is_unique(const Mechanism *b, int i) {
    const Friction *law = &b->system->friction[i];
    int all = 1;
    for (int r = 0; r < law->rows; r++) all &= b->linear.unique[law->row[r]];
    return all;
}

/* Do frictions that stick share their forces with other rows? */
static int shares_sticking(const Mechanism *b) {
    int any = 0;
    for (int i = 0; i < b->system->frictions; i++)
        any |= b->friction->loaded[i] && b->friction->stick_slip[i].sticks && !is_unique(b, i);
    return any;
}

/* FAILED where a norm of multipliers that are not the only ones would decide on the motion. */
static Status check_norms(Mechanism *b, double t) {
    const System *s = b->system;
    for (int i = 0; i < s->frictions; i++) {
        const Friction *law = &s->friction[i];
        int shared = 0;
        for (int k = law->first; k < law->first + law->normals; k++)
            shared |= !b->linear.unique[s->normal_row[k]];
        if (law->parts == 1 || !shared || normal_is_unique(b, i)) continue;
        return fail(b->why,
                    "friction '%s': its normal force, a norm of multipliers, is not unique at t = %s s, as %s, "
                    "and the motion would depend on it: leave out what is redundant, or take as normal force "
                    "what is unique",
                    law->name, digits(t).text,
                    shares_sticking(b) ? "more joints stick than hold the mechanism (six that stop together are "
                                         "resolved at most)"
                                       : "its rows depend on others");
    }
    return OK;
}

/* Normal force and reserve of those that stick; `shared`: by whichever multipliers hold the same motion best. */
static void find_reserves(Mechanism *b, int shared) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    const double *best = b->lambda;
    if (shared) {
        nonunique_best(b, f->first);
        best = f->first;
    }
    for (int i = 0; i < s->frictions; i++) {
        double force[2];
        f->reserve[i] = 0;
        if (!f->loaded[i] || !f->stick_slip[i].sticks) continue;
        f->normal[i] = friction_norms(b, i, 1, b->lambda);
        const double held = f->mu[2 * i] * friction_norms(b, i, 1, best);
        const double asked = friction_tangential(b, i, best, force);
        if (held + asked > 0) f->reserve[i] = (held - asked) / (held + asked);
    }
}

/* Appends to the first `count` that slip those with normal forces of one component, or of several (`norms`);
 * how many there are then. */
static int list_sliding(Mechanism *b, int norms, int count) {
    struct FrictionForces *f = b->friction;
    for (int i = 0; i < b->system->frictions; i++)
        if (f->loaded[i] && !f->stick_slip[i].sticks && (b->system->friction[i].parts > 1) == norms)
            f->sliding[count++] = i;
    return count;
}

/* At rest, what rounding leaves of forces that hold each other moves nothing. */
static void rest(Mechanism *b, const double *v) {
    const int nv = b->system->nv;
    for (int j = 0; j < nv; j++)
        if (v[j] != 0) return;
    mechanism_at_work(b, b->place, b->reach);
    for (int j = 0; j < nv; j++)
        if (!(fabs(b->vdot[j]) <= LOST * b->reach[j])) return;
    memset(b->vdot, 0, (size_t)nv * sizeof *b->vdot);
}

/* Slips, and which way those go that do not stick; whether one sticks. */
static int find_slips(Mechanism *b, const double *v) {
    struct FrictionForces *f = b->friction;
    int sticking = 0;
    for (int i = 0; i < b->system->frictions; i++) {
        f->normal[i] = f->reserve[i] = f->held[i] = 0;
        friction_slip(b, i, v, f->slip + 2 * i);
        if (!f->loaded[i]) continue;
        sticking |= f->stick_slip[i].sticks;
        if (f->stick_slip[i].sticks) continue;
        friction_heading(&f->stick_slip[i], f->slip + 2 * i, f->towards + 2 * i);
    }
    return sticking;
}

static Status motion_with_friction(Mechanism *b, Instant at, const double *q, const double *v,
                                   const int *active) {
    const System *s = b->system;
    struct FrictionForces *f = b->friction;
    if (find_coefficients(b, at, q, v) != OK) return FAILED;
    if (linear_factor(&b->linear, b->M, b->G, acting(b, active)) != OK) return FAILED;
    if (linear_solve(&b->linear, b->F, b->gamma, b->vdot, b->lambda) != OK) return FAILED;
    const int sticking = find_slips(b, v);
    const int linear = list_sliding(b, 0, 0), sliding = f->slipping = list_sliding(b, 1, linear);
    if (check_norms(b, at.t) != OK) return FAILED;
    if (sliding > 0 && solve_sliding(b, at.t, linear, sliding) != OK) return FAILED;
    rest(b, v);
    if (b->stage) return OK;
    if (sticking) find_reserves(b, shares_sticking(b));
    for (int i = 0; i < s->frictions; i++) friction_tangential(b, i, b->lambda, f->tangential + 2 * i);
    return OK;
}

static Status under_given(Mechanism *b, Instant at, const double *q, const double *v, const int *active) {
    struct FrictionForces *f = b->friction;
    if (find_coefficients(b, at, q, v) != OK) return FAILED;
    (void)acting(b, active);
    if (find_slips(b, v)) find_reserves(b, b->dependent);
    memcpy(b->lambda, b->given, (size_t)b->system->m * sizeof *b->lambda);
    f->slipping = list_sliding(b, 1, list_sliding(b, 0, 0));
    for (int g = 0; g < f->slipping; g++) {
        const int i = f->sliding[g], norms = b->system->friction[i].parts > 1;
        f->held[i] = f->stick_slip[i].held;
        f->normal[i] = norms ? friction_norms(b, i, 1, b->lambda) : f->stick_slip[i].sign * friction_normal(b, i, b->lambda);
    }
    for (int i = 0; i < b->system->frictions; i++) friction_tangential(b, i, b->lambda, f->tangential + 2 * i);
    return OK;
}

static int unique_normal(Mechanism *b, int i) {
    return !b->friction->loaded[i] || normal_is_unique(b, i);
}

SHARED_VALUE const Sliding SLIDING = {layout_sliding, acting, motion_with_friction, under_given, unique_normal};
