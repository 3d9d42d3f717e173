/* component_values.c -- getting and setting variables by their value references. */
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "component.h"

const Variable *component_variable(unsigned reference, const Group *group) {
    if (reference >= (unsigned)VARIABLE_COUNT || !(group->types >> VARIABLES[reference].type & 1)) return NULL;
    return &VARIABLES[reference];
}

/* The value of a variable: before the initialization as it was set, later as it is. */
static int read_value(Component *c, const Call *call, const Variable *v, double *value) {
    if (c->instance.phase & READABLE)
        return instance_get(&c->instance, v, value) == OK ? CALL_OK : component_no_value(c);
    if (v->role == ROLE_OUTPUT) return component_forbidden(c, call);
    *value = instance_setting(&c->instance, v);
    return CALL_OK;
}

static void store_number(Form form, void *values, size_t k, double value) {
    switch (form) {
        case AS_DOUBLE: ((double *)values)[k] = value; break;
        case AS_INT: ((int *)values)[k] = (int)fmin(value, INT_MAX); break;
        case AS_LONG: ((int64_t *)values)[k] = (int64_t)value; break;
        case AS_BOOL: ((bool *)values)[k] = value != 0; break;
    }
}

static double number_at(Form form, const void *values, size_t k) {
    switch (form) {
        case AS_DOUBLE: return ((const double *)values)[k];
        case AS_LONG: return (double)((const int64_t *)values)[k];
        case AS_BOOL: return ((const bool *)values)[k];
        default: return ((const int *)values)[k];
    }
}

int component_get(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                  void *values) {
    double found = 0;
    if (component_forbids(c, call)) return CALL_ERROR;
    if (count > 0 && (references == NULL || values == NULL)) return component_missing(c, call);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_variable(references[k], group);
        if (v == NULL) return component_unknown(c, call, references[k], group);
        const int status = read_value(c, call, v, &found);
        if (status != CALL_OK) return status;
        store_number(group->form, values, k, found);
    }
    return CALL_OK;
}

int component_set(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                  const void *values) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (count > 0 && (references == NULL || values == NULL)) return component_missing(c, call);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_variable(references[k], group);
        if (v == NULL) return component_unknown(c, call, references[k], group);
        if (instance_settable(&c->instance, v, number_at(group->form, values, k)) != OK)
            return component_failed(c, CALL_ERROR);
    }
    for (size_t k = 0; k < count; k++)
        instance_put(&c->instance, &VARIABLES[references[k]], number_at(group->form, values, k));
    return CALL_OK;
}
