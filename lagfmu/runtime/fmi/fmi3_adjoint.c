/* fmi3_adjoint.c -- the gradient of a weighted sum of variables (section 2.2.11) by one transposed solve. */
#include <math.h>

#include "digits.h"
#include "fmi3_component.h"

/* The weight of one variable, as those of what it is of. */
static void weigh(Instance *x, const Variable *v, double weight, double *dt) {
    Solver *s = &x->solver;
    const int embedded = s->system->full != NULL, i = v->index;
    const Mechanism *b = embedded ? &s->full : &s->stepped;
    Sensitivity *stepped = &s->sensitivity, *w = embedded ? &x->along : stepped;
    switch (v->place) {
        case AT_Q: w->dq[i] += weight; break;
        case AT_V: w->dv[i] += weight; break;
        case AT_VDOT: w->dvdot[i] += weight; break;
        case AT_QDOT: w->drate[i] += weight; break;
        case AT_S: stepped->dq[i] += weight; break;
        case AT_SDOT: stepped->dv[i] += weight; break;
        case AT_SDDOT: stepped->dvdot[i] += weight; break;
        case AT_LAMBDA: w->dlambda[i] += weight; break;
        case AT_RESIDUAL:
            if (b->system->rows[i].kind == NONHOLONOMIC)
                adjoint_weigh_slip(w, b, i, weight, x->seen.v);
            else
                w->df[i] += weight;
            break;
        case AT_RESIDUAL_RATE: adjoint_weigh_slip(w, b, i, weight, x->seen.v); break;
        case AT_RESIDUAL_ACCELERATION: adjoint_weigh_acceleration(w, b, i, weight); break;
        case AT_FORCE: w->dforce[i] += weight; break;
        case AT_SHARE: adjoint_weigh_share(w, b, i, weight); break;
        case AT_KINETIC: w->denergy[0] += weight; break;
        case AT_POTENTIAL: w->denergy[1] += weight; break;
        case AT_TOTAL:
            w->denergy[0] += weight;
            w->denergy[1] += weight;
            break;
        case AT_OUTPUT: w->down[i] += weight; break;
        case AT_INPUT: stepped->du[i] += weight; break;
        case AT_TIME: *dt += weight; break;
        default: break; /* discrete ones and parameters: they do not change */
    }
}

/* What has no derivative has none along any direction: `undefined`, or NULL for another cause. */
static Status check_defined(Component *c, const fmi3ValueReference unknowns[], size_t count,
                            const Variable **undefined) {
    Instance *x = &c->instance;
    const Direction none = component_no_direction(c);
    double change;
    *undefined = NULL;
    if (instance_differentiate_factored(x, none) != OK) return FAILED;
    for (size_t k = 0; k < count; k++) {
        if (instance_change(x, &VARIABLES[unknowns[k]], none, &change) == OK) continue;
        *undefined = &VARIABLES[unknowns[k]];
        return FAILED;
    }
    return OK;
}

/* The weights of what the sum of these variables depends on: in the sensitivity's direction, and *dt. */
static Status find_gradient(Component3 *c, const fmi3ValueReference unknowns[], const double weights[],
                            size_t count, double *dt) {
    Instance *x = &c->common.instance;
    Solver *s = &x->solver;
    const System *full = s->system->full;
    Sensitivity *w = &s->sensitivity;
    Directions *in = &c->directions;
    Backward all = {.system = full, .of = MODEL_ADJOINT->full, .weights = &x->along, .along = &in->full, .in = in,
                    .at = x->at, .seen = &x->seen, .q = x->seen.q, .v = x->seen.v};
    Backward stepped = {.system = s->system, .of = MODEL_ADJOINT, .weights = w, .along = &in->stepped, .in = in,
                        .at = x->at, .seen = full == NULL ? &x->seen : NULL, .q = s->state.q, .v = s->state.v};
    if (full != NULL) adjoint_begin(&all, dt, w->du);
    adjoint_begin(&stepped, dt, w->du);
    for (size_t k = 0; k < count; k++) weigh(x, &VARIABLES[unknowns[k]], weights[k], dt);
    if (full != NULL) {
        if (adjoint_back(&all, full->dynamics != NULL ? &s->full : NULL) != OK) return FAILED;
        adjoint_embed(&stepped, &all);
    }
    if (adjoint_back(&stepped, &s->stepped) != OK) return FAILED;
    adjoint_settle(&stepped, &s->stepped);
    return OK;
}

/* Variables that have derivatives, with finite seeds? */
static int check_unknowns(Component *c, const Call *call, const fmi3ValueReference unknowns[], size_t count,
                          const double seed[]) {
    Why text;
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_find(c, call, unknowns[k], &FLOAT64);
        if (v == NULL) return CALL_ERROR;
        if (!component_has_derivatives(v)) return component_no_derivative(c, call, v);
        if (isfinite(seed[k])) continue;
        (void)fail(&text, "%s: the seed of '%s' is %s, expected a finite number", call->name, v->name,
                   digits(seed[k]).text);
        return component_refuse(c, text.text);
    }
    return CALL_OK;
}

fmi3Status fmi3GetAdjointDerivative(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,
                                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[],
                                    size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity) {
    const Call *call = FMI3_CALL(fmi3GetAdjointDerivative);
    if (component_forbids(instance, call) || component3_miscounts(instance, call, nSeed, nUnknowns) ||
        component3_miscounts(instance, call, nSensitivity, nKnowns))
        return fmi3Error;
    const int complete = (nUnknowns == 0 || (unknowns != NULL && seed != NULL)) &&
                         (nKnowns == 0 || (knowns != NULL && sensitivity != NULL));
    if (component_derivable(instance, call, complete) != CALL_OK ||
        check_unknowns(instance, call, unknowns, nUnknowns, seed) != CALL_OK)
        return fmi3Error;
    Component *c = instance;
    Instance *x = &c->instance;
    const Variable *undefined = NULL;
    double dt = 0;
    if (MODEL_ADJOINT == NULL) {
        (void)fail(&x->solver.why, "this FMU was built for a scene without derivatives of its outputs, or with frictions, "
                   "which have no adjoint");
        return component_no_value(c);
    }
    if (instance_factor(x) != OK || check_defined(c, unknowns, nUnknowns, &undefined) != OK)
        return undefined != NULL ? component_no_derivative(c, call, undefined) : component_no_value(c);
    if (find_gradient(instance, unknowns, seed, nUnknowns, &dt) != OK) return component_no_value(c);
    for (size_t k = 0; k < nKnowns; k++) {
        const double *weight = component_known(c, call, &FLOAT64, knowns[k], 1, &dt);
        if (weight == NULL) return fmi3Error;
        if (!isfinite(*weight)) return component_no_derivative(c, call, &VARIABLES[unknowns[0]]);
        sensitivity[k] = *weight;
    }
    return fmi3OK;
}
