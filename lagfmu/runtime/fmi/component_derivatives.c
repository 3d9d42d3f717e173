/* component_derivatives.c -- partial derivatives of variables, and their derivatives with respect to time. */
#include <math.h>
#include <string.h>

#include "algebraic.h"
#include "component.h"
#include "digits.h"

/* Adds a known variable's change to the direction; 0 if it is neither time nor a state nor an input, nor a multiplier
 * that is given. */
static int add_seed(Instance *x, double *dt, const Variable *v, double change) {
    const int nq = MODEL_SYSTEM->nq, j = variable_state(v);
    Sensitivity *w = &x->solver.sensitivity;
    if (v->place == AT_TIME)
        *dt += change;
    else if (v->place == AT_INPUT)
        w->du[v->index] += change;
    else if (v->place == AT_LAMBDA && x->imposed)
        w->dgiven[v->index] += change;
    else if (j < 0)
        return 0;
    else
        *(j < nq ? &w->dq[j] : &w->dv[j - nq]) += change;
    return 1;
}

/* The direction in which everything is to change: so far nothing. */
static Direction no_direction(Sensitivity *w) {
    const System *s = MODEL_SYSTEM;
    memset(w->dq, 0, (size_t)s->nq * sizeof *w->dq);
    memset(w->dv, 0, (size_t)s->nv * sizeof *w->dv);
    memset(w->du, 0, (size_t)s->inputs * sizeof *w->du);
    memset(w->dgiven, 0, (size_t)s->m * sizeof *w->dgiven);
    return (Direction){0, w->dq, w->dv, w->du, w->dp};
}

/* A known variable, by whose change something else is to change. */
static int take_seed(Component *c, const Call *call, const Group *group, unsigned known, double change, Direction *d) {
    Why text;
    const Variable *v = component_find(c, call, known, group);
    if (v == NULL) return CALL_ERROR;
    if (isfinite(change) && add_seed(&c->instance, &d->dt, v, change)) return CALL_OK;
    (void)fail(&text, "%s: a change of '%s' by %s, expected a finite change of a continuous state or an input%s",
               call->name, v->name, digits(change).text,
               ALGEBRAIC != NULL ? ", or of a multiplier once one has been set" : "");
    return component_refuse(c, text.text);
}

/* Quaternions that are set are normalized: of a direction there is what is left of it then. */
static void settle_direction(Instance *x) {
    mechanism_settle_change(&x->solver.stepped, x->solver.state.q, x->solver.sensitivity.dq);
}

static int is_derived(const Variable *v) { return v->role == ROLE_OUTPUT || v->role == ROLE_START; }

/* Can partial derivatives be had now, and are there all arrays? */
static int check_call(Component *c, const Call *call, int complete) {
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (c->instance.phase == INITIALIZATION) {
        (void)fail(&text, "%s: the start values pass through a projection whose derivative is not provided; ask "
                   "after the initialization", call->name);
        return component_refuse(c, text.text);
    }
    return complete ? CALL_OK : component_missing(c, call);
}

int component_directional(Component *c, const Call *call, const Group *group, const unsigned unknowns[],
                          size_t unknown_count, const unsigned knowns[], size_t known_count, const double seed[],
                          double sensitivity[]) {
    const int complete = (unknown_count == 0 || (unknowns != NULL && sensitivity != NULL)) &&
                         (known_count == 0 || (knowns != NULL && seed != NULL));
    if (check_call(c, call, complete) != CALL_OK) return CALL_ERROR;
    Direction d = no_direction(&c->instance.solver.sensitivity);
    for (size_t k = 0; k < known_count; k++)
        if (take_seed(c, call, group, knowns[k], seed[k], &d) != CALL_OK) return CALL_ERROR;
    if (instance_observe(&c->instance) != OK) return component_no_value(c);
    settle_direction(&c->instance);
    if (instance_differentiate(&c->instance, d) != OK) return component_no_value(c);
    for (size_t k = 0; k < unknown_count; k++) {
        const Variable *v = component_find(c, call, unknowns[k], group);
        if (v == NULL) return CALL_ERROR;
        if (!is_derived(v) || instance_change(&c->instance, v, d, &sensitivity[k]) != OK)
            return component_no_derivative(c, call, v);
    }
    return CALL_OK;
}

int component_adjoint(Component *c, const Call *call, const Group *group, const unsigned unknowns[],
                      size_t unknown_count, const unsigned knowns[], size_t known_count, const double seed[],
                      double sensitivity[]) {
    const int complete = (unknown_count == 0 || (unknowns != NULL && seed != NULL)) &&
                         (known_count == 0 || (knowns != NULL && sensitivity != NULL));
    const Variable *undefined;
    Instance *x = &c->instance;
    Why text;
    if (check_call(c, call, complete) != CALL_OK) return CALL_ERROR;
    for (size_t k = 0; k < unknown_count; k++) {
        const Variable *v = component_find(c, call, unknowns[k], group);
        if (v == NULL) return CALL_ERROR;
        if (!is_derived(v)) return component_no_derivative(c, call, v);
        if (isfinite(seed[k])) continue;
        (void)fail(&text, "%s: the seed of '%s' is %s, expected a finite number", call->name, v->name,
                   digits(seed[k]).text);
        return component_refuse(c, text.text);
    }
    if (instance_adjoint(x, unknowns, seed, unknown_count) != OK) return component_no_value(c);
    for (size_t k = 0; k < known_count; k++) {
        Direction d = no_direction(&x->solver.sensitivity);
        if (take_seed(c, call, group, knowns[k], 1, &d) != CALL_OK) return CALL_ERROR;
        settle_direction(x);
        if (instance_gradient(x, unknowns, seed, unknown_count, d, &sensitivity[k], &undefined) == OK) continue;
        return undefined != NULL ? component_no_derivative(c, call, undefined) : component_no_value(c);
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

int component_push(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                   const int orders[], const double values[]) {
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (count > 0 && (references == NULL || orders == NULL || values == NULL)) return component_missing(c, call);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_find(c, call, references[k], group);
        if (v == NULL) return CALL_ERROR;
        if (v->role == ROLE_INPUT && (orders[k] == 1 || orders[k] == 2) && isfinite(values[k])) continue;
        (void)fail(&text,
                   "%s: derivative %d of '%s' = %s, expected a finite derivative of an input, of "
                   "order 1 or 2",
                   call->name, orders[k], v->name, digits(values[k]).text);
        return component_refuse(c, text.text);
    }
    for (size_t k = 0; k < count; k++)
        instance_set_input_derivative(&c->instance, &VARIABLES[references[k]], orders[k], values[k]);
    return CALL_OK;
}
