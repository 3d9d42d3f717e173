/* instance_values.c -- the values of variables that lie in the state, or are evaluated at it with the inputs of
 * now. */
#include "instance.h"

#include <math.h>
#include <string.h>

#include "algebraic.h"
#include "exchange.h"
#include "peaks.h"
#include "prescribed.h"

/* What is read after an input was set is read at the state with which the next step begins. */
static Status follow(Instance *x) {
    if (x->followed || x->exchange || !x->started || !x->running) return OK;
    if (x->solver.state.now.pending || x->between.paused) return OK; /* the limit from the left */
    const int estimated = PRESCRIBED != NULL && PRESCRIBED->was_set(x);
    if (!estimated && !instance_turned(x)) return OK;
    instance_save(x, x->backup);
    x->followed = 1;
    x->observed = x->evaluated = 0;
    if (estimated) PRESCRIBED->estimate(x);
    instance_turn(x);
    if (ERROR_BARS != NULL) ERROR_BARS->turn(x);
    if (solver_look(&x->solver) == OK) return OK;
    instance_unfollow(x);
    return FAILED;
}

Status instance_observe(Instance *x) {
    if (x->observed) return OK;
    if (instance_start(x) != OK || solver_arrive(&x->solver) != OK || follow(x) != OK) return FAILED;
    if (solver_observe(&x->solver, &x->seen) != OK) return FAILED;
    x->observed = 1;
    x->motion = x->solver.stepped.evaluations + x->solver.full.evaluations;
    x->evaluated = 0;
    if (DERIVATIVES != NULL) DERIVATIVES->observed(x);
    if (ERROR_BARS != NULL) x->bars->observed = 0;
    return OK;
}

Status instance_observe_unique(Instance *x) {
    if (!x->seen.asked) x->observed = 0;
    x->seen.asked = 1;
    return instance_observe(x);
}

/* What lies ready of an event; 0 if it is a state by the coordinates of an embedding. */
static int ready_of_event(const Solver *s, const Variable *v, double *value) {
    const Latest *latest = &s->state.latest[event_kind(v->place)];
    const int of_q = event_part(v->place) == AT_DEPARTURE_Q;
    switch (event_part(v->place)) {
        case AT_DEPARTURE_COUNT: *value = (double)latest->count[v->contact]; return 1;
        case AT_DEPARTURE_TIME: *value = latest->time[v->contact]; return 1;
        default: break;
    }
    if (s->system->full != NULL) return 0;
    const int at = v->contact * (of_q ? s->system->nq : s->system->nv) + v->index;
    *value = (of_q ? latest->q : latest->v)[at];
    return 1;
}

/* The state at an event by the coordinates of an embedding. */
static double of_event(const Solver *s, const Observed *o, const Variable *v) {
    const int at = v->contact * s->system->full->nq + v->index, of_q = event_part(v->place) == AT_DEPARTURE_Q;
    return (of_q ? o->latest_q : o->latest_v)[event_kind(v->place)][at];
}

/* Values that lie ready in the state; 0 if the value has to be calculated first. */
static int ready(const Solver *s, const Variable *v, double *value) {
    const int embedded = s->system->full != NULL;
    if (is_of_event(v->place)) return ready_of_event(s, v, value);
    if (is_of_peak(v->place)) {
        *value = s->peak[PEAK_PARTS * v->index + (int)(v->place - AT_PEAK_MAX)];
        return 1;
    }
    switch (v->place) {
        case AT_Q:
            if (embedded) return 0;
            *value = s->state.q[v->index];
            return 1;
        case AT_V:
            if (embedded) return 0;
            *value = s->state.v[v->index];
            return 1;
        case AT_S: *value = s->state.q[v->index]; return 1;
        case AT_SDOT: *value = s->state.v[v->index]; return 1;
        case AT_TIME: *value = s->state.now.t; return 1;
        case AT_STEPS: *value = (double)s->state.now.steps; return 1;
        case AT_CONTACT: *value = s->state.closed[v->index]; return 1;
        case AT_IMPULSE: *value = s->state.impulse[v->index]; return 1;
        case AT_LOST: *value = s->state.now.lost; return 1;
        default: return 0;
    }
}

