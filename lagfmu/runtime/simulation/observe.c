/* observe.c -- a state -> everything that the FMU reports.
 *
 *   M vdot = F + G^T lambda ,  G vdot = gamma ,  Q_j = sum_k lambda_k G_kj      (system.h)
 *
 * are solved at this very state and these inputs, so that lambda, Q and the accelerations are
 * consistent with what the importer reads; with an embedding on the full coordinates. */
#include <float.h>
#include <string.h>

#include "digits.h"
#include "outputs.h"
#include "flow.h"

static int same_row(const System *a, int i, const System *b, int k) {
    return strcmp(a->rows[i].name, b->rows[k].name) == 0;
}

/* The rows of the full system that act: those of the contacts that are closed, by their names. */
static void full_active(Solver *s) {
    const System *own = s->system, *full = own->full;
    int *active = s->active_full;
    for (int k = 0; k < full->m; k++)
        active[k] = full->rows[k].kind != CONTACT && full->rows[k].while_closed < 0;
    for (int c = 0; c < own->contacts; c++) {
        if (!s->state.closed[c]) continue;
        for (int k = 0; k < full->m; k++) {
            int gate = full->rows[k].kind == CONTACT ? k : full->rows[k].while_closed;
            if (gate >= 0 && same_row(own, own->contact[c], full, gate)) active[k] = 1;
        }
    }
}

/* The level that a row of the full system keeps. */
static double level(const Solver *s, int k) {
    const System *own = s->system;
    if (own->embed == NULL) return s->state.offset[k];
    for (int i = 0; i < own->m; i++)
        if (same_row(own, i, own->full, k)) return s->state.offset[i];
    return 0;
}

/* Coordinates and velocities of the full system. */
static void expand(const Solver *s, double t, const double *q, const double *v, double *full_q,
                   double *full_v) {
    const size_t bytes = (size_t)s->system->n * sizeof *q;
    if (s->system->embed != NULL) {
        s->system->embed(t, q, v, s->u, s->p, full_q, full_v);
        return;
    }
    memcpy(full_q, q, bytes);
    memcpy(full_v, v, bytes);
}

/* The coordinates that are stepped, where there are others. */
static Status observe_stepped(Solver *s, Instant at, Observed *o) {
    const State *state = &s->state;
    const size_t n = (size_t)s->system->n * sizeof(double);
    if (mechanism_motion(&s->stepped, at, state->q, state->v, s->active) == FAILED) return FAILED;
    memcpy(o->s, state->q, n);
    memcpy(o->sdot, state->v, n);
    memcpy(o->sddot, s->stepped.vdot, n);
    return OK;
}

/* lambda, whether it is unique, Q and each constraint's share in it. */
static void observe_forces(const Mechanism *b, Observed *o) {
    const System *s = b->system;
    memcpy(o->vdot, b->vdot, (size_t)s->n * sizeof *o->vdot);
    memcpy(o->lambda, b->lambda, (size_t)s->m * sizeof *o->lambda);
    memcpy(o->unique, b->linear.unique, (size_t)s->m * sizeof *o->unique);
    for (int j = 0; j < s->n; j++) o->force[j] = 0;
    for (int e = 0; e < s->entries; e++) {
        o->share[e] = b->G[e] * b->lambda[s->entry_row[e]];
        o->force[s->entry_column[e]] += o->share[e];
    }
}

static Status observe_residuals(const Solver *s, Instant at, Mechanism *b, Observed *o) {
    const System *system = b->system;
    if (mechanism_residual(b, at, o->q, o->residual) == FAILED) return FAILED;
    for (int k = 0; k < system->m; k++) {
        if (system->rows[k].kind == NONHOLONOMIC || system->rows[k].friction != 0)
            o->residual[k] = mechanism_slip(b, k, o->v);
        else
            o->residual[k] -= level(s, k);
    }
    return OK;
}

/* What frictions do, of the latest motion. */
static void observe_frictions(const Solver *s, Observed *o) {
    const struct Frictions *f = s->stepped.friction;
    for (int i = 0; i < s->system->frictions; i++) {
        const int slips = !f->slide[i].sticks;
        const double *force = f->tangential + 2 * i, *slip = f->slip + 2 * i;
        o->sticks[i] = f->loaded[i] && !slips;
        o->slip[2 * i] = slip[0];
        o->slip[2 * i + 1] = slip[1];
        o->margin[i] = f->mu[2 * i] * f->normal[i] - hypot(force[0], force[1]);
        o->power[i] = slips ? force[0] * slip[0] + force[1] * slip[1] : 0;
    }
}

/* Accelerations, lambda, Q and residuals. */
static Status observe_solved(Solver *s, Instant at, Mechanism *b, Observed *o) {
    const int *active = s->active;
    if (s->system->embed != NULL) {
        full_active(s);
        active = s->active_full;
    }
    const Status status = b->dependent ? mechanism_motion_near(b, at, o->q, o->v, active, s->state.offset,
                                                               s->state.size)
                                       : mechanism_motion(b, at, o->q, o->v, active);
    if (status == FAILED) return FAILED;
    observe_forces(b, o);
    if (s->system->frictions > 0) observe_frictions(s, o);
    return observe_residuals(s, at, b, o);
}

