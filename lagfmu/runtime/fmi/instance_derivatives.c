/* instance_derivatives.c -- how variables change along a direction, and with time. */
#include "instance.h"

#include <math.h>
#include <string.h>

#include "algebraic.h"
#include "exchange.h"
#include "outputs.h"
#include "prescribed.h"
#include "segment.h"

Status instance_factor(Instance *x) {
    Solver *s = &x->solver;
    const System *full = s->system->full;
    Instant *at = &x->at;
    if (s->system->tangent == NULL || (s->system->frictions > 0 && s->sensitivity.slide == NULL))
        return fail(&s->why, "this FMU was built for a scene without derivatives of its outputs");
    if (instance_observe_unique(x) != OK) return FAILED;
    *at = segment_instant(s, s->state.now.t);
    segment_begin(s);
    /* what was observed is the latest motion still, but frictions may have turned */
    if (s->system->frictions == 0 && x->motion == s->stepped.evaluations + s->full.evaluations) return OK;
    if (segment_motion_near(s, *at, s->state.q, s->state.v) != OK) return FAILED;
    if (full == NULL || full->dynamics == NULL) return OK;
    return mechanism_motion(&s->full, *at, x->seen.q, x->seen.v, s->active_full);
}

void instance_change_outputs(Instance *x, Direction d) {
    Solver *s = &x->solver;
    const System *full = s->system->full;
    Sensitivity *w = &x->along;
    if (full == NULL) {
        outputs_change(&s->sensitivity, &s->stepped, s->system, x->at, &x->seen, d);
        return;
    }
    const Direction wide = {d.dt, w->dq, w->dv, d.du, d.dp};
    outputs_change(w, full->dynamics != NULL ? &s->full : NULL, full, x->at, &x->seen, wide);
}

Status instance_differentiate_factored(Instance *x, Direction d, Differentiate *solve) {
    Solver *s = &x->solver;
    const Instant at = x->at;
    const System *full = s->system->full;
    Sensitivity *w = &x->along;
    if (solve(&s->sensitivity, &s->stepped, at, s->state.q, s->state.v, d) != OK) return FAILED;
    if (full != NULL) {
        s->system->embed_tangent(at.t, s->state.q, s->state.v, at.u, at.p, d.dt, d.dq, d.dv, d.du, d.dp, w->dq, w->dv);
        const Direction wide = {d.dt, w->dq, w->dv, d.du, d.dp};
        if (full->dynamics == NULL)
            sensitivity_of_values(w, full, at, x->seen.q, x->seen.v, wide);
        else if (solve(w, &s->full, at, x->seen.q, x->seen.v, wide) != OK)
            return FAILED;
    }
    instance_change_outputs(x, d);
    return OK;
}

Status instance_differentiate(Instance *x, Direction d) {
    x->apart = 0;
    if (instance_factor(x) != OK) return FAILED;
    if (!exchange_leads_back(x)) return instance_differentiate_factored(x, d, sensitivity_along);
    if (exchange_differentiate(x, d) != OK || instance_factor(x) != OK) return FAILED;
    x->apart = instance_differentiate_factored(x, d, sensitivity_along) != OK; /* dependent rows, off the constraints */
    return OK;
}

#define CHANGES(place, value, it) case AT_##place: *change = it; break;

Status instance_change(const Instance *x, const Variable *v, Direction d, double *change) {
    const Solver *s = &x->solver;
    const int embedded = s->system->full != NULL;
    const Mechanism *b = embedded ? &s->full : &s->stepped;
    const Sensitivity *w = embedded ? &x->along : &s->sensitivity;
    const double *dq = embedded ? w->dq : d.dq, *dv = embedded ? w->dv : d.dv;
    const Observed *o = &x->seen;
    const int i = v->index;
    *change = 0;
    if (v->place == AT_VDOT && exchange_leads_back(x)) {
        *change = exchange_change_of_vdot(x, i);
        return isfinite(*change) ? OK : FAILED;
    }
    const int kinematic = v->place == AT_Q || v->place == AT_V || v->place == AT_QDOT ||
                          (v->place == AT_RESIDUAL && !embedded); /* no accelerations are asked for */
    if (x->apart && !kinematic) return FAILED;
    if (v->place == AT_LOST && EXCHANGE_LOST && x->exchange) {
        *change = x->dlost;
        return OK;
    }
    switch (v->place) {
        PLACES_READY(CHANGES) PLACES_OBSERVED(CHANGES)
        case AT_EQUATION: *change = ALGEBRAIC->change(x, i); break;
        case AT_INDICATOR: *change = exchange_change_of_indicator(x, i, d); break;
        case AT_INPUT: *change = d.du[v->index]; break;
        case AT_ERROR: case AT_SENSITIVITY: *change = NAN; break; /* it is not known, or not asked for */
        default: break; /* discrete ones and parameters: none */
    }
    return isfinite(*change) ? OK : FAILED;
}

Status instance_rates(Instance *x, Direction *d) {
    Solver *s = &x->solver;
    const System *system = s->system;
    Sensitivity *w = &s->sensitivity;
    if (instance_observe_unique(x) != OK) return FAILED;
    const double *vdot = system->full == NULL ? x->seen.vdot : x->seen.sddot;
    memcpy(w->dq, system->kinematics == NULL ? s->state.v : x->seen.rate, (size_t)system->nq * sizeof *w->dq);
    memcpy(w->dv, vdot, (size_t)system->nv * sizeof *w->dv);
    for (int k = 0; k < system->inputs; k++) {
        const int order = PRESCRIBED == NULL ? -1 : PRESCRIBED->order(x, k);
        w->du[k] = order < 0 ? s->drive.first[k] : PRESCRIBED->rate(x, k, order);
    }
    *d = (Direction){1, w->dq, w->dv, w->du, w->dp};
    return instance_differentiate(x, *d);
}
