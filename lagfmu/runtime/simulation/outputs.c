/* outputs.c -- the outputs of the model's own, from a state and what is solved for there.
 *
 *   w = w(t, q, v, vdot, u, p, lambda, Q) ,
 *   dw by the chain rule (system->outputs_tangent, symbolic), dQ = d(G^T lambda)
 *
 * Where rows depend on each other lambda is one of lambda + z with G^T z = 0, by which Q and the motion do not change.
 * An output has one value for all of these if its slope c = dw/dlambda is orthogonal to every z (Wojtyra 2005), that
 * is if  G x = c  has a solution.  The slope is taken at multipliers that nothing has chosen: that of a norm of
 * several is blind, at some, to what changes them. */
#include "outputs.h"

#include <math.h>
#include <string.h>

#include "digits.h"
#include "numbers.h"
#include "thresholds.h"

static const double SLOPE_STEP = 0x1p-17; /* of the multipliers: cubic in it, and rounding over it, are below VANISHES */

Status outputs_observe(const System *s, Instant at, Observed *o, Why *why) {
    if (s->output_count == 0) return OK;
    s->outputs(at.t, o->q, o->v, at.u, at.p, o->vdot, o->lambda, o->force, o->own, o->other);
    for (int i = 0; i < s->output_count; i++) {
        if (!isfinite(o->own[i]) && s->guarded[i]) o->own[i] = o->other[i];
        if (isfinite(o->own[i])) continue;
        return fail(why,
                    "the output '%s' has no value at t = %s s (not finite): give the model's Output "
                    "an `otherwise`",
                    s->output_names[i], digits(at.t).text);
    }
    return OK;
}

/* Multipliers that nothing has chosen, as large as those of the motion; their size is returned. */
static double any_multipliers(const System *s, const double *lambda, double *any) {
    const double most = largest(s->m, lambda), size = most > 0 ? most : 1;
    for (int k = 0; k < s->m; k++) any[k] = lambda[k] + size * (0.5 + fmod(0.6180339887498949 * (k + 1), 1));
    return size;
}

/* slope (unique_count, m) of the outputs at `any` (m). */
static void find_slopes(const System *s, Instant at, const Observed *o, double *any, double size, double *slope,
                        double *values) {
    double *up = values, *down = up + s->output_count, *other = down + s->output_count;
    const double step = SLOPE_STEP * size;
    for (int k = 0; k < s->m; k++) {
        const double held = any[k];
        any[k] = held + step;
        s->outputs(at.t, o->q, o->v, at.u, at.p, o->vdot, any, o->force, up, other);
        any[k] = held - step;
        s->outputs(at.t, o->q, o->v, at.u, at.p, o->vdot, any, o->force, down, other);
        any[k] = held;
        for (int i = 0; i < s->unique_count; i++) {
            const int j = s->unique_output[i];
            slope[i * s->m + k] = (up[j] - down[j]) / (2 * step);
        }
    }
}

/* length (m) of the rows in the metric of M, by its diagonal; what has no mass counts as the lightest that is alike. */
static void find_lengths(const Mechanism *b, double *weight, double *length) {
    const System *s = b->system;
    for (int i = 0; i < s->nv; i++) weight[i] = 0;
    for (int e = 0; e < s->masses; e++)
        if (s->mass_row[e] == s->mass_column[e] && b->M[e] > 0) weight[s->mass_row[e]] = 1 / sqrt(b->M[e]);
    for (int i = 0; i < s->nv; i++) {
        if (weight[i] > 0) continue;
        const double alike = mechanism_largest_alike(s, s->speed_dimension[i], weight);
        weight[i] = alike > 0 ? alike : 1;
    }
    for (int k = 0; k < s->m; k++) length[k] = mechanism_row_size(b, k, weight);
}

/* Has  G x = c  a solution on the rows that act? */
static int is_in_range(Mechanism *b, const double *c, const double *length, double *x) {
    const System *s = b->system;
    double terms = 0, missed = 0;
    if (linear_nearest(&b->linear, NULL, c, x, NULL) != OK) return 0;
    for (int k = 0; k < s->m; k++) {
        if (!b->linear.active[k] || !(length[k] > 0)) continue;
        terms = fmax(terms, (fabs(c[k]) + mechanism_row_size(b, k, x)) / length[k]);
        missed = fmax(missed, fabs(mechanism_row(b, k, x) - c[k]) / length[k]);
    }
    return missed <= VANISHES * terms;
}

void outputs_unique(Mechanism *b, Instant at, Observed *o) {
    const System *s = b->system;
    double *slope = o->work_unique, *any = slope + s->m * s->unique_count, *length = any + s->m, *x = length + s->m;
    int all = 1;
    for (int k = 0; k < s->m; k++) all &= o->unique[k];
    const int some = !all && outputs_told_apart(s);
    if (some) {
        find_slopes(s, at, o, any, any_multipliers(s, o->lambda, any), slope, x + s->nv);
        find_lengths(b, x, length);
    }
    for (int i = 0; i < s->unique_count; i++)
        o->own_unique[i] = all || (some && is_in_range(b, slope + i * s->m, length, x));
}

/* What is the same with all multipliers changes as it does with those of least norm. */
static void change_unique(Sensitivity *w, const System *s, Instant at, const Observed *o, Direction d) {
    double *down = o->work_unique, *other = down + s->output_count;
    s->outputs_tangent(at.t, o->q, o->v, at.u, at.p, o->vdot, o->lambda, o->force, d.dt, d.dq, d.dv,
                       d.du, d.dp, w->dvdot, w->dlambda, w->dforce, down, other);
    for (int i = 0; i < s->unique_count; i++) {
        const int j = s->unique_output[i];
        if (!o->own_unique[i]) continue;
        w->down[j] = down[j];
        w->dother[j] = other[j];
    }
}

void outputs_change(Sensitivity *w, const Mechanism *b, const System *s, Instant at,
                    const Observed *o, Direction d) {
    for (int j = 0; j < s->nv; j++) w->dforce[j] = 0;
    for (int e = 0; b != NULL && e < s->entries; e++) w->dforce[s->entry_column[e]] += sensitivity_share(w, b, e);
    if (s->outputs_tangent == NULL) return;
    for (int k = 0; b != NULL && k < s->m; k++) w->known[k] = o->unique[k] ? w->dlambda[k] : NAN;
    /* the values tell which of a guarded output's two expressions holds: */
    s->outputs(at.t, o->q, o->v, at.u, at.p, o->vdot, o->lambda, o->force, o->own, o->other);
    s->outputs_tangent(at.t, o->q, o->v, at.u, at.p, o->vdot, o->lambda, o->force, d.dt, d.dq, d.dv,
                       d.du, d.dp, w->dvdot, w->known, w->dforce, w->down, w->dother);
    if (b != NULL && s->unique_count > 0) change_unique(w, s, at, o, d);
    for (int i = 0; i < s->output_count; i++) {
        if (isfinite(o->own[i]) || !s->guarded[i]) continue;
        o->own[i] = o->other[i];
        w->down[i] = w->dother[i];
    }
}
