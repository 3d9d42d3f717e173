/* variation.c -- derivatives of the motion between two events: the variational equations
 *
 *   S' = phi_y S + phi_p
 *
 * of the index-1 equations y' = phi(t, y, p) (Hairer, Norsett & Wanner I, sect. I.14), which the integrator steps
 * beside the state under the state's own error control: a step of S is the derivative of the step of y.  After each
 * step S is moved onto the tangents of the constraints, in the metric of M as the state itself,
 *
 *   f_q S_q + f_p = offset_p ,   G S_v = nu' - G' v        (' along S and p).
 */
#include "variation.h"

#include <math.h>
#include <string.h>

#include "saltation.h"
#include "segment.h"

/* ------------------------------------------------------------------ rates */

/* By the tangents, of the latest motion; inputs do not change. */
static Status rates_along(Solver *s, Instant at, const double *y, const double *S, int parameter, double *rates) {
    const System *system = s->system;
    Sensitivity *w = &s->sensitivity;
    const Direction d = {0, S, S + system->nq, w->du, w->dp};
    if (parameter >= 0) w->dp[parameter] = 1;
    const Status status = sensitivity_along(w, &s->stepped, at, y, y + system->nq, d);
    if (parameter >= 0) w->dp[parameter] = 0;
    memcpy(rates, w->drate, (size_t)system->nq * sizeof *rates);
    memcpy(rates + system->nq, w->dvdot, (size_t)system->nv * sizeof *rates);
    return status;
}

static void variation_rates(Solver *s, double t, const double *y, double *rates) {
    const int n = system_states(s->system);
    const Instant at = {t, s->u, s->p}; /* as the motion had them */
    memset(s->sensitivity.du, 0, (size_t)s->system->inputs * sizeof *rates);
    for (int c = 0; c < s->columns && *s->state.varied; c++)
        if (rates_along(s, at, y, y + n * (1 + c), s->column[c].parameter, rates + n * c) != OK) saltation_end(s);
    if (!*s->state.varied) memset(rates, 0, (size_t)(n * s->columns) * sizeof *rates);
}

static int arrays_of_step(const Integrator *i) { return 4 + i->method->dense_arrays; }

/* What is left of a step: array k. */
static double *left_of_step(const Integrator *i, int k) {
    double *const one[] = {i->y, i->y_old, i->f, i->f_old};
    return k < 4 ? one[k] : i->dense + (k - 4) * i->ny;
}

static void variation_stepped(Solver *s, Integrator *i) {
    const int n = system_states(s->system);
    for (int k = 0; k < arrays_of_step(i) && *s->state.varied; k++)
        for (int j = n; j < i->ny && *s->state.varied; j++) {
            if (isfinite(left_of_step(i, k)[j])) continue;
            (void)fail(&s->why, "they are beyond a double at t = %.17g s", i->t);
            saltation_end(s);
        }
    for (int k = 0; k < arrays_of_step(i) && !*s->state.varied; k++)
        memset(left_of_step(i, k) + n, 0, (size_t)(i->ny - n) * sizeof(double));
}

/* ------------------------------------------------------------------ projection */

static Status project_places(Solver *s, Instant at, const double *y, int c, double *S) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    Sensitivity *w = &s->sensitivity;
    const double *offset = column_at(s, c) + column_of_offset(system, 0);
    saltation_values_along(s, at, y, S, s->column[c].parameter);
    for (int k = 0; k < system->m; k++) w->c[k] = b->fixed[k] ? offset[k] - w->df[k] : 0;
    if (linear_nearest(&b->linear, NULL, w->c, b->dq, NULL) != OK) return FAILED;
    mechanism_move(b, 1, b->dq, S);
    return OK;
}

static Status project_speeds(Solver *s, Instant at, const double *y, const int *active, int c, double *S) {
    const System *system = s->system;
    Mechanism *b = &s->stepped;
    Sensitivity *w = &s->sensitivity;
    double *dv = S + system->nq;
    saltation_values_along(s, at, y, S, s->column[c].parameter);
    for (int k = 0; k < system->m; k++) w->c[k] = active[k] ? w->dnu[k] - mechanism_row(b, k, dv) : 0;
    for (int e = 0; e < system->entries; e++)
        if (active[system->entry_row[e]]) w->c[system->entry_row[e]] -= w->dG[e] * y[system->nq + system->entry_column[e]];
    if (linear_nearest(&b->linear, NULL, w->c, b->dq, NULL) != OK) return FAILED;
    for (int j = 0; j < system->nv; j++) dv[j] += b->dq[j];
    return OK;
}

/* With M and G as the projection of the state has left them. */
static Status project_columns(Solver *s, Instant at, double *y) {
    const System *system = s->system;
    const int n = system_states(system);
    Mechanism *b = &s->stepped;
    int acting = 0, fixed = 0, all = 1;
    const int *active = b->sliding != NULL ? b->sliding->acting(b, s->active) : s->active;
    for (int k = 0; k < system->m; k++) {
        b->fixed[k] = active[k] && system->rows[k].kind != NONHOLONOMIC;
        acting |= active[k];
        fixed |= b->fixed[k];
        all &= b->fixed[k] == active[k];
    }
    if (fixed && linear_factor(&b->linear, b->M, b->G, b->fixed) != OK) return FAILED;
    for (int c = 0; c < s->columns; c++) {
        double *S = y + n * (1 + c);
        if (fixed && project_places(s, at, y, c, S) != OK) return FAILED;
        mechanism_settle_change(b, y, S);
    }
    if (acting && !(fixed && all) && linear_factor(&b->linear, b->M, b->G, active) != OK) return FAILED;
    for (int c = 0; c < s->columns && acting; c++)
        if (project_speeds(s, at, y, active, c, y + n * (1 + c)) != OK) return FAILED;
    for (int j = n; j < solver_width(s); j++)
        if (!isfinite(y[j])) return fail(&s->why, "they are beyond a double at t = %.17g s", at.t);
    return OK;
}

static Status variation_project(Solver *s, Instant at, double *y) {
    const int n = system_states(s->system);
    if (*s->state.varied && project_columns(s, at, y) != OK) saltation_end(s);
    if (!*s->state.varied) memset(y + n, 0, (size_t)(n * s->columns) * sizeof *y);
    return OK;
}

SHARED_VALUE const Variation VARIATION = {saltation_layout, variation_rates, variation_stepped, variation_project, saltation_start,
                                          saltation_pass,   saltation_jump,  acceleration_jump_look,    saltation_ended};
