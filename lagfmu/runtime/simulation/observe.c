/* observe.c -- a state -> everything that the FMU reports.
 *
 *   M vdot = F + G^T lambda ,  G vdot = gamma ,  Q_j = sum_k lambda_k G_kj      (system.h)
 *
 * are solved at this very state and these inputs, so that lambda, Q and the accelerations are
 * consistent with what the importer reads; with an embedding on the full coordinates. */
#include <float.h>
#include <string.h>

#include "digits.h"
#include "optional.h"
#include "outputs.h"
#include "segment.h"

#define TAKE_NUMBERS(member, many, of, name) o->member = arena_doubles(arena, many);
#define TAKE_FLAGS(member, many, of, name) o->member = arena_ints(arena, many);

void observed_layout(Observed *o, Arena *arena, const System *own) {
    const System *full = system_read(own);
    const int stepped = own->embed != NULL ? own->nq : 0;
    OBSERVED_NUMBERS(TAKE_NUMBERS)
    OBSERVED_FLAGS(TAKE_FLAGS)
    for (int k = 0; k < EVENT_KINDS && stepped > 0; k++) {
        o->latest_q[k] = arena_doubles(arena, event_count_of(own, (EventKind)k) * full->nq);
        o->latest_v[k] = arena_doubles(arena, event_count_of(own, (EventKind)k) * full->nv);
    }
}

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

/* The offset that a row of the full system keeps. */
static double offset_of(const Solver *s, int k) {
    const System *own = s->system;
    if (own->embed == NULL) return s->state.offset[k];
    for (int i = 0; i < own->m; i++)
        if (same_row(own, i, own->full, k)) return s->state.offset[i];
    return 0;
}

/* Coordinates and velocities of the full system. */
static void expand(const Solver *s, double t, const double *q, const double *v, double *full_q,
                   double *full_v) {
    const System *system = s->system;
    if (system->embed != NULL) {
        system->embed(t, q, v, s->u, s->p, full_q, full_v);
        return;
    }
    memcpy(full_q, q, (size_t)system->nq * sizeof *q);
    memcpy(full_v, v, (size_t)system->nv * sizeof *v);
}

/* The coordinates that are stepped, where there are others. */
static Status observe_stepped(Solver *s, Instant at, Observed *o) {
    const State *state = &s->state;
    const size_t n = (size_t)s->system->nv * sizeof(double);
    if (mechanism_motion(&s->stepped, at, state->q, state->v, s->active) == FAILED) return FAILED;
    memcpy(o->s, state->q, n);
    memcpy(o->sdot, state->v, n);
    memcpy(o->sddot, s->stepped.vdot, n);
    return OK;
}

/* lambda, whether it is unique, Q and each constraint's share in it. */
static void observe_forces(const Mechanism *b, Observed *o) {
    const System *s = b->system;
    memcpy(o->vdot, b->vdot, (size_t)s->nv * sizeof *o->vdot);
    if (s->kinematics != NULL) mechanism_rates(b, o->v, o->rate);
    memcpy(o->lambda, b->lambda, (size_t)s->m * sizeof *o->lambda);
    memcpy(o->unique, b->linear.unique, (size_t)s->m * sizeof *o->unique);
    memcpy(o->applied, b->F, (size_t)s->nv * sizeof *o->applied);
    for (int j = 0; j < s->nv; j++) o->force[j] = 0;
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
            o->residual[k] -= offset_of(s, k);
    }
    return OK;
}

/* Accelerations, lambda, Q and residuals. */
static Status observe_solved(Solver *s, Instant at, Mechanism *b, Observed *o) {
    const int *active = s->active;
    if (s->system->embed != NULL) {
        full_active(s);
        active = s->active_full;
    }
    const Status status = b->dependent ? mechanism_motion_near(b, at, o->q, o->v, active, s->state.offset,
                                                               s->state.span)
                                       : mechanism_motion(b, at, o->q, o->v, active);
    if (status == FAILED) return FAILED;
    s->shown = b == &s->stepped && !b->dependent ? b->evaluations : 0;
    observe_forces(b, o);
    if (s->system->frictions > 0) OPTIONAL.friction->observe(s, o);
    return observe_residuals(s, at, b, o);
}

