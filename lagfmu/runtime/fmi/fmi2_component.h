/* fmi2_component.h -- what the functions of the interface have in common: an instance with the importer's
 * callbacks, the modes of its life cycle, and what there is to say of a call that cannot be.
 *
 * Knows, with the fmi2*.c, the interface; nothing else does. */
#ifndef LAGFMU_FMI2_COMPONENT_H
#define LAGFMU_FMI2_COMPONENT_H

#include "fmi2.h"
#include "instance.h"
#include "linkage.h"

enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEP_COMPLETE = 4,
    STEP_FAILED = 8,
    EVENT = 16,
    CONTINUOUS = 32,
    TERMINATED = 64,
    STEPPING = STEP_COMPLETE | STEP_FAILED,
    EXCHANGE = EVENT | CONTINUOUS,
    READABLE = INITIALIZATION | STEPPING | EXCHANGE | TERMINATED, /* whatever there is */
    ANY_MODE = INSTANTIATED | READABLE
};

/* Categories of the log: one bit each in `logging`. */
enum { LOG_WARNINGS, LOG_DISCARDS, LOG_ERRORS, LOG_FATALS, LOG_EVENTS, LOG_ALL, LOG_CATEGORIES };
SHARED const char *const CATEGORIES[LOG_CATEGORIES];

typedef struct {
    fmi2CallbackFunctions callbacks;
    Instance instance;
    const char *name;
    unsigned logging; /* one bit a category */
} Component;

static inline int component_allowed(const Component *c, int modes) {
    return c != NULL && (c->instance.phase & modes) != 0;
}

static inline int component_steps(const Component *c, int modes) {
    return component_allowed(c, modes) && !c->instance.exchange;
}

/* NULL if there is no such variable. */
static inline const Variable *component_variable(fmi2ValueReference vr, Type type) {
    if (vr >= (unsigned)VARIABLE_COUNT || VARIABLES[vr].type != type) return NULL;
    return &VARIABLES[vr];
}

/* To the importer's log: before there is an instance, of one, and as instance.h calls it. */
SHARED void component_send(const fmi2CallbackFunctions *callbacks, const char *name, fmi2Status status,
                           int category, const char *text);
SHARED void component_message(Component *c, fmi2Status status, int category, const char *text);
SHARED void component_told(void *context, Note note, const char *text);

/* The call returns fmi2Error, and why: the text; the cause that a function of the instance left, after this
 * function's name or as it stands; a function that may not be called now; a pointer that is missing; a value
 * reference of no such variable; a value or a derivative that there is not. */
SHARED fmi2Status component_refuse(Component *c, const char *text);
SHARED fmi2Status component_refused(Component *c, const char *function);
SHARED fmi2Status component_failed(Component *c, fmi2Status status);
SHARED fmi2Status component_forbidden(Component *c, const char *function);
SHARED fmi2Status component_missing(Component *c, const char *function);
SHARED fmi2Status component_unknown(Component *c, const char *function, fmi2ValueReference vr, Type type);
SHARED fmi2Status component_no_value(Component *c);
SHARED fmi2Status component_no_derivative(Component *c, const char *function, const Variable *v);

#endif
