/* fmi2_derivatives.c -- partial derivatives (section 2.1.9), and derivatives of inputs and outputs with
 * respect to time (4.2.1). */
#include "fmi2_component.h"

#include <math.h>
#include <string.h>

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

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component,
                                        const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    static const char *const NAME = "fmi2GetDirectionalDerivative";
    Component *c = component;
    Why text;
    if (!component_allowed(c, READABLE)) return component_forbidden(c, NAME);
    if (component_allowed(c, INITIALIZATION))
        return component_refuse(c, "fmi2GetDirectionalDerivative: the start values pass through a projection "
                         "whose derivative is not provided; ask after the initialization");
    if ((nUnknown > 0 && (vUnknown_ref == NULL || dvUnknown == NULL)) ||
        (nKnown > 0 && (vKnown_ref == NULL || dvKnown == NULL)))
        return component_missing(c, NAME);
    const System *s = MODEL_SYSTEM;
    Sensitivity *w = &c->instance.solver.sensitivity;
    memset(w->dq, 0, (size_t)s->nq * sizeof *w->dq);
    memset(w->dv, 0, (size_t)s->nv * sizeof *w->dv);
    memset(w->du, 0, (size_t)s->inputs * sizeof *w->du);
    for (size_t k = 0; k < nKnown; k++) {
        const Variable *v = component_variable(vKnown_ref[k], TYPE_REAL);
        if (v == NULL) return component_unknown(c, NAME, vKnown_ref[k], TYPE_REAL);
        if (!isfinite(dvKnown[k]) || !add_seed(w, v, dvKnown[k])) {
            (void)fail(&text,
                       "%s: a change of '%s' by %s, expected a finite change of a continuous state "
                       "or an input",
                       NAME, v->name, digits(dvKnown[k]).text);
            return component_refuse(c, text.text);
        }
    }
    const Direction d = {0, w->dq, w->dv, w->du};
    if (instance_differentiate(&c->instance, d) != OK) return component_no_value(c);
    for (size_t k = 0; k < nUnknown; k++) {
        const Variable *v = component_variable(vUnknown_ref[k], TYPE_REAL);
        if (v == NULL) return component_unknown(c, NAME, vUnknown_ref[k], TYPE_REAL);
        if (v->role != ROLE_OUTPUT && v->role != ROLE_START) return component_no_derivative(c, NAME, v);
        if (instance_change(&c->instance, v, d, &dvUnknown[k]) != OK)
            return component_no_derivative(c, NAME, v);
    }
    return fmi2OK;
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[],
                                       size_t nvr, const fmi2Integer order[],
                                       const fmi2Real value[]) {
    static const char *const NAME = "fmi2SetRealInputDerivatives";
    Component *c = component;
    Why text;
    if (!component_steps(c, INSTANTIATED | INITIALIZATION | STEPPING)) return component_forbidden(c, NAME);
    if (nvr > 0 && (vr == NULL || order == NULL || value == NULL)) return component_missing(c, NAME);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = component_variable(vr[k], TYPE_REAL);
        if (v == NULL) return component_unknown(c, NAME, vr[k], TYPE_REAL);
        if (v->role == ROLE_INPUT && (order[k] == 1 || order[k] == 2) && isfinite(value[k]))
            continue;
        (void)fail(&text,
                   "%s: derivative %d of '%s' = %s, expected a finite derivative of an input, of "
                   "order 1 or 2",
                   NAME, order[k], v->name, digits(value[k]).text);
        return component_refuse(c, text.text);
    }
    for (size_t k = 0; k < nvr; k++)
        instance_set_input_derivative(&c->instance, &VARIABLES[vr[k]], order[k], value[k]);
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[],
                                        size_t nvr, const fmi2Integer order[], fmi2Real value[]) {
    static const char *const NAME = "fmi2GetRealOutputDerivatives";
    Component *c = component;
    Direction d;
    Why text;
    if (!component_steps(c, STEPPING | TERMINATED)) return component_forbidden(c, NAME);
    if (nvr > 0 && (vr == NULL || order == NULL || value == NULL)) return component_missing(c, NAME);
    if (nvr == 0) return fmi2OK;
    if (instance_rates(&c->instance, &d) != OK) return component_no_value(c);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = component_variable(vr[k], TYPE_REAL);
        if (v == NULL) return component_unknown(c, NAME, vr[k], TYPE_REAL);
        if ((v->role != ROLE_OUTPUT && v->role != ROLE_START) || order[k] != 1) {
            (void)fail(&text, "%s: derivative %d of '%s', expected the first one of an output",
                       NAME, order[k], v->name);
            return component_refuse(c, text.text);
        }
        if (instance_change(&c->instance, v, d, &value[k]) != OK) return component_no_derivative(c, NAME, v);
    }
    return fmi2OK;
}
