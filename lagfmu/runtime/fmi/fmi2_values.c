/* fmi2_values.c -- getting and setting variables (section 2.1.7), and their derivatives (2.1.9, 4.2.1). */
#include "component.h"
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
    return component_push(component, FMI2_CALL(fmi2SetRealInputDerivatives), &REAL, vr, nvr, order, value);
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component component, const fmi2ValueReference vr[],
                                        size_t nvr, const fmi2Integer order[], fmi2Real value[]) {
    return component_rates(component, FMI2_CALL(fmi2GetRealOutputDerivatives), &REAL, vr, nvr, order, value);
}
