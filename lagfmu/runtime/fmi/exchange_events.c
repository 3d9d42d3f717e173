/* exchange_events.c -- what happens between two steps of an importer's integrator (Model Exchange).
 *
 * Some importers stop at the zero of an indicator, others only see at the end of a step that there was one:
 * what is read there lies beyond the event, and off the constraints by all that the integrator has let drift.
 * So nothing is judged as it stands.  First the state goes back onto the rows that acted until now; then lambda,
 * gaps and cones say what has happened; a slip that has gone past 0 is set to 0, a contact that was
 * penetrated to f = 0 (landing.c); then the modes are switched.  What is missed in time is at most a step, and so
 * is the error. */
#include "exchange.h"

#include <math.h>
#include <string.h>

#include "algebraic.h"
#include "feature.h"
#include "indicators.h"
#include "losses.h"
#include "nominals.h"
#include "optional.h"
#include "schur.h"
#include "segment.h"

static const double SHORT = 1e-2; /* natural time in which a contact closes what drift has opened */
static const double CLOSE = 10;   /* condition of rows that stand for all, beyond which they are chosen anew */
static const double DRIFT_LIMIT = 1e-3; /* residual, relative to a constraint's size, that is projected */

/* Which rows stand for all from here on. */
static Status choose_rows(Instance *x) {
    Solver *s = &x->solver;
    if (s->system->m < 2) return OK;
    segment_begin(s);
    s->stepped.basis = NULL;
    x->version += 1;
    if (segment_motion_near(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v) != OK) return FAILED;
    segment_choose_rows(s);
    return OK;
}

/* The worst residual of a row that acts, relative to the constraint's own size. */
static Status drift(Instance *x, double *worst) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    const System *system = s->system;
    *worst = 0;
    if (exchange_evaluate(x) != OK) return FAILED;
    const int *active = b->sliding != NULL ? b->sliding->acting(b, s->active) : s->active;
    if (mechanism_residual(b, segment_instant(s, s->state.now.t), s->state.q, b->f) != OK)
        return FAILED;
    for (int k = 0; k < system->m; k++) {
        double size = 0, speed = 0;
        if (!active[k]) continue;
        for (int e = system->row_start[k]; e < system->row_start[k + 1]; e++) {
            const int j = system->entry_column[e];
            size += fabs(b->G[e]) * s->state.span[j];
            speed += fabs(b->G[e]) * fmax(fabs(s->state.v[j]), s->state.span[j] * s->state.now.rate);
        }
        if (system->rows[k].kind != NONHOLONOMIC && size > 0)
            *worst = fmax(*worst, fabs(b->f[k] - s->state.offset[k]) / size);
        if (speed > 0) *worst = fmax(*worst, fabs(mechanism_slip(b, k, s->state.v)) / speed);
    }
    return OK;
}

/* Adds to x->happened, by the motion as it is solved for now: contacts whose indicator is not positive, a closed one
 * that pulls, an open one that is penetrated and goes further in, or is pulled back in; frictions.  x->pull: the
 * accelerations towards contacts. */
static Status add_happened(Instance *x) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    x->version += 1;
    if (exchange_multipliers(x) != OK) return FAILED;
    if (mechanism_residual(b, segment_instant(s, s->state.now.t), s->state.q, b->f) != OK)
        return FAILED;
    nominals_watch(s, segment_instant(s, s->state.now.t), s->state.q);
    for (int c = 0; c < s->system->contacts; c++) {
        const int k = s->system->contact[c];
        x->pull[c] = b->gamma[k] - mechanism_row(b, k, b->vdot);
        if (s->state.closed[c])
            x->happened[c] |= b->lambda[k] <= 0;
        else
            x->happened[c] |= b->f[k] + exchange_limit(x, c) <= 0 &&
                              (mechanism_slip(b, k, s->state.v) < 0 || x->pull[c] > 0);
    }
    if (s->system->frictions == 0) return OK;
    const int first = indicators_first_of_frictions(s->system);
    double *values = x->indicators;
    OPTIONAL.friction->indicators(s, values);
    for (int i = 0; i < 2 * s->system->frictions; i++)
        x->happened[first + i] |= values[i] < -indicators_range(s, first + i).slack;
    return OK;
}

