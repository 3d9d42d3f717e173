/* component_derivatives.c -- partial derivatives of variables, and their derivatives with respect to time. */
#include <math.h>
#include <string.h>

#include "component.h"
#include "digits.h"

/* Adds a known variable's change to the direction; 0 if it is neither a state nor an input. */
static int add_seed(Sensitivity *w, const Variable *v, double change) {
    const int nq = MODEL_SYSTEM->nq;
    if (v->place == AT_INPUT)
        w->du[v->index] += change;
    else if (v->role == ROLE_START && v->state < nq)
        w->dq[v->state] += change;
    else if (v->role == ROLE_START)
        w->dv[v->state - nq] += change;
    else
        return 0;
    return 1;
}

/* The direction in which everything is to change. */
static int take_seed(Component *c, const Call *call, const Group *group, const unsigned knowns[], size_t count,
                     const double seed[]) {
    const System *s = MODEL_SYSTEM;
    Sensitivity *w = &c->instance.solver.sensitivity;
    Why text;
    memset(w->dq, 0, (size_t)s->nq * sizeof *w->dq);
    memset(w->dv, 0, (size_t)s->nv * sizeof *w->dv);
    memset(w->du, 0, (size_t)s->inputs * sizeof *w->du);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_variable(knowns[k], group);
        if (v == NULL) return component_unknown(c, call, knowns[k], group);
        if (isfinite(seed[k]) && add_seed(w, v, seed[k])) continue;
        (void)fail(&text, "%s: a change of '%s' by %s, expected a finite change of a continuous state or an input",
                   call->name, v->name, digits(seed[k]).text);
        return component_refuse(c, text.text);
    }
    return CALL_OK;
}

int component_directional(Component *c, const Call *call, const Group *group, const unsigned unknowns[],
                          size_t unknown_count, const unsigned knowns[], size_t known_count, const double seed[],
                          double sensitivity[]) {
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (c->instance.phase == INITIALIZATION) {
        (void)fail(&text, "%s: the start values pass through a projection whose derivative is not provided; ask "
                   "after the initialization", call->name);
        return component_refuse(c, text.text);
    }
    if ((unknown_count > 0 && (unknowns == NULL || sensitivity == NULL)) ||
        (known_count > 0 && (knowns == NULL || seed == NULL)))
        return component_missing(c, call);
    if (take_seed(c, call, group, knowns, known_count, seed) != CALL_OK) return CALL_ERROR;
    const Sensitivity *w = &c->instance.solver.sensitivity;
    const Direction d = {0, w->dq, w->dv, w->du};
    if (instance_differentiate(&c->instance, d) != OK) return component_no_value(c);
    for (size_t k = 0; k < unknown_count; k++) {
        const Variable *v = component_variable(unknowns[k], group);
        if (v == NULL) return component_unknown(c, call, unknowns[k], group);
        if (v->role != ROLE_OUTPUT && v->role != ROLE_START) return component_no_derivative(c, call, v);
        if (instance_change(&c->instance, v, d, &sensitivity[k]) != OK) return component_no_derivative(c, call, v);
    }
    return CALL_OK;
}

int component_rates(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                    const int orders[], double values[]) {
    Direction d;
    Why text;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (count > 0 && (references == NULL || orders == NULL || values == NULL)) return component_missing(c, call);
    if (count == 0) return CALL_OK;
    if (instance_rates(&c->instance, &d) != OK) return component_no_value(c);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_variable(references[k], group);
        if (v == NULL) return component_unknown(c, call, references[k], group);
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
        const Variable *v = component_variable(references[k], group);
        if (v == NULL) return component_unknown(c, call, references[k], group);
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