/* The states of the latest events, by the full coordinates. */
static void observe_events(const Solver *s, EventKind kind, Observed *o) {
    const int own = s->system->nq, full = s->system->full->nq; /* of an embedding: as many speeds */
    const Latest *latest = &s->state.latest[kind];
    for (int i = 0; i < event_count_of(s->system, kind); i++) {
        double *q = o->latest_q[kind] + i * full, *v = o->latest_v[kind] + i * full;
        if (latest->count[i] > 0) {
            expand(s, latest->time[i], latest->q + i * own, latest->v + i * own, q, v);
            continue;
        }
        for (int j = 0; j < full; j++) q[j] = v[j] = 0;
    }
}

/* Its names, "" where there are fewer than three. */
static StateName names(const Solver *s, const System *full, Owner of, int i) {
    const System *own = s->system;
    switch (of) {
        case OF_NONE: break;
        case OF_COORDINATE: return (StateName){full->coordinates[i], "", ""};
        case OF_SPEED: return system_state_name(full, full->nq + i);
        case OF_ACCELERATION: return system_acceleration_name(full, i);
        case OF_FORCE: return (StateName){full->speeds[i], "", ""};
        case OF_STEPPED: return (StateName){own->coordinates[i], "", ""};
        case OF_ROW: return (StateName){full->rows[i].name, "", ""};
        case OF_ENTRY: return (StateName){full->rows[full->entry_row[i]].name, full->speeds[full->entry_column[i]], ""};
        case OF_CONTACT:
            return (StateName){own->rows[own->contact[i / full->nq]].name, full->coordinates[i % full->nq], ""};
        case OF_SLIP: return (StateName){own->rows[own->friction[i / 2].row[i % 2]].name, "", ""};
        case OF_FRICTION: return (StateName){own->friction[i].name, "", ""};
    }
    return (StateName){"", "", ""};
}

#define LOOK_AT(member, many, of, format) {o->member, of == OF_NONE ? 0 : (many), of, format},

/* FAILED if a value is not finite; the cause names them as the FMU's variables are named. */
static Status check_observed_finite(Solver *s, const System *full, const Observed *o) {
    const System *own = s->system;
    const int stepped = own->embed != NULL ? own->nq : 0;
    const int kept = stepped > 0 ? own->contacts * full->nq : 0; /* with an embedding there are no frictions */
    const double total = o->energy[0] + o->energy[1];
    const struct {
        const double *values;
        int count;
        Owner of;
        const char *format;
    } list[] = {
        OBSERVED_NUMBERS(LOOK_AT)
        {&o->energy[0], 1, OF_NONE, "energy.kinetic"},
        {&o->energy[1], 1, OF_NONE, "energy.potential"},
        {&total, 1, OF_NONE, "energy.total"},
        {o->latest_q[DEPARTURE], kept, OF_CONTACT, "departure.%s.%s"},
        {o->latest_v[DEPARTURE], kept, OF_CONTACT, "departure.%s.velocity.%s"},
        {o->latest_q[CLOSING], kept, OF_CONTACT, "closing.%s.%s"},
        {o->latest_v[CLOSING], kept, OF_CONTACT, "closing.%s.velocity.%s"},
        {&s->state.now.lost, 1, OF_NONE, "energy.dissipated"},
    };
    int bad = 0;
    for (size_t k = 0; k < sizeof list / sizeof *list; k++)
        for (int i = 0; i < list[k].count; i++) {
            if (fabs(list[k].values[i]) <= DBL_MAX) continue;
            const StateName of = names(s, full, list[k].of, i);
            if (bad++ == 0)
                (void)fail(&s->why, "not finite at t = %s s: ", digits(s->state.now.t).text);
            else
                why_append(&s->why, ", ");
            why_append(&s->why, list[k].format, of.head, of.name, of.tail);
        }
    return bad == 0 ? OK : FAILED;
}

Status solver_observe(Solver *s, Observed *o) {
    const System *full = system_read(s->system);
    Mechanism *b = s->system->embed != NULL ? &s->full : &s->stepped;
    const Instant at = segment_instant(s, s->state.now.t);
    segment_begin(s);
    if (s->system->embed != NULL && observe_stepped(s, at, o) == FAILED) return FAILED;
    expand(s, at.t, s->state.q, s->state.v, o->q, o->v);
    if (full->dynamics != NULL && observe_solved(s, at, b, o) == FAILED) return FAILED;
    if (full->energies != NULL) full->energies(at.t, o->q, o->v, at.u, at.p, o->energy);
    for (int k = 0; k < EVENT_KINDS && s->system->embed != NULL; k++) observe_events(s, (EventKind)k, o);
    if (check_observed_finite(s, full, o) != OK || outputs_observe(full, at, o, &s->why) != OK) return FAILED;
    if (full->unique_count > 0 && o->asked) outputs_unique(b, at, o);
    return OK;
}