/* What has happened; where an importer has solved for multipliers, by these too, for by these it has stopped. */
static Status find_happened(Instance *x, int *any) {
    const int count = indicators_count(x->solver.system);
    Mechanism *b = &x->solver.stepped;
    memset(x->happened, 0, (size_t)count * sizeof *x->happened);
    if (x->dae && !x->imposed) {
        b->given = x->multiplier;
        const Status added = add_happened(x);
        b->given = NULL;
        if (added != OK) return FAILED;
    }
    *any = 0;
    if (add_happened(x) != OK) return FAILED;
    for (int i = 0; i < count; i++) *any |= x->happened[i];
    return OK;
}

/* The rows that stand for all others are about to depend on each other. */
static int are_close(const Linear *l) {
    return l->rung != RUNG_SCHUR || schur_of(l)->condition > CLOSE;
}

/* Whether other rows would be chosen now. */
static Status find_others(Instance *x, int *others) {
    Solver *s = &x->solver;
    Mechanism *b = &s->stepped;
    if (segment_motion_near(s, segment_instant(s, s->state.now.t), s->state.q, s->state.v) != OK) return FAILED;
    (void)linear_basis(&b->linear, b->pulls);
    *others = memcmp(b->pulls, s->state.basis, (size_t)s->system->m * sizeof *b->pulls) != 0;
    return OK;
}

/* Where multipliers are given, whether other rows are to stand for all, which is for an event. */
static Status find_worn(Instance *x, int *worn) {
    Mechanism *b = &x->solver.stepped;
    int others = 0;
    b->given = NULL;
    x->version += 1;
    Status evaluated = exchange_evaluate(x);
    if (evaluated == OK && b->friction != NULL) evaluated = ALGEBRAIC->factor(x);
    if (evaluated == OK && are_close(&b->linear)) evaluated = find_others(x, &others);
    *worn |= others;
    b->given = x->multiplier;
    x->version += 1;
    return evaluated;
}

/* Contacts that have risen above what they were watched with meet at f = 0. */
static void arm_contacts(Solver *s, const Instance *x) {
    for (int c = 0; c < s->system->contacts; c++)
        if (!s->state.closed[c] && s->stepped.f[s->system->contact[c]] > exchange_limit(x, c)) s->state.armed[c] = 1;
}

/* Whether contacts, frictions or drift ask for an event. */
static Status judge_step(Instance *x, int *event) {
    Solver *s = &x->solver;
    double worst;
    int any; /* contacts that should have opened or closed, whatever the importer has seen of it */
    *event = s->system->switches > 0 &&
             OPTIONAL.switches->stale(s, segment_instant(s, s->state.now.t), s->state.q);
    if (s->system->m == 0) return OK;
    if (drift(x, &worst) != OK) return FAILED;
    if (x->imposed && s->state.now.dependent && find_worn(x, event) != OK) return FAILED;
    if (!x->imposed && s->state.now.dependent && are_close(&s->stepped.linear) && choose_rows(x) != OK) return FAILED;
    if (find_happened(x, &any) != OK) return FAILED;
    if (x->dae) arm_contacts(s, x);
    if (!any && s->system->frictions > 0) {
        double *y = x->work;
        state_gather(s->system, s->state.q, s->state.v, y);
        if (OPTIONAL.friction->turn(s, s->state.now.t, y) != OK) return FAILED;
    }
    *event = *event || any || worst > DRIFT_LIMIT;
    return OK;
}

Status exchange_step_done(Instance *x, int *event) {
    if (instance_start(x) != OK) return FAILED;
    if (judge_step(x, event) != OK) return FAILED;
    if (features_everywhere(&x->solver)) x->version += 1;
    FEATURES_DO(&x->solver, exchanged, &x->solver, event);
    return OK;
}

/* The switch states; `changed`: 1 if one is not what it was. */
static Status settle_jumps(Instance *x, int *changed) {
    Solver *s = &x->solver;
    const Instant at = segment_instant(s, s->state.now.t);
    int again = 0;
    *changed = 0;
    if (s->system->switches == 0) return OK;
    OPTIONAL.switches->settle(s, at, s->state.q, s->state.v, NULL, changed);
    x->version += 1;
    if (exchange_evaluate(x) != OK) return FAILED; /* what rests on a surface may be about to leave it */
    OPTIONAL.switches->settle(s, at, s->state.q, s->state.v, s->stepped.vdot, &again);
    *changed |= again;
    x->version += 1;
    return OK;
}