Status instance_value(Solver *s, const Observed *o, const Variable *v, double *value) {
    if (ready(s, v, value)) return OK;
    if (is_of_event(v->place)) {
        *value = of_event(s, o, v);
        return OK;
    }
    switch (v->place) {
        case AT_Q: *value = o->q[v->index]; break;
        case AT_V: *value = o->v[v->index]; break;
        case AT_VDOT: *value = o->vdot[v->index]; break;
        case AT_QDOT: *value = o->rate[v->index]; break;
        case AT_SDDOT: *value = o->sddot[v->index]; break;
        case AT_LAMBDA: *value = o->lambda[v->index]; break;
        case AT_UNIQUE: *value = o->unique[v->index]; break;
        case AT_OUTPUT_UNIQUE: *value = o->own_unique[v->index]; break;
        case AT_RESIDUAL: *value = o->residual[v->index]; break;
        case AT_FORCE: *value = o->force[v->index]; break;
        case AT_SHARE: *value = o->share[v->index]; break;
        case AT_KINETIC: *value = o->energy[0]; break;
        case AT_POTENTIAL: *value = o->energy[1]; break;
        case AT_TOTAL: *value = o->energy[0] + o->energy[1]; break;
        case AT_STICKS: *value = o->sticks[v->index]; break;
        case AT_SLIP: *value = o->slip[v->index]; break;
        case AT_MARGIN: *value = o->margin[v->index]; break;
        case AT_POWER: *value = o->power[v->index]; break;
        case AT_LOST_RATE:
            *value = 0;
            for (int i = 0; i < s->system->frictions; i++) *value -= o->power[i];
            break;
        case AT_OUTPUT: *value = o->own[v->index]; break;
        default: return fail(&s->why, "%s has no value", v->name);
    }
    return OK;
}

/* An event indicator, as an importer's integrator would watch it. */
static Status indicator(Instance *x, int i, double *value) {
    if (instance_observe(x) != OK || exchange_indicators(x, x->indicators) != OK) return FAILED;
    *value = x->indicators[i];
    return isfinite(*value) ? OK : fail(&x->solver.why, "event indicator %d is not finite", i + 1);
}

Status instance_get(Instance *x, const Variable *v, double *value) {
    if (v->place == AT_SENSITIVITY || v->place == AT_SENSITIVITY_VALID) return DERIVATIVES->get(x, v, value);
    const int estimated = v->place == AT_INPUT && x->solver.system->estimated_count > 0;
    if (v->place == AT_INPUT && x->between.paused && x->between.supplied[v->index]) {
        *value = x->between.value[v->index];
        return OK;
    }
    if (v->place == AT_CLOCK) {
        *value = instance_ticks(x, v->index);
        return OK;
    }
    if (!estimated && instance_was_set(x, v, value)) return OK;
    if (v->place == AT_ERROR) return ERROR_BARS->get(x, v, value);
    if (v->place == AT_RESIDUAL_RATE || v->place == AT_RESIDUAL_ACCELERATION) return ALGEBRAIC->residual(x, v, value);
    if (v->place == AT_INDICATOR) return indicator(x, v->index, value);
    if (solver_arrive(&x->solver) != OK) return FAILED;
    if (follow(x) != OK) return FAILED;
    if (estimated && instance_was_set(x, v, value)) return OK;
    if (x->started && ready(&x->solver, v, value))
        return isfinite(*value) ? OK : fail(&x->solver.why, "%s is not finite", v->name);
    if (v->place == AT_OUTPUT_UNIQUE && instance_observe_unique(x) != OK) return FAILED;
    if (!x->observed && instance_observe(x) != OK) return FAILED;
    return instance_value(&x->solver, &x->seen, v, value);
}