static void observe_departures(const Solver *s, Observed *o) {
    const int own = s->system->n, full = s->system->embed != NULL ? s->system->full->n : own;
    for (int c = 0; c < s->system->contacts; c++) {
        double *q = o->departure_q + c * full, *v = o->departure_v + c * full;
        if (s->state.count[c] > 0) {
            expand(s, s->state.departure_time[c], s->state.departure_q + c * own,
                   s->state.departure_v + c * own, q, v);
            continue;
        }
        for (int j = 0; j < full; j++) q[j] = v[j] = 0;
    }
}

/* Names of the values that are not finite, as the FMU's variables are named. */
typedef struct {
    Why *why;
    double t;
    int count;
} Bad;

static void check(Bad *bad, double value, const char *before, const char *a, const char *between,
                  const char *b, const char *after) {
    if (fabs(value) <= DBL_MAX) return;
    if (bad->count++ == 0) {
        Digits when = digits(bad->t);
        fail(bad->why, "not finite at t = %s s: ", when.text);
    } else {
        why_append(bad->why, ", ");
    }
    why_append(bad->why, "%s%s%s%s%s", before, a, between, b, after);
}

static void check_motion(Bad *bad, const char *name, double q, double v, double vdot) {
    check(bad, q, "", name, "", "", "");
    check(bad, v, "der(", name, "", "", ")");
    check(bad, vdot, "der(", name, "", "", ",2)");
}

static void check_frictions(Bad *bad, const Solver *s, const Observed *o) {
    const System *system = s->system;
    for (int i = 0; i < system->frictions; i++) {
        const Friction *f = &system->friction[i];
        for (int r = 0; r < f->rows; r++)
            check(bad, o->slip[2 * i + r], "slip.", system->rows[f->row[r]].name, "", "", "");
        check(bad, o->margin[i], "margin.", f->name, "", "", "");
        check(bad, o->power[i], "power.", f->name, "", "", "");
    }
    if (system->frictions > 0) check(bad, s->state.now.lost, "", "energy.dissipated", "", "", "");
}

static Status check_finite(Solver *s, const System *full, const Observed *o) {
    Bad bad = {&s->why, s->state.now.t, 0};
    for (int j = 0; j < full->n; j++) {
        check_motion(&bad, full->coordinates[j], o->q[j], o->v[j], o->vdot[j]);
        check(&bad, o->force[j], "Q.", full->coordinates[j], "", "", "");
    }
    for (int j = 0; s->system->embed != NULL && j < s->system->n; j++)
        check_motion(&bad, s->system->coordinates[j], o->s[j], o->sdot[j], o->sddot[j]);
    for (int k = 0; k < full->m; k++) {
        check(&bad, o->lambda[k], "lambda.", full->rows[k].name, "", "", "");
        check(&bad, o->residual[k], "residual.", full->rows[k].name, "", "", "");
    }
    for (int e = 0; e < full->entries; e++)
        check(&bad, o->share[e], "Q.", full->rows[full->entry_row[e]].name, ".",
              full->coordinates[full->entry_column[e]], "");
    check(&bad, o->energy[0], "", "energy.kinetic", "", "", "");
    check(&bad, o->energy[1], "", "energy.potential", "", "", "");
    check(&bad, o->energy[0] + o->energy[1], "", "energy.total", "", "", "");
    for (int c = 0; c < s->system->contacts; c++) {
        const char *contact = s->system->rows[s->system->contact[c]].name;
        for (int j = 0; j < full->n; j++) {
            int i = c * full->n + j;
            check(&bad, o->departure_q[i], "departure.", contact, ".", full->coordinates[j], "");
            check(&bad, o->departure_v[i], "departure.", contact, ".velocity.",
                  full->coordinates[j], "");
        }
    }
    check_frictions(&bad, s, o);
    return bad.count == 0 ? OK : FAILED;
}

Status solver_observe(Solver *s, Observed *o) {
    const System *full = s->system->embed != NULL ? s->system->full : s->system;
    Mechanism *b = s->system->embed != NULL ? &s->full : &s->stepped;
    const Instant at = flow_instant(s, s->state.now.t);
    system_active(s->system, s->state.closed, s->active);
    s->stepped.dependent = s->state.now.dependent;
    if (s->system->embed != NULL && observe_stepped(s, at, o) == FAILED) return FAILED;
    expand(s, at.t, s->state.q, s->state.v, o->q, o->v);
    if (full->dynamics != NULL && observe_solved(s, at, b, o) == FAILED) return FAILED;
    if (full->energies != NULL) full->energies(at.t, o->q, o->v, at.u, at.p, o->energy);
    observe_departures(s, o);
    if (check_finite(s, full, o) != OK) return FAILED;
    return outputs_observe(full, at, o, &s->why);
}
