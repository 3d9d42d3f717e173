/* fmi2_component.c -- messages of the interface (fmi2_component.h). */
#include "fmi2_component.h"

#include <string.h>

SHARED_VALUE const char *const CATEGORIES[LOG_CATEGORIES] = {
    "logStatusWarning", "logStatusDiscard", "logStatusError",
    "logStatusFatal",   "logEvents",        "logAll"};

/* The logger takes printf's format.  A text without % is one as it stands, which also serves importers
 * that do not look for further arguments. */
void component_send(const fmi2CallbackFunctions *callbacks, const char *name, fmi2Status status,
                    int category, const char *text) {
    if (callbacks->logger == NULL) return;
    if (strchr(text, '%') == NULL)
        callbacks->logger(callbacks->componentEnvironment, name, status, CATEGORIES[category],
                          text);
    else
        callbacks->logger(callbacks->componentEnvironment, name, status, CATEGORIES[category],
                          "%s", text);
}

void component_message(Component *c, fmi2Status status, int category, const char *text) {
    const int always = status >= fmi2Discard; /* what a call returns is never without a reason */
    if (always || c->logging & (1u << category | 1u << LOG_ALL))
        component_send(&c->callbacks, c->name, status, category, text);
}

void component_told(void *context, Note note, const char *text) {
    switch (note) {
        case NOTE_WARNING: component_message(context, fmi2Warning, LOG_WARNINGS, text); break;
        case NOTE_EVENT: component_message(context, fmi2OK, LOG_EVENTS, text); break;
        case NOTE_DISCARD: component_message(context, fmi2Discard, LOG_DISCARDS, text); break;
        case NOTE_ERROR: component_message(context, fmi2Error, LOG_ERRORS, text); break;
    }
}

fmi2Status component_refuse(Component *c, const char *text) {
    component_message(c, fmi2Error, LOG_ERRORS, text);
    return fmi2Error;
}

fmi2Status component_refused(Component *c, const char *function) {
    Why text;
    (void)fail(&text, "%s: %s", function, c->instance.solver.why.text);
    return component_refuse(c, text.text);
}

/* The cause that a numerical function left. */
fmi2Status component_failed(Component *c, fmi2Status status) {
    component_message(c, status, status == fmi2Discard ? LOG_DISCARDS : LOG_ERRORS,
                      c->instance.solver.why.text);
    return status;
}

static const char *mode_name(const Component *c) {
    switch (c->instance.phase) {
        case INSTANTIATED: return "instantiated";
        case INITIALIZATION: return "initialization mode";
        case STEP_COMPLETE: return "step complete";
        case STEP_FAILED: return "step failed";
        case EVENT: return "event mode";
        case CONTINUOUS: return "continuous-time mode";
        default: return "terminated";
    }
}

fmi2Status component_forbidden(Component *c, const char *function) {
    Why text;
    if (c == NULL) return fmi2Error;
    (void)fail(&text, "%s cannot be called in the state '%s' of a %s instance", function,
               mode_name(c), c->instance.exchange ? "Model Exchange" : "co-simulation");
    return component_refuse(c, text.text);
}

fmi2Status component_missing(Component *c, const char *function) {
    Why text;
    (void)fail(&text, "%s: an array or pointer is NULL", function);
    return component_refuse(c, text.text);
}

static const char *const TYPE_NAMES[] = {"Real", "Integer", "Boolean", "String"};

fmi2Status component_unknown(Component *c, const char *function, fmi2ValueReference vr, Type type) {
    Why text;
    (void)fail(&text, "%s: value reference %u is no %s variable of this FMU", function, vr,
               TYPE_NAMES[type]);
    return component_refuse(c, text.text);
}

/* Why a getter has no value: in Model Exchange the importer's integrator may try another state. */
fmi2Status component_no_value(Component *c) {
    return component_failed(c, component_allowed(c, EXCHANGE) ? fmi2Discard : fmi2Error);
}

fmi2Status component_no_derivative(Component *c, const char *function, const Variable *v) {
    Why text;
    (void)fail(&text, "%s: the derivative of '%s' is not defined here", function, v->name);
    return component_refuse(c, text.text);
}
