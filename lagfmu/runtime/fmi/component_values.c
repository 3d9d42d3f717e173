/* component_values.c -- getting and setting variables by their value references. */
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "component.h"

static int is_of(const Variable *v, const Group *group) { return (group->types >> v->type & 1) != 0; }

const Variable *component_find(Component *c, const Call *call, unsigned reference, const Group *group) {
    Why text;
    if (reference >= (unsigned)VARIABLE_COUNT || !is_of(&VARIABLES[reference], group)) {
        (void)component_unknown(c, call, reference, group);
        return NULL;
    }
    if (c->instance.phase != BETWEEN || (c->named != NULL && c->named[reference])) return &VARIABLES[reference];
    (void)fail(&text, "%s: '%s' was not named as an intermediate variable", call->name, VARIABLES[reference].name);
    (void)component_refuse(c, text.text);
    return NULL;
}

/* The value of a variable: before the initialization as it was set, later as it is. */
static int read_value(Component *c, const Call *call, const Variable *v, double *value) {
    if (c->instance.phase & READABLE)
        return instance_get(&c->instance, v, value) == OK ? CALL_OK : component_no_value(c);
    if (v->role == ROLE_OUTPUT && v->place != AT_DAE) return component_forbidden(c, call);
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
    if (c->instance.phase == BETWEEN && c->asked) return component_out_of_turn(c, call);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_find(c, call, references[k], group);
        if (v == NULL) return CALL_ERROR;
        const int status = read_value(c, call, v, &found);
        if (status != CALL_OK) return status;
        store_number(group->form, values, k, found);
    }
    return CALL_OK;
}

/* Whether it is a state that the importer moves by itself, at any time or, where no event does so, at an event: as FMI
 * 3.0.2 has it, 3.2.1; of FMI 2.0.4 section 3.1 says so, and the table of 3.2.3 not. */
static int moves_alone(const Component *c, const Variable *v) {
    const Instance *x = &c->instance;
    if (!x->exchange || instance_state(v) < 0) return 0;
    return x->phase == CONTINUOUS || (x->phase == EVENT && MODEL_SYSTEM->m == 0);
}

int component_set(Component *c, const Call *call, const Group *group, const unsigned references[], size_t count,
                  const void *values) {
    if (component_forbids(c, call)) return CALL_ERROR;
    if (count > 0 && (references == NULL || values == NULL)) return component_missing(c, call);
    if (c->instance.phase == BETWEEN && !c->asked) return component_out_of_turn(c, call);
    for (size_t k = 0; k < count; k++) {
        const Variable *v = component_find(c, call, references[k], group);
        if (v == NULL) return CALL_ERROR;
        const double value = number_at(group->form, values, k);
        if (moves_alone(c, v) ? instance_state_settable(&c->instance, v, value) != OK
                                  : instance_settable(&c->instance, v, value) != OK)
            return component_failed(c, CALL_ERROR);
    }
    for (size_t k = 0; k < count && c->instance.phase == BETWEEN; k++)
        c->instance.between.value[VARIABLES[references[k]].index] = number_at(group->form, values, k);
    for (size_t k = 0; k < count && c->instance.phase != BETWEEN; k++) {
        const Variable *v = &VARIABLES[references[k]];
        const double value = number_at(group->form, values, k);
        if (moves_alone(c, v)) instance_set_state(&c->instance, v, value);
        else
            instance_put(&c->instance, v, value);
    }
    return CALL_OK;
}
