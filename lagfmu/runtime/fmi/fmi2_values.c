/* fmi2_values.c -- getting and setting variables (section 2.1.7). */
#include "fmi2_component.h"

#include <limits.h>
#include <math.h>

/* The value of a variable: before the initialization as it was set, later as it is. */
static fmi2Status read_value(Component *c, const char *function, const Variable *v, double *value) {
    if (component_allowed(c, READABLE))
        return instance_get(&c->instance, v, value) == OK ? fmi2OK : component_no_value(c);
    if (v->role == ROLE_OUTPUT) return component_forbidden(c, function);
    *value = instance_setting(&c->instance, v);
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    Component *c = component;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2GetReal");
    if (nvr > 0 && (vr == NULL || value == NULL)) return component_missing(c, "fmi2GetReal");
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = component_variable(vr[k], TYPE_REAL);
        if (v == NULL) return component_unknown(c, "fmi2GetReal", vr[k], TYPE_REAL);
        const fmi2Status status = read_value(c, "fmi2GetReal", v, &value[k]);
        if (status != fmi2OK) return status;
    }
    return fmi2OK;
}

static fmi2Status get_whole(Component *c, const char *function, Type type,
                            const fmi2ValueReference vr[], size_t nvr, int value[]) {
    double found = 0;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, function);
    if (nvr > 0 && (vr == NULL || value == NULL)) return component_missing(c, function);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = component_variable(vr[k], type);
        if (v == NULL) return component_unknown(c, function, vr[k], type);
        const fmi2Status status = read_value(c, function, v, &found);
        if (status != fmi2OK) return status;
        value[k] = (int)fmin(found, INT_MAX);
    }
    return fmi2OK;
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
    return get_whole(component, "fmi2GetInteger", TYPE_INTEGER, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
    return get_whole(component, "fmi2GetBoolean", TYPE_BOOLEAN, vr, nvr, value);
}

/* No variable is a String. */
fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
    Component *c = component;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, "fmi2GetString");
    if (nvr > 0 && (vr == NULL || value == NULL)) return component_missing(c, "fmi2GetString");
    return nvr == 0 ? fmi2OK : component_unknown(c, "fmi2GetString", vr[0], TYPE_STRING);
}

enum { SETTABLE = INSTANTIATED | INITIALIZATION | STEPPING | EXCHANGE };

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    Component *c = component;
    if (!component_allowed(c, SETTABLE)) return component_forbidden(c, "fmi2SetReal");
    if (nvr > 0 && (vr == NULL || value == NULL)) return component_missing(c, "fmi2SetReal");
    for (size_t k = 0; k < nvr; k++) { /* all are checked before one is set */
        const Variable *v = component_variable(vr[k], TYPE_REAL);
        if (v == NULL) return component_unknown(c, "fmi2SetReal", vr[k], TYPE_REAL);
        if (instance_settable(&c->instance, v, value[k]) != OK) return component_failed(c, fmi2Error);
    }
    for (size_t k = 0; k < nvr; k++) instance_put(&c->instance, &VARIABLES[vr[k]], value[k]);
    return fmi2OK;
}

/* Of the Integers only solver.method can be set, an Enumeration; no Boolean: the message says why. */
static fmi2Status set_whole(Component *c, const char *function, Type type,
                            const fmi2ValueReference vr[], size_t nvr, const int value[]) {
    if (!component_allowed(c, SETTABLE & ~CONTINUOUS)) return component_forbidden(c, function);
    if (nvr > 0 && (vr == NULL || value == NULL)) return component_missing(c, function);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = component_variable(vr[k], type);
        if (v == NULL) return component_unknown(c, function, vr[k], type);
        if (instance_settable(&c->instance, v, value[k]) != OK) return component_failed(c, fmi2Error);
    }
    for (size_t k = 0; k < nvr; k++) instance_put(&c->instance, &VARIABLES[vr[k]], value[k]);
    return fmi2OK;
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
    return set_whole(component, "fmi2SetInteger", TYPE_INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
    return set_whole(component, "fmi2SetBoolean", TYPE_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
    Component *c = component;
    if (!component_allowed(c, SETTABLE & ~CONTINUOUS)) return component_forbidden(c, "fmi2SetString");
    if (nvr > 0 && (vr == NULL || value == NULL)) return component_missing(c, "fmi2SetString");
    return nvr == 0 ? fmi2OK : component_unknown(c, "fmi2SetString", vr[0], TYPE_STRING);
}
