/* instance_values.c -- the values of variables that lie in the state, or are evaluated at it with the inputs of
 * now. */
#include "instance.h"

#include <math.h>
#include <string.h>

#include "algebraic.h"
#include "exchange.h"
#include "feature.h"
#include "prescribed.h"

/* What is read after an input was set is read at the state with which the next step begins. */
static Status follow(Instance *x) {
    if (x->followed == x->version || x->exchange || !x->started || !x->running) return OK;
    if (x->solver.state.now.pending || x->between.paused) return OK; /* the limit from the left */
    const int estimated = PRESCRIBED != NULL && PRESCRIBED->was_set(x);
    if (!estimated && !instance_turned(x)) return OK;
    instance_save(x, x->backup);
    x->version += 1;
    x->followed = x->version;
    if (estimated) PRESCRIBED->estimate(x);
    instance_turn(x);
    if (ERROR_BARS != NULL) ERROR_BARS->turn(x);
    if (solver_look(&x->solver) == OK) return OK;
    instance_unfollow(x);
    return FAILED;
}

Status instance_observe(Instance *x) {
    if (x->observed == x->version) return OK;
    if (instance_start(x) != OK || solver_arrive(&x->solver) != OK || follow(x) != OK) return FAILED;
    const int leads_back = exchange_leads_back(x);
    if (leads_back && x->gain < 0 && exchange_find_gain(x) != OK) return FAILED;
    if (solver_observe(&x->solver, &x->seen) != OK) return FAILED;
    x->motion = x->solver.stepped.evaluations + x->solver.full.evaluations;
    if (leads_back && exchange_lead_back(x) != OK) return FAILED;
    x->observed = x->version;
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

#define READY(place, it, change) case AT_##place: *value = it; return 1;
#define OBSERVED(place, it, change) case AT_##place: *value = it; break;

/* Values that lie ready in the state; 0 if the value has to be calculated first. */
static int ready(const Solver *s, const Variable *v, double *value) {
    const int embedded = s->system->full != NULL;
    if (is_of_event(v->place)) return ready_of_event(s, v, value);
    const int i = v->index;
    switch (v->place) {
        case AT_Q:
        case AT_V:
            if (embedded) return 0;
            *value = (v->place == AT_Q ? s->state.q : s->state.v)[i];
            return 1;
            PLACES_READY(READY)
        default: break;
    }
    for (const Feature *const *f = s->features; f != NULL && *f != NULL; f++) {
        const double *of_feature = (*f)->value != NULL ? (*f)->value(s, (int)v->place, v->index) : NULL;
        if (of_feature == NULL) continue;
        *value = *of_feature;
        return 1;
    }
    return 0;
}

Status instance_value(Solver *s, const Observed *o, const Variable *v, double *value) {
    if (ready(s, v, value)) return OK;
    if (is_of_event(v->place)) {
        *value = of_event(s, o, v);
        return OK;
    }
    const int i = v->index;
    switch (v->place) {
        PLACES_OBSERVED(OBSERVED)
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
    if (exchange_held(x, v, value)) return OK;
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
    if (v->place == AT_EQUATION) return ALGEBRAIC->equation(x, v->index, value);
    if (v->place == AT_INDICATOR) return indicator(x, v->index, value);
    if (solver_arrive(&x->solver) != OK) return FAILED;
    if (follow(x) != OK) return FAILED;
    if (estimated && instance_was_set(x, v, value)) return OK;
    if (x->started && ready(&x->solver, v, value))
        return isfinite(*value) ? OK : fail(&x->solver.why, "%s is not finite", v->name);
    if (v->place == AT_OUTPUT_UNIQUE && instance_observe_unique(x) != OK) return FAILED;
    if (instance_observe(x) != OK) return FAILED;
    return instance_value(&x->solver, &x->seen, v, value);
}