/* Contacts whose surface was moved away open; `drift`: what of a gap the integrator may have made. */
static Status release(Instance *x, double drift) {
    Solver *s = &x->solver;
    if (s->system->contacts == 0) return OK;
    x->version += 1;
    return OPTIONAL.contacts->departures(s, SHORT / s->state.now.rate, drift);
}

static Status project_state(Solver *s) {
    segment_begin(s);
    return losses_project(s, segment_instant(s, s->state.now.t), 1);
}

/* The state back onto the rows that act. */
static Status project(Instance *x) {
    x->version += 1;
    return x->solver.system->m == 0 ? OK : project_state(&x->solver);
}

/* The state has been on the rows: what sticks slips where a motion has been moved away from it. */
static Status leave_behind(Instance *x) {
    Solver *s = &x->solver;
    if (s->system->frictions == 0 || s->system->prescribed_count == 0) return OK;
    return OPTIONAL.friction->slip_off(s, project_state);
}

/* What an importer has done to its inputs until now belongs to the step; what it does after, to the event. */
static Status come_back(Instance *x) {
    if (release(x, DRIFT_LIMIT) != OK || project(x) != OK) return FAILED;
    return choose_rows(x);
}

static Status pass_event(Instance *x) {
    Solver *s = &x->solver;
    int any, jumped;
    if (release(x, 0) != OK || leave_behind(x) != OK) return FAILED;
    if (settle_jumps(x, &jumped) != OK || project(x) != OK || choose_rows(x) != OK) return FAILED;
    if (find_happened(x, &any) != OK) return FAILED;
    if (any || jumped) x->moved = 1; /* some integrators begin anew only then, from beyond the event if they do not */
    if (!any && !(jumped && s->system->contacts + s->system->frictions > 0)) return OK;
    x->version += 1;
    if (s->system->frictions > 0 &&
        OPTIONAL.friction->stop(s, segment_instant(s, s->state.now.t),
                              x->happened + indicators_first_of_frictions(s->system)) != OK)
        return FAILED;
    const double inside = losses_energy(s, segment_instant(s, s->state.now.t));
    if (OPTIONAL.contacts->bring_back(s, x->happened, x->pull) != OK) return FAILED;
    s->state.now.lost += inside - losses_energy(s, segment_instant(s, s->state.now.t));
    if (OPTIONAL.contacts->pass(s, x->happened) != OK) return FAILED;
    return choose_rows(x);
}

/* `act`, and whether it has changed the state. */
static Status moving(Instance *x, Status (*act)(Instance *)) {
    Solver *s = &x->solver;
    double *before = x->work + 5 * system_states(s->system), *after = before + system_states(s->system);
    if (instance_start(x) != OK) return FAILED;
    state_gather(s->system, s->state.q, s->state.v, before);
    const double lost = s->state.now.lost;
    x->version += 1;
    if (act(x) != OK) return FAILED;
    instance_settled(x);
    state_gather(s->system, s->state.q, s->state.v, after);
    x->moved |= memcmp(before, after, (size_t)system_states(s->system) * sizeof *after) != 0;
    x->moved |= EXCHANGE_LOST && s->state.now.lost != lost;
    return OK;
}

/* Features know both sides of an event. */
static Status tell_features(Instance *x) {
    if (features_everywhere(&x->solver)) x->version += 1;
    FEATURES_DO(&x->solver, after, &x->solver);
    return OK;
}

void exchange_hold(Instance *x) {
    const System *s = x->solver.system, *full = system_read(s);
    const Observed *o = &x->seen;
    x->held = x->exchange && (full->unique_count > 0 ? instance_observe_unique(x) : instance_observe(x)) == OK;
    if (!x->held) return;
    memcpy(x->flag, o->unique, (size_t)full->m * sizeof *x->flag);
    memcpy(x->flag + full->m, o->own_unique, (size_t)full->unique_count * sizeof *x->flag);
    memcpy(x->flag + full->m + full->unique_count, o->sticks, (size_t)s->frictions * sizeof *x->flag);
}

Status exchange_enter_event(Instance *x) {
    x->held = 0;
    if (ALGEBRAIC != NULL) ALGEBRAIC->take(x);
    return moving(x, come_back) == OK ? tell_features(x) : FAILED;
}

Status exchange_event(Instance *x, int *moved) {
    if (moving(x, pass_event) != OK || tell_features(x) != OK) return FAILED;
    if (ALGEBRAIC != NULL && ALGEBRAIC->renew(x) != OK) return FAILED;
    *moved = x->moved;
    x->moved = 0;
    return exchange_find_gain(x);
}
