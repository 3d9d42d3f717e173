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

/* Reals are doubles, the others ints. */
static void store_number(Type type, void *values, size_t k, double value) {
    if (type == TYPE_REAL)
        ((double *)values)[k] = value;
    else
        ((int *)values)[k] = (int)fmin(value, INT_MAX);
}

static double number_at(Type type, const void *values, size_t k) {
    return type == TYPE_REAL ? ((const double *)values)[k] : ((const int *)values)[k];
}

static fmi2Status get_numbers(Component *c, const char *function, Type type,
                              const fmi2ValueReference vr[], size_t nvr, void *values) {
    double found = 0;
    if (!component_allowed(c, ANY_MODE)) return component_forbidden(c, function);
    if (nvr > 0 && (vr == NULL || values == NULL)) return component_missing(c, function);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = component_variable(vr[k], type);
        if (v == NULL) return component_unknown(c, function, vr[k], type);
        const fmi2Status status = read_value(c, function, v, &found);
        if (status != fmi2OK) return status;
        store_number(type, values, k, found);
    }
    return fmi2OK;
}

fmi2Status fmi2GetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                       fmi2Real value[]) {
    return get_numbers(component, "fmi2GetReal", TYPE_REAL, vr, nvr, value);
}

fmi2Status fmi2GetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Integer value[]) {
    return get_numbers(component, "fmi2GetInteger", TYPE_INTEGER, vr, nvr, value);
}

fmi2Status fmi2GetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          fmi2Boolean value[]) {
    return get_numbers(component, "fmi2GetBoolean", TYPE_BOOLEAN, vr, nvr, value);
}

/* No variable is a String. */
static fmi2Status no_string(Component *c, const char *function, int modes, const fmi2ValueReference vr[],
                            size_t nvr, const fmi2String value[]) {
    if (!component_allowed(c, modes)) return component_forbidden(c, function);
    if (nvr > 0 && (vr == NULL || value == NULL)) return component_missing(c, function);
    return nvr == 0 ? fmi2OK : component_unknown(c, function, vr[0], TYPE_STRING);
}

fmi2Status fmi2GetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                         fmi2String value[]) {
    return no_string(component, "fmi2GetString", ANY_MODE, vr, nvr, value);
}

enum { CHOSEN = INSTANTIATED | INITIALIZATION | STEPPING | EVENT, SETTABLE = CHOSEN | CONTINUOUS };

/* All are checked before one is set.  Of the Integers only solver.method can be, an Enumeration; no Boolean: the
 * message says why. */
static fmi2Status set_numbers(Component *c, const char *function, int modes, Type type,
                              const fmi2ValueReference vr[], size_t nvr, const void *values) {
    if (!component_allowed(c, modes)) return component_forbidden(c, function);
    if (nvr > 0 && (vr == NULL || values == NULL)) return component_missing(c, function);
    for (size_t k = 0; k < nvr; k++) {
        const Variable *v = component_variable(vr[k], type);
        if (v == NULL) return component_unknown(c, function, vr[k], type);
        if (instance_settable(&c->instance, v, number_at(type, values, k)) != OK)
            return component_failed(c, fmi2Error);
    }
    for (size_t k = 0; k < nvr; k++) instance_put(&c->instance, &VARIABLES[vr[k]], number_at(type, values, k));
    return fmi2OK;
}

fmi2Status fmi2SetReal(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                       const fmi2Real value[]) {
    return set_numbers(component, "fmi2SetReal", SETTABLE, TYPE_REAL, vr, nvr, value);
}

fmi2Status fmi2SetInteger(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Integer value[]) {
    return set_numbers(component, "fmi2SetInteger", CHOSEN, TYPE_INTEGER, vr, nvr, value);
}

fmi2Status fmi2SetBoolean(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                          const fmi2Boolean value[]) {
    return set_numbers(component, "fmi2SetBoolean", CHOSEN, TYPE_BOOLEAN, vr, nvr, value);
}

fmi2Status fmi2SetString(fmi2Component component, const fmi2ValueReference vr[], size_t nvr,
                         const fmi2String value[]) {
    return no_string(component, "fmi2SetString", CHOSEN, vr, nvr, value);
}
