/* fmi2_values.c -- getting and setting variables (section 2.1.7), and their derivatives (2.1.9, 4.2.1). */
#include <math.h>

#include "component.h"
#include "digits.h"
#include "fmi2.h"
#include "fmi2_calls.h"

static const Group REAL = {"Real", 1u << TYPE_REAL, AS_DOUBLE};
static const Group INTEGER = {"Integer", 1u << TYPE_INTEGER | 1u << TYPE_ENUMERATION, AS_INT};
static const Group BOOLEAN = {"Boolean", 1u << TYPE_BOOLEAN, AS_INT};
static const Group STRING = {"String", 0, AS_INT}; /* no variable is one */

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    return component_get(component, FMI2_CALL(fmi2GetReal), &REAL, vr, nvr, value);
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
    return component_get(component, FMI2_CALL(fmi2GetInteger), &INTEGER, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
    return component_get(component, FMI2_CALL(fmi2GetBoolean), &BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
    return component_get(component, FMI2_CALL(fmi2GetString), &STRING, vr, nvr, value);
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    return component_set(component, FMI2_CALL(fmi2SetReal), &REAL, vr, nvr, value);
}

/* Of the Integers only solver.method can be set, an Enumeration; no Boolean: the message says why. */
fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
    return component_set(component, FMI2_CALL(fmi2SetInteger), &INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
    return component_set(component, FMI2_CALL(fmi2SetBoolean), &BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
    return component_set(component, FMI2_CALL(fmi2SetString), &STRING, vr, nvr, value);
}

/* ------------------------------------------------------------------ derivatives */

fmi2Status fmi2GetDirectionalDerivative(fmi2Component component,
                                        const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown,
                                        const fmi2Real dvKnown[], fmi2Real dvUnknown[]) {
    return component_directional(component, FMI2_CALL(fmi2GetDirectionalDerivative), &REAL, vUnknown_ref, nUnknown,
                                 vKnown_ref, nKnown, dvKnown, dvUnknown);
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component component, const fmi2ValueReference vr[],
                                       size_t nvr, const fmi2Integer order[],
                                       const fmi2Real value[]) {
    const Call *call = FMI2_CALL(fmi2SetRealInputDerivatives);
    Component *c = component;
    Why text;
    if (component_forbids(c, call)) return fmi2Error;
    if (nvr > 0 && (vr == NULL || order == NULL || value == NULL)) return component_missing(c, call);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = component_find(c, call, vr[k], &REAL);
        if (v == NULL) return fmi2Error;
        if (v->role == ROLE_INPUT && (order[k] == 1 || order[k] == 2) && isfinite(value[k])) continue;
        (void)fail(&text,
                   "%s: derivative %d of '%s' = %s, expected a finite derivative of an input, of "
                   "order 1 or 2",
                   call->name, order[k], v->name, digits(value[k]).text);
        return component_refuse(c, text.text);
    }
    for (size_t k = 0; k < nvr; k++)
        instance_set_input_derivative(&c->instance, &VARIABLES[vr[k]], order[k], value[k]);
    return fmi2OK;
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[],
                                        size_t nvr, const fmi2Integer order[], fmi2Real value[]) {
    return component_rates(component, FMI2_CALL(fmi2GetRealOutputDerivatives), &REAL, vr, nvr, order, value);
}
