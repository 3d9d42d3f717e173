/* component_derivatives.c -- partial derivatives of variables, and their derivatives with respect to time. */
#include <math.h>
#include <string.h>

#include "algebraic.h"
#include "component.h"
#include "digits.h"
#include "segment.h"

/* Where a known variable's change stands; NULL if it is neither time nor a state nor an input, nor a multiplier
 * that is given. */
static double *known_place(Instance *x, const Variable *v, double *dt) {
    const int nq = MODEL_SYSTEM->nq, j = variable_state(v);
    Sensitivity *w = &x->solver.sensitivity;
    if (v->place == AT_TIME) return dt;
    if (v->place == AT_INPUT) return &w->du[v->index];
    if (v->place == AT_LOST && EXCHANGE_LOST && x->exchange) return &x->dlost;
    if (v->place == AT_LAMBDA && x->imposed) return &w->dgiven[v->index];
    if (j < 0) return NULL;
    return j < nq ? &w->dq[j] : &w->dv[j - nq];
}

Direction component_no_direction(Component *c) {
    Sensitivity *w = &c->instance.solver.sensitivity;
    const System *s = MODEL_SYSTEM;
    c->instance.dlost = 0;
    memset(w->dq, 0, (size_t)s->nq * sizeof *w->dq);
    memset(w->dv, 0, (size_t)s->nv * sizeof *w->dv);
    memset(w->du, 0, (size_t)s->inputs * sizeof *w->du);
    memset(w->dgiven, 0, (size_t)s->m * sizeof *w->dgiven);
    return (Direction){0, w->dq, w->dv, w->du, w->dp};
}

double *component_known(Component *c, const Call *call, const Group *group, unsigned known, double change, double *dt) {
    Why text;
    const Variable *v = component_find(c, call, known, group);
    if (v == NULL) return NULL;
    double *place = known_place(&c->instance, v, dt);
    if (isfinite(change) && place != NULL) return place;
    (void)fail(&text, "%s: a change of '%s' by %s, expected a finite change of a continuous state or an input%s",
               call->name, v->name, digits(change).text,
               ALGEBRAIC != NULL ? ", or, in the continuous-time mode of DAE mode, of a multiplier" : "");
    (void)component_refuse(c, text.text);
    return NULL;
}

/* States that are set are settled: of a direction there is what is left of it then. */
void component_settle(Component *c, double dt) {
    Solver *s = &c->instance.solver;
    const Sensitivity *w = &s->sensitivity;
    if (s->system->kinematics == NULL || s->system->kinematics_tangent == NULL) return;
    const Instant at = segment_instant(s, s->state.now.t);
    for (int k = 0; k < 4 * s->system->quaternions; k++) w->dq[s->system->quaternion[k]] /= c->instance.norm[k / 4];
    KINEMATICS->settle_along(&s->stepped, at.t, s->state.q, at.u, at.p, dt, w->dq, w->du, w->dp);
}

int component_derivable(Component *c, const Call *call, int complete) {
    if (component_forbids(c, call)) return CALL_ERROR;
    return complete ? CALL_OK : component_missing(c, call);
}

int component_directional(Component *c, const Call *call, const Group *group, const unsigned unknowns[],
                          size_t unknown_count, const unsigned knowns[], size_t known_count, const double seed[],
                          double sensitivity[]) {
    const int complete = (unknown_count == 0 || (unknowns != NULL && sensitivity != NULL)) &&
                         (known_count == 0 || (knowns != NULL && seed != NULL));
    if (component_derivable(c, call, complete) != CALL_OK) return CALL_ERROR;
    if (c->instance.phase == INITIALIZATION)
        return component_initial(c, call, group, unknowns, unknown_count, NULL, knowns, known_count, seed, sensitivity);
    Direction d = component_no_direction(c);
    for (size_t k = 0; k < known_count; k++) {
        double *change = component_known(c, call, group, knowns[k], seed[k], &d.dt);
        if (change == NULL) return CALL_ERROR;
        *change += seed[k];
    }
    if (instance_observe_unique(&c->instance) != OK) return component_no_value(c);
    component_settle(c, d.dt);
    if (instance_differentiate(&c->instance, d) != OK) return component_no_value(c);
    for (size_t k = 0; k < unknown_count; k++) {
        const Variable *v = component_find(c, call, unknowns[k], group);
        if (v == NULL) return CALL_ERROR;
        if (!component_has_derivatives(v) || instance_change(&c->instance, v, d, &sensitivity[k]) != OK)
            return component_no_derivative(c, call, v);
    }
    return CALL_OK;
}

int component_rates(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                    const int orders[], double values[]) {
    Direction d;
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (count > 0 && (references == NULL || orders == NULL || values == NULL)) return component_missing(c, call);
    if (c->instance.phase == BETWEEN && c->asked) return component_out_of_turn(c, call);
    if (count == 0) return CALL_OK;
    if (instance_rates(&c->instance, &d) != OK) return component_no_value(c);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_find(c, call, references[k], group);
        if (v == NULL) return CALL_ERROR;
        if ((v->role != ROLE_OUTPUT && v->role != ROLE_START) || orders[k] != 1) {
            (void)fail(&text, "%s: derivative %d of '%s', expected the first one of an output", call->name,
                       orders[k], v->name);
            return component_refuse(c, text.text);
        }
        if (instance_change(&c->instance, v, d, &values[k]) != OK) return component_no_derivative(c, call, v);
    }
    return CALL_OK;
}
